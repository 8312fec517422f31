"""A point model on disk (``format="freqid-point"``)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np

from freqid.core import store
from freqid.core.results.point import ErrorsInVariables, Fit, PointModel, ResponseModel
from freqid.core.scenario import Reference

FORMAT = "freqid-point"
_SCALARS = ("r2", "pse", "rmse", "fit_error")
_FROM_NOISE_LINES = ("distortion", "r2_ceiling")
_VECTORS = ("trim", "regressor_rms", "lower", "upper", "t_statistic", "variance_inflation", "condition_index")
_MATRICES = ("correlation", "variance_proportion")
# Beside each parameter where it was estimated by instruments: file name to field.
_BESIDE = {
    "least_squares": "estimate",
    "least_squares_std_error": "std_error",
    "difference_std_error": "difference_std_error",
    "difference_critical": "critical",
    "instrument_strength": "strength",
}
_WITHOUT_UNIT = ("difference_critical", "instrument_strength")


def write_point(path: Path, model: PointModel, scenario_sha256: str = "") -> None:
    """Write a point model, whole or not at all.

    Parameters
    ----------
    path : Path
    model : PointModel
    scenario_sha256 : str
        Of the scenario that it was identified with.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """

    def fill(file: h5py.File) -> None:
        reference = file.create_group("reference")
        for name, value in msgspec.to_builtins(model.reference).items():
            reference.attrs[name] = value
        for name in ("method", "form", "axes", "confidence", "duration", "vehicle", "estimator"):
            file.attrs[name] = getattr(model, name)
        store.put_json(file, "remarks", list(model.remarks))
        store.put_json(file, "responses", list(model.responses))
        store.put_json(file.create_group("provenance"), "json", model.provenance)
        for response in model.responses.values():
            _fill_response(file, response)
        prediction = file.create_group("prediction")
        for name, fit in model.prediction.items():
            _fill_fit(prediction.create_group(name), fit, "s", model[name].unit)

    store.write(path, FORMAT, fill, scenario_sha256)


def _fill_response(file: h5py.File, model: ResponseModel) -> None:
    parameters = file.create_group(f"parameter/{model.response}")
    units = [per(model.unit, unit) for unit in model.regressor_units]
    for j, name in enumerate(model.regressors):
        group = parameters.create_group(name)
        store.put(group, "estimate", model.estimate[j], units[j])
        store.put(group, "std_error", model.std_error[j], units[j])
        if model.errors_in_variables is not None:
            for key, field in _BESIDE.items():
                value = getattr(model.errors_in_variables, field)[j]
                store.put(group, key, value, "1" if key in _WITHOUT_UNIT else units[j])
    bias = parameters.create_group("bias")
    store.put(bias, "estimate", model.bias, model.unit)
    store.put(bias, "std_error", model.bias_std_error, model.unit)

    covariance = store.put(file.require_group("covariance"), model.response, model.covariance, "mixed")
    store.put_json(covariance, "parameters", list(model.regressors))
    store.put_json(covariance, "parameter_units", units)

    diagnostics = file.create_group(f"diagnostics/{model.response}")
    diagnostics.attrs["units"] = model.unit
    store.put_json(diagnostics, "regressor_units", list(model.regressor_units))
    store.put_json(diagnostics, "inseparable", model.inseparable)
    for name in _SCALARS:
        diagnostics.attrs[name] = getattr(model, name)
    for name in _FROM_NOISE_LINES:
        if getattr(model, name) is not None:
            diagnostics.attrs[name] = getattr(model, name)
    for name in _VECTORS + _MATRICES:
        store.put(diagnostics, name, getattr(model, name), "mixed" if name in _VECTORS[:4] else "1")
    for domain, fit in model.fit.items():
        group = file.create_group(f"fit/{model.response}/{domain}")
        if domain.startswith("frequency"):
            _fill_fit(group, fit, "Hz", f"{model.unit} s")
        else:
            _fill_fit(group, fit, "s", model.unit)


def _fill_fit(group: h5py.Group, fit: Fit, axis_unit: str, unit: str) -> None:
    store.put(group, "axis", fit.axis, axis_unit)
    store.put(group, "measured", fit.measured, unit)
    store.put(group, "modelled", fit.modelled, unit)
    if fit.noise is not None:
        store.put(group, "noise", fit.noise, unit)


def _read_fits(file: h5py.File, name: str) -> dict[str, Fit]:
    """Read every fit of a group, by its name there."""
    fits = {}
    for key in map(str, store.subgroup(file, name)):
        group = store.subgroup(file, f"{name}/{key}")
        axis = store.array(group, "axis")
        measured, modelled = (store.dataset(group, n)[()] for n in ("measured", "modelled"))
        noise = store.array(group, "noise") if "noise" in group else None
        shapes = {np.shape(v) for v in (axis, measured, modelled, axis if noise is None else noise)}
        if len(shapes) > 1 or axis.ndim != 1:
            raise ValueError(f"fit '{name}/{key}' has histories of different lengths")
        fits[key] = Fit(axis, measured, modelled, noise)
    return fits


def read_point(path: Path) -> PointModel:
    """Read a point model.

    Raises
    ------
    DataError
        Where the file is no intact point model.
    """
    with store.reading(path, FORMAT) as file:
        attrs = store.subgroup(file, "reference").attrs
        plain = {n: v.item() if isinstance(v, np.generic) else v for n, v in attrs.items()}
        provenance = store.get_json(store.subgroup(file, "provenance"), "json")
        if not isinstance(provenance, dict) or not store.get_json(file, "responses"):
            raise ValueError("provenance or responses are not as they are written")
        return PointModel(
            reference=msgspec.convert(plain, Reference),
            responses={r: _read_response(file, r) for r in store.get_json(file, "responses")},
            method=store.get_text(file, "method"),
            form=store.get_text(file, "form"),
            axes=store.get_text(file, "axes"),
            confidence=store.floats(file, "confidence")[0],
            duration=store.floats(file, "duration")[0],
            vehicle=store.get_text(file, "vehicle"),
            provenance=provenance,
            prediction=_read_fits(file, "prediction"),
            estimator=store.get_text(file, "estimator") or "least-squares",
            remarks=tuple(map(str, store.get_json(file, "remarks") or ())),
        )


def _read_response(file: h5py.File, response: str) -> ResponseModel:
    parameters = store.subgroup(file, f"parameter/{response}")
    diagnostics = store.subgroup(file, f"diagnostics/{response}")
    covariance = store.dataset(file, f"covariance/{response}")
    names = tuple(store.get_json(covariance, "parameters"))

    def column(field: str) -> np.ndarray:
        return np.array([float(store.array(parameters, f"{name}/{field}")) for name in names])

    beside = None
    if "least_squares" in store.subgroup(parameters, names[0]):
        beside = ErrorsInVariables(**{field: column(key) for key, field in _BESIDE.items()})
    p = len(names)
    expected = dict.fromkeys(_VECTORS, (p,)) | {"correlation": (p, p)}
    figures: dict[str, Any] = {name: store.floats(diagnostics, name)[0] for name in _SCALARS}
    figures |= {name: next(iter(store.floats(diagnostics, name)), None) for name in _FROM_NOISE_LINES}
    figures |= {name: store.array(diagnostics, name) for name in _VECTORS + _MATRICES}
    for name, shape in expected.items():
        if name != "condition_index" and figures[name].shape != shape:
            raise ValueError(f"'{name}' of {response} has shape {figures[name].shape}, expected {shape}")
    regressor_units = tuple(store.get_json(diagnostics, "regressor_units"))
    if len(regressor_units) != p:
        raise ValueError(f"{response} has {len(regressor_units)} units for {p} regressors")
    return ResponseModel(
        response=response,
        unit=store.get_text(diagnostics, "units"),
        regressors=names,
        regressor_units=regressor_units,
        estimate=column("estimate"),
        std_error=column("std_error"),
        covariance=store.array(file, f"covariance/{response}"),
        bias=float(store.array(parameters, "bias/estimate")),
        bias_std_error=float(store.array(parameters, "bias/std_error")),
        inseparable=tuple(tuple(group) for group in store.get_json(diagnostics, "inseparable")),
        fit=_read_fits(file, f"fit/{response}"),
        errors_in_variables=beside,
        **figures,
    )


def per(unit: str, regressor_unit: str) -> str:
    """Return the unit of a parameter: that of the response over that of the regressor."""
    if regressor_unit == "1":
        return unit
    over = f"({regressor_unit})" if any(c in regressor_unit for c in " /") else regressor_unit
    return f"{unit}/{over}"
