"""Small motions of a rigid body under a wrench that is known by its derivatives."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.units import STANDARD_GRAVITY
from freqid.core.vehicle import Vehicle
from freqid.gap.modes import MOTION
from freqid.identify.mass import moving_mass
from freqid.identify.momentum import airframe_momentum, rotor_momentum

Array = NDArray[np.float64]


def rigid_body_matrices(
    wrench: Array,
    mass: float,
    inertia: Array,
    velocity: Array,
    angles: tuple[float, float],
    *,
    spin: Array | None = None,
) -> tuple[Array, Array]:
    """Return A and B of small motions of a rigid body about steady straight flight.

    Parameters
    ----------
    wrench : ndarray, shape (6, 6 + n)
        Derivatives of X Y Z L M N about the centre of gravity by u v w p q r and n effectors.
    mass : float
        kg.
    inertia : ndarray, shape (3, 3)
        About the centre of gravity, kg m2.
    velocity : ndarray, shape (3,)
        m/s.
    angles : (roll, pitch)
        rad.
    spin : ndarray, shape (3,), optional
        Angular momentum of the rotors, N m s.

    Returns
    -------
    A : ndarray, shape (9, 9)
        States u v w p q r phi theta psi.
    B : ndarray, shape (9, n)

    Notes
    -----
    B. L. Stevens, F. L. Lewis, E. N. Johnson, *Aircraft Control and Simulation*, 3rd ed., Wiley, 2016,
    sec. 1.7 and 3.7, with ``- w x h`` of the rotors.
    """
    (phi, theta), g = angles, STANDARD_GRAVITY
    A, B = np.zeros((9, 9)), np.zeros((9, wrench.shape[1] - 6))
    A[:3, :6], B[:3] = wrench[:3, :6] / mass, wrench[:3, 6:] / mass
    turning = np.linalg.solve(inertia, wrench[3:])
    A[3:6, :6], B[3:6] = turning[:, :6], turning[:, 6:]
    A[:3, 3:6] += _cross_matrix(velocity)  # -w x V = V x w
    if spin is not None:
        A[3:6, 3:6] += np.linalg.solve(inertia, _cross_matrix(spin))
    A[:3, 6] = g * np.array([0.0, np.cos(theta) * np.cos(phi), -np.cos(theta) * np.sin(phi)])
    A[:3, 7] = g * np.array([-np.cos(theta), -np.sin(theta) * np.sin(phi), -np.sin(theta) * np.cos(phi)])
    A[6, 3:6] = 1.0, np.tan(theta) * np.sin(phi), np.tan(theta) * np.cos(phi)
    A[7, 3:6] = 0.0, np.cos(phi), -np.sin(phi)
    A[8, 3:6] = 0.0, np.sin(phi) / np.cos(theta), np.cos(phi) / np.cos(theta)
    return A, B


def inertia_and_spin(vehicle: Vehicle, positions: Mapping[str, float]) -> tuple[Array, Array]:
    """Return inertia about the centre of gravity, kg m2, and the rotors' angular momentum, N m s.

    Parameters
    ----------
    vehicle : Vehicle
    positions : mapping of float
        Tilts, rad, and rotor speeds, rad/s, by effector.

    Raises
    ------
    DataError
        Where a tilt or a speed that matters is missing.
    """
    time = np.arange(3.0)
    channels = {
        f"effector/{name}": Channel(f"effector/{name}", "", np.full(3, float(value)), 1.0, "held")
        for name, value in positions.items()
        if name not in MOTION and "*" not in name
    }
    maneuver = Maneuver(FlightRecord(time, channels), vehicle)
    mass = moving_mass(maneuver, lambda x, dt: np.zeros_like(x))
    return airframe_momentum(mass, np.eye(3)), rotor_momentum(maneuver)[:, 0]


def _cross_matrix(v: Array) -> Array:
    """Return the matrix of ``v x``."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
