"""Campaigns on one and two workers, on a cluster that loses one, with a slow scheduler, in memory, in flight.

    python benchmarks/campaign.py

Work units are exact in what they cost: so many sine sums, or so many seconds of sleep where processors must
not matter. The table is written beside the script.
"""

from __future__ import annotations

import asyncio
import contextlib
import csv
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pandas as pd

import freqid as fq

TABLE = Path(__file__).with_suffix(".csv")
FUNCTION = """
import time
import numpy as np

def busy(seed, *, size, rounds):
    rng = np.random.default_rng([seed, size])
    x, started = rng.standard_normal(2000), time.process_time()
    for _ in range(rounds):
        x = np.sin(x) + 0.5 * x
    return {"value": float(x.sum()), "quantity": "sum", "processor_s": time.process_time() - started}

def asleep(seed, *, size, seconds):
    time.sleep(seconds)
    return {"value": float(seed * size), "quantity": "product"}

def cheap(seed, *, size):
    x = np.random.default_rng([seed, size]).standard_normal(3)
    return {"quantity": ["a", "b", "c"], "estimate": x, "std_error": np.ones(3), "reference": np.zeros(3),
            "lo": x - 1.96, "hi": x + 1.96}
"""
LATENCY_S = 0.05


def campaign(
    folder: Path, name: str, function: str, *, seeds: int, batch: int = 1, **settings: float
) -> Path:
    """Write a campaign of two sizes."""
    (folder / "work.py").write_text(FUNCTION)
    fixed = "".join(f"{k} = {v}\n" for k, v in settings.items())
    path = folder / f"{name}.toml"
    path.write_text(
        f'stage = "work.py:{function}"\nseeds = {seeds}\nbatch = {batch}\n'
        f"[fixed]\n{fixed}\n[vary]\nsize = [1, 2]\n"
    )
    return path


def rows_of(folder: Path) -> pd.DataFrame:
    rows = pd.read_parquet(folder / "rows").sort_values(["size", "seed", "quantity"])
    return rows.drop(columns="processor_s", errors="ignore").reset_index(drop=True)


def ran(path: Path, folder: Path, **how: object) -> float:
    began = time.perf_counter()
    fq.monte_carlo(path, folder, **how)  # type: ignore[arg-type]
    return time.perf_counter() - began


@contextlib.contextmanager
def separate_cluster(port: int, workers: int = 2):
    """Start a scheduler and workers as processes of their own, as a recipe for a cluster does."""
    dask = str(Path(sys.executable).with_name("dask"))
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    address = f"tcp://127.0.0.1:{port}"
    scheduler = subprocess.Popen(
        [dask, "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"],
        env=environment,
        **quiet,
    )
    time.sleep(3.0)
    started = [
        subprocess.Popen(
            [dask, "worker", address, "--nthreads", "1", "--no-dashboard", "--no-nanny"],
            env=environment,
            **quiet,
        )
        for _ in range(workers)
    ]
    try:
        yield address, started
    finally:
        for process in [*started, scheduler]:
            process.terminate()
        for process in [*started, scheduler]:
            process.wait()


class SlowLine:
    """A TCP line to a scheduler that delays every piece, either way."""

    def __init__(self, target: int, delay_s: float) -> None:
        self.target, self.delay_s, self.port = target, delay_s, 0
        self._ready = threading.Event()
        self._loop = asyncio.new_event_loop()
        threading.Thread(target=self._run, daemon=True).start()
        self._ready.wait()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        server = self._loop.run_until_complete(asyncio.start_server(self._joined, "127.0.0.1", 0))
        self.port = server.sockets[0].getsockname()[1]
        self._ready.set()
        self._loop.run_forever()

    async def _joined(self, reader, writer) -> None:
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self.target)
        await asyncio.gather(self._pass(reader, far_writer), self._pass(far_reader, writer))

    async def _pass(self, reader, writer) -> None:
        queue: asyncio.Queue = asyncio.Queue()

        async def late() -> None:
            while True:
                due, data = await queue.get()
                await asyncio.sleep(max(due - time.monotonic(), 0.0))
                if not data:
                    writer.close()
                    return
                writer.write(data)

        task = asyncio.ensure_future(late())
        while data := await reader.read(65536):
            queue.put_nowait((time.monotonic() + self.delay_s, data))
        queue.put_nowait((time.monotonic() + self.delay_s, b""))
        await task


def speed_up(folder: Path) -> list[dict[str, str]]:
    """One process against two, in turns, so that a load on the machine meets both."""
    path = campaign(folder, "busy", "busy", seeds=12, rounds=40_000)
    ran(campaign(folder, "warm", "busy", seeds=2, rounds=10), folder / "warm", jobs=2)
    times: dict[int, list[float]] = {1: [], 2: []}
    for turn in range(3):
        for jobs in (1, 2):
            times[jobs].append(ran(path, folder / f"busy-{jobs}-{turn}", jobs=jobs))
    ratios = [one / two for one, two in zip(times[1], times[2], strict=True)]
    first = rows_of(folder / "busy-1-0")
    same = all(rows_of(folder / f"busy-{j}-{t}").equals(first) for j in (1, 2) for t in range(3))
    spent = pd.read_parquet(folder / "busy-2-0" / "rows")["processor_s"].sum()
    alone = pd.read_parquet(folder / "busy-1-0" / "rows")["processor_s"].sum()
    # what two free processors would give: work in processor time, over the time that they had in the run
    return [
        row(
            "speed-up of two processes over one, best and median of 3",
            f"{max(ratios):.2f}, {np.median(ratios):.2f}",
        ),
        row("processor time of the same units in two processes over one", f"{spent / alone:.2f}"),
        row("results of one and two processes identical", str(same)),
        row("load of the machine while this was measured", f"{os.getloadavg()[0]:.1f}"),
    ]


def lost_worker(folder: Path) -> list[dict[str, str]]:
    path = campaign(folder, "killed", "asleep", seeds=30, seconds=0.2)
    ran(path, folder / "alone", jobs=2)
    with separate_cluster(18786) as (address, workers):
        killer = threading.Timer(4.0, lambda: workers[0].send_signal(signal.SIGKILL))
        killer.start()
        found = fq.monte_carlo(path, folder / "lost", scheduler=address)
        killer.cancel()
        killed = workers[0].poll() == -signal.SIGKILL
    same = rows_of(folder / "lost").equals(rows_of(folder / "alone"))
    return [
        row("one of two separate dask workers killed in mid-campaign", str(killed)),
        row("cases of 60 that the campaign then has", str(found.cases - found.failed)),
        row("its rows identical to those without a cluster", str(same)),
    ]


def slow_scheduler(folder: Path) -> list[dict[str, str]]:
    """Units of 5 s of sleep on two workers, with and without a line that is 50 ms late either way."""
    path = campaign(folder, "slow", "asleep", seeds=8, seconds=5.0)
    times = {}
    for name, delay in (("near", 0.0), ("far", LATENCY_S)):
        with separate_cluster(18787 + (name == "far"), workers=0) as (address, _):
            port = int(address.rpartition(":")[2])
            line = SlowLine(port, delay)
            dask = str(Path(sys.executable).with_name("dask"))
            slow = f"tcp://127.0.0.1:{line.port}"
            environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
            workers = [
                subprocess.Popen(
                    [dask, "worker", slow, "--nthreads", "1", "--no-dashboard", "--no-nanny"],
                    env=environment,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                )
                for _ in range(2)
            ]
            # what a worker imports first is no latency
            ran(
                campaign(folder, f"first-{name}", "asleep", seeds=4, seconds=0.5),
                folder / f"first-{name}",
                scheduler=slow,
            )
            times[name] = ran(path, folder / name, scheduler=slow)
            for process in workers:
                process.terminate()
                process.wait()
    ideal = 8 * 2 * 5.0 / 2
    return [
        row("16 units of 5 s on two workers, s, at least 40", f"{times['near']:.2f}"),
        row("the same with 50 ms to and from the scheduler, s", f"{times['far']:.2f}"),
        row("cost of the latency", f"{100 * (times['far'] - times['near']) / times['near']:.1f} %"),
        row("cost of everything over the least time", f"{100 * (times['far'] - ideal) / ideal:.1f} %"),
    ]


def memory(folder: Path) -> list[dict[str, str]]:
    """Largest memory of a process that runs a campaign of cheap cases, by their number."""
    rows = []
    for seeds in (50, 500, 5000):
        path = campaign(folder, f"cheap-{seeds}", "cheap", seeds=seeds, batch=50)
        code = (
            "import resource, freqid as fq;"
            f"f = fq.monte_carlo({str(path)!r}, {str(folder / f'cheap-{seeds}')!r}, jobs=1);"
            "print(f.cases, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)"
        )
        done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
        cases, peak = done.stdout.split()
        rows.append(row(f"largest memory with {cases} cases, MiB", f"{float(peak):.0f}"))
    return rows


def manoeuvres(folder: Path, count: int = 1000) -> list[dict[str, str]]:
    """Manoeuvres of 60 s of the LA-8 in closed loop, flown by two processes, then flown and identified."""
    text = (Path(__file__).parents[1] / "scenarios" / "la8.toml").read_text()
    one_period = text.replace('residuals = "noise-lines"', 'residuals = "coloured"')
    (folder / "la8_once.toml").write_text(one_period)
    taken = {}
    for stage, seeds in (("warm", 2), ("fly", count), ("identify", count)):
        path = folder / f"{stage}.toml"
        path.write_text(
            f'stage = "{"identify" if stage == "warm" else stage}"\nscenario = "la8_once.toml"\n'
            f'seeds = {seeds}\nbatch = 25\n[fixed]\nat = "u45"\nduration = 60.0\nsensors = "research"\n'
        )
        taken[stage] = ran(path, folder / stage, jobs=2)
        done = pd.read_parquet(folder / stage / "rows")
        assert done["seed"].nunique() == seeds, f"{stage}: {done['seed'].nunique()} seeds"
        assert done["failure"].isna().all() or (done["failure"] == "").all(), f"{stage} failed"
    return [
        row(f"{count} manoeuvres of 60 s flown, two processes, s", f"{taken['fly']:.0f}"),
        row("the same flown and identified, s", f"{taken['identify']:.0f}"),
        row("of that more than flown, s", f"{taken['identify'] - taken['fly']:.0f}"),
    ]


def row(what: str, found: str) -> dict[str, str]:
    print(f"{what:<72}{found}", flush=True)
    return {"what": what, "found": found}


def main() -> None:
    asked = sys.argv[1:] or ["memory", "speed_up", "lost_worker", "slow_scheduler", "manoeuvres"]
    rows = []
    with tempfile.TemporaryDirectory() as name:
        for which in asked:
            rows += globals()[which](Path(name))
    if not sys.argv[1:]:
        with TABLE.open("w", newline="") as file:
            writer = csv.DictWriter(file, ["what", "found"], lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
