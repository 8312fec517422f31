"""What the simulation's actuators make of a record's commands."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from freqid.simulate.actuators import Actuators, Commands, motor_acceleration, servo_acceleration
from freqid.simulate.effects import actuator_lag
from freqid.simulate.integrate import rk4

Array = NDArray[np.float64]

STEP = 0.005  # s, of the integration; as in flight
_LEG = 1000  # steps that are compiled into one loop


class Driven(NamedTuple):
    """What moves: positions and rates of servos and tilt drives, speeds of rotors; rad, rad/s."""

    surface: jax.Array
    surface_rate: jax.Array
    tilt: jax.Array
    tilt_rate: jax.Array
    speed: jax.Array


def follow(
    actuators: Actuators, lag: dict[str, Array], arriving: Commands, ratio: Array, start: Commands
) -> Commands:
    """Return the positions at every step.

    Parameters
    ----------
    actuators : Actuators
    lag : dict of Array
        Settings of effect ``actuator_lag``.
    arriving : Commands of ndarray, shape (step, ...)
        As they reach the actuators; held over each step.
    ratio : ndarray, shape (step + 1,)
        Voltage over nominal voltage; straight over each step.
    start : Commands
        Positions at the first step, at rest.

    Returns
    -------
    Commands of ndarray, shape (step, ...)
        At the start of every step.
    """
    still = [jnp.zeros_like(x) for x in (start.surface, start.tilt)]
    carry = Driven(
        jnp.asarray(start.surface), still[0], jnp.asarray(start.tilt), still[1], jnp.asarray(start.speed)
    )
    count, legs = len(ratio) - 1, []
    schedule = (arriving, ratio[:-1], ratio[1:])
    for first in range(0, count, _LEG):
        now = jax.tree.map(lambda x: _leg(x, first), schedule)  # noqa: B023  used at once
        found, carry = _followed(actuators, lag, carry, now)
        legs.append(jax.tree.map(np.asarray, found))
    return jax.tree.map(lambda *x: np.concatenate(x)[:count], *legs)


def _leg(values: Array, first: int) -> Array:
    piece = np.asarray(values[first : first + _LEG])
    short = _LEG - len(piece)
    return np.concatenate([piece, np.repeat(piece[-1:], short, axis=0)]) if short else piece


@jax.jit
def _followed(actuators: Actuators, lag: dict[str, jax.Array], carry: Driven, schedule):
    def step(driven: Driven, now):
        commands, before, after = now

        def rate(x: Driven, elapsed: jax.Array) -> Driven:
            ratio = before + (after - before) * elapsed / STEP
            return Driven(
                x.surface_rate,
                servo_acceleration(actuators.surface, x.surface, x.surface_rate, commands.surface),
                x.tilt_rate,
                servo_acceleration(actuators.tilt, x.tilt, x.tilt_rate, commands.tilt),
                motor_acceleration(actuators.motor, x.speed, commands.speed, ratio),
            )

        surface = actuator_lag.position(lag, driven.surface, commands.surface)
        return rk4(rate, driven, STEP), Commands(surface, driven.tilt, driven.speed)

    carry, found = jax.lax.scan(step, carry, schedule)
    return found, carry
