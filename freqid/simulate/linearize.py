"""Exact derivatives at a trim: of the applied wrench, and of the whole vehicle's motion.

References
----------
B. L. Stevens, F. L. Lewis, E. N. Johnson, *Aircraft Control and Simulation*, 3rd ed., Wiley, 2016,
sec. 3.7 (linearisation), with derivatives by forward differentiation in place of differences.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from ..core.scenario import Scenario
from . import airframe, attitude, motion, multibody, rigid_body
from .actuators import Commands, by_kind
from .attitude import cross
from .effects import gyroscopic
from .multibody import Configuration
from .quantities import Positions
from .rigid_body import BodyState
from .surroundings import Surroundings, relative_flow
from .trim import HEIGHT, Trim

Array = NDArray[np.float64]

STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi")


@dataclass(frozen=True, eq=False)
class Linearization:
    """Small motions about a trim, of the centre of gravity and of effectors that move at will.

    Wakes are in their steady state and wings do not turn: rates of tilts and their reactions are left out.

    Attributes
    ----------
    effectors : tuple of str
        In the order of the scenario, tilts included.
    wrench : ndarray, shape (6, 6 + effector)
        Derivatives of X Y Z, N, and L M N about the centre of gravity, N m, by u v w of the centre of
        gravity, p q r and the effectors' positions.
    centre : ndarray, shape (3,)
        Centre of gravity, vehicle axes, m.
    A : ndarray, shape (9, 9)
        Of ``x' = A x + B d``, x in the order of `STATES`.
    B : ndarray, shape (9, effector)
    """

    effectors: tuple[str, ...]
    wrench: Array
    centre: Array
    A: Array
    B: Array


def linearize(scenario: Scenario, parameters: motion.Parameters, at: Trim) -> Linearization:
    """Differentiate the vehicle at a trim.

    Parameters
    ----------
    scenario : Scenario
    parameters : motion.Parameters
    at : Trim

    Returns
    -------
    Linearization
    """
    effectors = scenario.aircraft().effectors
    places = jax.tree.map(np.asarray, by_kind(scenario.aircraft(), np.arange(len(effectors))))
    phi, theta = at.angles
    state = np.concatenate([at.body.velocity, [0.0, 0.0, 0.0, phi, theta, 0.0]])
    moved = np.zeros(len(effectors))
    by_state, by_position, centre = _derivatives(parameters, at.positions, at.around, places, state, moved)
    return Linearization(
        effectors=tuple(effector.name for effector in effectors),
        wrench=np.hstack([by_state[0][:, :6], by_position[0]]),
        centre=np.asarray(centre),
        A=np.asarray(by_state[1]),
        B=np.asarray(by_position[1]),
    )


def small_motion(
    parameters: motion.Parameters,
    trimmed: Positions,
    around: Surroundings,
    places: Commands,
    state: jax.Array,
    moved: jax.Array,
) -> tuple[jax.Array, jax.Array]:
    """Return what `linearize` differentiates: the wrench and the rate of change of the state.

    Parameters
    ----------
    parameters : motion.Parameters
    trimmed : Positions
    around : Surroundings
    places : Commands of Array of int
        Of the effectors of each kind, in the scenario's order.
    state : Array, shape (9,)
        In the order of `STATES`, velocity of the centre of gravity.
    moved : Array, shape (effector,)
        From the trimmed positions, in the scenario's order.

    Returns
    -------
    wrench : Array, shape (6,)
        About the centre of gravity, N and N m.
    rate : Array, shape (9,)
    """
    positions = trimmed._replace(
        surface=trimmed.surface + moved[places.surface],
        tilt=trimmed.tilt + moved[places.tilt],
        speed=trimmed.speed + moved[places.speed],
    )
    velocity, rates, (phi, theta, psi) = state[:3], state[3:6], state[6:]
    mass = gyroscopic.spinning(parameters.airframe.effects["gyroscopic"], parameters.mass)
    centre = multibody.centre_of_gravity(mass, positions.tilt)
    turned = attitude.from_euler(phi, theta, psi)
    body = BodyState(
        jnp.stack([0.0, 0.0, -HEIGHT - around.ground]), turned, velocity - cross(rates, centre), rates
    )
    aero = airframe.wrench(parameters.airframe, relative_flow(body, around), positions)
    still = jnp.zeros_like(positions.tilt)
    inner = Configuration(positions.tilt, still, positions.speed)
    origin, turning = rigid_body.accelerations(
        mass, inner, Configuration(still, still, jnp.zeros_like(positions.speed)), body, aero.wrench
    )
    q_sin_r_cos = rates[1] * jnp.sin(phi) + rates[2] * jnp.cos(phi)
    angles = jnp.stack(
        [
            rates[0] + jnp.tan(theta) * q_sin_r_cos,
            rates[1] * jnp.cos(phi) - rates[2] * jnp.sin(phi),
            q_sin_r_cos / jnp.cos(theta),
        ]
    )
    moment = aero.wrench.moment - cross(centre, aero.wrench.force)
    return (
        jnp.concatenate([aero.wrench.force, moment]),
        jnp.concatenate([origin + cross(turning, centre), turning, angles]),
    )


@jax.jit
def _derivatives(
    parameters: motion.Parameters,
    trimmed: Positions,
    around: Surroundings,
    places: Commands,
    state: jax.Array,
    moved: jax.Array,
) -> tuple[tuple[jax.Array, jax.Array], tuple[jax.Array, jax.Array], jax.Array]:
    """Return the derivatives of wrench and rate by the state, and by the positions; and the centre."""
    of = partial(small_motion, parameters, trimmed, around, places)
    (wrench_x, wrench_d), (rate_x, rate_d) = jax.jacfwd(of, argnums=(0, 1))(state, moved)
    centre = multibody.centre_of_gravity(parameters.mass, trimmed.tilt)
    return (wrench_x, rate_x), (wrench_d, rate_d), centre
