"""Mass properties that follow the tilt: where the wings' mass is, how it moves, and the centre of gravity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from freqid.core.arrays import Array
from freqid.core.record import Maneuver
from freqid.dynamics.frames import cross, turn_about_y
from freqid.dynamics.mass import stated_arm, wing_arm, without_wings

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
    fixed_inertia : ndarray, shape (3, 3)
        Of all that does not tilt, about the vehicle's stated centre of gravity, kg m2.
    wings : tuple of WingMass
        Empty for a rigid vehicle.
    cg : ndarray, shape (3, sample) or (3, 1)
        Centre of gravity of the whole from the stated one, body axes, m; one column where it stays.
    cg_rate : ndarray, shape (3, sample) or (3, 1)
        Rate of change of `cg` in body axes, m/s.
    """

    mass: float
    fixed_inertia: Array
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
    """
    record, vehicle = maneuver.record, maneuver.vehicle
    stated = vehicle.mass_properties
    heavy = [w for w in vehicle.wings if w.mass_kg > 0 or w.inertia.matrix.any()] if wings else []
    moving, cg, cg_rate = [], np.zeros((3, 1)), np.zeros((3, 1))
    tilts = record.matrix(f"effector/{w.tilt}" for w in heavy)
    tilt_rates = differentiate(tilts, record.dt) if heavy else tilts
    for wing, tilt, rate in zip(heavy, tilts, tilt_rates, strict=True):
        arm = turn_about_y(wing_arm(wing), tilt)
        pivot = np.subtract(wing.pivot_m, stated.cg_m)[:, None]
        position, velocity = pivot + arm, rate * cross(ALONG_Y, arm)
        moving.append(WingMass(wing.mass_kg, wing.inertia.matrix, tilt, rate, position, velocity))
        cg = cg + wing.mass_kg / stated.mass_kg * (arm - stated_arm(vehicle, wing)[:, None])
        cg_rate = cg_rate + wing.mass_kg / stated.mass_kg * velocity
    _, fixed_inertia = without_wings(vehicle, heavy, stated.cg_m)
    return MovingMass(stated.mass_kg, fixed_inertia, tuple(moving), cg, cg_rate)
