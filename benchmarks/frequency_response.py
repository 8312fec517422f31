"""Bias and stated errors of frequency responses under feedback, by Monte Carlo.

An unstable plant with two inputs under a regulator, sensor noise fed back and gusts; flights of two periods
of 40 s of orthogonal multisines. Bias is the mean error over its own standard error, rms over responses at
four frequencies: one where there is none. Coverage is how often circles of 50, 90 and 95 % hold the truth.
Least squares on the measured inputs stands beside.

    python benchmarks/frequency_response.py [FLIGHTS]      writes frequency_response.csv
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

PROJECT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(PROJECT / "tests" / "oracle"))

import closed_loop_plant as plant  # noqa: E402

from freqid.identify.response.injected_lines import injected_lines  # noqa: E402
from freqid.identify.response.local_response import ResponseLines, local_response  # noqa: E402

AT = np.array([0.1, 0.3, 0.6, 1.0])
CONDITIONS = ((1.0, 0.1), (1.0, 0.3), (0.5, 0.3))  # amplitude of the signals, noise
LEVELS = (0.5, 0.9, 0.95)


def flown(amplitude, noise, seed):
    """Return estimates, their variances and degrees of freedom, and least squares, at `AT`."""
    m = plant.fly(amplitude=amplitude, gust=noise, sensor=noise, seed=seed)
    lines = injected_lines(m, 0, plant.INPUTS, "effector", plant.OUTPUTS, plant.PERIOD)
    naive = ResponseLines(lines.hz, lines.record, lines.excited, lines.u, lines.u, lines.y)
    found = [local_response(lines, f, 2, 4) for f in AT]
    value = np.stack([one.value for one in found], axis=-1)
    variance = np.stack([one.variance for one in found], axis=-1)
    freedom = np.array([one.degrees_of_freedom for one in found])
    plain = np.stack([local_response(naive, f, 2, 4).value for f in AT], axis=-1)
    return value, variance, freedom, plain


def bias(estimates, truth):
    mean = estimates.mean(axis=0)
    scatter = np.mean(np.abs(estimates - mean) ** 2, axis=0) / len(estimates)
    return float(np.sqrt(np.mean(np.abs(mean - truth) ** 2 / scatter)))


def main(flights):
    truth = plant.response(AT)
    rows = []
    for amplitude, noise in CONDITIONS:
        parts = [flown(amplitude, noise, seed) for seed in range(flights)]
        value, variance, freedom, plain = (np.array(part) for part in zip(*parts, strict=True))
        error = np.abs(value - truth) ** 2
        row = {
            "amplitude": amplitude,
            "noise": noise,
            "flights": flights,
            "bias_instruments": round(bias(value, truth), 2),
            "bias_least_squares": round(bias(plain, truth), 2),
            "error_least_squares": round(float(np.median(np.abs(plain.mean(axis=0) / truth - 1))), 4),
            "error_instruments": round(float(np.median(np.abs(value.mean(axis=0) / truth - 1))), 4),
            "stated_over_scatter": round(
                float(np.median(np.sqrt(variance.mean(axis=0) / error.mean(axis=0)))), 3
            ),
        }
        for level in LEVELS:
            dof = freedom[:, None, None]
            radius = variance * dof * ((1 - level) ** (-1 / dof) - 1)
            row[f"coverage_{round(100 * level)}"] = round(float(np.mean(error < radius)), 3)
        rows.append(row)
        print(row)
    with (Path(__file__).with_suffix(".csv")).open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 400)
