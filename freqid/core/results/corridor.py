"""Point models lined up along the corridor: what a global model is blended from, and its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from freqid.core import store
from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.core.results.point import per


@dataclass(frozen=True)
class KnotResponse:
    """One response at all knots, as the point models have it.

    ``response = bias[k] + sum_j estimate[j, k] (regressor[j] - trim[j, k])`` at knot k

    Attributes
    ----------
    response, unit : str
        Name and SI unit.
    regressors, regressor_units : tuple of str, length p
    trim : ndarray, shape (p, knot)
        Values of the regressors that each model is expanded about.
    regressor_rms : ndarray, shape (p, knot)
        What each regressor was moved by when the point was identified.
    estimate : ndarray, shape (p, knot)
        Unit of the response per unit of the regressor, at the density of the knot.
    covariance : ndarray, shape (knot, p, p)
        Of the estimates; knots are independent of each other.
    bias, bias_std_error : ndarray, shape (knot,)
        Response at the trim; its error is independent of the estimates'.
    """

    response: str
    unit: str
    regressors: tuple[str, ...]
    regressor_units: tuple[str, ...]
    trim: Array
    regressor_rms: Array
    estimate: Array
    covariance: Array
    bias: Array
    bias_std_error: Array

    @property
    def std_error(self) -> Array:
        """Standard errors of the estimates, shape (p, knot)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)).T


@dataclass(frozen=True)
class Corridor:
    """Point models of one aircraft, sorted by line and speed.

    Attributes
    ----------
    ids : tuple of str, length knot
        Of the reference conditions.
    u, rho : ndarray, shape (knot,)
        True speed, m/s, and air density, kg/m3.
    tilt : ndarray, shape (2, knot)
        Front and rear wing tilt ``dw1 dw2``, rad.
    line : ndarray of int, shape (knot,)
        Which line of the corridor a knot belongs to, from 0; lines ascend in density.
    responses : mapping of str to KnotResponse
    form : {"force", "specific", "coefficient"}
    vehicle : str
    highest_hz : float
        Highest frequency that all points were identified at; nan where some were in time.
    provenance : dict
        Files of the points and their own provenance; JSON-compatible.
    """

    ids: tuple[str, ...]
    u: Array
    rho: Array
    tilt: Array
    line: NDArray[np.int64]
    responses: Mapping[str, KnotResponse]
    form: str
    vehicle: str
    highest_hz: float = float("nan")
    provenance: dict[str, Any] = field(default_factory=dict)

    def __getitem__(self, response: str) -> KnotResponse:
        try:
            return self.responses[response]
        except KeyError:
            raise UsageError(
                f"the model has no response '{response}'", remedy=nearest(response, self.responses)
            ) from None

    @property
    def units(self) -> dict[str, str]:
        """SI unit by regressor, over all responses."""
        return {
            name: unit
            for r in self.responses.values()
            for name, unit in zip(r.regressors, r.regressor_units, strict=True)
        }


FORMAT = "freqid-global"


def write_global(path: Path, corridor: Corridor) -> None:
    """Write a global model, whole or not at all.

    Parameters
    ----------
    path : Path
    corridor : Corridor

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """

    def fill(file: h5py.File) -> None:
        for name in ("form", "vehicle", "highest_hz"):
            file.attrs[name] = getattr(corridor, name)
        reference = file.create_group("reference")
        store.put_json(reference, "ids", list(corridor.ids))
        store.put(reference, "u", corridor.u, "m/s")
        store.put(reference, "rho", corridor.rho, "kg/m3")
        for name, tilt in zip(("dw1", "dw2"), corridor.tilt, strict=True):
            store.put(reference, name, tilt, "rad")
        store.put(reference, "line", corridor.line, "1")
        store.put_json(file, "responses", list(corridor.responses))
        store.put_json(file.create_group("provenance"), "json", corridor.provenance)
        for response in corridor.responses.values():
            _fill_response(file, response)

    store.write(path, FORMAT, fill)


def _fill_response(file: h5py.File, knots: KnotResponse) -> None:
    parameters = file.create_group(f"parameter/{knots.response}")
    parameters.attrs["units"] = knots.unit
    store.put_json(parameters, "regressors", list(knots.regressors))
    store.put_json(parameters, "regressor_units", list(knots.regressor_units))
    std_error = knots.std_error
    for j, (name, unit) in enumerate(zip(knots.regressors, knots.regressor_units, strict=True)):
        group = parameters.create_group(name)
        store.put(group, "estimate", knots.estimate[j], per(knots.unit, unit))
        store.put(group, "std_error", std_error[j], per(knots.unit, unit))
        store.put(group, "trim", knots.trim[j], unit)
        store.put(group, "regressor_rms", knots.regressor_rms[j], unit)
    bias = parameters.create_group("bias")
    store.put(bias, "estimate", knots.bias, knots.unit)
    store.put(bias, "std_error", knots.bias_std_error, knots.unit)
    covariance = store.put(file.require_group("covariance"), knots.response, knots.covariance, "mixed")
    store.put_json(covariance, "parameters", list(knots.regressors))


def read_global(path: Path) -> Corridor:
    """Read the knots of a global model.

    Raises
    ------
    DataError
        Where the file is no intact global model, or one of a newer layout.
    """
    with store.reading(path, FORMAT) as file:
        reference = store.subgroup(file, "reference")
        u, rho, dw1, dw2, line = (store.array(reference, n) for n in ("u", "rho", "dw1", "dw2", "line"))
        ids = tuple(map(str, store.get_json(reference, "ids")))
        provenance = store.get_json(store.subgroup(file, "provenance"), "json")
        if not (u.ndim == 1 and u.shape == rho.shape == dw1.shape == dw2.shape == line.shape == (len(ids),)):
            raise ValueError("the references have arrays of different lengths")
        line = line.astype(np.int64)
        if set(line) != set(range(line.max() + 1)) or np.bincount(line).min() < 2:
            raise ValueError("the lines have no two knots each")
        if not (np.diff(u * np.sqrt(rho))[np.diff(line) == 0] > 0).all() or (np.diff(line) < 0).any():
            raise ValueError("the knots do not ascend along their lines")
        if not isinstance(provenance, dict) or not store.get_json(file, "responses"):
            raise ValueError("provenance or responses are not as they are written")
        return Corridor(
            ids=ids,
            u=u,
            rho=rho,
            tilt=np.array([dw1, dw2]),
            line=line,
            responses={r: _read_response(file, r, u.size) for r in store.get_json(file, "responses")},
            form=store.get_text(file, "form"),
            vehicle=store.get_text(file, "vehicle"),
            highest_hz=store.floats(file, "highest_hz")[0],
            provenance=provenance,
        )


def _read_response(file: h5py.File, response: str, knots: int) -> KnotResponse:
    parameters = store.subgroup(file, f"parameter/{response}")
    names = tuple(store.get_json(parameters, "regressors"))
    units = tuple(store.get_json(parameters, "regressor_units"))
    columns = {
        field: np.array([store.array(parameters, f"{name}/{field}") for name in names])
        for field in ("trim", "regressor_rms", "estimate")
    }
    bias, bias_error = (store.array(parameters, f"bias/{field}") for field in ("estimate", "std_error"))
    covariance = store.array(file, f"covariance/{response}")
    p = len(names)
    found = {"covariance": covariance.shape, "bias": bias.shape, "bias's error": bias_error.shape}
    expected = {"covariance": (knots, p, p), "bias": (knots,), "bias's error": (knots,)}
    found |= {name: values.shape for name, values in columns.items()}
    expected |= dict.fromkeys(columns, (p, knots))
    for name, shape in found.items():
        if shape != expected[name]:
            raise ValueError(f"{name} of {response} has shape {shape}, expected {expected[name]}")
    if len(units) != p:
        raise ValueError(f"{response} has {len(units)} units for {p} regressors")
    return KnotResponse(
        response=response,
        unit=store.get_text(parameters, "units"),
        regressors=names,
        regressor_units=units,
        covariance=covariance,
        bias=bias,
        bias_std_error=bias_error,
        **columns,
    )
