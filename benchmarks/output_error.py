"""Output error on a known aircraft: coverage of its intervals, convergence, and time beside scipy.

A lateral model with 18 parameters, 20 s at 50 Hz, rudder 2-1-1 and aileron doublet. Coverage counts truths
inside 95 % intervals over seeds, with white residuals and with residuals of first order (0.9 a sample).
Convergence starts every parameter up to 50 % off. Time is that of warm functions from equation-error starts,
beside scipy.optimize.least_squares on the same compiled simulation, its derivatives by finite differences.
Read beside docs/theory/output-error.md. Run as ``make bench`` or ``python benchmarks/output_error.py``.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Callable
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from freqid.identify.output_error.estimate import estimate
from freqid.identify.output_error.minimise import minimise
from freqid.identify.output_error.model import DynamicModel, Named, Signals
from freqid.identify.output_error.parameters import Choices, choose_parameters
from freqid.identify.output_error.simulation import compiled
from freqid.identify.output_error.starts import equation_error_starts
from freqid.identify.output_error.time_domain import TimeDomain

Array = NDArray[np.float64]
SEEDS, DRAWS, REPEATS = 500, 200, 20
DT, DURATION = 0.02, 20.0
POLE = 0.9  # of coloured residuals, a sample
SPEED, ALPHA, THETA, G = 60.0, 0.08, 0.08, 9.80665
SPAN, SIDE, TURN = 19.8, 0.35, 12.0  # span, qbar S / m / V, qbar S b / Ix
YAW = 0.6  # Ix / Iz
NOISE = {"beta": 0.002, "p": 0.004, "r": 0.002, "phi": 0.005, "ay": 0.007}
TRUTH = {
    "CYb": -0.87,
    "CYr": 0.93,
    "CYdr": 0.38,
    "bias_beta": -6e-4,
    "Clb": -0.12,
    "Clp": -0.586,
    "Clr": 0.189,
    "Clda": -0.228,
    "Cldr": 0.042,
    "bias_p": 5e-3,
    "Cnb": 0.086,
    "Cnp": -0.064,
    "Cnr": -0.191,
    "Cnda": -0.003,
    "Cndr": -0.135,
    "bias_r": -0.015,
    "bias_phi": -0.003,
    "bias_ay": -3e-4,
}


def equations(x: Named, u: Named, p: Named) -> tuple[Named, Named]:
    """Return the lateral equations in coefficients."""
    roll, yaw = x["p"] * SPAN / (2 * SPEED), x["r"] * SPAN / (2 * SPEED)
    side = p["CYb"] * x["beta"] + p["CYr"] * yaw + p["CYdr"] * u["dr"]
    rolling = p["Clb"] * x["beta"] + p["Clp"] * roll + p["Clr"] * yaw
    rolling += p["Clda"] * u["da"] + p["Cldr"] * u["dr"]
    yawing = p["Cnb"] * x["beta"] + p["Cnp"] * roll + p["Cnr"] * yaw
    yawing += p["Cnda"] * u["da"] + p["Cndr"] * u["dr"]
    rates = {
        "beta": SIDE * side
        + jnp.sin(ALPHA) * x["p"]
        - jnp.cos(ALPHA) * x["r"]
        + G / SPEED * jnp.cos(THETA) * x["phi"]
        + p["bias_beta"],
        "p": TURN * rolling + p["bias_p"],
        "r": YAW * TURN * yawing + p["bias_r"],
        "phi": x["p"] + jnp.tan(THETA) * x["r"] + p["bias_phi"],
    }
    return rates, {**x, "ay": SIDE * SPEED / G * side + p["bias_ay"]}


MODEL = DynamicModel(
    "lateral", ("beta", "p", "r", "phi"), ("da", "dr"), tuple(NOISE), tuple(TRUTH), equations
)
CHOICES = Choices(initial="zero")


def inputs() -> Array:
    """Return aileron and rudder, rad, shape (N, 2)."""
    t = DT * np.arange(round(DURATION / DT))
    rudder = 0.08 * np.select(
        [(t >= 1) & (t < 3), (t >= 3) & (t < 4), (t >= 4) & (t < 5)], [1.0, -1.0, 1.0], 0.0
    )
    aileron = 0.06 * np.select([(t >= 11) & (t < 12), (t >= 12) & (t < 13)], [1.0, -1.0], 0.0)
    return np.stack([aileron, rudder], axis=1)


def flight(seed: int, coloured: bool) -> Signals:
    """Return one simulated manoeuvre with noise."""
    u, rng = inputs(), np.random.default_rng(seed)
    vector = np.array([[*TRUTH.values(), 0.0, 0.0, 0.0, 0.0]])
    y = np.asarray(compiled(MODEL)[0](vector, u[None], DT))[0]
    e = rng.normal(size=(len(u) + 200, y.shape[1]))
    if coloured:
        e = lfilter([np.sqrt(1 - POLE**2)], [1.0, -POLE], e, axis=0)
    y = y + e[200:] * np.array(list(NOISE.values()))
    return Signals(DT, {"da": u[:, 0], "dr": u[:, 1]}, dict(zip(NOISE, y.T, strict=True)))


def cover(coloured: bool, seeds: int = SEEDS) -> dict[str, float]:
    """Return how often 95 % intervals hold the truth, over all parameters and by parameter."""
    truth = np.array([TRUTH[n] for n in MODEL.parameters])
    inside, converged, valid = np.zeros(truth.size), 0, 0
    spread, claimed = [], []
    for seed in range(seeds):
        found = estimate(MODEL, [flight(seed, coloured)], CHOICES)
        inside += (found.lower <= truth) & (truth <= found.upper)
        converged, valid = converged + found.converged, valid + (not found.coloured)
        spread.append(found.estimate)
        claimed.append(found.std_error)
    ratio = np.sqrt(np.mean(np.square(claimed), axis=0)) / np.std(spread, axis=0)
    return {
        "coverage": float(inside.mean() / seeds),
        "least_of_a_parameter": float(inside.min() / seeds),
        "most_of_a_parameter": float(inside.max() / seeds),
        "std_error_over_scatter": float(ratio.mean()),
        "converged": converged / seeds,
        "called_white": valid / seeds,
    }


def problem(signals: Signals, start: dict[str, float] | None = None) -> TimeDomain:
    """Return the likelihood from equation-error starts, or from those given."""
    values = equation_error_starts(MODEL, [signals], start or {}, {})
    values |= {n: 0.0 for n in values if n.startswith("x0_")}
    return TimeDomain(MODEL, [signals], choose_parameters(MODEL, [signals], values, CHOICES), "diagonal")


def converge(draws: int = DRAWS) -> dict[str, float]:
    """Return the share of starts, each parameter up to 50 % off, that reach the optimum."""
    signals, rng = flight(0, coloured=False), np.random.default_rng(1)
    best = _minimum(problem(signals))
    reached, steps = 0, []
    for _ in range(draws):
        start = {n: v * rng.uniform(0.5, 1.5) for n, v in TRUTH.items()}
        found = _minimum(problem(signals, start))
        reached += found.converged and found.point.cost - best.point.cost < 1e-3
        steps.append(found.steps)
    return {"reached": reached / draws, "median_steps": float(np.median(steps))}


def _minimum(likelihood: TimeDomain):
    p = likelihood.parameters
    found = minimise(likelihood.cost, likelihood.linearise, p.start, p.lower, p.upper)
    assert found is not None
    return found


def race() -> dict[str, float]:
    """Return the median times of both, s, and their ratio, in one run."""
    signals = flight(0, coloured=False)
    likelihood = problem(signals)
    parameters, free = likelihood.parameters, _minimum(likelihood).free
    weight = 1 / np.sqrt(np.diag(likelihood.noise_covariance(free)))
    u, z = signals.input_matrix(MODEL)[None], signals.output_matrix(MODEL)
    simulate = compiled(MODEL)[0]

    def residual(trial: Array) -> Array:
        return ((z - np.asarray(simulate(parameters.vectors(trial), u, DT))[0]) * weight).ravel()

    ours = _timed(lambda: _minimum(likelihood))
    whole = _timed(lambda: estimate(MODEL, [signals], CHOICES))
    theirs = _timed(lambda: least_squares(residual, parameters.start, x_scale="jac"))
    there = least_squares(residual, parameters.start, x_scale="jac").x
    apart = np.abs(there - free) * np.sqrt(np.diag(likelihood.linearise(free).information))
    return {
        "minimise_s": ours,
        "with_starts_errors_whiteness_s": whole,
        "scipy_s": theirs,
        "scipy_over_minimise": theirs / ours,
        "apart_in_standard_errors": float(apart.max()),
    }


def _timed(run: Callable[[], object]) -> float:
    run()
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return float(np.median(times))


def main() -> None:
    cases = {
        "white residuals": lambda: cover(coloured=False),
        "coloured residuals": lambda: cover(coloured=True),
        "starts 50 % off": converge,
        "time": race,
    }
    with open(Path(__file__).with_suffix(".csv"), "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["case", "figure", "value"])
        for case, run in cases.items():
            for figure, value in run().items():
                table.writerow([case, figure, f"{value:.4g}"])
                print(f"{case:20s} {figure:32s} {value:.4g}")
                file.flush()


if __name__ == "__main__":
    main()
