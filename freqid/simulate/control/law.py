"""The control law that keeps an unstable vehicle at its trim while it is excited.

State feedback with integral action asks for a wrench; an allocation shares it among all surfaces and
rotors; trim, gains and allocation are straight in forward speed between the corridor's conditions. It
plays the role of the Robust Uniform Control law of the LA-8 class aircraft (Cook and Gregory, VFS
Autonomous VTOL Technical Meeting, 2021): excitations are added after it, at the actuators' commands.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from freqid.simulate.motion import attitude
from freqid.simulate.motion.actuators import Commands
from freqid.simulate.motion.rigid_body import BodyState

AXES = ("X", "Z", "L", "M", "N")  # of the wrench that is asked for by default; side force comes by rolling


class Setting(NamedTuple):
    """The law at one condition; in `Law` every field has a knot axis in front.

    Attributes
    ----------
    commands : Commands
        Of the trim.
    state : Array, shape (9,)
        Trim in the order of `linearize.STATES`, velocity of the centre of gravity.
    centre : Array, shape (3,)
        Centre of gravity, vehicle axes, m.
    gain : Array, shape (axis, 13)
        From states and integrals to the wrench asked for, N and N m; with stated gains, an axis is an
        effector.
    surface, speed : Array, shape (effector, axis)
        Allocation, rad and rad/s per N and N m.
    """

    commands: Commands
    state: jax.Array
    centre: jax.Array
    gain: jax.Array
    surface: jax.Array
    speed: jax.Array


class Law(NamedTuple):
    """The control law along a corridor.

    Attributes
    ----------
    u : Array, shape (knot,)
        Forward speed of the conditions, increasing, m/s.
    settings : Setting of Array, shape (knot, ...)
    low, high : Commands
        What is commanded at most.
    """

    u: jax.Array
    settings: Setting
    low: Commands
    high: Commands

    @property
    def memory(self) -> jax.Array:
        """What the law remembers at the start of a flight, shape (memory,)."""
        return jnp.zeros((*self.u.shape[:-1], 3))

    def command(self, body: BodyState, memory: jax.Array, aim: Aim) -> tuple[Commands, jax.Array]:
        """Return commands and the rate of change of the memory, as the function of that name."""
        return command(self, body, memory, aim)


class Aim(NamedTuple):
    """What the law is to hold.

    Attributes
    ----------
    u : Array, shape ()
        Forward speed, m/s, which also sets trim, gains and tilts.
    altitude : Array, shape ()
        m.
    wind : Array, shape (3,)
        Mean wind, north, east, down, m/s: the vehicle holds its speed in it.
    """

    u: jax.Array
    altitude: jax.Array
    wind: jax.Array


def command(law: Law, body: BodyState, drift: jax.Array, aim: Aim) -> tuple[Commands, jax.Array]:
    """Return what the law commands, before any excitation, and the rate of change of its integrals.

    Parameters
    ----------
    law : Law
    body : BodyState
    drift : Array, shape (3,)
        Integrals of the deviations of u, v and psi.
    aim : Aim

    Returns
    -------
    commands : Commands
    drift_rate : Array, shape (3,)
    """
    weight = jax.vmap(lambda knot: jnp.interp(aim.u, law.u, knot))(jnp.eye(law.u.size))
    here = jax.tree.map(lambda table: jnp.tensordot(weight, table, axes=1), law.settings)
    velocity = (
        body.velocity - attitude.to_body(body.attitude, aim.wind) + attitude.cross(body.rates, here.centre)
    )
    state = jnp.concatenate([velocity, body.rates, attitude.euler(body.attitude)])
    off = state - here.state
    climbed = -body.position[2] - aim.altitude
    asked = -here.gain @ jnp.concatenate([off, drift[:2], climbed[None], drift[2:]])
    trimmed = here.commands
    wanted = Commands(
        trimmed.surface + here.surface @ asked, trimmed.tilt, trimmed.speed + here.speed @ asked
    )
    return jax.tree.map(jnp.clip, wanted, law.low, law.high), jnp.stack([off[0], off[1], off[8]])
