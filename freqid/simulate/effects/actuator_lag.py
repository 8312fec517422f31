"""The time that the servos of surfaces and the tilt drives take to follow."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import numpy as np
from numpy.typing import NDArray

from .effect import Effect, Parameter
from .signals import lagged

Signals = dict[str, NDArray[np.float64]]


def position(settings: dict[str, jax.Array], servo: jax.Array, command: jax.Array) -> jax.Array:
    """Return where surfaces are, rad, shape (surface,): at their servos, or ahead of them by command."""
    return command + settings["strength"] * (servo - command)


def behind(time_constant: jax.Array, command: jax.Array, before: jax.Array, dt: float) -> jax.Array:
    """Return the command after a first-order lag, rad or rad/s, shape (effector,).

    Parameters
    ----------
    time_constant : Array, shape ()
        s.
    command, before : Array, shape (effector,)
        What comes in, held over a step, and what came out in the step before.
    dt : float
        Step, s.

    Notes
    -----
    By the implicit Euler rule, whose delay at low frequency is the time constant at any step, and which
    passes into no lag at all smoothly.
    """
    return before + dt / (dt + time_constant) * (command - before)


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
