"""What identification gives: a point model of the applied wrench at one reference condition, and its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np
from numpy.typing import NDArray

from freqid.core import store
from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.core.scenario import Gates, Reference
from freqid.core.viewable import Viewable


@dataclass(frozen=True)
class Fit:
    """A response as measured and as the model gives it, on frequencies or samples.

    Attributes
    ----------
    axis : ndarray, shape (n,)
        Frequencies in Hz, or times in s.
    measured, modelled : ndarray, shape (n,)
        Complex transforms on frequencies, real values in time.
    noise : ndarray, shape (n,), optional
        On frequencies, where noise lines tell it: rms magnitude of a residual that is noise alone, allowing
        for what the fit takes of it.
    """

    axis: Array
    measured: NDArray[Any]
    modelled: NDArray[Any]
    noise: Array | None = None

    def __repr__(self) -> str:
        kind = "lines" if np.iscomplexobj(self.measured) else "samples"
        return f"<Fit on {self.axis.size} {kind}: R2 {self.r2:.4f}, rms of the residual {self.rms:.4g}>"

    @property
    def residual(self) -> NDArray[Any]:
        """Measured less modelled, shape (n,)."""
        return self.measured - self.modelled

    @property
    def r2(self) -> float:
        """Share of the measured energy that the model explains; about the mean in time."""
        centre = 0.0 if np.iscomplexobj(self.measured) else self.measured.mean()
        total = np.sum(np.abs(self.measured - centre) ** 2)
        return float(1 - np.sum(np.abs(self.residual) ** 2) / total) if total else float("nan")

    @property
    def rms(self) -> float:
        """Root mean square of the residual."""
        return float(np.sqrt(np.mean(np.abs(self.residual) ** 2)))


@dataclass(frozen=True)
class ErrorsInVariables:
    """Least squares beside an estimate by instruments, and where noise in the regressors tells them apart.

    Attributes
    ----------
    estimate, std_error : ndarray, shape (p,)
        By least squares, unit of the response per unit of the regressor.
    difference_std_error : ndarray, shape (p,)
        Standard deviation of instruments less least squares, were the regressors free of noise.
    critical : ndarray, shape (p,)
        What the difference over its standard deviation would then exceed in any of the p parameters
        with the probability that the confidence level leaves.
    strength : ndarray, shape (p,)
        First-stage F statistic of each regressor; below ten its instrument is too weak.
    """

    estimate: Array
    std_error: Array
    difference_std_error: Array
    critical: Array
    strength: Array


@dataclass(frozen=True)
class ResponseModel:
    """One response as a linear function of p regressors about the reference, with its uncertainty.

    ``response = bias + sum_j estimate[j] (regressor[j] - trim[j])``

    Attributes
    ----------
    response, unit : str
        Name and SI unit.
    regressors, regressor_units : tuple of str, length p
    trim : ndarray, shape (p,)
        Values of the regressors that the model is expanded about.
    regressor_rms : ndarray, shape (p,)
        Of the regressors over the manoeuvre, about a straight line: what each was moved by.
    estimate, std_error : ndarray, shape (p,)
        Unit of the response per unit of the regressor.
    covariance : ndarray, shape (p, p)
    lower, upper : ndarray, shape (p,)
        Confidence limits at the level of the identification.
    bias, bias_std_error : float
        Response at the trim, from the time domain.
    r2, pse, rmse, fit_error : float
        Coefficient of determination; predicted squared error of one real equation; rms of the residual
        in the band of the fit, in the response's unit; standard deviation of one real equation.
    t_statistic, variance_inflation : ndarray, shape (p,)
    correlation : ndarray, shape (p, p)
        Of the parameters' errors.
    condition_index : ndarray, shape (n,)
        Of the n = p + nuisance columns; the last is the condition number.
    variance_proportion : ndarray, shape (n, p)
        Share of each parameter's variance by condition index.
    inseparable : tuple of tuple of str
        Groups of parameters that the data cannot tell apart.
    fit : mapping of str to Fit
        ``"frequency"`` where lines were regressed, and ``"time"``, then up to the highest line. Further
        manoeuvres of the same fit follow as ``"frequency 2"``, ``"time 2"`` and so on.
    errors_in_variables : ErrorsInVariables, optional
        Where the estimate is by instruments: what least squares says beside it.
    distortion : float, optional
        Power of the residual on the harmonics over that of noise, where noise lines tell it: one for a
        response that is linear as far as noise shows.
    r2_ceiling : float, optional
        What `r2` would be were the residual on the harmonics noise alone, likewise; a fit may chance to
        exceed it.
    """

    response: str
    unit: str
    regressors: tuple[str, ...]
    regressor_units: tuple[str, ...]
    trim: Array
    regressor_rms: Array
    estimate: Array
    std_error: Array
    covariance: Array
    lower: Array
    upper: Array
    bias: float
    bias_std_error: float
    r2: float
    pse: float
    rmse: float
    fit_error: float
    t_statistic: Array
    variance_inflation: Array
    correlation: Array
    condition_index: Array
    variance_proportion: Array
    inseparable: tuple[tuple[str, ...], ...]
    fit: Mapping[str, Fit]
    errors_in_variables: ErrorsInVariables | None = None
    distortion: float | None = None
    r2_ceiling: float | None = None

    def __repr__(self) -> str:
        rows = ", ".join(
            f"{name} {value:.4g} +- {2 * error:.2g}"
            for name, value, error in zip(self.regressors, self.estimate, self.std_error, strict=True)
        )
        return (
            f"<ResponseModel {self.response} in {self.unit}: {rows} (2 sigma); R2 {self.r2:.4f}, "
            f"rmse {self.rmse:.3g}>"
        )

    @property
    def normalised_difference(self) -> Array:
        """Instruments less least squares over its standard deviation, shape (p,); nan without both."""
        beside = self.errors_in_variables
        if beside is None:
            return np.full(len(self.regressors), np.nan)
        with np.errstate(invalid="ignore", divide="ignore"):  # no noise, no difference: nan
            return (self.estimate - beside.estimate) / beside.difference_std_error

    @property
    def differing(self) -> tuple[str, ...]:
        """Parameters whose two estimates differ beyond noise; empty without both."""
        if self.errors_in_variables is None:
            return ()
        beyond = np.abs(self.normalised_difference) > self.errors_in_variables.critical
        return tuple(name for name, b in zip(self.regressors, beyond, strict=True) if b)

    @property
    def condition_number(self) -> float:
        """Ratio of largest to smallest singular value of the scaled columns."""
        return float(self.condition_index[-1])

    def __getitem__(self, regressor: str) -> tuple[float, float]:
        """Return estimate and standard error of one parameter, or of ``"bias"``."""
        if regressor == "bias":
            return self.bias, self.bias_std_error
        if regressor not in self.regressors:
            raise UsageError(
                f"response '{self.response}' has no parameter '{regressor}'",
                remedy=nearest(regressor, (*self.regressors, "bias")),
            )
        j = self.regressors.index(regressor)
        return float(self.estimate[j]), float(self.std_error[j])


@dataclass(frozen=True)
class PointModel(Viewable):
    """Responses identified at one reference condition.

    Attributes
    ----------
    reference : Reference
    responses : mapping of str to ResponseModel
    method : {"frequency", "time", "output-error", "filter-error"}
    form : {"force", "specific", "coefficient"}
    axes : {"body", "stability"}
    confidence : float
        Level of the intervals.
    duration : float
        Length of the manoeuvre, or of all together, s.
    vehicle : str
    provenance : dict
        Records, scenario and settings; JSON-compatible.
    prediction : mapping of str to Fit
        By response: history of a manoeuvre that was not used, measured and as the model predicts it.
    estimator : {"least-squares", "instruments", "maximum-likelihood"}
    remarks : tuple of str
        What a reader should know before using the model, one sentence each.
    trim : mapping of str to float
        Means over the manoeuvre: ``V`` m/s, ``alpha`` rad and the propellers' ``advance_ratio``, inf where
        they are stopped; as far as the records tell.
    no_advance_ratio : str
        Why there is none in `trim`; empty where there is.
    """

    reference: Reference
    responses: Mapping[str, ResponseModel]
    method: str
    form: str
    axes: str
    confidence: float
    duration: float
    vehicle: str
    provenance: dict[str, Any] = field(default_factory=dict)
    prediction: Mapping[str, Fit] = field(default_factory=dict)
    estimator: str = "least-squares"
    remarks: tuple[str, ...] = ()
    trim: Mapping[str, float] = field(default_factory=dict)
    no_advance_ratio: str = ""

    def __repr__(self) -> str:
        fits = ", ".join(f"{name} R2 {r.r2:.4f}" for name, r in self.responses.items())
        at = f" at {self.reference.id!r}" if self.reference.id else ""
        return (
            f"<PointModel of {self.vehicle!r}{at}, u {self.reference.u:.4g} m/s: {fits}; "
            f"{self.estimator}, {self.duration:.4g} s>"
        )

    def __getitem__(self, response: str) -> ResponseModel:
        try:
            return self.responses[response]
        except KeyError:
            raise UsageError(
                f"the model has no response '{response}'", remedy=nearest(response, self.responses)
            ) from None


@dataclass(frozen=True)
class MissedGate:
    """A figure of merit that is not what the scenario asks for.

    Attributes
    ----------
    response : str
    figure : str
        ``"R2"`` or ``"condition number"``.
    found, gate : float
    """

    response: str
    figure: str
    found: float
    gate: float


def missed_gates(model: PointModel, gates: Gates) -> list[MissedGate]:
    """Return the gates that a model misses; a figure that is not a number misses its gate."""
    missed = []
    for name, response in model.responses.items():
        asked = gates.r2.get(name) if isinstance(gates.r2, dict) else gates.r2
        if asked is not None and not response.r2 >= asked:
            missed.append(MissedGate(name, "R2", response.r2, asked))
        bound = gates.condition_number
        if bound is not None and not response.condition_number <= bound:
            missed.append(MissedGate(name, "condition number", response.condition_number, bound))
    return missed


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
        trim = file.create_group("trim")
        for name, value in model.trim.items():
            trim.attrs[name] = value
        trim.attrs["no_advance_ratio"] = model.no_advance_ratio
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
        known = "trim" in file  # files of layout 1.1 have none
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
            trim=_read_trim(store.subgroup(file, "trim")) if known else {},
            no_advance_ratio=store.get_text(store.subgroup(file, "trim"), "no_advance_ratio")
            if known
            else "",
        )


def _read_trim(group: h5py.Group) -> dict[str, float]:
    return {
        name: store.floats(group, name)[0] for name in ("V", "alpha", "advance_ratio") if name in group.attrs
    }


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
