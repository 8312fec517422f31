"""Propellers: thrust, torque, in-plane force and hub moment against advance ratio and inflow angle.

Coefficients are cubic in the advance ratio J = U / nD, written with speeds instead of J so that nothing
divides by the rotor speed: with X = nD and S^2 = X^2 + U^2,

    T = rho D^2 (c0 X^2 + c1 X U + (c2 X U^2 + c3 U^3) / S)

is ``rho n^2 D^4 (c0 + c1 J + (c2 J^2 + c3 J^3) / sqrt(1 + J^2))``. It is smooth through rest, windmilling
and reversed flow, and tends to the drag c3 rho D^2 U |U| of a stopped propeller.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import jax
import jax.numpy as jnp

from freqid.dynamics import precision as precision
from freqid.dynamics.moment_reference_point import moment_about
from freqid.simulate.effects import rotor_inplane_force
from freqid.simulate.loads.frames import Motion

SMALLEST_SPEED = 0.1  # m/s, keeps the denominators from zero; 3e-6 of the tip speed squared in hover


class Propellers(NamedTuple):
    """All rotors of the vehicle.

    Attributes
    ----------
    frame : Array, shape (rotor, frame)
        One where the rotor is on that wing, or in the last column on the body; otherwise zero.
    hub : Array, shape (rotor, 3)
        From the frame's origin, in its axes, m.
    axis : Array, shape (rotor, 3)
        Unit vector towards the thrust, frame axes.
    spin : Array, shape (rotor,)
        +1 where right-handed about the axis, else -1.
    diameter : Array, shape (rotor,)
        m.
    thrust, torque : Array, shape (4,)
        c0 to c3 of CT and of CQ = CP / 2 pi.
    crossflow_thrust : Array, shape ()
        Gain of CT with the square of the in-plane advance ratio W / nD.
    inplane_force : Array, shape ()
        In-plane force over ``rho D^2 S W``, against the in-plane velocity W.
    hub_moment : Array, shape ()
        Moment of the advancing side over ``rho D^3 S W``, about the axis of W.
    """

    frame: jax.Array
    hub: jax.Array
    axis: jax.Array
    spin: jax.Array
    diameter: jax.Array
    thrust: jax.Array
    torque: jax.Array
    crossflow_thrust: jax.Array
    inplane_force: jax.Array
    hub_moment: jax.Array


class Discs(NamedTuple):
    """What the rotors do at one moment.

    Attributes
    ----------
    axial : Array, shape (rotor,)
        Velocity U of the hub along its axis, m/s.
    inplane : Array, shape (rotor, 3)
        The rest of the hub's velocity, frame axes, m/s.
    thrust, torque : Array, shape (rotor,)
        N, and N m against the rotation.
    inplane_force : Array, shape (rotor, 3)
        N, frame axes.
    hub_moment : Array, shape (rotor, 3)
        N m, frame axes.
    """

    axial: jax.Array
    inplane: jax.Array
    thrust: jax.Array
    torque: jax.Array
    inplane_force: jax.Array
    hub_moment: jax.Array


def discs(propellers: Propellers, velocity: jax.Array, speed: jax.Array, rho: jax.Array) -> Discs:
    """Return the loads of all rotors.

    Parameters
    ----------
    propellers : Propellers
    velocity : Array, shape (rotor, 3)
        Of the hubs relative to the air, frame axes, m/s.
    speed : Array, shape (rotor,)
        rad/s.
    rho : Array, shape ()
        kg/m3.

    Returns
    -------
    Discs

    References
    ----------
    Ribner, H. S., "Propellers in Yaw", NACA Report 820, 1945, for the in-plane loads, which are taken
    proportional to the in-plane velocity here.
    """
    d = propellers.diameter
    axial = jnp.sum(velocity * propellers.axis, axis=-1)
    inplane = velocity - axial[:, None] * propellers.axis
    x = speed * d / (2 * pi)
    s = jnp.sqrt(x**2 + axial**2 + SMALLEST_SPEED**2)
    powers = jnp.stack([x**2, x * axial, x * axial**2 / s, axial**3 / s])
    w2 = jnp.sum(inplane**2, axis=-1)
    gain = propellers.crossflow_thrust * w2 * x**2 / (x**2 + w2 + SMALLEST_SPEED**2)
    disc = rho * d**2
    side = (disc * s)[:, None] * inplane
    return Discs(
        axial=axial,
        inplane=inplane,
        thrust=disc * (propellers.thrust @ powers + gain),
        torque=disc * d * (propellers.torque @ powers),
        inplane_force=-propellers.inplane_force * side,
        hub_moment=-propellers.hub_moment * (propellers.spin * d)[:, None] * side,
    )


def rotor_loads(
    propellers: Propellers, at: Motion, speed: jax.Array, rho: jax.Array, inplane: dict[str, jax.Array]
) -> tuple[Discs, jax.Array]:
    """Return what all rotors do to the frames that carry them.

    Parameters
    ----------
    propellers : Propellers
    at : Motion
        Of the frames that carry them.
    speed : Array, shape (rotor,)
        rad/s.
    rho : Array, shape ()
        kg/m3.
    inplane : dict of Array
        Settings of the effect `rotor_inplane_force`.

    Returns
    -------
    discs : Discs
    loads : Array, shape (frame, 6)
        Force and moment about the frame's origin on each frame, in its axes, N and N m.
    """
    hubs = propellers.frame @ jnp.concatenate([at.velocity, at.rates], axis=1)
    hubs = hubs[:, :3] + jnp.cross(hubs[:, 3:], propellers.hub)
    found = discs(propellers, hubs, speed, rho)
    inplane_force, hub_moment = rotor_inplane_force.loads(inplane, found)
    push = found.thrust[:, None] * propellers.axis + inplane_force
    twist = hub_moment - (propellers.spin * found.torque)[:, None] * propellers.axis
    twist = moment_about(propellers.hub, push, twist, axis=-1)
    return found, propellers.frame.T @ jnp.concatenate([push, twist], axis=1)
