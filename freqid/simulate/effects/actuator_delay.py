"""The dead time between a command and its arrival at the actuator."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import numpy as np
from numpy.typing import NDArray

from ...core.vehicle import Vehicle
from ..actuators import Commands
from .effect import Effect, Parameter
from .signals import delayed

Signals = dict[str, NDArray[np.float64]]


def delays(settings: dict[str, jax.Array], described: Commands) -> Commands:
    """Return the delay of each kind of command, s; flights delay all effectors of a kind alike."""
    return Commands(*(settings["strength"] * delay + settings["extra"] for delay in described))


def _act(settings: Mapping[str, float], signals: Signals, dt: float, kinds: dict[str, str]) -> Signals:
    """Return the positions late by what no description says; linear actuators pass a delay on."""
    del kinds
    return {n: delayed(x, dt, settings["extra"] + settings.get(n, 0.0)) for n, x in signals.items()}


def _for_vehicle(vehicle: Vehicle) -> dict[str, Parameter]:
    """Return a delay for each effector."""
    return {
        e.name: Parameter(0.0, "s", f"delay of {e.name} alone", 0.02, -0.1, 0.1) for e in vehicle.effectors
    }


def alone(settings: Mapping[str, float]) -> list[str]:
    """Return the effectors that have a delay of their own."""
    return [name for name, late in settings.items() if late and name not in EFFECT.parameters]


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
    alternatives=True,
    act=_act,
    for_vehicle=_for_vehicle,
)
