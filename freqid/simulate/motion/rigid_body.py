"""Equations of motion of the whole vehicle: a body, wings that tilt on it and rotors that spin on them.

The rate of change of the total momentum under the vehicle's inner motion comes from one forward
derivative of `multibody.momentum`, so a moving centre of gravity, the reaction of a tilt drive and the
gyroscopic moments of the rotors can neither be forgotten nor counted twice.

References
----------
P. C. Hughes, *Spacecraft Attitude Dynamics*, Dover, 2004, ch. 3 (momentum about a moving point).
B. L. Stevens, F. L. Lewis, E. N. Johnson, *Aircraft Control and Simulation*, 3rd ed., Wiley, 2016,
sec. 1.4-1.8 (flat Earth, quaternions). Equations: docs/theory/simulation-motion.md.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from freqid.core.units import STANDARD_GRAVITY
from freqid.dynamics.moment_reference_point import moment_about
from freqid.simulate.loads.quantities import Wrench
from freqid.simulate.motion import attitude
from freqid.simulate.motion.attitude import cross
from freqid.simulate.motion.multibody import Configuration, MassModel, moments_of_mass, momentum


class BodyState(NamedTuple):
    """Motion of the vehicle axes over a flat Earth that does not turn; also its rate of change.

    Attributes
    ----------
    position : Array, shape (3,)
        Of the vehicle's origin: north, east, down, m.
    attitude : Array, shape (4,)
        Quaternion, scalar first, that turns body components into north-east-down ones.
    velocity : Array, shape (3,)
        Of the vehicle's origin over the ground, body axes, m/s.
    rates : Array, shape (3,)
        p, q, r, rad/s.
    """

    position: jax.Array
    attitude: jax.Array
    velocity: jax.Array
    rates: jax.Array


def accelerations(
    model: MassModel,
    configuration: Configuration,
    configuration_rate: Configuration,
    body: BodyState,
    wrench: Wrench,
    gravity: float = STANDARD_GRAVITY,
) -> tuple[jax.Array, jax.Array]:
    """Return the rates of change of velocity and rates, body axes, from Newton's and Euler's laws.

    Parameters
    ----------
    model : MassModel
    configuration, configuration_rate : Configuration
        The second holds tilt rates, tilt accelerations and rotor accelerations.
    body : BodyState
    wrench : Wrench
        Applied, about the vehicle's origin, without weight.
    gravity : float
        m/s2.

    Returns
    -------
    velocity_rate, rates_rate : Array, shape (3,)
        m/s2 and rad/s2.

    Notes
    -----
    With P and H linear in velocity V and rates w, and ' the change that the configuration causes,
    ``P_V V. + P_w w. = F + m g - w x P - P'`` and
    ``H_V V. + H_w w. = M + S x g - w x H - V x P - H'``, where S is the first moment about the origin.
    V. is eliminated, which leaves the inertia about the centre of gravity to be inverted.
    """
    velocity, rates = body.velocity, body.rates
    (linear, angular), (linear_rate, angular_rate) = jax.jvp(
        lambda c: momentum(model, c, velocity, rates), (configuration,), (configuration_rate,)
    )
    moment, inertia = moments_of_mass(model, configuration.tilt)
    weight = gravity * attitude.down(body.attitude)
    force = wrench.force + model.mass * weight - cross(rates, linear) - linear_rate
    torque = wrench.moment + cross(moment, weight) - cross(rates, angular)
    torque = torque - cross(velocity, linear) - angular_rate
    centre = moment / model.mass
    about_centre = inertia - ((moment * centre).sum() * np.eye(3) - moment[:, None] * centre)
    rates_rate = _solve(about_centre, moment_about(-centre, force, torque, axis=-1))
    return force / model.mass - cross(rates_rate, centre), rates_rate


def derivative(
    model: MassModel,
    configuration: Configuration,
    configuration_rate: Configuration,
    body: BodyState,
    wrench: Wrench,
    gravity: float = STANDARD_GRAVITY,
) -> BodyState:
    """Return the rate of change of the body's state; parameters as in `accelerations`."""
    velocity_rate, rates_rate = accelerations(model, configuration, configuration_rate, body, wrench, gravity)
    return BodyState(
        attitude.to_ground(body.attitude, body.velocity),
        attitude.rate(body.attitude, body.rates),
        velocity_rate,
        rates_rate,
    )


def normalised(body: BodyState) -> BodyState:
    """Return the state with its quaternion brought back to unit length, once a step."""
    return body._replace(attitude=body.attitude / jnp.sqrt((body.attitude**2).sum()))


def _solve(matrix: jax.Array, right: jax.Array) -> jax.Array:
    """Solve a symmetric 3 by 3 system by its adjugate: a few products in place of a library call."""
    a, b, c = matrix
    adjugate = jnp.stack([cross(b, c), cross(c, a), cross(a, b)])
    return (adjugate * right).sum(-1) / (a * adjugate[0]).sum()
