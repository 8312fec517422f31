"""Explanatory variables: a regressor's name to its time history, logged or computed from what was logged."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import ADVANCE_RATIO, AIR, FLOW, RATES, STATE, VELOCITY
from freqid.core.errors import DataError, nearest
from freqid.core.record import Maneuver
from freqid.core.sections.identification import factors_of
from freqid.dynamics.frames import body_velocity, cross, flow_angles
from freqid.dynamics.mass import centre_of_gravity

# Rounds in which a velocity is found from V, alpha and beta of different places: each gains the ratio of a
# sensor's own velocity to the airspeed, some two digits.
FLOW_ROUNDS = 4


def explanatory_variables(
    maneuver: Maneuver, names: Iterable[str], trim: Mapping[str, float] | None = None
) -> tuple[Array, tuple[str, ...]]:
    """Return regressors over a manoeuvre.

    Parameters
    ----------
    maneuver : Maneuver
    names : iterable of str
        Channels without their group: states, air data or effectors. Air data and nondimensional rates
        that were not logged are computed from those that were. Velocities and flow angles of a sensor
        that states its position are those that the centre of gravity has. A product, as ``w*de1``, is
        that of the departures from the trim.
    trim : mapping of str to float, optional
        By factor of a product; the mean of the manoeuvre where absent.

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
    values = np.array([history(maneuver, name, trim) for name in names])
    return values, tuple(unit_of(maneuver, name) for name in names)


def history(maneuver: Maneuver, name: str, trim: Mapping[str, float] | None = None) -> Array:
    """Return one explanatory variable, shape (sample,), logged or else computed, at the centre of gravity."""
    factors = factors_of(name)
    if len(factors) > 1:
        values = {factor: history(maneuver, factor) for factor in factors}
        about = {factor: float(x.mean()) for factor, x in values.items()} | dict(trim or {})
        return np.prod([values[factor] - about[factor] for factor in factors], axis=0)
    record = maneuver.record
    for group in ("state", "air", "effector"):
        if f"{group}/{name}" in record:
            return _at_centre_of_gravity(maneuver, f"{group}/{name}")
    if name in _COMPUTED:
        return _COMPUTED[name](maneuver)
    available = {n for g in ("state", "air", "effector") for n in record.group(g)}
    raise DataError(
        f"regressor '{name}' is no channel of the record", remedy=nearest(name, available | set(_COMPUTED))
    )


def motion_of_centre(maneuver: Maneuver) -> dict[str, Array]:
    """Return what can be had of u, v, w, V, alpha, beta and qbar of the centre of gravity, as `history` does.

    The way from the sensors to there, which moves with tilting wings, is computed once for all of them.
    """
    record = maneuver.record
    names = [name for name in (*VELOCITY, *FLOW) if name in record]
    found: dict[str, Array] = {}
    try:
        velocity = _velocity(maneuver)
    except DataError:  # what was logged there may be had all the same
        velocity = None
    else:
        found = dict(zip("uvw", velocity, strict=True))
        names = [n for n in names if n not in VELOCITY or not all(v in record for v in VELOCITY)]
        if not all(name in record for name in FLOW):
            found |= dict(zip(("V", "alpha", "beta"), flow_angles(velocity), strict=True))
    for name in names:
        short = name.partition("/")[2]
        try:
            found[short] = _at_centre_of_gravity(maneuver, name, velocity)
        except DataError:
            found.pop(short, None)
    if "air/qbar" in record:
        found["qbar"] = record["air/qbar"]
    elif "V" in found and "air/rho" in record:
        found["qbar"] = 0.5 * record["air/rho"] * found["V"] ** 2
    return found


def unit_of(maneuver: Maneuver, name: str) -> str:
    """Return the SI unit of an explanatory variable."""
    factors = factors_of(name)
    if len(factors) > 1:
        units = [unit for unit in (unit_of(maneuver, factor) for factor in factors) if unit != "1"]
        return " ".join(units) or "1"
    if name in STATE:
        return STATE[name][0]
    if name in AIR:
        return AIR[name][0]
    if name == ADVANCE_RATIO:
        return "1"
    return maneuver.record.channel(f"effector/{name}").unit


def _velocity(maneuver: Maneuver) -> Array:
    """Return u v w of the centre of gravity, shape (3, sample), logged or from V, alpha and beta."""
    record = maneuver.record
    if all(name in record for name in VELOCITY):
        velocity, lever = record.matrix(VELOCITY), {}
        for k, name in enumerate(VELOCITY):
            place = record.channel(name).position_m
            if place not in lever:
                lever[place] = _lever(maneuver, name)
            velocity[k] -= lever[place][k]
        return velocity
    logged, lever = record.matrix(FLOW), [_lever(maneuver, name) for name in FLOW]
    velocity = body_velocity(*logged)
    for _ in range(FLOW_ROUNDS if any(part.any() for part in lever) else 0):
        shift = [_flow_shift(k, velocity, part) for k, part in enumerate(lever)]
        velocity = body_velocity(*(logged - np.array(shift)))
    return velocity


def _flow(maneuver: Maneuver) -> tuple[Array, Array, Array]:
    """Return V, alpha and beta, shape (sample,) each, computed."""
    return flow_angles(np.array([history(maneuver, n) for n in "uvw"]))


def _at_centre_of_gravity(maneuver: Maneuver, name: str, velocity: Array | None = None) -> Array:
    """Return a logged channel, shape (sample,), as a sensor at the centre of gravity would have it.

    `velocity` is that of the centre of gravity, where it is known already.
    """
    values = maneuver.record[name]
    if name not in (*VELOCITY, *FLOW):
        return values
    lever = _lever(maneuver, name)
    if not lever.any():
        return values
    if name in VELOCITY:
        return values - lever[VELOCITY.index(name)]
    velocity = _velocity(maneuver) if velocity is None else velocity
    return values - _flow_shift(FLOW.index(name), velocity, lever)


def _flow_shift(k: int, velocity: Array, lever: Array) -> Array:
    """Return what a sensor's own velocity adds to the k-th of V, alpha and beta, shape (sample,)."""
    return flow_angles(velocity + lever)[k] - flow_angles(velocity)[k]


def _lever(maneuver: Maneuver, name: str) -> Array:
    """Return the velocity of a sensor relative to the centre of gravity, ``w x d``, m/s.

    Shape (3, sample), or (3, 1) of zeros for a sensor that is there or states no place.
    """
    record = maneuver.record
    position = record.channel(name).position_m
    if position is None:
        return np.zeros((3, 1))
    tilts = {w.tilt: record[f"effector/{w.tilt}"] for w in maneuver.vehicle.wings if w.mass_kg > 0}
    arm = np.asarray(position)[:, None] - centre_of_gravity(maneuver.vehicle, tilts).reshape(3, -1)
    if not arm.any():
        return np.zeros((3, 1))
    missing = [rate for rate in RATES if rate not in record]
    if missing:
        raise DataError(
            f"channel '{name}' was measured {np.linalg.norm(arm, axis=0).max():.2g} m from the centre of "
            f"gravity and cannot be brought there, because '{missing[0]}' is missing",
            remedy="log the angular rates, or state that the channel holds for the centre of gravity",
        )
    return cross(record.matrix(RATES), arm)


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


def _advance_ratio(maneuver: Maneuver) -> Array:
    """Return the propellers' advance ratio, shape (sample,); unlike ones count by their tip speed."""
    rotors = [r for r in maneuver.vehicle.rotors if r.diameter_m and f"effector/{r.name}" in maneuver.record]
    if not rotors:
        raise DataError(
            f"the advance ratio '{ADVANCE_RATIO}' needs rotors whose diameter is stated and speed is logged",
            remedy="add diameter_m to each [[rotor]], and import their speeds as effectors",
        )
    tips = np.mean([(r.diameter_m or 0.0) * maneuver.record[f"effector/{r.name}"] for r in rotors], axis=0)
    with np.errstate(divide="ignore"):
        return 2 * np.pi * history(maneuver, "V") / tips


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
    ADVANCE_RATIO: _advance_ratio,
}
