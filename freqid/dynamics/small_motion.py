"""Linearised equations of motion of a rigid aircraft with spinning rotors, about straight flight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from freqid.core.arrays import Array
from freqid.core.units import STANDARD_GRAVITY
from freqid.core.vehicle import Vehicle
from freqid.dynamics.frames import cross, shaft_axis

STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta")

NAVIGATION = {"psi": "rad", "alt": "m"}
"""Heading and altitude, which no load depends on, with their units."""

AIR_DATA = {"V": "m/s", "alpha": "rad", "beta": "rad"}
"""What is measured against the air, with its unit."""

SIGNALS = {
    **dict.fromkeys(("u", "v", "w"), "m/s"),
    **dict.fromkeys(("p", "q", "r"), "rad/s"),
    **dict.fromkeys(("phi", "theta"), "rad"),
    **NAVIGATION,
    **AIR_DATA,
}
"""What a sensor may measure of the small motion, with its unit."""

_AT_REST = 0.1  # m/s: below it there is no flow direction


def equations_of_motion(
    wrench: Array,
    vehicle: Vehicle,
    velocity: Array,
    theta: float,
    spin: Array,
    momentum: Array,
    gravity: float = STANDARD_GRAVITY,
) -> tuple[Array, Array]:
    """Return E and A of ``E x' = A x``, with x the states and then the effectors' positions.

    Parameters
    ----------
    wrench : ndarray, shape (6, 8 + n)
        Applied X Y Z L M N per unit of x, N and N m.
    vehicle : Vehicle
        Its mass and inertia are used.
    velocity : ndarray, shape (3,)
        u v w of the reference, m/s.
    theta : float
        Pitch angle of the reference, rad.
    spin : ndarray, shape (3, n)
        Angular momentum of the rotors per unit of effector position, kg m2.
    momentum : ndarray, shape (3,)
        That of all rotors at the reference, N m s.
    gravity : float
        m/s2.

    Returns
    -------
    E, A : ndarray, shape (8, 8 + n)
        Rows are forces, moments and the two attitude angles.

    Notes
    -----
    ``m (v' + w x V0) = F + m dg``, ``I w' + S d' + w x h0 = M``; ``phi' = p + r tan(theta)``,
    ``theta' = q``. Tilting wings keep their mass where the reference has it.

    References
    ----------
    Klein & Morelli, *Aircraft System Identification*, 2nd ed., ch. 3, linearised equations of motion.
    """
    mass, inertia = vehicle.mass_properties.mass_kg, vehicle.mass_properties.inertia.matrix
    E, A = np.zeros((8, wrench.shape[1])), np.zeros((8, wrench.shape[1]))
    A[:6] = wrench
    E[:3, :3] = mass * np.eye(3)
    A[:3, 3:6] -= mass * cross(np.eye(3), velocity[:, None] * np.ones(3))
    A[1, 6] += mass * gravity * np.cos(theta)
    A[[0, 2], 7] -= mass * gravity * np.array([np.cos(theta), np.sin(theta)])
    E[3:6, 3:6], E[3:6, 8:] = inertia, spin
    A[3:6, 3:6] -= cross(np.eye(3), momentum[:, None] * np.ones(3))
    E[6, 6] = E[7, 7] = 1.0
    A[6, 3], A[6, 5], A[7, 4] = 1.0, np.tan(theta), 1.0
    return E, A


def rotor_spin(vehicle: Vehicle, effectors: Sequence[str], positions: Mapping[str, float]) -> Array:
    """Return the rotors' angular momentum per unit of each effector's position, ``s_k J_k e_k``.

    Parameters
    ----------
    vehicle : Vehicle
    effectors : sequence of str, length n
        A rotor's speed is the position of the effector of its name; others have no momentum.
    positions : mapping of str to float
        Of tilt effectors, rad; the angle at which the vehicle's mass is stated where absent.

    Returns
    -------
    ndarray, shape (3, n)
        Body axes, kg m2.
    """
    spin = np.zeros((3, len(effectors)))
    tilts = {
        wing.name: positions.get(wing.tilt, vehicle.tilt_rad.get(wing.name, 0.0)) for wing in vehicle.wings
    }
    for rotor in vehicle.rotors:
        if rotor.name in effectors and rotor.inertia:
            axis = shaft_axis(rotor.axis, tilts.get(rotor.wing or "", 0.0))
            spin[:, list(effectors).index(rotor.name)] = rotor.spin * rotor.inertia * axis
    return spin


def navigation_rows(velocity: Array, theta: float) -> Array:
    """Return the rates of psi and altitude by u v w p q r phi theta, wings level, shape (2, 8).

    Parameters
    ----------
    velocity : ndarray, shape (3,)
        u v w of the reference, m/s.
    theta : float
        Pitch angle of the reference, rad.

    Notes
    -----
    ``psi' = r / cos(theta)``, ``h' = u sin(theta) - w cos(theta) + (u0 cos(theta) + w0 sin(theta)) theta``.
    """
    u, _, w = velocity
    rows = np.zeros((2, len(STATES)))
    rows[0, STATES.index("r")] = 1 / np.cos(theta)
    rows[1, [STATES.index(n) for n in ("u", "w", "theta")]] = (
        np.sin(theta),
        -np.cos(theta),
        u * np.cos(theta) + w * np.sin(theta),
    )
    return rows


def signal_row(name: str, velocity: Array) -> Array:
    """Return one of `SIGNALS` by u v w p q r phi theta, psi and altitude, shape (10,).

    Airspeed and flow angles are those at the centre of gravity in still air; at rest there are none.

    Raises
    ------
    ValueError
        For a flow angle or an airspeed at rest.
    """
    states = (*STATES, *NAVIGATION)
    row = np.zeros(len(states))
    if name in states:
        row[states.index(name)] = 1.0
        return row
    u, _, w = velocity
    speed = float(np.hypot(u, w))
    if speed < _AT_REST:
        raise ValueError(f"'{name}' has no meaning at {speed:.2g} m/s")
    by_velocity = {"V": (u, 0.0, w), "alpha": (-w / speed, 0.0, u / speed), "beta": (0.0, 1.0, 0.0)}[name]
    row[:3] = np.array(by_velocity) / speed
    return row
