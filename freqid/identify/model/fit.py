"""The regression of a point model: on lines, transforms on transforms, or on samples with the bias."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.results.fit import Fit
from freqid.core.results.point import ResponseModel
from freqid.identify.model.line_equations import LineEquations, on_lines
from freqid.identify.model.problem import Problem, numbered
from freqid.identify.regress.covariance_corrections import (
    correct_coloured_lines,
    correct_coloured_samples,
    correct_line_spacing,
    independent_share,
)
from freqid.identify.regress.equations import real_equations
from freqid.identify.regress.estimators import Regression, find_estimator
from freqid.identify.regress.noise_lines import Noise, correct_by_noise_lines, noise_lines, noise_power
from freqid.identify.regress.regression import LeastSquares
from freqid.identify.spectra.trend import up_to

# The bias is a mean over the record; its error is judged by the residual on the lines nearest to zero.
BIAS_LINES = 10


def fit_lines(
    problem: Problem,
    lines_hz: Array,
    driven: Sequence[Array] | None = None,
    period_s: float | None = None,
) -> dict[str, ResponseModel]:
    """Fit all responses on lines.

    Parameters
    ----------
    problem : Problem
    lines_hz : ndarray, shape (M,)
        Hz, ascending.
    driven : sequence of ndarray, shape (p, N_s), optional
        Instruments: each manoeuvre's regressors as the injected signals alone would have made them.
    period_s : float, optional
        Of the multisines; needed for noise lines.

    Returns
    -------
    dict of str to ResponseModel

    Raises
    ------
    DataError, UsageError
        As `least_squares`; where noise lines are asked for and the period is unknown, or a manoeuvre is
        shorter than two periods.
    """
    settings = problem.settings
    trend = settings.trend or "line"

    def transformed(histories: Sequence[Array]) -> LineEquations:
        return on_lines(
            histories, problem.wrench, problem.dt, lines_hz, trend=trend, nuisance=settings.nuisance
        )

    equations = transformed(problem.x)
    instruments = None if driven is None else transformed(driven).x
    durations = equations.durations
    between = None
    if settings.residuals == "noise-lines":
        between = _NoiseEquations.of(problem, equations, lines_hz, period_s)

    share = [independent_share(lines_hz, duration) for duration in durations]
    models: dict[str, ResponseModel] = {}
    for rows, columns in problem.groups():

        def correct(fit: LeastSquares, rows: list[int] = rows, columns: list[int] = columns) -> LeastSquares:
            if between is not None:
                return correct_by_noise_lines(fit, equations.every_line_hz, between.left(fit, rows, columns))
            coloured = settings.residuals == "coloured"
            corrected = correct_coloured_lines if coloured else correct_line_spacing
            return corrected(fit, equations.every_line_hz, durations)

        regression = Regression(
            x=equations.x[columns],
            z=equations.z[rows],
            names=[problem.names[j] for j in columns],
            response_names=[settings.responses[r] for r in rows],
            nuisance=equations.nuisance,
            nuisance_names=[f"end term {i + 1}" for i in range(len(equations.nuisance))],
            instruments=None if instruments is None else instruments[columns],
            correct=correct,
            independent=float(np.mean(share)),
            confidence=settings.confidence,
        )
        found = find_estimator(settings.estimator).fit(regression)
        residuals = equations.each(found.fit.residual)
        # Parseval on lines 1/T apart: each stands for its mirror image too.
        square = [
            2 * k * (np.abs(e) ** 2).sum(axis=1) / t**2
            for k, e, t in zip(share, residuals, durations, strict=True)
        ]
        error = [
            np.mean(np.abs(e[:, :BIAS_LINES]) ** 2, axis=1) / t**2
            for e, t in zip(residuals, durations, strict=True)
        ]
        mean = np.array([w.mean(dt)[rows] for w, dt in zip(problem.wrench, problem.dt, strict=True)])
        noise = None if between is None else between.power(found.fit, rows, columns)
        models |= problem.models(
            rows,
            columns,
            found,
            bias=(problem.share @ mean, np.sqrt(problem.share**2 @ np.array(error))),
            rmse=np.sqrt(problem.share @ np.array(square)),
            fits=_fits(problem, rows, columns, found.fit, equations, mean, noise),
            noise=None if noise is None else _relative_to_noise(found.fit, noise),
        )
    return models


@dataclass(frozen=True, eq=False)
class _NoiseEquations:
    """The equations of each manoeuvre between the harmonics, weighted as those on them."""

    lines_hz: tuple[Array, ...]
    equations: tuple[LineEquations, ...]
    weight: tuple[float, ...]
    harmonics_hz: Array

    @classmethod
    def of(
        cls, problem: Problem, fitted: LineEquations, lines_hz: Array, period_s: float | None
    ) -> _NoiseEquations:
        if period_s is None:
            raise UsageError(
                "noise lines need the period of the multisines",
                remedy="give section [excitation], or take residuals = 'coloured'",
            )
        settings = problem.settings
        lines = tuple(noise_lines(lines_hz, period_s, duration) for duration in fitted.durations)
        each = zip(problem.x, problem.wrench, problem.dt, lines, strict=True)
        equations = tuple(
            on_lines([x], [wrench], [dt], f, trend=settings.trend or "line", nuisance=settings.nuisance)
            for x, wrench, dt, f in each
        )
        return cls(lines, equations, tuple(fitted.weight[:: lines_hz.size]), lines_hz)

    def left(self, fit: LeastSquares, rows: list[int], columns: list[int]) -> list[Noise]:
        """Return what a fit leaves there."""
        noise = []
        for f, e, weight in zip(self.lines_hz, self.equations, self.weight, strict=True):
            residual = e.z[rows] - fit.estimate @ e.x[columns]
            # End terms anew: those of the fit hold what is not linear on the harmonics.
            stacked, target = real_equations(e.nuisance, residual)
            own = np.linalg.lstsq(stacked.T, target.T)[0].T
            freed = 1 - len(stacked) / stacked.shape[1]
            noise.append(Noise(f, np.abs(weight * (residual - own @ e.nuisance)) ** 2 / freed))
        return noise

    def power(self, fit: LeastSquares, rows: list[int], columns: list[int]) -> Array:
        """Return the power of a residual on the harmonics that is noise alone, shape (R, S M).

        Of the two equations of a line the fit takes the leverage away.
        """
        noise = [noise_power(self.harmonics_hz, n) for n in self.left(fit, rows, columns)]
        return np.concatenate(noise, axis=1) * np.maximum(1 - fit.leverage / 2, 0.1)


def _relative_to_noise(fit: LeastSquares, noise: Array) -> tuple[Array, Array]:
    """Return how much more the residual is than noise, and the R2 that noise allows, shape (R,)."""
    with np.errstate(divide="ignore", invalid="ignore"):  # a response that is zero throughout
        ratio = np.mean(np.abs(fit.residual) ** 2 / noise, axis=1)
        return ratio, 1.0 - noise.sum(axis=1) / fit.total_square


def _fits(
    problem: Problem,
    rows: list[int],
    columns: list[int],
    fit: LeastSquares,
    equations: LineEquations,
    mean: Array,
    noise: Array | None,
) -> list[dict[str, Fit]]:
    """Return measured and modelled, on lines and in time up to the highest line, by response."""
    fits: list[dict[str, Fit]] = [{} for _ in rows]
    lines, highest = equations.lines_hz, float(equations.lines_hz[-1])
    spectra, residuals = equations.each(equations.z[rows]), equations.each(fit.residual)
    alone = None if noise is None else equations.each(np.sqrt(noise))
    for m, (x, wrench, dt) in enumerate(zip(problem.x, problem.wrench, problem.dt, strict=True)):
        measured = up_to(wrench.history(dt)[rows], dt, highest)
        modelled = up_to(fit.estimate @ x[columns] + mean[m][:, None], dt, highest)
        time = dt * np.arange(x.shape[1])
        for i in range(len(rows)):
            z = spectra[m][i]
            fits[i][numbered("frequency", m)] = Fit(
                lines, z, z - residuals[m][i], None if alone is None else alone[m][i]
            )
            fits[i][numbered("time", m)] = Fit(time, measured[i], modelled[i])
    return fits


def fit_samples(problem: Problem, driven: Sequence[Array] | None = None) -> dict[str, ResponseModel]:
    """Fit all responses on samples.

    Parameters
    ----------
    problem : Problem
    driven : sequence of ndarray, shape (p, N_s), optional
        Instruments: each manoeuvre's regressors as the injected signals alone would have made them.

    Returns
    -------
    dict of str to ResponseModel
    """
    settings, count = problem.settings, len(problem.x)
    samples = [x.shape[1] for x in problem.x]
    ends = np.cumsum(samples)[:-1]
    time = [dt * np.arange(n) for dt, n in zip(problem.dt, samples, strict=True)]
    slope = settings.trend in ("line", "endpoints")
    ramps = [t / t[-1] - 0.5 for t in time] if slope else []
    nuisance = np.concatenate([block_diag(*map(np.ones_like, time)), *([block_diag(*ramps)] * slope)])
    about_trim = problem.mean - problem.trim  # of each manoeuvre's own means
    x = np.concatenate([x_s + d[:, None] for x_s, d in zip(problem.x, about_trim, strict=True)], axis=1)
    z = np.concatenate([w.history(dt) for w, dt in zip(problem.wrench, problem.dt, strict=True)], axis=1)
    instruments = None if driven is None else np.concatenate(driven, axis=1)

    def correct(fit: LeastSquares) -> LeastSquares:
        return correct_coloured_samples(fit, samples=samples) if settings.residuals == "coloured" else fit

    models: dict[str, ResponseModel] = {}
    for rows, columns in problem.groups():
        regression = Regression(
            x=x[columns],
            z=z[rows],
            names=[problem.names[j] for j in columns],
            response_names=[settings.responses[r] for r in rows],
            nuisance=nuisance,
            nuisance_names=[numbered(n, m) for n in ("bias", "slope")[: 1 + slope] for m in range(count)],
            instruments=None if instruments is None else instruments[columns],
            correct=correct,
            independent=1.0,
            confidence=settings.confidence,
        )
        found = find_estimator(settings.estimator).fit(regression)
        fit = found.fit
        covariance = fit.solution_covariance[:, :count, :count]
        bias_error = np.sqrt(np.einsum("m,rmn,n->r", problem.share, covariance, problem.share))
        fits: list[dict[str, Fit]] = [{} for _ in rows]
        split = [np.split(values, ends, axis=1) for values in (z[rows], fit.residual)]
        for m, (measured, residual) in enumerate(zip(*split, strict=True)):
            for i in range(len(rows)):
                fits[i][numbered("time", m)] = Fit(time[m], measured[i], measured[i] - residual[i])
        models |= problem.models(
            rows,
            columns,
            found,
            bias=(fit.nuisance_estimate[:, :count] @ problem.share, bias_error),
            rmse=np.sqrt(fit.residual_square / z.shape[1]),
            fits=fits,
        )
    return models
