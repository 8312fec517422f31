"""The rows of a page's tables: what the model holds, as text beside its exact value."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from markupsafe import Markup

from freqid.core.channels import KNOWN
from freqid.core.record import FlightRecord
from freqid.core.results.fit import Fit
from freqid.core.results.judged.doubt import HIGH_INFLATION
from freqid.core.results.point import PointModel, ResponseModel, per
from freqid.core.scenario import Gates
from freqid.identify.regress.estimators import label_of
from freqid.report.kit import notation
from freqid.report.kit.notation import exact
from freqid.report.point.verdict import crosses_zero, missed_by_response

_METHOD = {
    "frequency": "equation error, frequency domain",
    "time": "equation error, time domain",
    "output-error": "output error, time domain",
    "filter-error": "filter error, time domain",
}
_FORM = {
    "force": "forces and moments",
    "specific": "forces per mass, moments per inertia",
    "coefficient": "nondimensional coefficients",
}


def _scheduled(name: str, value: float, model: PointModel) -> tuple[str, float, str]:
    """Return name, value and unit of what a condition sets, angles in degrees."""
    unit = model.scheduled_units.get(name, "rad")
    return (name, math.degrees(value), "deg") if unit == "rad" else (name, value, unit)


def point_facts(model: PointModel, record: FlightRecord | None) -> list[tuple[str, str]]:
    """Return what the model is about, label and text."""
    reference = model.reference
    condition = [reference.id]
    for label, value, unit in (
        ("u", reference.u, "m/s"),
        ("ρ", reference.rho, "kg/m³"),
        *(_scheduled(name, value, model) for name, value in reference.scheduled.items()),
    ):
        if math.isfinite(value) and not (label in reference.scheduled and value == 0):
            condition.append(f"{label} = {notation.short(value)} {unit}")
    facts = [("Vehicle", model.vehicle or notation.NONE)]
    if record is not None:
        for label, text in asdict(record.configuration).items():
            if text:
                facts.append((label.replace("_", " ").capitalize(), text))
    facts += [
        ("Reference", ", ".join(condition)),
        ("Method", _METHOD.get(model.method, model.method)),
        ("Responses", f"{_FORM.get(model.form, model.form)}, {model.axes} axes"),
        ("Estimator", label_of(model.estimator)),
        ("Duration", _duration(model)),
    ]
    if any(r.distortion is not None for r in model.responses.values()):
        facts.append(("Standard errors", "of noise alone, from lines between the harmonics"))
    lines = [r.fit["frequency"].axis for r in model.responses.values() if "frequency" in r.fit]
    if lines:
        low, high = notation.short(lines[0][0]), notation.short(lines[0][-1])
        facts.append(("Lines", f"{lines[0].size}, from {low} to {high} Hz"))
    if record is not None:
        facts.append(("Samples", f"{record.time.size} at {notation.short(1 / record.dt)} Hz"))
    for label, key in (("Record", "record"), ("Predicted record", "predicted")):
        source = model.provenance.get(key)
        if isinstance(source, str):
            facts.append((label, source))
    return facts


def _duration(model: PointModel) -> str:
    """Return the length of the manoeuvre, or of each where there are several."""
    fits = max((r.fit for r in model.responses.values()), key=len)
    lengths = [notation.short(float(f.axis[-1])) for name, f in fits.items() if name.startswith("time")]
    if len(lengths) < 2:
        return f"{notation.short(model.duration)} s"
    return f"{len(lengths)} manoeuvres of {', '.join(lengths[:-1])} and {lengths[-1]} s"


def fit_summary(model: PointModel, gates: Gates | None) -> dict[str, Any]:
    """Return the table that says how each response fares."""
    missed = missed_by_response(model, gates) if gates else {}
    gated = gates is not None and gates.of_points
    rows = []
    for name, response in model.responses.items():
        ceiling, distortion = _or_nan(response.r2_ceiling), _or_nan(response.distortion)
        rows.append(
            {
                "symbol": notation.symbol(name, model.form),
                "meaning": notation.meaning(name, model.form),
                "r2": exact(response.r2, notation.share(response.r2)),
                "ceiling": exact(ceiling, notation.share(ceiling)),
                "distortion": exact(distortion, notation.number(distortion)),
                "time": _in_time(response.fit) if model.method == "frequency" else None,
                "prediction": _r2_of(model.prediction.get(name)),
                "rmse": exact(response.rmse, notation.number(response.rmse)),
                "unit": notation.pretty_unit(response.unit),
                "condition": exact(response.condition_number, notation.number(response.condition_number)),
                "differing": _of_all(len(response.differing), response)
                if response.errors_in_variables
                else notation.NONE,
                "weak": _of_all(int(crosses_zero(response).sum()), response),
                "missed": Markup("; ").join(missed.get(name, ())),
            }
        )
    return {
        "rows": rows,
        "gated": gated,
        "in_time": model.method == "frequency" and any("time" in r.fit for r in model.responses.values()),
        "predicted": bool(model.prediction),
        "with_noise": any(r.r2_ceiling is not None for r in model.responses.values()),
        "both": any(r.errors_in_variables is not None for r in model.responses.values()),
    }


def _r2_of(fit: Fit | None) -> Markup | str:
    return notation.NONE if fit is None else exact(fit.r2, notation.share(fit.r2))


def _in_time(fits: Mapping[str, Fit]) -> Markup | str:
    """Return R2 in time; of several manoeuvres the lowest and the highest."""
    found = sorted((f for name, f in fits.items() if name.startswith("time")), key=lambda f: f.r2)
    if len(found) < 2:
        return _r2_of(fits.get("time"))
    return Markup("{} to {}").format(_r2_of(found[0]), _r2_of(found[-1]))


def _of_all(count: int, response: ResponseModel) -> str:
    return f"{count} of {len(response.regressors)}"


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def scores(model: PointModel, name: str) -> list[tuple[str, str]]:
    """Return the figures of merit of one response, label and text."""
    response = model[name]
    unit = "" if response.unit == "1" else f" {notation.pretty_unit(response.unit)}"
    squared = f" ({unit.strip()} s)²" if model.method == "frequency" else f" ({unit.strip()})²"
    phrases = [
        ("R²", notation.share(response.r2)),
        ("residual rms", notation.number(response.rmse) + unit),
        ("PSE", notation.number(response.pse) + (squared if unit else "")),
        ("condition number", notation.number(response.condition_number)),
    ]
    if name in model.prediction:
        phrases.insert(1, ("predicted R²", notation.share(model.prediction[name].r2)))
    if response.r2_ceiling is not None:
        phrases.insert(1, ("noise allows", notation.share(response.r2_ceiling)))
    if response.distortion is not None:
        phrases.append(("residual over noise", notation.number(response.distortion)))
    return phrases


def parameter_table(model: PointModel, name: str) -> list[dict[str, Any]]:
    """Return the rows of the table of one response, the bias last; numbers in SI as the model holds them."""
    response = model[name]
    weak = crosses_zero(response)
    rows = []
    for j, regressor in enumerate(response.regressors):
        estimate, error = float(response.estimate[j]), float(response.std_error[j])
        low, high = float(response.lower[j]), float(response.upper[j])
        texts = notation.measured_values(error, estimate, low, high)
        t, inflation = float(response.t_statistic[j]), float(response.variance_inflation[j])
        rows.append(
            {
                "name": regressor,
                "estimate": exact(estimate, texts[1]),
                "error": exact(error, texts[0]),
                "relative": notation.percent(error / abs(estimate) if estimate else math.inf),
                "t": exact(t, notation.number(t, 3)),
                "low": exact(low, texts[2]),
                "high": exact(high, texts[3]),
                "inflation": exact(inflation, notation.number(inflation)),
                "inflated": inflation > HIGH_INFLATION,
                "unit": notation.pretty_unit(per(response.unit, response.regressor_units[j])),
                "weak": bool(weak[j]),
            }
        )
    error, bias = notation.measured_values(response.bias_std_error, response.bias)
    rows.append(
        {
            "name": "bias",
            "estimate": exact(response.bias, bias),
            "error": exact(response.bias_std_error, error),
            "unit": notation.pretty_unit(response.unit),
        }
    )
    return rows


def channel_table(record: FlightRecord) -> list[dict[str, str]]:
    """Return the rows that say where each channel of a record comes from."""
    rows = []
    for channel in record.channels.values():
        group, _, name = channel.name.partition("/")
        rows.append(
            {
                "name": channel.name,
                "meaning": KNOWN.get(group, {}).get(name, ("", group))[1],
                "unit": notation.pretty_unit(channel.unit),
                "rate": notation.short(channel.native_rate_hz),
                "source": channel.source,
            }
        )
    return rows
