"""Ready forms chosen by what is identified, and their estimates as a point model of applied loads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.record import Maneuver
from freqid.core.results.fit import Fit
from freqid.core.results.output_error import OutputErrorModel
from freqid.core.results.point import PointModel, ResponseModel, per
from freqid.core.scenario import Reference
from freqid.core.sections.identification import Identification, factors_of
from freqid.identify.advance_ratio.trim import flown_trim
from freqid.identify.loads.explanatory import explanatory_variables, unit_of
from freqid.identify.loads.wrench import AppliedWrench, response_unit
from freqid.identify.model.problem import measured_responses
from freqid.identify.model.problem import numbered as numbered_fit
from freqid.identify.output_error.forms.form import Loads, find_form, model_of
from freqid.identify.output_error.model import DynamicModel
from freqid.identify.output_error.parameters import numbered
from freqid.identify.output_error.signals import signals_of
from freqid.identify.point import departures, flown_reference, scheduled_units
from freqid.identify.regress.regression import Collinearity, examine_columns
from freqid.identify.spectra.trend import up_to


def ready_model(
    maneuvers: Sequence[Maneuver], settings: Identification, outputs: Sequence[str] | None = None
) -> DynamicModel:
    """Return the ready form for the responses of an identification.

    Parameters
    ----------
    maneuvers : sequence of Maneuver
    settings : Identification
        Its responses choose the form: X Z M, Z M, or Y L N.
    outputs : sequence of str, optional
        What is compared; all that the form has and the records hold where absent.

    Raises
    ------
    UsageError
        Where no form has the responses, or an output is none of the form's.
    DataError
        Where no output was recorded.
    """
    if settings.axes != "body":
        raise UsageError(
            "output error is for body axes, found axes 'stability'",
            remedy="use axes 'body', or equation error",
        )
    form = find_form(settings.responses, settings.form)
    for name in outputs or ():
        if name not in form.outputs:
            raise UsageError(
                f"'{name}' is no output of the {form.name} model", remedy=nearest(name, form.outputs)
            )
    regressors = tuple((r, settings.regressors_of(r)) for r in form.responses)
    asked = tuple(outputs or form.outputs)
    if outputs is None and form.name == "short period":
        factors = {f for _, names in regressors for n in names for f in factors_of(n)}
        asked = tuple(n for n in asked if n != ("w" if "alpha" in factors else "alpha"))
    held = tuple(n for n in asked if all(_measured(m, n) for m in maneuvers))
    if outputs is not None and held != asked:
        missing = next(n for n in asked if n not in held)
        raise DataError(f"output '{missing}' is not recorded", remedy="name outputs that are")
    if not held:
        raise DataError(f"none of {' '.join(form.outputs)} is recorded, expected outputs to compare")
    return model_of(form, Loads(regressors, settings.form, held))


def _measured(maneuver: Maneuver, name: str) -> bool:
    probe = DynamicModel("", (), (), (name,), ("none",), lambda x, u, p: ({}, {}))
    try:
        signals_of(maneuver, probe)
    except DataError:
        return False
    return True


def parameter_units(maneuver: Maneuver, settings: Identification) -> dict[str, str]:
    """Return the units of a ready form's parameters."""
    found = {}
    for response in settings.responses:
        unit = response_unit(response, settings.form)
        found[f"{response}_bias"] = unit
        for name in settings.regressors_of(response):
            found[f"{response}_{name}"] = per(unit, unit_of(maneuver, name))
    return found


def point_model(
    result: OutputErrorModel,
    maneuvers: Sequence[Maneuver],
    settings: Identification,
    reference: Reference | None = None,
    highest_hz: float | None = None,
) -> PointModel:
    """Return the estimates of a ready form as a point model, as `freqid.identify.point` makes them.

    Parameters
    ----------
    result : OutputErrorModel
        Of a `ready_model`.
    maneuvers : sequence of Maneuver
    settings : Identification
    reference : Reference, optional
        The records' means where absent.
    highest_hz : float, optional
        Loads are compared up to here: above the excitation, what the motion needed is differentiated noise.

    Notes
    -----
    Parameters that the manoeuvres do not tell are left out. The figures of fit are those of the loads: as
    the motion needed them, and as the model gives them along the measured motion, about the same mean.
    """
    flown = flown_reference(maneuvers, reference.scheduled if reference else ())
    units = scheduled_units(maneuvers, reference or flown)
    wrench: list[AppliedWrench] | None
    try:
        wrench = [measured_responses(m, settings) for m in maneuvers]
    except DataError:  # say, without accelerometers: outputs are compared, loads cannot be
        wrench = None
    responses = {r: _response(r, result, maneuvers, settings, wrench, highest_hz) for r in settings.responses}
    records = [m.record.provenance for m in maneuvers]
    trim, no_advance_ratio = flown_trim(maneuvers)
    return PointModel(
        reference=reference or flown,
        responses=responses,
        method=result.method,
        form=settings.form,
        axes=settings.axes,
        confidence=result.confidence,
        duration=sum(m.record.duration for m in maneuvers),
        vehicle=maneuvers[0].vehicle.name,
        provenance={"record": records[0]} if len(records) == 1 else {"records": records},
        estimator="maximum-likelihood",
        remarks=(*(() if reference is None else departures(reference, flown, units)), *result.remarks),
        trim=trim,
        no_advance_ratio=no_advance_ratio,
        scheduled_units=units,
        aircraft=maneuvers[0].vehicle,
    )


def account_of(result: OutputErrorModel) -> dict:
    """Return what a point model's provenance holds of the estimation, JSON-compatible."""

    def number(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    dynamic = {
        n: {
            "estimate": number(e),
            "std_error": number(s),
            "cramer_rao": number(c),
            "start": number(b),
        }
        for n, e, s, c, b in zip(
            result.names, result.estimate, result.std_error, result.cramer_rao, result.start, strict=True
        )
    }
    return {
        "model": result.model,
        "domain": result.domain,
        "valid": result.valid,
        "converged": result.converged,
        "steps": result.steps,
        "parameters": dynamic,
        "held": dict(result.held),
        "at_bound": list(result.at_bound),
        "not_excited": {n: list(v) for n, v in result.not_excited.items()},
        "noise": dict(result.noise),
        "process_noise": dict(result.process_noise),
        "whiteness": dict(result.whiteness),
        "coloured": list(result.coloured),
        "outputs": {n: {"r2": number(f.r2), "rmse": number(f.rms)} for n, f in result.fit.items()},
    }


def _response(
    response: str,
    result: OutputErrorModel,
    maneuvers: Sequence[Maneuver],
    settings: Identification,
    wrench: Sequence[AppliedWrench] | None,
    highest_hz: float | None,
) -> ResponseModel:
    told = [n for n in settings.regressors_of(response) if f"{response}_{n}" not in result.not_excited]
    if not told:
        raise DataError(
            f"the manoeuvres tell no derivative of {response}",
            remedy=f"excite what {response} depends on, or leave it out of [identification] responses",
        )
    each = [explanatory_variables(m, told)[0] for m in maneuvers]
    means = [x.mean(axis=1) for x in each]
    duration = [m.record.duration for m in maneuvers]
    trim, share = np.average(means, axis=0, weights=duration), np.array(duration) / np.sum(duration)
    p = len(told)
    names = [f"{response}_{n}" for n in told]
    estimate, std_error = (np.array(v) for v in zip(*(result[n] for n in names), strict=True))
    covariance = np.zeros((p, p))
    place = [result.names.index(n) if n in result.names else None for n in names]
    for i, a in enumerate(place):
        for j, b in enumerate(place):
            if a is not None and b is not None:
                covariance[i, j] = result.covariance[a, b]
    half = np.array(
        [0.0 if a is None else 0.5 * (result.upper[a] - result.lower[a]) for a in place], dtype=float
    )
    own = [numbered(f"{response}_bias", i, len(maneuvers)) for i in range(len(maneuvers))]
    biases = np.array([result[n][0] for n in own])
    # a manoeuvre's bias is about its own means, the model's about those of all; of a product it is that at
    # zero, the model's that at its mean
    products = np.array([len(factors_of(n)) > 1 for n in told])
    biases = biases + [float(estimate @ (trim - np.where(products, 0.0, mean))) for mean in means]
    where = [result.names.index(n) for n in own if n in result.names]
    bias_error = 0.0
    if len(where) == len(own):
        bias_error = float(np.sqrt(share @ result.covariance[np.ix_(where, where)] @ share))
    fits, square, total, count = {}, 0.0, 0.0, 0
    for i, (maneuver, x) in enumerate(zip(maneuvers, each, strict=True)):
        modelled = estimate @ (x - trim[:, None]) + biases[i]
        if wrench is not None:
            measured = wrench[i].history(maneuver.record.dt)[settings.responses.index(response)]
            if highest_hz is not None:
                measured, modelled = up_to(np.array([measured, modelled]), maneuver.record.dt, highest_hz)
            # An accelerometer's bias is no load: both are compared about the measured mean.
            modelled = modelled + (measured.mean() - modelled.mean())
            fit = Fit(maneuver.record.time - maneuver.record.time[0], measured, modelled)
            fits[numbered_fit("time", i)] = fit
            square += float(np.sum(fit.residual**2))
            total += float(np.sum((measured - measured.mean()) ** 2))
            count += measured.size
    unknown = float("nan")
    rmse = float(np.sqrt(square / count)) if count else unknown
    collinearity = _examined(covariance, told)
    ok = bool(np.isfinite(covariance).all())
    deviation = np.where(std_error > 0, std_error, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return ResponseModel(
            response=response,
            unit=response_unit(response, settings.form),
            regressors=tuple(told),
            regressor_units=tuple(unit_of(maneuvers[0], n) for n in told),
            trim=trim,
            regressor_rms=np.sqrt(
                np.average([(x - x.mean(axis=1, keepdims=True)).var(axis=1) for x in each], axis=0)
            ),
            estimate=estimate,
            std_error=std_error,
            covariance=covariance,
            lower=estimate - half,
            upper=estimate + half,
            bias=float(share @ biases),
            bias_std_error=bias_error,
            r2=1 - square / total if total else unknown,
            pse=(square + total * p / count) / count if count else unknown,
            rmse=rmse,
            fit_error=rmse,
            t_statistic=estimate / std_error,
            variance_inflation=np.ones(p) if collinearity is None else collinearity.inflation,
            correlation=covariance / np.outer(deviation, deviation) if ok else np.full((p, p), np.nan),
            condition_index=np.ones(p) if collinearity is None else collinearity.condition_index,
            variance_proportion=np.eye(p) if collinearity is None else collinearity.proportion,
            inseparable=tuple(
                tuple(n.removeprefix(f"{response}_") for n in group)
                for group in result.inseparable
                if set(group) <= set(names)
            ),
            fit=fits,
        )


def _examined(covariance: Array, names: Sequence[str]) -> Collinearity | None:
    """Return how well the parameters of one response are told apart; None where some were held."""
    if not np.isfinite(covariance).all() or not (np.diag(covariance) > 0).all():
        return None
    information = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    size = np.sqrt(np.diag(information))
    factor = np.asarray(np.linalg.cholesky(information / np.outer(size, size)).T, dtype=np.float64)
    return examine_columns(factor, names, 0)
