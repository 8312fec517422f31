"""How long ``import freqid`` and ``freqid --help`` take beside a bare interpreter.

Run as ``python benchmarks/startup.py``.
"""

from __future__ import annotations

import csv
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

RUNS = 30
COMMANDS = {
    "bare interpreter": [sys.executable, "-c", "pass"],
    "import freqid": [sys.executable, "-c", "import freqid"],
    "freqid --help": [sys.executable, "-m", "freqid", "--help"],
}


def main() -> None:
    """Time both in turn and write the table."""
    took: dict[str, list[float]] = {name: [] for name in COMMANDS}
    for _ in range(RUNS):
        for name, command in COMMANDS.items():
            start = time.perf_counter()
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            took[name].append(time.perf_counter() - start)
    bare = np.median(took["bare interpreter"])
    rows = [
        {"what": n, "median_s": f"{np.median(t):.3f}", "ratio": f"{np.median(t) / bare:.2f}"}
        for n, t in took.items()
    ]
    for row in rows:
        print(f"{row['what']:<18} {row['median_s']} s  {row['ratio']} x")
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
