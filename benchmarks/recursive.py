"""Time of one update and of one estimate in flight, and whether either grows with the flight.

The LA-8 class aircraft of ``scenarios/la8.toml``: 24 regressors (6 states, 18 effectors), six responses
reconstructed from raw samples with the gyroscopic terms of 8 rotors, 106 lines. Random samples: the time does
not depend on their values. Run as ``make bench`` or ``python benchmarks/recursive.py``.
"""

from __future__ import annotations

import csv
import gc
import os
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import freqid as fq
from freqid.core.sections.identification import Identification
from freqid.identify.in_flight.running import InFlight
from freqid.identify.spectra.fourier import harmonics

SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "la8.toml"
DT, LINES = 0.02, harmonics(60.0, (0.05, 1.8))
UPDATES, ESTIMATES = 60_000, 200  # 20 min of flight
LATE = 1 / 3  # share of the updates, at the start and at the end, that are compared


def main() -> None:
    """Print and write the times."""
    vehicle = fq.read_scenario(SCENARIO).aircraft()
    effectors = tuple(e.name for e in vehicle.effectors if e.kind != "tilt")
    settings = Identification(regressors=(*"uvwpqr", *effectors))
    flight = InFlight(vehicle, settings, DT, LINES, accelerometer_m=(0.1, 0.0, 0.0))
    samples = np.random.default_rng(0).standard_normal((1000, len(flight.channels)))
    took = np.empty(UPDATES)
    gc.collect()
    gc.disable()  # as a flight computer would
    for i in range(UPDATES):
        start = time.perf_counter()
        flight.update(samples[i % 1000])
        took[i] = time.perf_counter() - start
    solved = np.empty(ESTIMATES)
    for i in range(ESTIMATES):
        start = time.perf_counter()
        flight.estimate()
        solved[i] = time.perf_counter() - start
    gc.enable()
    part = int(LATE * UPDATES)
    rows = []
    for what, times in (
        ("update", took),
        ("update, first third", took[:part]),
        ("update, last third", took[-part:]),
        ("estimate", solved),
    ):
        percentiles = np.percentile(1e6 * times, [50, 99, 99.9, 100])
        names = ("median_us", "p99_us", "p99.9_us", "max_us")
        rows.append({"what": what} | {n: f"{v:.0f}" for n, v in zip(names, percentiles, strict=True)})
    print(f"{len(settings.regressors)} regressors, 6 responses, {LINES.size} lines, {UPDATES} samples")
    for row in rows:
        print(f"{row['what']:<22}" + "".join(f"{k} {v:>6}   " for k, v in row.items() if k != "what"))
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
