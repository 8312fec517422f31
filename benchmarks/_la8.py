"""Flights of the LA-8 class simulation that the study's benchmarks share: designs, truths, noisy records."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import cast

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import msgspec
import numpy as np

import freqid as fq
from freqid.core.channels import WRENCH
from freqid.core.results.design import SampledInputs
from freqid.core.scenario import Reference
from freqid.core.sections.estimators import EstimatorName
from freqid.core.sections.excitation import Excitation
from freqid.core.sections.identification import Identification
from freqid.identify.model.line_equations import LineEquations, on_lines
from freqid.identify.model.problem import Problem
from freqid.identify.point import identify_point
from freqid.identify.spectra.fourier import harmonics
from freqid.simulate import sensors
from freqid.simulate.control.lq import ClosedLoop, close_loop
from freqid.simulate.fly import fly, sortie
from freqid.simulate.truth import truth_of

RATE_HZ = 50.0  # of the log
Truth = tuple[fq.FlightRecord, np.ndarray]


PATH = "la8"  # comes with the package
SCENARIO = fq.read_scenario(PATH)
SHA256 = SCENARIO.sha256
SETTINGS = cast(Identification, SCENARIO.identification)
EXCITATION = cast(Excitation, SCENARIO.excitation)


@lru_cache
def inputs(seed: int) -> SampledInputs:
    """Return multisines of the scenario; another seed gives other phases to the same harmonics."""
    return fq.design_inputs(SCENARIO, seed=seed).inputs


@lru_cache
def closed_loop(rho: float, wake: float = 1.0) -> ClosedLoop:
    """Return trims and law of one altitude, of an aircraft with a share of its wakes."""
    simulation = msgspec.structs.replace(SCENARIO.simulation, effects={"wing_wake": wake})
    described = msgspec.structs.replace(SCENARIO, simulation=simulation)
    return close_loop(described, next(at for at in described.reference if at.rho == rho))


def flown(at: Reference, signals: SampledInputs, scale: float = 1.0, wake: float = 1.0) -> Truth:
    """Fly one manoeuvre, with a multiple of its signals, and return its truth and wind."""
    loop = closed_loop(at.rho, wake)
    flight = fly(sortie(SCENARIO, loop, at, replace(signals, values=scale * signals.values)))
    if flight.divergence:
        raise SystemExit(f"{at.id}: {flight.divergence}")
    return truth_of(SCENARIO, flight, excited=signals.names, reference=at.id)


def logged(truth: Truth, noise: float, seed: int = 0, suite: str = "research") -> fq.Maneuver:
    """Return what is logged of a flight with a multiple of a suite's noise; none of its errors at zero."""
    carried = sensors.with_scaled_noise(sensors.suite(SCENARIO, suite), noise)
    return fq.Maneuver.of(sensors.measure(*truth, carried, RATE_HZ, seed))


def on_harmonics(maneuver: fq.Maneuver) -> LineEquations:
    """Return what is regressed: all regressors and responses on the harmonics of the multisines."""
    problem = Problem.of([maneuver], SETTINGS)
    lines = harmonics(EXCITATION.period_s, EXCITATION.band_hz)
    return on_lines(problem.x, problem.wrench, problem.dt, lines)


def identified(maneuver: fq.Maneuver, at: Reference, estimator: EstimatorName | None = None) -> fq.PointModel:
    return identify_point(maneuver, SETTINGS, excitation=EXCITATION, reference=at, estimator=estimator)


def table(model: fq.PointModel) -> tuple[np.ndarray, np.ndarray]:
    """Return estimates and standard errors, shape (6, regressor)."""
    rows = [model[r] for r in WRENCH]
    return np.array([r.estimate for r in rows]), np.array([r.std_error for r in rows])


def told(found: Iterable[object]) -> list[dict[str, str]]:
    """Print rows as lists of them come in, and return them all."""
    rows: list[dict[str, str]] = []
    for rows_of in found:
        each = cast(list[dict[str, str]], rows_of)
        rows += each
        for row in each:
            print("  ".join(f"{value:<9}" for value in row.values()), flush=True)
    return rows


def write(path: Path, rows: Sequence[Mapping[str, object]]) -> None:
    """Write rows beside a script."""
    with path.with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
