"""Point models lined up along the corridor: what a global model is blended from, and its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.core.layout import Attribute, Dataset, NestedSeries, ResultFile, Table
from freqid.core.results.point import check_covariance, per, spread_of
from freqid.core.units import RHO0
from freqid.core.vehicle import Vehicle


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
    def parameters(self) -> tuple[str, ...]:
        """Of the rows of the covariance: one for each regressor."""
        return self.regressors

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Of the estimates, length p."""
        return tuple(per(self.unit, unit) for unit in self.regressor_units)

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
    schedule : ndarray, shape (variable, knot)
        What else was set at each condition, tilts above all, SI.
    line : ndarray of int, shape (knot,)
        Which line of the corridor a knot belongs to, from 0; lines ascend in density.
    responses : mapping of str to KnotResponse
    form : {"force", "specific", "coefficient"}
    vehicle : str
    highest_hz : float
        Highest frequency that all points were identified at; nan where some were in time.
    provenance : dict
        Files of the points and their own provenance; JSON-compatible.
    scheduled, scheduled_units : tuple of str
        Names of the rows of `schedule`, and their units. Files that name none are older: their rows are
        ``dw1 dw2``.
    along : str
        What lines are sorted and interpolated by: ``u``, or the name of a scheduled variable.
    aircraft : Vehicle, optional
        Its mass, geometry and effectors, where all points state the same; files of older releases have none.
    """

    ids: tuple[str, ...]
    u: Array
    rho: Array
    schedule: Array
    line: NDArray[np.int64]
    responses: Mapping[str, KnotResponse]
    form: str
    vehicle: str
    highest_hz: float = float("nan")
    provenance: dict[str, Any] = field(default_factory=dict)
    scheduled: tuple[str, ...] = ("dw1", "dw2")
    scheduled_units: tuple[str, ...] = ("rad", "rad")
    along: str = "u"
    aircraft: Vehicle | None = None

    @property
    def coordinate(self) -> Array:
        """Place of each knot along its line, shape (knot,): equivalent speed, or what `along` names."""
        if self.along == "u":
            return self.u * np.sqrt(self.rho / RHO0)
        return self.schedule[self.scheduled.index(self.along)]

    def __getitem__(self, response: str) -> KnotResponse:
        try:
            return self.responses[response]
        except KeyError:
            raise UsageError(
                f"the model has no response '{response}'", remedy=nearest(response, self.responses)
            ) from None

    def drawn(self, count: int, seed: int = 0) -> list[Corridor]:
        """Return corridors as far from this one as its covariances let them be.

        Parameters
        ----------
        count : int
            How many; knots and responses are drawn apart from each other.
        seed : int
            Of the random numbers.

        Raises
        ------
        UsageError
            Where the points state no covariance.
        """
        rng = np.random.default_rng(seed)
        estimates, biases = {}, {}
        for name, knots in self.responses.items():
            check_covariance(name, knots.covariance)
            step = spread_of(knots.covariance) @ rng.standard_normal((count, *knots.covariance.shape[:2], 1))
            estimates[name] = knots.estimate + step[..., 0].swapaxes(1, 2)
            biases[name] = knots.bias + knots.bias_std_error * rng.standard_normal((count, knots.bias.size))
        return [
            replace(
                self,
                responses={
                    name: replace(knots, estimate=estimates[name][i], bias=biases[name][i])
                    for name, knots in self.responses.items()
                },
            )
            for i in range(count)
        ]

    @property
    def units(self) -> dict[str, str]:
        """SI unit by regressor, over all responses."""
        return {
            name: unit
            for r in self.responses.values()
            for name, unit in zip(r.regressors, r.regressor_units, strict=True)
        }


_PARAMETERS = "parameter/{response}"
_COLUMN = ("regressors", "ids")
_RESPONSE = {
    "unit": Attribute(f"{_PARAMETERS}@units"),
    "regressors": Attribute(f"{_PARAMETERS}@regressors", json=True),
    "regressor_units": Attribute(f"{_PARAMETERS}@regressor_units", json=True, axes=("regressors",)),
    "estimate": Dataset(f"{_PARAMETERS}/{{regressors}}/estimate", "{parameter_units}", _COLUMN),
    "std_error": Dataset(f"{_PARAMETERS}/{{regressors}}/std_error", "{parameter_units}"),
    "trim": Dataset(f"{_PARAMETERS}/{{regressors}}/trim", "{regressor_units}", _COLUMN),
    "regressor_rms": Dataset(f"{_PARAMETERS}/{{regressors}}/regressor_rms", "{regressor_units}", _COLUMN),
    "bias": Dataset(f"{_PARAMETERS}/bias/estimate", "{unit}", ("ids",)),
    "bias_std_error": Dataset(f"{_PARAMETERS}/bias/std_error", "{unit}", ("ids",)),
    "covariance": Dataset("covariance/{response}", "mixed", ("ids", "regressors", "regressors")),
    "parameters": Attribute("covariance/{response}@parameters", json=True),
}
_CORRIDOR = {
    **{name: Attribute(f"@{name}") for name in ("form", "vehicle", "highest_hz")},
    "ids": Attribute("reference@ids", json=True),
    "u": Dataset("reference/u", "m/s", ("ids",)),
    "rho": Dataset("reference/rho", "kg/m3", ("ids",)),
    "scheduled": Attribute("reference@scheduled", json=True),
    "scheduled_units": Attribute("reference@scheduled_units", json=True),
    "along": Attribute("reference@along"),
    "schedule": Dataset("reference/{scheduled}", "{scheduled_units}", ("scheduled", "ids")),
    "line": Dataset("reference/line", axes=("ids",)),
    "provenance": Attribute("provenance@json", json=True),
    "aircraft": Table("aircraft"),
    "responses": NestedSeries(KnotResponse, _RESPONSE, "response", "@responses"),
}


def _check(corridor: Corridor) -> None:
    line = corridor.line
    if set(line) != set(range(line.max() + 1)) or np.bincount(line).min() < 2:
        raise ValueError("the lines have no two knots each")
    if not (np.diff(corridor.coordinate)[np.diff(line) == 0] > 0).all() or (np.diff(line) < 0).any():
        raise ValueError("the knots do not ascend along their lines")
    if not corridor.responses:
        raise ValueError("it has no response")
    for name, knots in corridor.responses.items():
        if (np.diagonal(knots.covariance, axis1=1, axis2=2) < 0).any():
            raise ValueError(f"a variance of '{name}' is negative")


FILE = ResultFile("freqid-global", Corridor, _CORRIDOR, check=_check)
write_global, read_global = FILE.write, FILE.read
