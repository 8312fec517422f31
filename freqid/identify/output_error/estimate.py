"""The whole estimation: starts, iteration, what the data do not tell, errors, and whether it is valid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.core.results.fit import Fit
from freqid.core.results.output_error import OutputErrorModel
from freqid.identify.output_error.filter_error import FilterError
from freqid.identify.output_error.frequency_domain import FrequencyDomain
from freqid.identify.output_error.minimise import Minimum, minimise, unexcited
from freqid.identify.output_error.model import DynamicModel, Signals
from freqid.identify.output_error.parameters import (
    Choices,
    ParameterSet,
    choose_parameters,
    numbered,
    spelled_out,
)
from freqid.identify.output_error.starts import equation_error_starts
from freqid.identify.output_error.time_domain import EXACT, NoiseKind, TimeDomain
from freqid.identify.output_error.whiteness import coloured, whiteness
from freqid.identify.regress.confidence_interval import confidence_interval
from freqid.identify.regress.covariance_corrections import (
    correct_coloured_lines,
    correct_coloured_samples,
    correct_line_spacing,
)
from freqid.identify.regress.regression import LeastSquares, least_squares
from freqid.identify.spectra.trend import TrendKind

Likelihood = TimeDomain | FrequencyDomain | FilterError
LEAST_PROCESS, FIRST_PROCESS = 1e-6, 1e-2
"""Process noise per square root of a second, as a share of the state's rms: what counts as none, and where
the iteration begins."""


@dataclass(frozen=True)
class Settings:
    """How a model is estimated.

    Attributes
    ----------
    method : {"output-error", "filter-error"}
    domain : {"time", "frequency"}
    noise : {"diagonal", "full"}
        Covariance of the outputs' noise that output error in time estimates.
    residuals : {"coloured", "white"}
        What the standard errors allow residuals to be.
    confidence : float
    lines_hz : sequence of float, optional
        Lines of the frequency domain.
    trend : {"endpoints", "line", "mean", "none"}
        What is removed before a transform.
    process_noise : sequence of str, optional
        States that filter error lets process noise drive; all where absent.
    """

    method: Literal["output-error", "filter-error"] = "output-error"
    domain: Literal["time", "frequency"] = "time"
    noise: NoiseKind = "diagonal"
    residuals: Literal["coloured", "white"] = "coloured"
    confidence: float = 0.95
    lines_hz: Sequence[float] | None = None
    trend: TrendKind = "endpoints"
    process_noise: Sequence[str] | None = None


@dataclass(frozen=True, eq=False)
class _Solution:
    """Where an iteration ended, and what was held on the way."""

    likelihood: Likelihood
    minimum: Minimum | None
    free: Array
    not_excited: dict[str, tuple[str, ...]] = field(default_factory=dict)


def estimate(
    model: DynamicModel,
    signals: Sequence[Signals],
    choices: Choices | None = None,
    settings: Settings | None = None,
) -> OutputErrorModel:
    """Estimate the parameters of a model by maximum likelihood.

    Parameters
    ----------
    model : DynamicModel
    signals : sequence of Signals
        Manoeuvres, all sampled alike; each has its own initial states and own parameters.
    choices : Choices, optional
        Starts, fixed and tied parameters, bounds, initial states.
    settings : Settings, optional

    Returns
    -------
    OutputErrorModel
        Also where the iteration did not converge, parameters are not excited or at a bound: its remarks
        then say so. Where the model diverges at its start, it holds that start.

    Raises
    ------
    DataError
        Where a signal is missing or not finite.
    UsageError
        Where choices and model do not fit, or starts are missing.

    References
    ----------
    Klein & Morelli, *Aircraft System Identification*, 2nd ed., ch. 6 and 7; Jategaonkar, *Flight Vehicle
    System Identification*, 2nd ed., ch. 4 and 5.
    """
    choices, settings = choices or Choices(), settings or Settings()
    _check(model, signals, settings)
    if settings.domain == "frequency":  # a trend was removed, and with it biases and the initial state
        own = dict.fromkeys(model.own, 0.0)
        choices = replace(choices, fixed={**own, **(choices.fixed or {})}, initial="zero")
    fixed = choices.fixed or {}
    start = spelled_out(model, len(signals), "start", choices.start or {})
    values = equation_error_starts(model, signals, start, fixed)
    if choices.initial == "zero":
        values |= {n: 0.0 for n in values if n.startswith("x0_")}
    parameters = choose_parameters(model, signals, values, choices)
    first: Likelihood
    if settings.domain == "frequency":
        lines = np.asarray(settings.lines_hz, dtype=np.float64)
        first = FrequencyDomain(model, signals, parameters, lines, settings.trend)
    else:
        first = TimeDomain(model, signals, parameters, settings.noise)
    solution = _solved(first)
    beside = None
    if settings.method == "filter-error":
        beside = solution
        solution = _filtered(model, signals, solution, settings)
    return _result(solution, beside, parameters, settings)


def _check(model: DynamicModel, signals: Sequence[Signals], settings: Settings) -> None:
    if not signals:
        raise UsageError("no manoeuvre is given", remedy="give at least one")
    for s in signals:  # whatever is missing or not finite is said before anything is computed
        s.input_matrix(model)
        s.output_matrix(model)
    if any(abs(s.dt / signals[0].dt - 1) > 1e-6 for s in signals):
        rates = ", ".join(f"{1 / s.dt:.6g} Hz" for s in signals)
        raise UsageError(f"manoeuvres are sampled at {rates}", remedy="import them with one --resample RATE")
    if settings.domain == "frequency":
        if settings.lines_hz is None or not len(settings.lines_hz):
            raise UsageError("no frequencies are named", remedy="give the lines of the band in Hz")
        if settings.method == "filter-error":
            raise UsageError(
                "filter error is for the time domain", remedy="use domain 'time', or method 'output-error'"
            )
    for state in settings.process_noise or ():
        if state not in model.states:
            raise UsageError(
                f"model '{model.name}' has no state '{state}'", remedy=nearest(state, model.states)
            )


def _solved(likelihood: TimeDomain | FrequencyDomain) -> _Solution:
    """Minimise; hold parameters that the data do not tell where that ended, and go on with the rest.

    They are judged at the minimum: at a wrong start, a delay of an input without effect tells nothing.
    """
    free = likelihood.parameters.start
    not_excited: dict[str, tuple[str, ...]] = {}
    while True:
        parameters = likelihood.parameters
        found = minimise(likelihood.cost, likelihood.linearise, free, parameters.lower, parameters.upper)
        if found is None:
            return _Solution(likelihood, None, free, not_excited)
        hold, others = unexcited(found.point.information)
        if not hold:
            return _Solution(likelihood, found, found.free, not_excited)
        names = parameters.free_names
        not_excited |= {names[i]: tuple(names[k] for k in others[i]) for i in hold}
        if len(hold) == len(names):
            return _Solution(likelihood, None, free, not_excited)
        likelihood = likelihood.with_parameters(parameters.held([names[i] for i in hold], found.free))
        free = likelihood.parameters.start


def _filtered(
    model: DynamicModel, signals: Sequence[Signals], start: _Solution, settings: Settings
) -> _Solution:
    """Go on from output error with a filter; from equation error where output error diverged."""
    parameters = start.likelihood.parameters
    noisy = tuple(settings.process_noise or model.states)
    likelihood = FilterError(model, signals, parameters, noisy)
    if start.minimum is None:
        deviation = 0.1 * np.concatenate([s.output_matrix(model) for s in signals]).std(axis=0)
    else:
        deviation = np.sqrt(np.diag(start.likelihood.noise_covariance(start.free)))
    tiny = np.finfo(float).tiny
    states, outputs = np.sqrt(_square(signals, noisy)), np.sqrt(_square(signals, model.outputs))
    least = np.log(np.concatenate((LEAST_PROCESS * states, EXACT * outputs)) + tiny)
    free = np.concatenate((start.free, np.log(FIRST_PROCESS * states + tiny), np.log(deviation + tiny)))
    lower = np.concatenate((parameters.lower, least))
    upper = np.concatenate((parameters.upper, np.full(least.size, np.inf)))
    found = minimise(likelihood.cost, likelihood.linearise, free, lower, upper)
    return _Solution(likelihood, found, free if found is None else found.free, start.not_excited)


def _square(signals: Sequence[Signals], names: Sequence[str]) -> Array:
    """Return mean squares of measured outputs; one for a state that is not measured."""
    each = [[np.mean(np.square(s.outputs.get(n, 1.0))) for s in signals] for n in names]
    return np.mean(np.array(each, dtype=np.float64), axis=1)


def _result(
    solution: _Solution, beside: _Solution | None, chosen: ParameterSet, settings: Settings
) -> OutputErrorModel:
    likelihood, found = solution.likelihood, solution.minimum
    model, parameters = likelihood.model, likelihood.parameters
    f = len(parameters.free_names)
    scale = parameters.scale
    start = dict(zip(chosen.free_names, chosen.start * chosen.scale, strict=True))
    values = dict(zip(parameters.names, parameters.full(solution.free[:f]).tolist(), strict=True))
    common: dict[str, Any] = {
        "model": model.name,
        "method": settings.method,
        "domain": settings.domain,
        "names": parameters.free_names,
        "units": tuple(model.units.get(n.partition("@")[0], "") for n in parameters.free_names),
        "estimate": solution.free[:f] * scale,
        "start": np.array([start[n] for n in parameters.free_names]),
        "held": {n: v for n, v in values.items() if n not in parameters.free_names},
        "confidence": settings.confidence,
        "not_excited": solution.not_excited,
    }
    unknown = np.full(f, np.nan)
    if found is None:
        why = (
            "no parameter is excited"
            if len(solution.not_excited) >= f
            else "the simulation of the model diverges at its start"
        )
        return OutputErrorModel(
            **common,
            std_error=unknown,
            lower=unknown,
            upper=unknown,
            covariance=np.full((f, f), np.nan),
            cramer_rao=unknown,
            noise={},
            process_noise={},
            whiteness={},
            coloured=(),
            converged=False,
            steps=0,
            cost=float("nan"),
            at_bound=(),
            inseparable=(),
            fit={},
            remarks=(
                f"{why}, so the parameters are those that it was to start from; give other starts, tighter "
                "bounds, a shorter manoeuvre, or use filter-error.",
                *_remarks_of_held(solution),
            ),
        )
    told = ~found.at_bound[:f]
    covariance, dof, cramer_rao = np.full((f, f), np.nan), np.full(f, np.nan), unknown.copy()
    inseparable: tuple[tuple[str, ...], ...] = ()
    if told.any():
        white, coloured_fit = _regressions(likelihood, solution.free, told)
        fit = coloured_fit if settings.residuals == "coloured" else white
        size = scale[told]
        covariance[np.ix_(told, told)] = fit.covariance[0] * np.outer(size, size)
        dof[told], cramer_rao[told] = fit.degrees_of_freedom[0], white.std_error[0] * size
        inseparable = fit.collinearity.inseparable()
    std_error = np.sqrt(np.diag(covariance))
    lower, upper = confidence_interval(
        common["estimate"], std_error, level=settings.confidence, degrees_of_freedom=dof
    )
    probabilities = {}
    if not isinstance(likelihood, FrequencyDomain):
        probabilities = whiteness(model.outputs, likelihood.residuals(solution.free))
    at_bound = tuple(n for n, b in zip(parameters.free_names, found.at_bound, strict=False) if b)
    result = OutputErrorModel(
        **common,
        std_error=std_error,
        lower=lower,
        upper=upper,
        covariance=covariance,
        cramer_rao=cramer_rao,
        noise=dict(
            zip(
                model.outputs,
                np.sqrt(np.diag(likelihood.noise_covariance(solution.free))).tolist(),
                strict=True,
            )
        ),
        process_noise=likelihood.process_noise(solution.free) if isinstance(likelihood, FilterError) else {},
        whiteness=probabilities,
        coloured=coloured(probabilities),
        converged=found.converged,
        steps=found.steps,
        cost=found.point.cost,
        at_bound=at_bound,
        inseparable=inseparable,
        fit=_fits(likelihood, solution.free),
    )
    return replace(result, remarks=tuple(_remarks(result, solution, beside, parameters)))


def _regressions(likelihood: Likelihood, free: Array, told: np.ndarray) -> tuple[LeastSquares, LeastSquares]:
    """Return the regression that a problem is near its optimum, for white and for coloured residuals.

    Columns are the derivatives of the outputs, in units of the noise: the covariances are the Cramer-Rao
    bounds, and the same corrected. Every output of every manoeuvre is a stretch with a spectrum of its own.
    """
    names = [n for n, t in zip(likelihood.parameters.free_names, told, strict=True) if t]
    if isinstance(likelihood, FrequencyDomain):
        residual, columns, lines, durations = likelihood.white_equations(free)
        fit = least_squares(columns[told], residual[None], names=names)
        stretches = list(lines), list(map(float, durations))
        return correct_line_spacing(fit, *stretches), correct_coloured_lines(fit, *stretches)
    residual, columns, samples = likelihood.white_equations(free)
    fit = least_squares(columns[told], residual[None], names=names)
    return fit, correct_coloured_samples(fit, samples=samples)


def _fits(likelihood: Likelihood, free: Array) -> dict[str, Fit]:
    fits, signals = {}, likelihood.signals
    modelled, residuals = likelihood.outputs(free), likelihood.residuals(free)
    for i, s in enumerate(signals):
        for k, output in enumerate(likelihood.model.outputs):
            if isinstance(likelihood, FrequencyDomain):
                y = modelled[i][k] * np.sqrt(s.dt * s.samples)
                left = residuals[i][k] * np.sqrt(s.dt * s.samples)
                axis = likelihood.lines_hz
            else:
                y, left, axis = modelled[i][:, k], residuals[i][:, k], s.time
            fits[numbered(output, i, len(signals))] = Fit(axis, y + left, y)
    return fits


def _remarks(
    result: OutputErrorModel, solution: _Solution, beside: _Solution | None, parameters: ParameterSet
) -> list[str]:
    """Say what a reader should know, one sentence each."""
    said = []
    if not result.converged:
        said.append(
            f"the iteration has not settled in {result.steps} steps; the parameters are the best it found."
        )
    for name in result.at_bound:
        i = result.names.index(name)
        low, high = parameters.lower[i] * parameters.scale[i], parameters.upper[i] * parameters.scale[i]
        said.append(
            f"the optimum of '{name}' is outside its bounds {low:.4g} to {high:.4g}; it is held at "
            f"{result.estimate[i]:.4g}, has no standard error, and biases the others if the bound is wrong."
        )
    said += _remarks_of_held(solution)
    names = " ".join(result.coloured)
    if result.coloured and result.method == "output-error":
        said.append(
            f"residuals of {names} are not white, so output error is not valid here: noise drives the "
            "motion, as turbulence does, or the model lacks dynamics; standard errors allow for the colour, "
            "but estimates may be biased; compare filter-error."
        )
    elif result.coloured:
        said.append(
            f"innovations of {names} are not white: the model lacks dynamics that process noise does not "
            "make up for; standard errors allow for the colour."
        )
    if beside is not None and beside.minimum is not None:
        assert isinstance(beside.likelihood, TimeDomain)
        left = coloured(whiteness(beside.likelihood.model.outputs, beside.likelihood.residuals(beside.free)))
        if left and not result.coloured:
            said.append(
                f"residuals of output error are not white ({' '.join(left)}), innovations of filter error "
                "are: filter error is valid here and output error is not."
            )
        elif not left:
            said.append("residuals of output error are white too: output error is valid here and simpler.")
    return said


def _remarks_of_held(solution: _Solution) -> list[str]:
    values = dict(
        zip(
            solution.likelihood.parameters.names,
            solution.likelihood.parameters.full(
                solution.free[: len(solution.likelihood.parameters.free_names)]
            ),
            strict=True,
        )
    )
    return [
        f"the manoeuvres do not tell '{name}'"
        + (f" from {' '.join(others)}" if others else "")
        + f"; it is held at {values[name]:.4g}."
        for name, others in solution.not_excited.items()
    ]
