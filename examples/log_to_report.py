"""From a log to a report: a flight is imported, identified, used to predict another, and reported.

With the Twin Otter records beside the project these are real flights; otherwise the linear aircraft flies.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]
FLIGHTS = PROJECT.parent / "shared" / "data" / "sidpac"


def run(*arguments: object) -> None:
    """Show a command, run it, and stop where it fails."""
    words = [str(a) for a in arguments]
    print("$ freqid", *words, flush=True)  # noqa: T201
    subprocess.run([sys.executable, "-m", "freqid", *words], cwd=PROJECT, check=True)


def main() -> None:
    """Run the chain on real flights where they are at hand, else on a simulated one."""
    out = Path("reports/log")
    if FLIGHTS.is_dir():
        scenario = "scenarios/twin_otter.toml"
        logs = [FLIGHTS / f"totter_{name}_data.mat" for name in ("f1_017", "f1_014")]
        options: list[object] = []
    else:
        from linear_record import fly

        scenario = "scenarios/linear.toml"
        logs = [PROJECT / out / f"linear-{seed}.csv" for seed in (1, 2)]
        logs[0].parent.mkdir(parents=True, exist_ok=True)
        for seed, log in enumerate(logs, start=1):
            fly(seed=seed).to_csv(log, index=False, float_format="%.10g")
        options = ["--map", "scenarios/maps/linear.toml", "--at", "u20"]
    records = [out / f"{log.stem}.h5" for log in logs]
    for log, record in zip(logs, records, strict=True):
        run("import-log", log, "--scenario", scenario, *options, "-o", record)
    point = out / "point.h5"
    run("identify-point", records[0], "--scenario", scenario, "--predict", records[1], "-o", point)
    run("report", point, "--scenario", scenario, "-o", out / "report.html")
    print(f"The report is {PROJECT / out / 'report.html'}")  # noqa: T201


if __name__ == "__main__":
    main()
