"""Mass properties that follow the tilt: where the wings' mass is, how it moves, and the centre of gravity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.frames import cross, turn_about_y
from freqid.core.record import Maneuver
from freqid.core.vehicle import Vehicle, Wing

Differentiate = Callable[[Array, float], Array]

ALONG_Y = np.array([[0.0], [1.0], [0.0]])


@dataclass(frozen=True, eq=False)
class WingMass:
    """The mass of one tilting wing over a manoeuvre, seen from the body.

    Attributes
    ----------
    mass : float
        Everything that tilts, kg.
    inertia : ndarray, shape (3, 3)
        About the wing's own centre of gravity at zero tilt, rotors locked, kg m2.
    tilt, tilt_rate : ndarray, shape (sample,)
        rad, rad/s.
    position : ndarray, shape (3, sample)
        Its centre of gravity from the vehicle's stated one, body axes, m.
    velocity : ndarray, shape (3, sample)
        Rate of change of `position` in body axes, m/s.
    """

    mass: float
    inertia: Array
    tilt: Array
    tilt_rate: Array
    position: Array
    velocity: Array


@dataclass(frozen=True, eq=False)
class MovingMass:
    """An aircraft's mass over a manoeuvre: what keeps its place in the body, and the wings.

    Attributes
    ----------
    mass : float
        Of the whole aircraft, kg.
    still_inertia : ndarray, shape (3, 3)
        Of all that does not tilt, about the vehicle's stated centre of gravity, kg m2.
    wings : tuple of WingMass
        Empty for a rigid vehicle.
    cg : ndarray, shape (3, sample) or (3, 1)
        Centre of gravity of the whole from the stated one, body axes, m; one column where it stays.
    cg_rate : ndarray, shape (3, sample) or (3, 1)
        Rate of change of `cg` in body axes, m/s.
    """

    mass: float
    still_inertia: Array
    wings: tuple[WingMass, ...]
    cg: Array
    cg_rate: Array


def moving_mass(maneuver: Maneuver, differentiate: Differentiate, *, wings: bool = True) -> MovingMass:
    """Return the vehicle's mass over a manoeuvre.

    Parameters
    ----------
    maneuver : Maneuver
        Tilt angles are read from ``effector/<tilt>`` for wings that have mass.
    differentiate : callable
        ``differentiate(x, dt)``, x of shape (channel, sample); gives the tilt rates.
    wings : bool
        False keeps the wings where the stated mass properties hold.

    Returns
    -------
    MovingMass

    Raises
    ------
    DataError
        Where a tilt angle is missing from the record.
    UsageError
        Where a wing with mass has no centre of gravity, or the wings together outweigh the vehicle.

    Notes
    -----
    The stated properties hold with the wings at ``vehicle.tilt_rad`` and contain them. The wings are
    taken out there, by parallel axes, and put back where they are (docs/theory/wrench.md).
    """
    record, vehicle = maneuver.record, maneuver.vehicle
    stated = vehicle.mass_properties
    heavy = [w for w in vehicle.wings if w.mass_kg > 0 or w.inertia.matrix.any()] if wings else []
    moving, cg, cg_rate = [], np.zeros((3, 1)), np.zeros((3, 1))
    tilts = record.matrix(f"effector/{w.tilt}" for w in heavy)
    tilt_rates = differentiate(tilts, record.dt) if heavy else tilts
    for wing, tilt, rate in zip(heavy, tilts, tilt_rates, strict=True):
        arm = turn_about_y(_arm(wing), tilt)
        pivot = np.subtract(wing.pivot_m, stated.cg_m)[:, None]
        position, velocity = pivot + arm, rate * cross(ALONG_Y, arm)
        moving.append(WingMass(wing.mass_kg, wing.inertia.matrix, tilt, rate, position, velocity))
        home = turn_about_y(_arm(wing), vehicle.tilt_rad.get(wing.name, 0.0))[:, None]
        cg = cg + wing.mass_kg / stated.mass_kg * (arm - home)
        cg_rate = cg_rate + wing.mass_kg / stated.mass_kg * velocity
    return MovingMass(stated.mass_kg, _still_inertia(vehicle, heavy), tuple(moving), cg, cg_rate)


def _arm(wing: Wing) -> Array:
    """Return the wing's centre of gravity from its pivot at zero tilt, shape (3,)."""
    if wing.mass_kg == 0:
        return np.zeros(3)
    if wing.cg_m is None:
        raise UsageError(
            f"wing '{wing.name}' has a mass of {wing.mass_kg:g} kg but no centre of gravity",
            remedy="add cg_m to its [[wing]] of the scenario, or set its mass_kg to 0",
        )
    return np.subtract(wing.cg_m, wing.pivot_m)


def _still_inertia(vehicle: Vehicle, heavy: list[Wing]) -> Array:
    """Return the inertia of all that does not tilt about the stated centre of gravity, shape (3, 3)."""
    stated = vehicle.mass_properties
    mass, moment, inertia = stated.mass_kg, np.zeros(3), stated.inertia.matrix
    for wing in heavy:
        tilt = vehicle.tilt_rad.get(wing.name, 0.0)
        place = np.subtract(wing.pivot_m, stated.cg_m) + turn_about_y(_arm(wing), tilt)
        turn = turn_about_y(np.eye(3), tilt)
        mass -= wing.mass_kg
        moment -= wing.mass_kg * place
        inertia = inertia - turn @ wing.inertia.matrix @ turn.T - _parallel(wing.mass_kg, place)
    # What is left must be a body: a mass, and an inertia about its own centre that is not negative.
    own = inertia - _parallel(mass, moment / mass) if mass > 0 else -np.eye(3)
    lowest = np.linalg.eigvalsh(own)[0]
    if heavy and lowest < -1e-9 * np.trace(stated.inertia.matrix):
        raise UsageError(
            f"vehicle '{vehicle.name}' without its wings has a mass of {mass:.4g} kg and a lowest moment of "
            f"inertia of {lowest:.4g} kg m2, expected both positive",
            remedy="correct the mass properties of [vehicle] or [[wing]]; the vehicle's include its wings",
        )
    return inertia


def _parallel(mass: float, place: Array) -> Array:
    """Return the inertia of a point mass at a place, shape (3, 3)."""
    return mass * (place @ place * np.eye(3) - np.outer(place, place))
