"""Delays of effectors and a steady wind, as those that the responses agree with; and what they change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.record import Maneuver
from freqid.core.sections.identification import Identification
from freqid.identify.instruments.driven import driven_maneuvers
from freqid.identify.loads.explanatory import explanatory_variables
from freqid.identify.model.line_equations import LineEquations, on_lines
from freqid.identify.model.problem import Problem
from freqid.identify.regress.equations import real_equations
from freqid.identify.sensors.alignment_motion import HORIZONTAL_WINDS, Misaligned
from freqid.identify.sensors.errors import error_kind

STEPS = {"delay": 1e-4, "bias": 1e-4, "scale": 1e-3, "wind": 1.0}  # s, rad, 1, m/s; for derivatives
ROUNDS = 8
SETTLED = 0.02  # of a standard error
_NOTHING = 1e-300  # a response that tells nothing of an unknown does not disagree about it


@dataclass(frozen=True, eq=False)
class Changes:
    """Regressors and responses on lines, and how they change with each unknown of a record's sensors.

    Attributes
    ----------
    names : tuple of str, length p
        Regressors.
    equations : LineEquations
    driven : ndarray of complex, shape (p, M)
        Their instruments; themselves where nothing was injected.
    x, z : ndarray of complex, shape (k, p, M) and (k, R, M)
        Derivatives by the k unknowns.
    """

    names: tuple[str, ...]
    equations: LineEquations
    driven: NDArray[np.complex128]
    x: NDArray[np.complex128]
    z: NDArray[np.complex128]

    @classmethod
    def about(
        cls,
        flown: Misaligned,
        errors: Mapping[str, float],
        unknowns: Sequence[str],
        settings: Identification,
        lines_hz: Array,
    ) -> Changes:
        """Return the equations at given errors of the sensors, and their derivatives by some of these."""

        def equations(maneuver: Maneuver) -> tuple[Problem, LineEquations]:
            problem = Problem.of([maneuver], settings)
            trend = settings.trend or "line"
            return problem, on_lines(
                problem.x, problem.wrench, problem.dt, lines_hz, trend=trend, nuisance=settings.nuisance
            )

        here = flown.at(errors)
        problem, now = equations(here)
        driven = now.x
        if any(here.record[f"excitation/{n}"].any() for n in here.record.group("excitation")):
            alone = driven_maneuvers((here,), lines_hz, settings)[0]
            trim = dict(zip(problem.names, problem.trim.tolist(), strict=True))
            x = explanatory_variables(alone, problem.names, trim)[0]
            x = x - x.mean(axis=1, keepdims=True)
            driven = on_lines([x], problem.wrench, problem.dt, lines_hz, trend=settings.trend or "line").x
        dx, dz = [], []
        for unknown in unknowns:
            step = STEPS[error_kind(unknown)]
            there = equations(flown.at({**errors, unknown: errors.get(unknown, 0.0) + step}))[1]
            dx.append((there.x - now.x) / step)
            dz.append((there.z - now.z) / step)
        return cls(problem.names, now, driven, np.array(dx), np.array(dz))

    def part(self, regressors: Sequence[str]) -> Part:
        """Return the fit of one response's regressors, without its response."""
        columns = [self.names.index(n) for n in regressors]
        extra = self.equations.nuisance
        x, instruments = real_equations(
            np.concatenate([extra, self.equations.x[columns]]),
            np.concatenate([extra, self.driven[columns]]),
        )
        length = np.sqrt((instruments**2).sum(axis=1, keepdims=True))
        dual = np.linalg.solve((instruments / length) @ x.T, instruments / length)
        return Part(columns, x, instruments, dual)


@dataclass(frozen=True, eq=False)
class Part:
    """Columns of one fit as real equations: ``estimate = dual @ response``, nuisance first.

    Attributes
    ----------
    columns : list of int
        Rows of the regressors among those of `Changes`.
    x, instruments, dual : ndarray, shape (q + p, 2 M)
    """

    columns: list[int]
    x: Array
    instruments: Array
    dual: Array

    def disturbance(self, changes: Changes, row: int, estimate: Array) -> Array:
        """Return what each unknown adds to model less response, shape (k, 2 M), for given parameters."""
        by = np.einsum("p,kpm->km", estimate, changes.x[:, self.columns]) - changes.z[:, row]
        return real_equations(by.astype(complex))[0]


@dataclass(frozen=True, eq=False)
class LoadsFit:
    """Unknowns that the responses tell.

    Attributes
    ----------
    estimate : ndarray, shape (k,)
    covariance : ndarray, shape (k, k)
        At given errors of the motion.
    by_motion : ndarray, shape (k, m)
        Derivatives of the estimate by these.
    disagreement : ndarray, shape (k,)
        Birge ratio of each, one where the responses agree within noise.
    changes : Changes
        At the estimate, by the errors of the motion and then these.
    """

    estimate: Array
    covariance: Array
    by_motion: Array
    disagreement: Array
    changes: Changes


def loads_unknowns(flown: Misaligned) -> tuple[str, ...]:
    """Return the delays of effectors, by kind, and the wind where velocity is known over the ground only."""
    delays = tuple(n for n in flown.clocks() if n.split()[0] in flown.effectors)
    return (*delays, *(HORIZONTAL_WINDS if flown.over_ground else ()))


def fit_loads(
    flown: Misaligned,
    motion: Mapping[str, float],
    settings: Identification,
    lines_hz: Array,
    plausible: Mapping[str, float],
) -> LoadsFit:
    """Estimate `loads_unknowns` together with the parameters of all responses.

    Parameters
    ----------
    flown : Misaligned
    motion : mapping of str to float
        What kinematics said.
    settings : Identification
    lines_hz : ndarray, shape (M,)
        Hz.
    plausible : mapping of str to float
        One sigma of each unknown beforehand, SI units.

    Returns
    -------
    LoadsFit

    Notes
    -----
    Each response leaves ``e = z - theta x`` with theta by instruments, and to first order an unknown's change
    leaves ``d = theta dx - dz`` of it. The unknowns solve ``sum_r w_r B_r e_r = 0`` with B_r that part of d_r
    which no instrument explains, and w_r by what a response leaves: an estimate that noise in the regressors
    does not bias, since a signal's noise and that of its derivative are uncorrelated. The covariance is that
    of these sums with the residuals as they are, line by line. Where responses disagree about an unknown by
    more than noise, as loads that follow the motion late make them do, its error is multiplied with the root
    mean square of their disagreement (Birge, Physical Review 40, 1932).
    """
    names, given = loads_unknowns(flown), tuple(motion)
    found, prior = np.zeros(len(names)), np.diag([plausible[n] ** -2 for n in names])

    def step(unknowns: tuple[str, ...]) -> LoadsFit:
        now = {**motion, **dict(zip(names, found.tolist(), strict=True))}
        changes = Changes.about(flown, now, unknowns, settings, lines_hz)
        return _step(changes, settings, len(unknowns) - len(names), prior, found)

    for _ in range(ROUNDS):
        fit = step(names)
        moved, found = np.abs(fit.estimate - found), fit.estimate
        if (moved < SETTLED * np.sqrt(np.diag(fit.covariance))).all():
            break
    return step((*given, *names))


def _step(changes: Changes, settings: Identification, given: int, prior: Array, found: Array) -> LoadsFit:
    """Return the estimate of one step of Gauss-Newton from `found`."""
    scores, slopes, spreads = [], [], []
    for row, response in enumerate(settings.responses):
        part = changes.part(settings.regressors_of(response))
        z = real_equations(changes.equations.z)[0][row]
        theta = part.dual @ z
        left = z - theta @ part.x
        by = part.disturbance(changes, row, theta[-len(part.columns) :])
        basis = np.linalg.qr(part.instruments.T)[0]
        weights = by[given:] - (by[given:] @ basis) @ basis.T
        weights = weights - (weights @ part.x.T) @ part.dual  # of the residual to those of the noise
        free = 1 - (basis**2).sum(axis=1)
        precision = (left.size - len(part.x)) / (left @ left)
        scores.append(precision * weights @ left)
        slopes.append(precision * weights @ by.T)
        spreads.append(precision**2 * (weights * left**2 / np.maximum(free, 0.25)) @ weights.T)
    slope = np.sum(slopes, axis=0)
    inverse = np.linalg.inv(slope[:, given:] + prior)
    step = inverse @ (np.sum(scores, axis=0) - prior @ found)
    # what each response would have an unknown be, less what all together say, over its noise
    apart = [score - own[:, given:] @ step for score, own in zip(scores, slopes, strict=True)]
    square = sum(a**2 / np.maximum(np.diag(c), _NOTHING) for a, c in zip(apart, spreads, strict=True))
    disagreement = np.sqrt(np.maximum(1.0, square / max(len(scores) - 1, 1)))
    spread = np.outer(disagreement, disagreement) * np.sum(spreads, axis=0) + prior
    return LoadsFit(
        found + step, inverse @ spread @ inverse.T, -inverse @ slope[:, :given], disagreement, changes
    )
