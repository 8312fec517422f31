"""Models and records as plain dictionaries of names, numbers and arrays: what MATLAB, JSON and tables hold.

The keys are the schema of the JSON file and the fields of the MATLAB file (docs/exports.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from freqid.blend.exports.usable_range import units_of
from freqid.blend.global_model import GlobalModel
from freqid.core.arrays import Array
from freqid.core.record import FlightRecord
from freqid.core.results.advance_ratio import AdvanceRatioLaw, AdvanceRatioModel
from freqid.core.results.output_error import OutputErrorModel
from freqid.core.results.point import PointModel
from freqid.identify.regress.confidence_interval import confidence_interval

CONFIDENCE = 0.95
"""Level of intervals that a result does not have of its own."""
SCHEMA = 1
"""Version of the keys; it rises when a reader of the old ones would fail or misread."""

Model = PointModel | GlobalModel | AdvanceRatioModel | OutputErrorModel


def plain(result: Model | FlightRecord) -> dict[str, Any]:
    """Return a result as a dictionary of texts, numbers, arrays, lists and dictionaries of them.

    Parameters
    ----------
    result : PointModel, GlobalModel, AdvanceRatioModel, OutputErrorModel or FlightRecord
        SI units throughout.
    """
    if isinstance(result, PointModel):
        kind, content = "point model", _point(result)
    elif isinstance(result, GlobalModel):
        kind, content = "global model", _global(result)
    elif isinstance(result, AdvanceRatioModel):
        kind, content = "advance-ratio model", _laws(result)
    elif isinstance(result, OutputErrorModel):
        kind, content = "output-error model", _output_error(result)
    else:
        kind, content = "record", _record(result)
    return {"format": "freqid-export", "schema": SCHEMA, "kind": kind, **content}


def _point(model: PointModel) -> dict[str, Any]:
    responses = {
        name: {
            "unit": r.unit,
            "regressors": list(r.regressors),
            "regressor_units": list(r.regressor_units),
            "parameter_units": list(r.parameter_units),
            "estimate": r.estimate,
            "std_error": r.std_error,
            "lower": r.lower,
            "upper": r.upper,
            "covariance": r.covariance,
            "trim": r.trim,
            "regressor_rms": r.regressor_rms,
            "bias": r.bias,
            "bias_std_error": r.bias_std_error,
            "r2": r.r2,
            "pse": r.pse,
            "rmse": r.rmse,
            "fit_error": r.fit_error,
        }
        for name, r in model.responses.items()
    }
    return {
        "vehicle": model.vehicle,
        "form": model.form,
        "axes": model.axes,
        "method": model.method,
        "estimator": model.estimator,
        "confidence": model.confidence,
        "duration_s": model.duration,
        "condition": {
            "id": model.reference.id,
            "u": model.reference.u,
            "rho": model.reference.rho,
            "scheduled": dict(model.reference.scheduled),
            "scheduled_units": {n: model.scheduled_units.get(n, "rad") for n in model.reference.scheduled},
        },
        "trim": dict(model.trim),
        "responses": responses,
        "remarks": list(model.remarks),
        "provenance": model.provenance,
    }


def _global(model: GlobalModel) -> dict[str, Any]:
    c = model.corridor
    limits = {
        name: confidence_interval(r.estimate, r.std_error, level=CONFIDENCE)
        for name, r in c.responses.items()
    }
    responses = {
        name: {
            "unit": r.unit,
            "regressors": list(r.regressors),
            "regressor_units": list(r.regressor_units),
            "parameter_units": list(r.parameter_units),
            "estimate": r.estimate,
            "std_error": r.std_error,
            "lower": limits[name][0],
            "upper": limits[name][1],
            "covariance": r.covariance,
            "trim": r.trim,
            "regressor_rms": r.regressor_rms,
            "bias": r.bias,
            "bias_std_error": r.bias_std_error,
        }
        for name, r in c.responses.items()
    }
    return {
        "vehicle": c.vehicle,
        "form": c.form,
        "axes": "body",
        "confidence": CONFIDENCE,
        "along": c.along,
        "inputs": list(model.inputs),
        "input_units": list(units_of(model).values()),
        "highest_hz": c.highest_hz,
        "conditions": {
            "id": list(c.ids),
            "u": c.u,
            "rho": c.rho,
            "line": c.line + 1,
            "scheduled": dict(zip(c.scheduled, c.schedule, strict=True)),
            "scheduled_units": dict(zip(c.scheduled, c.scheduled_units, strict=True)),
        },
        "tolerance": {"tilt_rad": model.tolerance.tilt, "speed_m_s": model.tolerance.speed},
        "responses": responses,
        "provenance": c.provenance,
    }


def _laws(model: AdvanceRatioModel) -> dict[str, Any]:
    clusters = []
    for cluster in model.clusters:
        local = cluster.local
        clusters.append(
            {
                "alpha": cluster.alpha,
                "manoeuvres": {
                    "id": list(local.ids),
                    "advance_ratio": local.advance_ratio,
                    "alpha": local.alpha,
                    "airspeed": local.airspeed,
                    "derivatives": list(local.names),
                    "units": list(local.units),
                    "estimate": local.estimate,
                    "std_error": local.std_error,
                    "covariance": local.covariance,
                },
                "laws": [_law(law) for law in cluster.laws.values()],
            }
        )
    return {
        "vehicle": model.vehicle,
        "law": "unblown + sum amplitude exp(-rate J)",
        "laws_from": model.kind,
        "confidence": CONFIDENCE,
        "clusters": clusters,
        "held": list(model.held),
        "remarks": list(model.remarks),
        "provenance": model.provenance,
    }


def _law(law: AdvanceRatioLaw) -> dict[str, Any]:
    low, high = law.interval(np.inf, CONFIDENCE)
    return {
        "derivative": law.name,
        "unit": law.unit,
        "form": law.form,
        "unblown": law.unblown,
        "unblown_std_error": law.std_error,
        "unblown_lower": float(low),
        "unblown_upper": float(high),
        "amplitude": law.amplitude,
        "rate": law.rate,
        "scatter": law.scatter,
        "lowest_advance_ratio": law.lowest,
        "highest_advance_ratio": law.highest,
        "reaches_unblown": law.reaches_unblown,
        "manoeuvres": law.points,
        "remarks": list(law.remarks),
    }


def _output_error(model: OutputErrorModel) -> dict[str, Any]:
    return {
        "model": model.model,
        "method": model.method,
        "domain": model.domain,
        "confidence": model.confidence,
        "parameters": list(model.names),
        "parameter_units": list(model.units),
        "estimate": model.estimate,
        "std_error": model.std_error,
        "lower": model.lower,
        "upper": model.upper,
        "covariance": model.covariance,
        "cramer_rao": model.cramer_rao,
        "held": dict(model.held),
        "remarks": list(model.remarks),
        "provenance": model.provenance,
    }


def _record(record: FlightRecord) -> dict[str, Any]:
    groups: dict[str, dict[str, Any]] = {}
    units: dict[str, dict[str, str]] = {}
    for name, channel in record.channels.items():
        group, _, short = name.partition("/")
        groups.setdefault(group, {})[short] = channel.values
        units.setdefault(group, {})[short] = channel.unit
    vehicle = record.vehicle
    return {
        "vehicle": vehicle.name if vehicle else "",
        "reference": record.reference,
        "time": record.time,
        "time_unit": "s",
        **groups,
        "units": units,
        "provenance": record.provenance,
    }


def rows(result: Model) -> list[dict[str, Any]]:
    """Return a model's parameters as a long table, one row a parameter and condition.

    Columns are what docs/exports.md says; those that a kind of model has not are absent.
    """
    found = plain(result)
    if isinstance(result, PointModel):
        at = {k: found["condition"][k] for k in ("id", "u", "rho")} | found["condition"]["scheduled"]
        return [
            row | {"confidence": result.confidence}
            for name, r in found["responses"].items()
            for row in _parameters(name, r, at, result.confidence, slice(None))
        ]
    if isinstance(result, GlobalModel):
        where = found["conditions"]
        table = []
        for k, id_ in enumerate(where["id"]):
            at = {"id": id_, "u": where["u"][k], "rho": where["rho"][k], "line": int(where["line"][k])}
            at |= {n: row[k] for n, row in where["scheduled"].items()}
            for name, r in found["responses"].items():
                table += _parameters(name, r, at, CONFIDENCE, (slice(None), k))
        return [row | {"confidence": CONFIDENCE} for row in table]
    if isinstance(result, OutputErrorModel):
        columns = ("estimate", "std_error", "lower", "upper", "cramer_rao")
        return [
            {"parameter": name, "unit": unit}
            | {c: float(found[c][j]) for c in columns}
            | {"confidence": result.confidence}
            for j, (name, unit) in enumerate(zip(result.names, result.units, strict=True))
        ]
    return [row for cluster in result.clusters for row in _law_rows(cluster)]


def _parameters(
    name: str, r: Mapping[str, Any], at: Mapping[str, Any], confidence: float, of: Any
) -> list[dict[str, Any]]:
    """Return the rows of one response at one condition, bias first."""
    k = of[1] if isinstance(of, tuple) else None
    bias, error = (
        float(np.asarray(r[key]) if k is None else r[key][k]) for key in ("bias", "bias_std_error")
    )
    first = {**_condition(at), "response": name, "parameter": "bias", "unit": r["unit"], "estimate": bias}
    lower, upper = map(float, confidence_interval(bias, error, level=confidence))
    table = [first | {"std_error": error, "lower": lower, "upper": upper}]
    for j, parameter in enumerate(r["regressors"]):
        row = {**_condition(at), "response": name, "parameter": parameter, "unit": r["parameter_units"][j]}
        for column in ("estimate", "std_error", "lower", "upper", "trim", "regressor_rms"):
            row[column] = float(np.asarray(r[column])[of][j])
        table.append(row | {"regressor_unit": r["regressor_units"][j]})
    return table


def _condition(at: Mapping[str, Any]) -> dict[str, Any]:
    return {"condition": at["id"]} | {k: v for k, v in at.items() if k != "id"}


def _law_rows(cluster: Any) -> list[dict[str, Any]]:
    """Return local estimates and what the laws say at the same advance ratios, the unblown limit last."""
    local, table = cluster.local, []
    for j, name in enumerate(local.names):
        law = cluster.laws.get(name)
        if law is None:
            continue
        places: Array = np.append(local.advance_ratio, np.inf)
        value, error = law.value(places), law.std_error_at(places)
        low, high = law.interval(places, CONFIDENCE)
        for i, id_ in enumerate((*local.ids, "")):
            own = i < len(local.ids)
            row = {
                "cluster_alpha": cluster.alpha,
                "condition": id_ if own else "unblown limit",
                "advance_ratio": float(places[i]),
                "derivative": name,
                "unit": local.units[j],
            }
            if own:
                row |= {
                    "alpha": float(local.alpha[i]),
                    "airspeed": float(local.airspeed[i]),
                    "estimate": float(local.estimate[i, j]),
                    "std_error": float(local.std_error[i, j]),
                }
            row |= {
                "law": law.form,
                "law_value": float(value[i]),
                "law_std_error": float(error[i]),
                "law_lower": float(low[i]),
                "law_upper": float(high[i]),
                "confidence": CONFIDENCE,
            }
            table.append(row)
    return table
