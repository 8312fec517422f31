"""What the plausibility checks say of real flight records: none of them may be refused.

Twin Otter (Klein & Morelli), ATTAS and HFB-320 (Jategaonkar) and Crazyflie (Busetto et al.) records, where a
folder of real data is there. The Crazyflie's accelerations are in axes of the ground, so they are not mapped.
Run as ``python benchmarks/plausibility_real.py``.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pandas as pd

import freqid as fq
from freqid.core.record import Channel
from freqid.flightlog.plausibility.check import check_plausibility

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT.parent / "shared" / "data"
MAPS = ROOT / "scenarios" / "maps"
# Forward, left and up in the log; forward, right and down here.
DRONE = {
    "state/phi": ("roll", "rad", 1),
    "state/theta": ("pitch", "rad", -1),
    "state/psi": ("yaw", "rad", -1),
    "state/p": ("wx", "rad/s", 1),
    "state/q": ("wy", "rad/s", -1),
    "state/r": ("wz", "rad/s", -1),
    "state/alt": ("z", "m", 1),
    "state/vd": ("vz", "m/s", -1),
}


def records() -> Iterator[tuple[str, fq.FlightRecord]]:
    """Yield the records by name."""
    for path in sorted((DATA / "sidpac").glob("totter*.mat")):
        yield (
            path.stem,
            fq.read_log(path, scenario=ROOT / "scenarios" / "twin_otter.toml", plausibility="off"),
        )
    for path in sorted((DATA / "fvsysid").glob("fAttas*.mat")):
        yield path.stem, fq.read_log(path, MAPS / "attas.toml", plausibility="off")
    path = DATA / "fvsysid" / "hfb320_1_10.asc"
    yield path.stem, fq.read_log(path, MAPS / "hfb320.toml", plausibility="off")
    for path in sorted((DATA / "nanodrone").glob("*.parquet")):
        yield path.stem, drone(path)


def drone(path: Path) -> fq.FlightRecord:
    """Return a Crazyflie's log on a uniform clock."""
    log = pd.read_parquet(path)
    t = log["t"].to_numpy(float)
    step = float(np.median(np.diff(t)))
    time = np.arange(0.0, t[-1] - t[0], step)
    channels = {}
    for name, (column, unit, sign) in DRONE.items():
        x = log[column].to_numpy(float)
        known = np.isfinite(x) & np.isfinite(t)
        values = sign * np.interp(time, t[known] - t[0], x[known])
        channels[name] = Channel(name, unit, values, 1 / step, f"{path.name}: {column}")
    return fq.FlightRecord(time, channels)


def main() -> None:
    """Check all and write the table."""
    rows = []
    for name, record in records():
        report = check_plausibility(record)
        kinds = [f"{f.check} {f.channels[0]}" for f in report.warnings]
        row = {
            "record": name,
            "relations": len(report.agreement),
            "lowest_attitude": f"{min(c for n, c in report.agreement.items() if n.endswith('angle')):.2f}",
            "errors": len(report.errors),
            "warnings": " | ".join(kinds),
        }
        rows.append(row)
        print("  ".join(f"{value!s:<12}" for value in row.values()))
        for found in report.errors:
            print("   ", found)
    print(f"{sum(row['errors'] > 0 for row in rows)} of {len(rows)} records refused")
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
