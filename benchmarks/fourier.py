"""Time of the finite Fourier integral against scipy's bare transforms and a matrix product.

Run: OPENBLAS_NUM_THREADS=1 python benchmarks/fourier.py
Prints a table and writes benchmarks/fourier.csv. Only `freqid` includes end corrections, a check for finite
samples and a check of the shape; the others are bare sums. Every round times each once, in turn; the
ratio is the median over rounds of (this time / scipy's CZT in the same round).
"""

from __future__ import annotations

import csv
import os
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.signal import CZT, ZoomFFT

from freqid.identify.spectra.fourier import FourierPlan, frequency_grid, harmonics

ROUNDS = 200
CASES = {  # name: channels, samples, dt, frequencies
    "reference grid": (40, 3001, 0.02, frequency_grid(0.05, 0.01, 2.0)),
    "grid off the FFT bins": (40, 3001, 0.02, frequency_grid(0.0503, 0.01, 2.0)),
    "point identification": (27, 6001, 0.01, harmonics(60.0, (0.05, 1.8))),
    "two periods": (27, 12001, 0.01, harmonics(60.0, (0.05, 1.8))),
    "short list": (27, 6001, 0.01, harmonics(60.0, (0.05, 0.85))),
    "half as many off the bins": (40, 3001, 0.02, frequency_grid(0.0503, 0.01, 1.04)),
}


def measure(
    channels: int, samples: int, dt: float, f: np.ndarray
) -> tuple[str, float, dict[str, list[float]]]:
    """Return the plan's method, the time to build it and all times of all ways to transform, s."""
    x = np.random.default_rng(1).standard_normal((channels, samples))
    start = time.perf_counter()
    plan = FourierPlan(samples, dt, f)
    built = time.perf_counter() - start
    step = (f[-1] - f[0]) / (f.size - 1)
    czt = CZT(samples, f.size, np.exp(-2j * np.pi * step * dt), np.exp(2j * np.pi * f[0] * dt))
    zoom = ZoomFFT(samples, [f[0], f[-1]], f.size, fs=1 / dt, endpoint=True)
    matrix = np.exp(-2j * np.pi * dt * np.outer(np.arange(samples), f))
    columns = matrix.view(float)
    ways = {
        "freqid": lambda: plan(x),
        "scipy CZT": lambda: czt(x),
        "scipy ZoomFFT": lambda: zoom(x),
        "matrix, complex": lambda: x @ matrix,
        "matrix, real and imaginary": lambda: x @ columns,
    }
    times: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(ROUNDS):
        for name, way in ways.items():
            start = time.perf_counter()
            way()
            times[name].append(time.perf_counter() - start)
    return plan.method, built, times


def main() -> None:
    rows = []
    print(f"{'case':26}{'channels x samples, lines':28}{'way':34}{'ms':>8}{'to CZT':>9}{'to matrix':>11}")
    for case, (channels, samples, dt, f) in CASES.items():
        method, built, times = measure(channels, samples, dt, f)
        for name, t in times.items():
            milliseconds = 1e3 * np.median(t)
            to_czt = np.median(np.divide(t, times["scipy CZT"]))
            to_matrix = np.median(np.divide(t, times["matrix, complex"]))
            way = f"freqid ({method}, built in {1e3 * built:.1f} ms)" if name == "freqid" else name
            size = f"{channels} x {samples}, {f.size}"
            print(f"{case:26}{size:28}{way:34}{milliseconds:8.2f}{to_czt:9.2f}{to_matrix:11.2f}")
            rows.append([case, channels, samples, f.size, name, method if name == "freqid" else "",
                         f"{milliseconds:.3f}", f"{to_czt:.2f}", f"{to_matrix:.2f}"])  # fmt: skip
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        file.write("case,channels,samples,lines,way,method,median_ms,ratio_to_czt,ratio_to_matrix\n")
        writer.writerows(rows)


if __name__ == "__main__":
    main()
