"""What a regression with all its diagnostics costs: `OPENBLAS_NUM_THREADS=1 python benchmarks/regression.py`.

Six responses on 21 regressors and two end terms over 106 lines, against the bare floor of the same linear
algebra: stacking, one QR, six triangular right-hand sides. Writes benchmarks/regression.csv.
"""

from __future__ import annotations

import csv
import timeit
from collections.abc import Callable
from pathlib import Path

import numpy as np

from freqid.identify.regress.covariance_corrections import correct_coloured_lines, correct_line_spacing
from freqid.identify.regress.regression import LeastSquares, least_squares

RNG = np.random.default_rng(0)
N_LINES, DURATION = 106, 60.0
LINES = np.arange(3, 3 + N_LINES) / DURATION


def complex_noise(*shape: int) -> np.ndarray:
    return RNG.standard_normal(shape) + 1j * RNG.standard_normal(shape)


PHI = complex_noise(21, N_LINES)
END_TERMS = np.array([np.ones(N_LINES), np.exp(-2j * np.pi * LINES * 0.9 * DURATION)])
Z = RNG.standard_normal((6, 21)) @ PHI + complex_noise(6, N_LINES)


def floor() -> list[np.ndarray]:
    columns = np.vstack([END_TERMS, PHI])
    q, r = np.linalg.qr(np.hstack([columns.real, columns.imag]).T)
    z = np.hstack([Z.real, Z.imag])
    return [np.linalg.solve(r, q.T @ row) for row in z]


def estimate() -> LeastSquares:
    return least_squares(PHI, Z, nuisance=END_TERMS)


def diagnose(fit: LeastSquares) -> tuple:
    return (
        fit.estimate, fit.std_error, fit.covariance, fit.correlation, fit.t_statistic, fit.interval(), fit.r2,
        fit.pse, fit.fit_error, fit.variance_inflation, fit.collinearity.condition_number,
        fit.collinearity.proportion, fit.collinearity.inseparable(),
    )  # fmt: skip


def cost(calls: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Milliseconds per call, warm, the best of thirty rounds that take turns, so that all see one machine."""
    rounds = [{name: timeit.timeit(call, number=20) for name, call in calls.items()} for _ in range(30)]
    return {name: 1e3 * min(one[name] for one in rounds) / 20 for name in calls}


def main() -> None:
    calls: dict[str, Callable[[], object]] = {
        "floor: one QR, six solves": floor,
        "least_squares": estimate,
        "least_squares and all diagnostics": lambda: diagnose(estimate()),
        "the same, line spacing corrected": lambda: diagnose(
            correct_line_spacing(estimate(), LINES, DURATION)
        ),
        "the same, coloured residuals corrected": lambda: diagnose(
            correct_coloured_lines(estimate(), LINES, DURATION)
        ),
    }
    milliseconds = cost(calls)
    least = milliseconds["floor: one QR, six solves"]
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["what", "milliseconds", "times_floor"])
        for name, value in milliseconds.items():
            print(f"{name:<42}{value:8.3f} ms{value / least:7.2f} x")
            writer.writerow([name, f"{value:.3f}", f"{value / least:.2f}"])


if __name__ == "__main__":
    main()
