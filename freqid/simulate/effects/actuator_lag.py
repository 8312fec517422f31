"""The time that the servos of surfaces and the tilt drives take to follow."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from .effect import Effect, Parameter
from .signals import lagged

Signals = dict[str, NDArray[np.float64]]

# A flight follows a shorter lag by a share of this one, which agrees in the first order of the lag and
# keeps the integration stable down to no lag at all.
SHORTEST = 0.01  # s


def position(settings: dict[str, jax.Array], servo: jax.Array, command: jax.Array) -> jax.Array:
    """Return where surfaces are, rad, shape (surface,): at their servos, or ahead of them by command."""
    return command + settings["strength"] * (servo - command)


def behind(time_constant: jax.Array, command: jax.Array, memory: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the command after a first-order lag, and the rate of the lag's memory.

    Parameters
    ----------
    time_constant : Array, shape ()
        s.
    command, memory : Array, shape (effector,)
        rad or rad/s; what comes in, and what the lag holds.
    """
    share = jnp.clip(time_constant / SHORTEST, 0.0, 1.0)
    return command + share * (memory - command), (command - memory) / jnp.maximum(time_constant, SHORTEST)


def _act(settings: Mapping[str, float], signals: Signals, dt: float, kinds: dict[str, str]) -> Signals:
    """Return the positions of surfaces and tilts behind those that are described."""
    return {
        name: lagged(values, dt, settings["extra"]) if kinds.get(name) in ("surface", "tilt") else values
        for name, values in signals.items()
    }


EFFECT = Effect(
    id="actuator_lag",
    stage="command",
    meaning="A control surface or a tilting wing follows its command with the dynamics of its servo.",
    parameters={
        "extra": Parameter(
            0.0, "s", "time constant of a first-order lag that no one described", 0.03, 0.0, 1.0
        ),
        "strength": Parameter(1.0, "1", "share of the distance between command and described servo", 0.0),
    },
    needs=("command",),
    states={"surface": "rad", "tilt": "rad"},
    act=_act,
)
