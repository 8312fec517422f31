"""What the simulation's parts hand to each other.

Each is a NamedTuple of arrays, so JAX differentiates and batches through it. Body axes: x forward,
y right, z down; SI and radians. Orders are those of the scenario's ``[[effector]]`` entries of a kind,
and of its ``[[rotor]]`` and ``[[wing]]`` entries.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from freqid.dynamics import precision as precision
from freqid.dynamics.moment_reference_point import moment_about


class Flow(NamedTuple):
    """How the vehicle moves through the air.

    Attributes
    ----------
    velocity : Array, shape (3,)
        Of the vehicle's origin relative to the air, body axes, m/s.
    rates : Array, shape (3,)
        Angular velocity p, q, r relative to the air, rad/s.
    rho : Array, shape ()
        Air density, kg/m3.
    height : Array, shape ()
        Of the vehicle's origin above ground, m.
    """

    velocity: jax.Array
    rates: jax.Array
    rho: jax.Array
    height: jax.Array


class Positions(NamedTuple):
    """Where the effectors are, as opposed to where they were commanded.

    Attributes
    ----------
    surface : Array, shape (surface,)
        Deflections, rad, trailing edge down positive.
    tilt : Array, shape (wing,)
        Wing tilt angles, rad, leading edge up positive.
    tilt_rate : Array, shape (wing,)
        rad/s.
    speed : Array, shape (rotor,)
        Rotor speeds, rad/s, not negative.
    """

    surface: jax.Array
    tilt: jax.Array
    tilt_rate: jax.Array
    speed: jax.Array


class Wrench(NamedTuple):
    """Aerodynamic and propulsive force and moment; inertial terms belong to the rigid body.

    Attributes
    ----------
    force : Array, shape (3,)
        X, Y, Z, body axes, N.
    moment : Array, shape (3,)
        L, M, N about the vehicle's origin, body axes, N m.
    """

    force: jax.Array
    moment: jax.Array

    @classmethod
    def of(cls, force: jax.Array, place: jax.Array, moment: jax.Array | None = None) -> Wrench:
        """Return the wrench of a force that acts at a place, vehicle axes, m, with a moment of its own."""
        return cls(force, moment_about(place, force, moment, axis=-1))

    def about(self, point: jax.Array) -> jax.Array:
        """Return X Y Z and L M N with the moments about another point, vehicle axes, m, shape (6,)."""
        return jnp.concatenate([self.force, moment_about(-point, self.force, self.moment, axis=-1)])


class Wake(NamedTuple):
    """What the front wing sends to the rear wing and the tail; the left half first.

    Attributes
    ----------
    downwash : Array, shape (2,)
        Velocity of the air along +z behind the left and the right half, m/s.
    blowing : Array, shape (2,)
        Velocity of the air along -x that the front rotors add there, m/s.
    """

    downwash: jax.Array
    blowing: jax.Array


class Aero(NamedTuple):
    """All that one evaluation of the airframe yields.

    Attributes
    ----------
    wrench : Wrench
    torque : Array, shape (rotor,)
        Of the air against each rotor's rotation, N m; what the motor has to hold.
    thrust : Array, shape (rotor,)
        Along each shaft, N.
    shed : Wake
        What leaves the front wing now; it reaches the rear wing after a convection time.
    """

    wrench: Wrench
    torque: jax.Array
    thrust: jax.Array
    shed: Wake
