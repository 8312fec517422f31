"""Explanatory variables: a regressor's name to its time history, logged or computed from what was logged."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import AIR, STATE
from freqid.core.errors import DataError, nearest
from freqid.core.frames import body_velocity, flow_angles
from freqid.core.record import Maneuver

Array = NDArray[np.float64]


def explanatory_variables(maneuver: Maneuver, names: Iterable[str]) -> tuple[Array, tuple[str, ...]]:
    """Return regressors over a manoeuvre.

    Parameters
    ----------
    maneuver : Maneuver
    names : iterable of str
        Channels without their group: states, air data or effectors. Air data and nondimensional rates
        that were not logged are computed from those that were.

    Returns
    -------
    values : ndarray, shape (regressor, sample)
        SI units.
    units : tuple of str

    Raises
    ------
    DataError
        Where a name is neither logged nor computable, with the nearest names.
    """
    names = tuple(names)
    values = np.array([history(maneuver, name) for name in names])
    return values, tuple(unit_of(maneuver, name) for name in names)


def history(maneuver: Maneuver, name: str) -> Array:
    """Return one explanatory variable, shape (sample,), logged or else computed."""
    record = maneuver.record
    for group in ("state", "air", "effector"):
        if f"{group}/{name}" in record:
            return record[f"{group}/{name}"]
    if name in _COMPUTED:
        return _COMPUTED[name](maneuver)
    available = {n for g in ("state", "air", "effector") for n in record.group(g)}
    raise DataError(
        f"regressor '{name}' is no channel of the record", remedy=nearest(name, available | set(_COMPUTED))
    )


def unit_of(maneuver: Maneuver, name: str) -> str:
    """Return the SI unit of an explanatory variable."""
    if name in STATE:
        return STATE[name][0]
    if name in AIR:
        return AIR[name][0]
    return maneuver.record.channel(f"effector/{name}").unit


def _velocity(maneuver: Maneuver) -> Array:
    """Return u v w, shape (3, sample), logged or from V, alpha and beta."""
    record = maneuver.record
    if all(f"state/{n}" in record for n in "uvw"):
        return record.matrix(("state/u", "state/v", "state/w"))
    return body_velocity(*record.matrix(("air/V", "air/alpha", "air/beta")))


def _flow(maneuver: Maneuver) -> tuple[Array, Array, Array]:
    """Return V, alpha and beta, shape (sample,) each, computed."""
    return flow_angles(np.array([history(maneuver, n) for n in "uvw"]))


def _per_span(rate: str, length: str) -> Callable[[Maneuver], Array]:
    def nondimensional(maneuver: Maneuver) -> Array:
        reference = getattr(maneuver.vehicle, length)
        if reference is None:
            raise DataError(
                f"'{rate}hat' needs the vehicle's {length}",
                remedy=f"add {length} to [vehicle] of the scenario",
            )
        return history(maneuver, rate) * reference / (2 * history(maneuver, "V"))

    return nondimensional


_COMPUTED: dict[str, Callable[[Maneuver], Array]] = {
    "u": lambda m: _velocity(m)[0],
    "v": lambda m: _velocity(m)[1],
    "w": lambda m: _velocity(m)[2],
    "V": lambda m: _flow(m)[0],
    "alpha": lambda m: _flow(m)[1],
    "beta": lambda m: _flow(m)[2],
    "qbar": lambda m: 0.5 * m.record["air/rho"] * history(m, "V") ** 2,
    "phat": _per_span("p", "span_m"),
    "qhat": _per_span("q", "chord_m"),
    "rhat": _per_span("r", "span_m"),
}
