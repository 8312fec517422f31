"""What effects read off a record: flow, tilting wings, shafts, thrust, and loads about the centre of gravity.

Vectors have shape (3, sample), body axes; positions are in vehicle axes. `replay` is a
`freqid.gap.model.replay.Replay` throughout.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from freqid.core.arrays import Array
from freqid.core.record import FlightRecord
from freqid.core.vehicle import Rotor, Vehicle, Wing
from freqid.dynamics.frames import shaft_axis, turn_about_y
from freqid.dynamics.moment_reference_point import moment_about


def velocity(record: FlightRecord) -> Array:
    """Return u v w of the vehicle's origin relative to the air, m/s."""
    return record.matrix(("state/u", "state/v", "state/w"))


def rates(record: FlightRecord) -> Array:
    """Return p q r, rad/s."""
    return record.matrix(("state/p", "state/q", "state/r"))


def tilt(record: FlightRecord, wing: Wing) -> Array:
    """Return a wing's tilt angle, rad, shape (sample,)."""
    return record[f"effector/{wing.tilt}"]


def slope(values: Array, dt: float) -> Array:
    """Return the derivative of signals, shape (..., sample), by a quartic over nine samples."""
    from scipy.signal import savgol_filter

    return savgol_filter(values, 9, 4, deriv=1, delta=dt, axis=-1, mode="interp")


def rotor_wing(vehicle: Vehicle, rotor: Rotor) -> Wing | None:
    """Return the wing that carries a rotor, None where the body does."""
    return next((w for w in vehicle.wings if w.name == rotor.wing), None)


def shaft(record: FlightRecord, vehicle: Vehicle, rotor: Rotor) -> Array:
    """Return the unit vector along a rotor's shaft, towards the thrust."""
    wing = rotor_wing(vehicle, rotor)
    return shaft_axis(rotor.axis, tilt(record, wing) if wing else np.zeros(record.time.size))


def hub(record: FlightRecord, vehicle: Vehicle, rotor: Rotor) -> Array:
    """Return where a rotor's hub is, m."""
    wing, place = rotor_wing(vehicle, rotor), np.array(rotor.position_m)
    if wing is None:
        return np.repeat(place[:, None], record.time.size, axis=1)
    pivot = np.array(wing.pivot_m)
    return pivot[:, None] + turn_about_y(place - pivot, tilt(record, wing))


def centre(record: FlightRecord, vehicle: Vehicle) -> Array:
    """Return the centre of gravity, m, as the wings carry it along."""
    stated = vehicle.mass_properties
    found = np.repeat(np.array(stated.cg_m)[:, None], record.time.size, axis=1)
    for wing in vehicle.wings:
        if wing.cg_m is not None and wing.mass_kg > 0:
            arm = np.subtract(wing.cg_m, wing.pivot_m)
            moved = turn_about_y(arm, tilt(record, wing))
            rest = turn_about_y(arm, vehicle.tilt_rad.get(wing.name, 0.0))
            found = found + wing.mass_kg / stated.mass_kg * (moved - rest[:, None])
    return found


def wrench(replay: Any, force: Array, place: ArrayLike, moment: Array | float = 0.0) -> Array:
    """Return a force at a place, and a moment, as X Y Z L M N about the centre of gravity.

    Parameters
    ----------
    replay : Replay
    force : ndarray, shape (3, sample)
        N.
    place : array_like, shape (3,) or (3, sample)
        Where it acts, m.
    moment : ndarray, shape (3, sample)
        That comes with it, N m.

    Returns
    -------
    ndarray, shape (6, sample)
    """
    place = np.asarray(place, dtype=float)
    place = place[:, None] if place.ndim == 1 else place
    arm = place - centre(replay.record, replay.vehicle)
    return np.concatenate([force, moment_about(arm, force, moment)])


def thrusts(replay: Any, rotors: Sequence[Rotor]) -> Array:
    """Return the thrusts that the simulation gives rotors, N, shape (rotor, sample).

    Half the speed times the derivative of the force along the shaft: exact where thrust goes with the
    square of the speed, as it nearly does.
    """
    record, channels = replay.record, [f"effector/{rotor.name}" for rotor in rotors]
    axes = np.array([shaft(record, replay.vehicle, rotor) for rotor in rotors])
    return 0.5 * record.matrix(channels) * (replay.gradients(channels)[:, :3] * axes).sum(axis=1)


def torques(replay: Any, rotors: Sequence[Rotor]) -> Array:
    """Return the torques about their shafts that the simulation gives rotors, N m, shape (rotor, sample).

    As `thrusts`, of the moment that is left once the rotor's force acts at its hub.
    """
    record, channels = replay.record, [f"effector/{rotor.name}" for rotor in rotors]
    found = 0.5 * record.matrix(channels)[:, None] * replay.gradients(channels)
    middle = centre(record, replay.vehicle)
    for k, rotor in enumerate(rotors):
        arm = hub(record, replay.vehicle, rotor) - middle
        found[k, 3:] -= moment_about(arm, found[k, :3])
    axes = np.array([shaft(record, replay.vehicle, rotor) for rotor in rotors])
    return (found[:, 3:] * axes).sum(axis=1)
