"""The time that the servos of surfaces and the tilt drives take to follow."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import numpy as np
from numpy.typing import NDArray

from freqid.core.vehicle import Vehicle
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.effects.places import one_each
from freqid.simulate.effects.signals import lagged

Signals = dict[str, NDArray[np.float64]]

_KINDS = ("surface", "tilt")


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
        name: lagged(x, dt, settings["extra"] + settings.get(name, 0.0)) if kinds.get(name) in _KINDS else x
        for name, x in signals.items()
    }


def _for_vehicle(vehicle: Vehicle) -> dict[str, Parameter]:
    """Return a time constant for each surface and tilt drive."""
    return one_each(vehicle, EFFECT.parameters["extra"], _KINDS)


EFFECT = Effect(
    id="actuator_lag",
    stage="command",
    meaning="A control surface or a tilting wing follows its command with the dynamics of its servo.",
    parameters={
        "extra": Parameter(
            0.0,
            "s",
            "time constant of a first-order lag that no one described",
            0.03,
            0.0,
            0.5,
            signs=(
                "A control surface or a tilting wing follows its command later than described",
                "A control surface or a tilting wing follows its command sooner than described",
            ),
        ),
        "strength": Parameter(1.0, "1", "share of the distance between command and described servo", 0.0),
    },
    needs=("command",),
    states={"surface": "rad", "tilt": "rad"},
    alternatives=True,
    in_loop=True,
    act=_act,
    for_vehicle=_for_vehicle,
)
