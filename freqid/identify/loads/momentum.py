"""Angular momentum of airframe, tilting wings and rotors about the instantaneous centre of gravity."""

from __future__ import annotations

import numpy as np

from freqid.core.arrays import Array
from freqid.core.record import Maneuver
from freqid.dynamics.frames import cross, shaft_axis, turn_about_y
from freqid.identify.loads.mass import ALONG_Y, MovingMass


def airframe_momentum(mass: MovingMass, rates: Array) -> Array:
    """Return the angular momentum of everything but the rotors' spin, about the centre of gravity.

    Parameters
    ----------
    mass : MovingMass
    rates : ndarray, shape (3, sample)
        p q r, rad/s.

    Returns
    -------
    ndarray, shape (3, sample)
        Body axes, N m s.

    Notes
    -----
    Seen from the stated centre of gravity, a point O of the body, each wing contributes its spin with
    the angular velocity ``w + tilt_rate y`` and the moment of its momentum; ``- m d x (w x d + d')``
    moves the sum from O to the centre of gravity at d (docs/theory/wrench.md, eq. 7).
    """
    momentum = mass.fixed_inertia @ rates
    for wing in mass.wings:
        in_wing = turn_about_y(rates + wing.tilt_rate * ALONG_Y, -wing.tilt)
        momentum += turn_about_y(wing.inertia @ in_wing, wing.tilt)
        momentum += wing.mass * cross(wing.position, cross(rates, wing.position) + wing.velocity)
    if mass.wings:
        momentum -= mass.mass * cross(mass.cg, cross(rates, mass.cg) + mass.cg_rate)
    return momentum


def rotor_momentum(maneuver: Maneuver) -> Array:
    """Return the angular momentum of the rotors' spin, h.

    Parameters
    ----------
    maneuver : Maneuver
        Speeds are read from ``effector/<rotor>``, tilt angles from ``effector/<tilt>``, for rotors
        that have inertia.

    Returns
    -------
    ndarray, shape (3, sample)
        Body axes, N m s: ``sum_k s_k J_k Omega_k e_k(tilt)``.

    Raises
    ------
    DataError
        Where a speed or a tilt angle is missing from the record.

    Notes
    -----
    Omega is the speed relative to the mount; that a rotor also turns with the body and its wing is part
    of their inertia, which is stated with rotors locked.
    """
    record, vehicle = maneuver.record, maneuver.vehicle
    tilts = {wing.name: f"effector/{wing.tilt}" for wing in vehicle.wings}
    momentum = np.zeros((3, record.time.size))
    for wing in (None, *tilts):  # rotors of one wing turn together: add them up first, then turn the sum
        rotors = [r for r in vehicle.rotors if r.wing == wing and r.inertia != 0]
        if rotors:
            shafts = np.array([r.spin * r.inertia * shaft_axis(r.axis, 0.0) for r in rotors])
            spin = shafts.T @ record.matrix(f"effector/{r.name}" for r in rotors)
            momentum += spin if wing is None else turn_about_y(spin, record[tilts[wing]])
    return momentum
