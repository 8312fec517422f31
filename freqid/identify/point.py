"""Equation error at one reference condition: from a manoeuvre to a point model."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import RESPONSE
from freqid.core.errors import DataError, UsageError
from freqid.core.models import Fit, PointModel, ResponseModel
from freqid.core.record import Maneuver
from freqid.core.scenario import Excitation, Identification, Reference
from freqid.identify.explanatory import explanatory_variables, history
from freqid.identify.fourier import FourierPlan, frequency_grid, harmonics
from freqid.identify.regression import LeastSquares, least_squares
from freqid.identify.trend import remove_trend, trend_columns, up_to
from freqid.identify.uncertainty import (
    correct_coloured_lines,
    correct_coloured_samples,
    correct_line_spacing,
)
from freqid.identify.wrench import AppliedWrench, applied_wrench, response_name

Array = NDArray[np.float64]

# The bias is a mean over the record; its error is judged by the residual on the lines nearest to zero.
BIAS_LINES = 10
# A regressor that moves by less than this share of its mean is constant but for rounding.
STILL = 1e-9


def identify_point(
    maneuver: Maneuver,
    settings: Identification,
    *,
    excitation: Excitation | None = None,
    reference: Reference | None = None,
) -> PointModel:
    """Identify the applied wrench as a linear function of states and effectors about a reference.

    Parameters
    ----------
    maneuver : Maneuver
    settings : Identification
        Responses, regressors, lines and method.
    excitation : Excitation, optional
        Gives the lines, its harmonics, where the settings name none.
    reference : Reference, optional
        Condition that the model holds at; the record's means where absent.

    Returns
    -------
    PointModel

    Raises
    ------
    DataError
        Where a channel is missing, constant or collinear, or the record does not support the lines.
    UsageError
        Where no lines are named.

    Notes
    -----
    Equation error (Klein & Morelli, 2nd ed., ch. 5 and 7). In the frequency domain responses keep
    their derivative part apart and it is differentiated there, so no measured rate ever is
    (docs/theory/identification.md).
    """
    names = tuple(dict.fromkeys(n for r in settings.responses for n in settings.regressors_of(r)))
    x, units = explanatory_variables(maneuver, names)
    wrench = _responses(maneuver, settings)
    dt, trim = maneuver.record.dt, x.mean(axis=1)
    x = x - trim[:, None]
    rms = remove_trend(x, dt, "line").x.std(axis=1)
    _refuse_still(names, rms, trim)
    problem = _Problem(names, units, x, trim, rms, wrench, dt, settings)
    if settings.method == "frequency":
        lines = _lines(settings, excitation)
        maneuver.record.check_band(_used(maneuver, names, settings), float(lines[-1]))
        responses = _fit_lines(problem, lines)
    else:
        responses = _fit_samples(problem)
    return PointModel(
        reference=reference or _flown(maneuver),
        responses={r: responses[r] for r in settings.responses},
        method=settings.method,
        form=settings.form,
        axes=settings.axes,
        confidence=settings.confidence,
        duration=maneuver.record.duration,
        vehicle=maneuver.vehicle.name,
        provenance={"record": maneuver.record.provenance},
    )


def predict(model: PointModel, maneuver: Maneuver, settings: Identification) -> dict[str, Fit]:
    """Predict the responses of another manoeuvre, in the time domain.

    Parameters
    ----------
    model : PointModel
    maneuver : Maneuver
        Not used in the identification.
    settings : Identification
        Those of the identification: how responses are had from the record.

    Returns
    -------
    dict of str to Fit
        Measured and predicted history by response, each about its own mean: a point model says how the
        wrench changes about a trim, not what another flight's trim was. Of a model identified on lines
        both are shown up to the highest line.
    """
    wrench = _responses(maneuver, settings)
    measured = wrench.history(maneuver.record.dt)
    time = maneuver.record.time - maneuver.record.time[0]
    fits = {}
    for r, name in enumerate(settings.responses):
        response = model[name]
        x = np.array([history(maneuver, n) for n in response.regressors])
        both = np.array([measured[r], response.estimate @ x])
        if "frequency" in response.fit:
            both = up_to(both, maneuver.record.dt, float(response.fit["frequency"].axis[-1]))
        both -= both.mean(axis=1, keepdims=True)
        fits[name] = Fit(time, both[0], both[1])
    return fits


@dataclass(frozen=True)
class _Problem:
    """What is regressed on what: regressors about the trim, and the responses."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    x: Array
    trim: Array
    rms: Array
    wrench: AppliedWrench
    dt: float
    settings: Identification

    def groups(self) -> Iterable[tuple[list[int], list[int]]]:
        """Yield rows of responses that share their regressors, and the rows of those regressors."""
        shared: dict[tuple[str, ...], list[int]] = {}
        for r, response in enumerate(self.settings.responses):
            shared.setdefault(self.settings.regressors_of(response), []).append(r)
        for regressors, rows in shared.items():
            yield rows, [self.names.index(n) for n in regressors]


def _refuse_still(names: tuple[str, ...], rms: Array, trim: Array) -> None:
    """Refuse regressors that, but for a straight line, move by no more than their rounding."""
    still = np.flatnonzero(rms <= STILL * np.abs(trim))
    if still.size:
        name, level = names[still[0]], trim[still[0]]
        raise DataError(
            f"regressor '{name}' is constant, or a straight line, over the manoeuvre (mean {level:.6g}, rms "
            f"about the line {rms[still[0]]:.2g}), so its parameter cannot be estimated",
            remedy="drop it from the regressors, or excite it",
        )


def _used(maneuver: Maneuver, names: tuple[str, ...], settings: Identification) -> list[str]:
    """Return the channels that carry the band of the regression: regressors, rates, forces and rotors."""
    wanted = [f"{group}/{name}" for group in ("state", "air", "effector") for name in names]
    if settings.response_source == "reconstruct":
        wanted += [f"state/{n}" for n in ("p", "q", "r", "ax", "ay", "az")]
        wanted += [f"effector/{r.name}" for r in maneuver.vehicle.rotors if r.inertia]
    return [name for name in dict.fromkeys(wanted) if name in maneuver.record]


def _responses(maneuver: Maneuver, settings: Identification) -> AppliedWrench:
    """Return the responses asked for, reconstructed or as the record holds them."""
    if settings.response_source == "reconstruct":
        return applied_wrench(
            maneuver,
            settings.responses,
            form=settings.form,
            axes=settings.axes,
            angular_acceleration=settings.angular_acceleration,
        )
    if settings.form == "specific":
        raise UsageError(
            "a record holds responses as forces or as coefficients, not per mass",
            remedy="use form 'force' or 'coefficient', or response_source 'reconstruct'",
        )
    names = [response_name(r, settings.form) for r in settings.responses]
    direct = maneuver.record.matrix(f"response/{n}" for n in names)
    return AppliedWrench(
        names=settings.responses,
        units=tuple(RESPONSE[n][0] for n in names),
        direct=direct,
        momentum=np.zeros_like(direct),
    )


def _lines(settings: Identification, excitation: Excitation | None) -> Array:
    if settings.frequencies_hz is None:
        if excitation is None:
            raise UsageError(
                "no frequencies are named",
                remedy="give identification.frequencies_hz, or [excitation] whose harmonics are then used",
            )
        return harmonics(excitation.period_s, excitation.band_hz)
    if isinstance(settings.frequencies_hz, tuple):
        return np.array(settings.frequencies_hz)
    grid = settings.frequencies_hz
    return frequency_grid(grid.start, grid.step, grid.stop)


def _flown(maneuver: Maneuver) -> Reference:
    """Return the condition that was flown, from the means of what the record holds."""
    record = maneuver.record

    def mean(name: str) -> float:
        try:
            return float(np.mean(history(maneuver, name)))
        except DataError:
            return float("nan")

    tilts = [mean(wing.tilt) for wing in maneuver.vehicle.wings] + [0.0, 0.0]
    return Reference(id=record.reference or "flown", u=mean("u"), rho=mean("rho"), dw1=tilts[0], dw2=tilts[1])


def _fit_lines(problem: _Problem, lines: Array) -> dict[str, ResponseModel]:
    """Regress transforms on transforms."""
    settings, wrench, dt = problem.settings, problem.wrench, problem.dt
    plan = _plan(problem.x.shape[1], dt, tuple(lines))
    trend = settings.trend or "line"
    x = plan(remove_trend(problem.x, dt, trend).x)
    z = plan(remove_trend(wrench.direct, dt, trend).x)
    changing = bool(wrench.momentum.any())
    if changing:
        z += plan.derivative(remove_trend(wrench.momentum, dt, "endpoints").x)
    nuisance = _nuisance(plan, settings, changing)

    highest = float(lines[-1])
    measured = up_to(wrench.history(dt), dt, highest)
    mean = wrench.mean(dt)
    time = dt * np.arange(problem.x.shape[1])
    models = {}
    for rows, columns in problem.groups():
        fit = least_squares(
            x[columns],
            z[rows],
            names=[problem.names[j] for j in columns],
            response_names=[settings.responses[r] for r in rows],
            nuisance=nuisance,
            nuisance_names=[f"end term {i + 1}" for i in range(len(nuisance))],
        )
        correct = correct_coloured_lines if settings.residuals == "coloured" else correct_line_spacing
        fit = correct(fit, lines, plan.duration)
        limits = fit.interval(settings.confidence)
        share = 1.0 if plan.resolution is None else min(1.0, plan.duration * plan.resolution)
        # Parseval on lines 1/T apart: each stands for its mirror image too.
        rmse = np.sqrt(2 * share * fit.residual_square) / plan.duration
        near = np.argsort(lines)[:BIAS_LINES]
        bias_error = np.sqrt(np.mean(np.abs(fit.residual[:, near]) ** 2, axis=1)) / plan.duration
        modelled_t = up_to(fit.estimate @ problem.x[columns] + mean[rows, None], dt, highest)
        for i, r in enumerate(rows):
            models[settings.responses[r]] = _response_model(
                problem,
                fit,
                i,
                r,
                columns,
                limits=limits,
                bias=(float(mean[r]), float(bias_error[i])),
                rmse=float(rmse[i]),
                fits={
                    "frequency": Fit(lines, z[r], z[r] - fit.residual[i]),
                    "time": Fit(time, measured[r], modelled_t[i]),
                },
            )
    return models


@lru_cache(maxsize=16)
def _plan(samples: int, dt: float, lines: tuple[float, ...]) -> FourierPlan:
    """Return a transform; manoeuvres of one campaign share theirs."""
    return FourierPlan(samples, dt, lines)


def _nuisance(plan: FourierPlan, settings: Identification, changing: bool) -> NDArray[np.complex128]:
    """Return the columns that absorb what is not motion: end samples and what is left of a trend.

    A line removed from every channel differs between response and regressors by as much as their end
    samples are noisy. The transforms of 1 and t take that up, whatever was removed before.
    """
    if settings.nuisance == "none":
        return np.empty((0, plan.frequencies_hz.size), dtype=complex)
    if settings.nuisance == "constant":
        return plan.end_terms()[:1]
    columns = [trend_columns(plan.frequencies_hz, plan.duration)]
    if changing:
        columns.append(plan.nuisance())
    return np.concatenate(columns)


def _fit_samples(problem: _Problem) -> dict[str, ResponseModel]:
    """Regress samples on samples, the bias among the parameters."""
    settings, dt = problem.settings, problem.dt
    z = problem.wrench.history(dt)
    time = dt * np.arange(z.shape[1])
    columns_of_time = [np.ones_like(time)]
    if settings.trend in ("line", "endpoints"):
        columns_of_time.append(time / time[-1] - 0.5)
    models = {}
    for rows, columns in problem.groups():
        fit = least_squares(
            problem.x[columns],
            z[rows],
            names=[problem.names[j] for j in columns],
            response_names=[settings.responses[r] for r in rows],
            nuisance=np.array(columns_of_time),
            nuisance_names=["bias", "slope"][: len(columns_of_time)],
        )
        if settings.residuals == "coloured":
            fit = correct_coloured_samples(fit)
        limits = fit.interval(settings.confidence)
        for i, r in enumerate(rows):
            models[settings.responses[r]] = _response_model(
                problem,
                fit,
                i,
                r,
                columns,
                limits=limits,
                bias=(float(fit.nuisance_estimate[i, 0]), float(fit.nuisance_std_error[i, 0])),
                rmse=float(np.sqrt(fit.residual_square[i] / z.shape[1])),
                fits={"time": Fit(time, z[r], z[r] - fit.residual[i])},
            )
    return models


def _response_model(
    problem: _Problem,
    fit: LeastSquares,
    i: int,
    row: int,
    columns: list[int],
    *,
    limits: tuple[Array, Array],
    bias: tuple[float, float],
    rmse: float,
    fits: dict[str, Fit],
) -> ResponseModel:
    """Collect what one response of a fit says."""
    nuisance = len(fit.nuisance_names)
    return ResponseModel(
        response=problem.settings.responses[row],
        unit=problem.wrench.units[row],
        regressors=fit.names,
        regressor_units=tuple(problem.units[j] for j in columns),
        trim=problem.trim[columns],
        regressor_rms=problem.rms[columns],
        estimate=fit.estimate[i],
        std_error=fit.std_error[i],
        covariance=fit.covariance[i],
        lower=limits[0][i],
        upper=limits[1][i],
        bias=bias[0],
        bias_std_error=bias[1],
        r2=float(fit.r2[i]),
        pse=float(fit.pse[i]),
        rmse=rmse,
        fit_error=float(fit.fit_error[i]),
        t_statistic=fit.t_statistic[i],
        variance_inflation=fit.variance_inflation,
        correlation=fit.correlation[i],
        condition_index=fit.collinearity.condition_index,
        variance_proportion=fit.collinearity.proportion[:, nuisance:],
        inseparable=fit.collinearity.inseparable(),
        fit=fits,
    )
