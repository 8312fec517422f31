"""Least squares and instruments on an unstable aircraft under feedback: `python benchmarks/instruments.py`.

The aircraft and its two loops are those of benchmarks/_unstable_aircraft.py, with three times the noise of
research-quality sensors. Every estimate is compared with the derivatives that flew. Instruments are made

fitted        as `identify_point` makes them, of a closed loop with a fitted control law;
known gains   of the same loop with the true gains on the eight states in place of the fitted law;
per input     without a model: the response to each input on its own lines, smoothed by a complex parabola;
doubled       as "fitted", with complex first-stage coefficients, which is twice as many instruments;
truth         of the regressors that fly when no sensor has noise.

Writes benchmarks/instruments.csv. An argument gives another number of seeds.
"""

from __future__ import annotations

import csv
import os
import sys
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from _unstable_aircraft import (
    DT,
    DURATION,
    EFFECTORS,
    INTEGRATED,
    SCENARIO,
    SPEED,
    STATES,
    TRUTH,
    VEHICLE,
    Flights,
    fly_lagged,
    fly_static,
    injected,
    logged,
    regulator,
)

import freqid as fq
from freqid.core.channels import WRENCH
from freqid.core.sections.identification import Identification
from freqid.design.multisine.orthogonal_set import design_multisines
from freqid.identify.instruments.driven import driven_maneuvers
from freqid.identify.instruments.loop_model import LoopModel
from freqid.identify.loads.explanatory import explanatory_variables
from freqid.identify.model.line_equations import LineEquations, on_lines
from freqid.identify.model.problem import Problem
from freqid.identify.point import identify_point
from freqid.identify.regress.covariance_corrections import correct_coloured_lines
from freqid.identify.regress.two_stage import two_stage_least_squares
from freqid.identify.spectra.fourier import fourier, harmonics

SEEDS = int(sys.argv[1]) if len(sys.argv) > 1 else 200
LINES = harmonics(SCENARIO.excitation.period_s, SCENARIO.excitation.band_hz)
REGRESSORS = (*STATES, *EFFECTORS)
SETTINGS = Identification(regressors=REGRESSORS, frequencies_hz=tuple(LINES))
Found = tuple[np.ndarray, np.ndarray]  # estimates and standard errors, shape (6, 24) each


def by_instruments(equations: LineEquations, driven: np.ndarray) -> Found:
    """Estimate as `identify_point` does, with other instruments, however weak."""
    fit, _ = two_stage_least_squares(equations.x, equations.z, driven, nuisance=equations.nuisance)
    fit = correct_coloured_lines(fit, equations.every_line_hz, equations.durations)
    return fit.estimate, fit.std_error


def known_gains(equations: LineEquations, e: np.ndarray, gains: np.ndarray, wrench: np.ndarray) -> Found:
    feedback, forward = np.zeros((3, 18, 8)), np.zeros((3, 18))
    feedback[1], forward[0] = -gains[:, :8], 1.0
    loop = LoopModel(
        vehicle=VEHICLE,
        velocity=np.array([SPEED, 0, 0]),
        theta=0.0,
        spin=np.zeros((3, 18)),
        momentum=np.zeros(3),
        wrench=wrench,
        feedback=feedback,
        forward=forward,
        moving=np.ones(8, dtype=bool),
    )
    first = by_instruments(equations, loop.response(LINES, e))
    return by_instruments(equations, replace(loop, wrench=first[0]).response(LINES, e))


def per_input(equations: LineEquations, e: np.ndarray, owner: np.ndarray) -> np.ndarray:
    driven = np.zeros_like(equations.x)
    for i in range(len(e)):
        own = np.flatnonzero(owner == i)
        powers = np.vander(LINES[own] - LINES[own].mean(), 3)
        smooth = powers @ np.linalg.pinv(powers)
        driven[:, own] = (equations.x[:, own] / e[i, own]) @ smooth.T * e[i, own]
    return driven


def doubled(equations: LineEquations, driven: np.ndarray) -> np.ndarray:
    z = np.concatenate([equations.nuisance, driven]).T
    return (z @ np.linalg.lstsq(z, equations.x.T)[0]).T


def estimates(
    flight: fq.Maneuver, alone: np.ndarray, e: np.ndarray, owner: np.ndarray, gains: np.ndarray
) -> dict[str, Found]:
    """Return what each estimator finds in one flight."""
    model = identify_point(flight, SETTINGS, estimator="instruments")
    responses = [model[r] for r in WRENCH]
    beside = [r.errors_in_variables for r in responses]
    plain = (np.array([b.estimate for b in beside]), np.array([b.std_error for b in beside]))
    problem = Problem.of([flight], SETTINGS)
    equations = on_lines(problem.x, problem.wrench, problem.dt, LINES)
    (driven,) = driven_maneuvers([flight], LINES, SETTINGS)
    driven = on_lines([explanatory_variables(driven, REGRESSORS)[0]], problem.wrench, problem.dt, LINES).x
    return {
        "least squares": plain,
        "truth": by_instruments(equations, alone),
        "fitted": (np.array([r.estimate for r in responses]), np.array([r.std_error for r in responses])),
        "known gains": known_gains(equations, e, gains, plain[0]),
        "per input": by_instruments(equations, per_input(equations, e, owner)),
        "doubled": by_instruments(equations, doubled(equations, driven)),
    }


def figures(found: list[Found], rows: list[int], reference: list[Found]) -> dict[str, str]:
    estimate_, stated = (np.array(part)[:, rows] for part in zip(*found, strict=True))
    other = np.array([f[0] for f in reference])[:, rows]
    error = (estimate_ - TRUTH[rows]) / stated
    scatter = estimate_.std(axis=0, ddof=1)
    ratio = scatter / np.sqrt((stated**2).mean(axis=0))
    low, high = np.percentile(ratio, [2.5, 97.5])
    return {
        "mean_normalised_error_rms": f"{np.sqrt((error.mean(axis=0) ** 2).mean()):.3f}",
        "largest": f"{np.abs(error.mean(axis=0)).max():.2f}",
        "normalised_error_rms": f"{np.sqrt((error**2).mean()):.3f}",
        "within_2_std_errors_percent": f"{100 * (np.abs(error) < 2).mean():.1f}",
        "scatter_over_stated_median": f"{np.median(ratio):.3f}",
        "scatter_over_stated_95_percent": f"{low:.3f}-{high:.3f}",
        "within_0.88_1.12_percent": f"{100 * ((ratio > 0.88) & (ratio < 1.12)).mean():.1f}",
        "scatter_over_truth_s_median": f"{np.median(scatter / other.std(axis=0, ddof=1)):.3f}",
        "scatter_over_truth_s_max": f"{(scatter / other.std(axis=0, ddof=1)).max():.3f}",
    }


def transforms(flown: Flights) -> np.ndarray:
    clean = np.concatenate([flown["x"][:6, :, 0], flown["d"][:, :, 0]])
    return fourier(clean - clean.mean(axis=1, keepdims=True), DT, LINES)


def main() -> None:
    design = design_multisines(SCENARIO.excitation, VEHICLE.effectors)
    signals = injected(design, DT * np.arange(round(DURATION / DT) + 1))
    e = fourier(signals, DT, LINES)
    owner = np.abs(e).argmax(axis=0)
    static, lagged = regulator([], 1.0), regulator(INTEGRATED, 0.5)
    clean = fly_static(design, static)
    quiet, flown = fly_lagged(design, lagged, 1, 0.0), fly_lagged(design, lagged, SEEDS, 1.0)
    print(f"{SEEDS} seeds: standard error of a ratio of scatters {100 / np.sqrt(2 * SEEDS):.0f} %,")
    print(f"of a mean normalised error {1 / np.sqrt(SEEDS):.3f}")
    table = []
    for loop, gains, alone in (("static", static, transforms(clean)), ("lagged", lagged, transforms(quiet))):
        found: dict[str, list[Found]] = {}
        for seed in range(SEEDS):
            if loop == "static":
                flight = logged(clean, signals, 0, seed, fed_back=False)
            else:
                flight = logged(flown, signals, seed, seed, fed_back=True)
            for name, pair in estimates(flight, alone, e, owner, gains).items():
                found.setdefault(name, []).append(pair)
        for name, pairs in found.items():
            for response in ("all", *WRENCH):
                rows = [0, 1, 2, 3, 4, 5] if response == "all" else [WRENCH.index(response)]
                row = {"loop": loop, "estimator": name, "response": response}
                table.append(row | figures(pairs, rows, found["truth"]))
                if response == "all" or name in ("least squares", "fitted"):
                    print("  ".join(f"{v:<13}" for v in table[-1].values()))
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, table[0].keys())
        writer.writeheader()
        writer.writerows(table)


if __name__ == "__main__":
    main()
