"""Transforms of one or several manoeuvres as the equations of one regression on lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from freqid.core.arrays import Array, Complex
from freqid.identify.loads.wrench import AppliedWrench
from freqid.identify.regress.covariance_corrections import independent_share
from freqid.identify.spectra.fourier import FourierPlan
from freqid.identify.spectra.trend import TrendKind, remove_trend, trend_columns


@dataclass(frozen=True, eq=False)
class LineEquations:
    """Regressors, responses and nuisance columns of S manoeuvres, one manoeuvre after another.

    Attributes
    ----------
    x : ndarray of complex, shape (p, S M)
        Transforms of the regressors, weighted, unit of the regressor times s.
    z : ndarray of complex, shape (R, S M)
        Of the responses, likewise.
    nuisance : ndarray of complex, shape (q, S M)
        Each manoeuvre has its own, zero on the lines of the others.
    lines_hz : ndarray, shape (M,)
        The same for all manoeuvres.
    durations : tuple of float, length S
        s.
    weight : ndarray, shape (S M,)
        What the transforms were multiplied with: 1 for the first manoeuvre.

    Notes
    -----
    A sensor's noise has transforms whose variance grows with T, and lines closer than 1/T repeat each
    other, k = min(1, T df) of them being independent. The weight ``sqrt(k / T)``, relative to the first
    manoeuvre's, gives each manoeuvre the influence of the information that it holds.
    """

    x: Complex
    z: Complex
    nuisance: Complex
    lines_hz: Array
    durations: tuple[float, ...]
    weight: Array

    @property
    def every_line_hz(self) -> list[Array]:
        """Lines of each manoeuvre, as `freqid.identify.regress.covariance_corrections` wants them."""
        return [self.lines_hz] * len(self.durations)

    def each(self, values: NDArray) -> list[NDArray]:
        """Split values on all lines, shape (..., S M), into unweighted ones of each manoeuvre."""
        return np.split(values / self.weight, len(self.durations), axis=-1)


def on_lines(
    histories: Sequence[Array],
    wrenches: Sequence[AppliedWrench],
    dt: Sequence[float],
    lines_hz: Array,
    *,
    trend: TrendKind = "line",
    nuisance: str = "auto",
) -> LineEquations:
    """Transform manoeuvres to lines.

    Parameters
    ----------
    histories : sequence of ndarray, shape (p, N_s)
        Regressors of each manoeuvre.
    wrenches : sequence of AppliedWrench
        Responses of each manoeuvre.
    dt : sequence of float
        Sampling intervals, s.
    lines_hz : ndarray, shape (M,)
        Hz, ascending.
    trend : {"endpoints", "line", "mean", "none"}
        What is removed before the transform.
    nuisance : {"auto", "constant", "none"}
        Columns that absorb end samples and trends.

    Returns
    -------
    LineEquations
    """
    xs, zs, extras, durations, shares = [], [], [], [], []
    for x, wrench, step in zip(histories, wrenches, dt, strict=True):
        plan = plan_of(x.shape[1], step, tuple(lines_hz))
        z = plan(remove_trend(wrench.direct, step, trend).x)
        changing = bool(wrench.momentum.any())
        if changing:
            z += plan.derivative(remove_trend(wrench.momentum, step, "endpoints").x)
        xs.append(plan(remove_trend(x, step, trend).x))
        zs.append(z)
        extras.append(_nuisance(plan, nuisance, changing))
        durations.append(plan.duration)
        shares.append(independent_share(lines_hz, plan.duration))
    scale = np.sqrt(np.array(shares) / np.array(durations))
    weight = np.repeat(scale / scale[0], len(lines_hz))
    return LineEquations(
        x=np.concatenate(xs, axis=1) * weight,
        z=np.concatenate(zs, axis=1) * weight,
        nuisance=block_diag(*extras) * weight,
        lines_hz=lines_hz,
        durations=tuple(durations),
        weight=weight,
    )


@lru_cache(maxsize=16)
def plan_of(samples: int, dt: float, lines_hz: tuple[float, ...]) -> FourierPlan:
    """Return a transform; manoeuvres of one campaign share theirs."""
    return FourierPlan(samples, dt, lines_hz)


def _nuisance(plan: FourierPlan, kind: str, changing: bool) -> Complex:
    """Return the columns that absorb what is not motion: end samples and what is left of a trend.

    A line removed from every channel differs between response and regressors by as much as their end
    samples are noisy. The transforms of 1 and t take that up, whatever was removed before.
    """
    if kind == "none":
        return np.empty((0, plan.frequencies_hz.size), dtype=complex)
    if kind == "constant":
        return plan.end_terms()[:1]
    columns = [trend_columns(plan.frequencies_hz, plan.duration)]
    if changing:
        columns.append(plan.nuisance())
    return np.concatenate(columns)
