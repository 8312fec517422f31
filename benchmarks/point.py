"""One point identification against the least that numpy could do for the same answer.

27 channels x 6001 samples (60 s at 100 Hz), 106 lines, 6 responses on 21 regressors: the whole of
`identify_point` with every diagnostic, warm, beside a floor that only multiplies by a stored Fourier
matrix, makes one QR and solves six times. Run as ``make bench`` or ``python benchmarks/point.py``.
"""

from __future__ import annotations

import csv
import os
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import freqid as fq
from freqid.core.record import Channel
from freqid.core.sections.identification import Identification
from freqid.core.vehicle import Inertia, MassProperties
from freqid.identify.point import identify_point

REPEATS = 200
RESPONSES = ("X", "Y", "Z", "L", "M", "N")
STATES = ("u", "w", "q")
EFFECTORS = tuple(f"e{i + 1}" for i in range(18))


def maneuver() -> tuple[fq.Maneuver, np.ndarray, np.ndarray]:
    """Return a manoeuvre of 27 channels, and regressors and responses as arrays."""
    rng = np.random.default_rng(0)
    time_s = np.arange(6001) * 0.01
    k = np.arange(3, 109)
    tones = np.array([np.sin(2 * np.pi * k / 60 * t) for t in time_s]).T
    x = rng.standard_normal((21, k.size)) @ tones
    z = rng.standard_normal((6, 21)) @ x + rng.standard_normal((6, time_s.size))
    names = [f"state/{n}" for n in STATES] + [f"effector/{n}" for n in EFFECTORS]
    rows = {n: (v, "m/s" if n.startswith("state") else "rad") for n, v in zip(names, x, strict=True)}
    rows |= {f"response/{r}": (v, "N") for r, v in zip(RESPONSES, z, strict=True)}
    channels = {n: Channel(n, unit, v, 100.0, "benchmark") for n, (v, unit) in rows.items()}
    body = MassProperties(mass_kg=1.0, inertia=Inertia(xx=1, yy=1, zz=1))
    return (
        fq.Maneuver(fq.FlightRecord(time_s, channels), fq.Vehicle(name="bench", mass_properties=body)),
        x,
        z,
    )


def floor(x: np.ndarray, z: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return the bare estimate: one product, one QR, six solves."""
    spectra = np.concatenate([x, z]) @ matrix
    stacked = np.concatenate([spectra.real, spectra.imag], axis=1)
    q, r = np.linalg.qr(stacked[:21].T)
    return np.array([np.linalg.solve(r, q.T @ response) for response in stacked[21:]])


def main() -> None:
    """Time both in turn and write the table."""
    flown, x, z = maneuver()
    lines = np.arange(3, 109) / 60
    settings = Identification(
        regressors=STATES + EFFECTORS, frequencies_hz=tuple(lines), response_source="record"
    )
    matrix = np.exp(-2j * np.pi * np.outer(flown.record.time, lines)) * 0.01
    model, bare = identify_point(flown, settings), floor(x, z, matrix)
    apart = max(np.abs(model[r].estimate - b).max() for r, b in zip(RESPONSES, bare, strict=True))
    took: dict[str, list[float]] = {"identify_point": [], "floor": []}
    for _ in range(REPEATS):
        for name, call in (
            ("identify_point", lambda: identify_point(flown, settings)),
            ("floor", lambda: floor(x, z, matrix)),
        ):
            start = time.perf_counter()
            call()
            took[name].append(time.perf_counter() - start)
    ratio = np.median(np.array(took["identify_point"]) / np.array(took["floor"]))
    rows = [
        {"what": name, "median_ms": f"{1e3 * np.median(t):.2f}", "ratio_to_floor": f"{r:.2f}"}
        for (name, t), r in zip(took.items(), (ratio, 1.0), strict=True)
    ]
    for row in rows:
        print(f"{row['what']:<16} {row['median_ms']:>8} ms  {row['ratio_to_floor']:>6} x floor")
    print(f"largest difference of the estimates: {apart:.2g}")
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
