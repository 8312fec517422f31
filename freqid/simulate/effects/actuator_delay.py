"""The dead time between a command and its arrival at the actuator."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import numpy as np
from numpy.typing import NDArray

from ..actuators import Commands
from .effect import Effect, Parameter
from .signals import delayed

Signals = dict[str, NDArray[np.float64]]


def delays(settings: dict[str, jax.Array], described: Commands) -> Commands:
    """Return the delay of each kind of command, s."""
    return Commands(*(settings["strength"] * delay + settings["extra"] for delay in described))


def _act(settings: Mapping[str, float], signals: Signals, dt: float, kinds: dict[str, str]) -> Signals:
    """Return the positions late by what no description says; linear actuators pass a delay on."""
    del kinds
    return {name: delayed(values, dt, settings["extra"]) for name, values in signals.items()}


EFFECT = Effect(
    id="actuator_delay",
    stage="command",
    meaning="Commands reach servos, tilt drives and motors late.",
    parameters={
        "extra": Parameter(0.0, "s", "delay beyond those that are described", 0.02, -0.1, 0.1),
        "strength": Parameter(1.0, "1", "factor of the delays of [simulation.actuators]", 0.0),
    },
    needs=("command",),
    states={"command": "rad or rad/s"},
    act=_act,
)
