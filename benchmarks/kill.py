"""Commands that are killed (SIGKILL) at random moments: what they leave, and what going on makes of it.

Four commands on small cases: ``study`` and ``campaign``, which fly simulated flights and resume;
``global-blend`` of the study's points; and ``diagnose-gap`` of an aircraft with a worn elevator. After each
kill every file must be whole: HDF5 with its checksum, Parquet, JSON and pages to their ends. What resumes
goes on in the same folder until it is finished; the others are run to their end after every tenth kill. What
is finished must hold the same numbers as a run that was never killed, and no temporary file may be left.
Moments are counted in processor time, which a busy machine does not stretch. Run as
``python benchmarks/kill.py``; ``--kills 50`` a command, ``--only study`` for one.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import hashlib
import json
import math
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow.parquet as pq

import freqid.cli.campaign  # what a child would import again; nothing is computed before the forks
import freqid.gap.diagnose
import freqid.views.page
import freqid.workflows.diagnose
import freqid.workflows.fly
import freqid.workflows.models.blend
import freqid.workflows.monte_carlo.run
import freqid.workflows.studies.study  # noqa: F401
from freqid.cli.main import _exit_code
from freqid.core import store

PROJECT = Path(__file__).resolve().parents[1]
_OF_THE_WRITING = ("created", "date", "REFERENCE_LIST", "DIMENSION_LIST", "files")  # files: with hashes
_KEY = re.compile(r"\b[0-9a-f]{32}\b")


def contents(folder: Path) -> dict[str, Any]:
    """Return every number and text of every HDF5 and Parquet file of a folder, but when it was written.

    Units of work are named by a hash of their inputs, among them a design's file, which says when it was
    written: they count by what they hold.
    """
    found: dict[str, Any] = {}
    for path in sorted([*folder.rglob("*.h5"), *folder.rglob("*.parquet")]):
        name, inside = str(path.relative_to(folder)), _contents_of(path)
        if _KEY.search(name):
            digest = hashlib.sha256(repr(sorted(inside.items())).encode()).hexdigest()
            name = _KEY.sub(digest, name)
        found |= {f"{name}/{part}": value for part, value in inside.items()}
    return found


def _contents_of(path: Path) -> dict[str, Any]:
    if path.suffix == ".parquet":
        return {"rows": str(pq.ParquetFile(path).read().to_pydict())}
    found: dict[str, Any] = {}

    def add(name: str, item: Any) -> None:
        for key, value in item.attrs.items():
            if key not in _OF_THE_WRITING:
                text = _KEY.sub("KEY", str(value))
                found[f"{name}@{key}"] = np.asarray(value).tobytes() if _plain(value) else text
        if isinstance(item, h5py.Dataset):
            value = item[()]
            found[name] = value.tobytes() if _plain(value) else value

    with h5py.File(path) as file:
        add("", file)
        file.visititems(add)
    return found


def _plain(value: Any) -> bool:
    return isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "iufbc"


def damaged(folder: Path) -> list[str]:
    """Return the files of a folder that are not whole."""
    wrong = []
    for path in (p for p in folder.rglob("*") if p.is_file() and not p.name.endswith(".part")):
        try:
            if path.suffix == ".h5":
                with store.reading(path, store.kind_of(path)):
                    pass
            elif path.suffix == ".parquet":
                pq.ParquetFile(path).read()
            elif path.suffix == ".json":
                json.loads(path.read_text())
            elif path.suffix == ".html" and not path.read_text().rstrip().endswith("</html>"):
                raise ValueError("cut off")
        except Exception as error:
            wrong.append(f"{path}: {error}")
    return wrong


def left_overs(folder: Path) -> int:
    """Return how many temporary files lie in a folder."""
    return sum(1 for _ in folder.rglob("*.part"))


def start(words: list[str]) -> int:
    """Start a command in a process of its own and return its id."""
    child = os.fork()
    if child == 0:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
        code = 70
        with contextlib.suppress(BaseException):
            code = _exit_code(words)
        os._exit(code)
    return child


def killed(words: list[str], seconds: float = math.inf) -> bool:
    """Run a command for so many seconds of processor at most; return whether it had to be killed."""
    child = start(words)
    while processor_of(child) < seconds:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            assert os.waitstatus_to_exitcode(status) == 0, f"{words} ended with {status}"
            return False
        time.sleep(0.002)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return True


def processor_of(child: int) -> float:
    """Return the seconds of processor that a process of ours has used, to a nanosecond."""
    return int(Path(f"/proc/{child}/schedstat").read_text().split()[0]) / 1e9


def prepare(folder: Path) -> dict[str, Callable[[Path], list[str]]]:
    """Make the inputs of all commands; return the words of each, by the folder that it writes into.

    They are small, so that a run takes seconds: 24 s of inputs, three conditions of a linear aircraft.
    """
    linear = PROJECT / "scenarios" / "linear.toml"
    scenario = folder / "s.toml"
    scenario.write_text(_three_conditions(linear.read_text()))
    words = ["study", str(scenario), "--jobs", "1", "--hold-out", "u20", "--no-page", "-o"]
    assert not killed([*words, str(folder / "points")])
    points = sorted(map(str, (folder / "points" / "points").glob("*.h5")))
    campaign = folder / "campaign.toml"
    campaign.write_text(
        'stage = "identify"\nscenario = "s.toml"\nseeds = 4\nbatch = 1\n[fixed]\nat = "u20"\n'
        "[vary]\nnoise = [0.5, 1.0]\n"
    )
    records = _worn_flights(folder / "gap")
    sim = ["--sim", f"{PROJECT / 'examples' / 'linear_simulation.py'}:wrench", "--scenario", str(linear)]
    sim.append("--no-next-flight")
    return {
        "study": lambda out: [*words, str(out)],
        "campaign": lambda out: ["campaign", str(campaign), "--jobs", "1", "-o", str(out)],
        "global-blend": lambda out: ["global-blend", *points, "-o", str(out / "model.h5")],
        "diagnose-gap": lambda out: [
            "diagnose-gap",
            *records,
            *sim,
            "--no-next-flight",
            "-o",
            str(out / "gap.h5"),
        ],
    }


def _three_conditions(text: str) -> str:
    """Return the example's scenario with inputs of 24 s and two more conditions."""
    for old, new in (
        ("period_s = 60.0\nperiods = 2", "period_s = 24.0\nperiods = 1"),
        ("band_hz = [0.05, 1.8]", "band_hz = [0.1, 1.8]"),
        (
            '[[reference]]\nid = "u20"\nu = 20.0\nrho = 1.225\n',
            "".join(f'[[reference]]\nid = "u{u}"\nu = {u}.0\nrho = 1.225\n' for u in (18, 20, 22)),
        ),
    ):
        assert old in text
        text = text.replace(old, new)
    return text


def _worn_flights(folder: Path) -> list[str]:
    """Return records of the example aircraft whose elevator lost half of its effect."""
    import freqid as fq
    from freqid.workflows import diagnose

    sys.path.insert(0, str(PROJECT / "examples"))
    import gap_flights

    folder.mkdir()
    scenario = fq.read_scenario(PROJECT / "scenarios" / "linear.toml")
    records = []
    for seed in (1, 2):
        log = folder / f"flight{seed}.csv"
        table = gap_flights.fly(seed=seed, period=30.0, periods=1, derivatives=gap_flights.derivatives())
        table.to_csv(log, index=False, float_format="%.10g")
        columns = PROJECT / "scenarios" / "maps" / "linear.toml"
        records.append(str(folder / f"flight{seed}.h5"))
        fq.save(fq.read_log(log, columns=columns, scenario=scenario, at="u20"), records[-1])
    every = diagnose.effects_with  # three candidates: a diagnosis of all takes a minute, and writes the same
    few = ("surface_effectiveness", "sensor_bias", "time_skew")
    diagnose.effects_with = lambda own: {n: e for n, e in every(own).items() if n in few}
    return records


def judge(name: str, words: Callable[[Path], list[str]], kills: int, folder: Path) -> list[Any]:
    """Kill one command so often; return the row of the table."""
    out, rng = folder / name, np.random.default_rng(28)
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert not killed(words(out))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    whole = after.ru_utime + after.ru_stime - spent.ru_utime - spent.ru_stime
    reference = contents(out)
    resumes = name in ("study", "campaign")
    done = finished = different = with_parts = parts_stay = 0
    wrong: list[str] = []

    def finish() -> None:
        nonlocal different, finished, parts_stay
        found = contents(out)
        other = sorted(k for k in {*found, *reference} if found.get(k) != reference.get(k))
        if other:
            print(f"{name}: {len(other)} differ, first {other[:5]}", flush=True)
        different += bool(other)
        parts_stay += left_overs(out)
        finished += 1

    shutil.rmtree(out)
    while done < kills:
        if not killed(words(out), rng.uniform(0.0, (0.3 if resumes else 1.0) * whole)):
            finish()
            if resumes:
                shutil.rmtree(out)
            continue
        done += 1
        wrong += damaged(out)
        with_parts += left_overs(out) > 0
        if not resumes and done % 10 == 0:
            assert not killed(words(out))
            finish()
            if done % 20 == 0:  # half the kills meet an old result, half none
                shutil.rmtree(out)
    if out.exists():
        assert not killed(words(out))
        finish()
    for one in wrong[:5]:
        print(one)
    return [name, f"{whole:.1f}", done, len(wrong), with_parts, finished, different, parts_stay]


def main() -> None:
    """Kill the commands and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--only", default="")
    parser.add_argument("--csv", type=Path, default=Path(__file__).with_suffix(".csv"))
    asked = parser.parse_args()
    head = (
        "command, processor seconds, kills, damaged files, kills that left a temporary file, finished runs, "
        "finished runs that differ, temporary files after them"
    )
    rows = [head.split(", ")]
    with tempfile.TemporaryDirectory() as there:
        for name, words in prepare(Path(there)).items():
            if asked.only in name:
                rows.append(judge(name, words, asked.kills, Path(there)))
                print(*rows[-1], flush=True)
                with asked.csv.open("w", newline="") as file:
                    csv.writer(file).writerows(rows)


if __name__ == "__main__":
    main()
