"""Loads and motion as one smooth function of state and effectors, with its exact derivatives.

Trim and linearisation are both made from it, so that it is compiled once for the two.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from freqid.simulate.air.surroundings import Surroundings, relative_flow
from freqid.simulate.effects import gyroscopic
from freqid.simulate.loads import airframe
from freqid.simulate.loads.quantities import Aero, Positions
from freqid.simulate.motion import attitude, multibody, rigid_body
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.motion.actuators import Commands
from freqid.simulate.motion.attitude import cross
from freqid.simulate.motion.multibody import Configuration
from freqid.simulate.motion.rigid_body import BodyState
from freqid.simulate.tracing import stored

STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi")
HEIGHT = 100.0  # m above ground, where manoeuvres are flown


class SmallMotion(NamedTuple):
    """Loads and rates of change at one state, effectors standing still there.

    Attributes
    ----------
    wrench : Array, shape (6,)
        Applied X Y Z, N, and L M N about the centre of gravity, N m.
    rate : Array, shape (9,)
        Of the state, in the order of `STATES`.
    """

    wrench: jax.Array
    rate: jax.Array


class Derivatives(NamedTuple):
    """A small motion with its surroundings in the space of states and effectors.

    Attributes
    ----------
    value : SmallMotion
    by_state : SmallMotion of Array, shape (..., 9)
    by_position : SmallMotion of Array, shape (..., surface + tilt + rotor)
    centre : Array, shape (3,)
        Centre of gravity, vehicle axes, m.
    body : BodyState
    aero : Aero
    commands : Commands
        That keep the effectors where they are, on a battery as full as the scenario says.
    """

    value: SmallMotion
    by_state: SmallMotion
    by_position: SmallMotion
    centre: jax.Array
    body: BodyState
    aero: Aero
    commands: Commands


def small_motion(
    parameters: motion.Parameters, around: Surroundings, state: jax.Array, effectors: jax.Array
) -> tuple[SmallMotion, tuple[BodyState, Aero, Commands]]:
    """Return loads and rates of change, wakes in their steady state and wings standing still.

    Parameters
    ----------
    parameters : motion.Parameters
    around : Surroundings
    state : Array, shape (9,)
        In the order of `STATES`, velocity of the centre of gravity.
    effectors : Array, shape (surface + tilt + rotor,)
        Positions: surfaces and tilts, rad, then rotor speeds, rad/s.

    Returns
    -------
    SmallMotion
    body, aero, commands : BodyState, Aero, Commands
    """
    positions = split(parameters, effectors)
    velocity, rates, (phi, theta, psi) = state[:3], state[3:6], state[6:]
    mass = gyroscopic.spinning(parameters.airframe.effects["gyroscopic"], parameters.mass)
    centre = multibody.traced_centre_of_gravity(mass, positions.tilt)
    place = jnp.stack([jnp.zeros(()), jnp.zeros(()), -HEIGHT - around.ground])
    turned = attitude.from_euler(phi, theta, psi)
    body = BodyState(place, turned, velocity - cross(rates, centre), rates)
    aero = airframe.wrench(parameters.airframe, relative_flow(body, around), positions)
    still = jnp.zeros_like(positions.tilt)
    inner = Configuration(positions.tilt, still, positions.speed)
    origin, turning = rigid_body.accelerations(
        mass, inner, Configuration(still, still, jnp.zeros_like(positions.speed)), body, aero.wrench
    )
    swing = rates[1] * jnp.sin(phi) + rates[2] * jnp.cos(phi)
    angles = jnp.stack(
        [
            rates[0] + jnp.tan(theta) * swing,
            rates[1] * jnp.cos(phi) - rates[2] * jnp.sin(phi),
            swing / jnp.cos(theta),
        ]
    )
    found = SmallMotion(
        wrench=aero.wrench.about(centre),
        rate=jnp.concatenate([origin + cross(turning, centre), turning, angles]),
    )
    commands = motion.holding(parameters, positions, aero, parameters.actuators.battery.charge)
    return found, (body, aero, commands)


@stored
def derivatives(
    parameters: motion.Parameters, around: Surroundings, state: jax.Array, effectors: jax.Array
) -> Derivatives:
    """Return `small_motion` and its exact derivatives; parameters as there."""

    # Traced on its own first, which halves the time to compile: differentiating as it is traced would
    # differentiate every small function of jax.numpy by itself.
    @jax.jit
    def of(state: jax.Array, effectors: jax.Array):
        found, more = small_motion(parameters, around, state, effectors)
        return found, (found, more)

    slopes, (found, (body, aero, commands)) = jax.jacfwd(of, argnums=(0, 1), has_aux=True)(state, effectors)
    centre = multibody.traced_centre_of_gravity(parameters.mass, split(parameters, effectors).tilt)
    (wrench_x, wrench_d), (rate_x, rate_d) = slopes
    return Derivatives(
        found, SmallMotion(wrench_x, rate_x), SmallMotion(wrench_d, rate_d), centre, body, aero, commands
    )


def split(parameters: motion.Parameters, effectors: jax.Array) -> Positions:
    """Return effectors that stand still by kind."""
    surfaces, wings = parameters.actuators.surface.low.size, parameters.actuators.tilt.low.size
    surface, tilt, speed = jnp.split(effectors, (surfaces, surfaces + wings))
    return Positions(surface, tilt, jnp.zeros_like(tilt), speed)
