"""The dead time between a command and its arrival at the actuator."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import numpy as np
from numpy.typing import NDArray

from freqid.core.vehicle import Vehicle
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.effects.signals import delayed
from freqid.simulate.motion import delay_line
from freqid.simulate.motion.actuators import Commands

Signals = dict[str, NDArray[np.float64]]

_KINDS = ("surface", "tilt", "rotor")
"""In the order of `Commands`."""


def delays(settings: dict[str, jax.Array], described: Commands) -> Commands:
    """Return the delay of each kind of command, s; a flight delays all effectors of a kind alike."""
    extra = (settings["extra"] + settings.get(kind, 0.0) for kind in _KINDS)
    return Commands(*(settings["strength"] * d + e for d, e in zip(described, extra, strict=True)))


def arrived(settings: dict[str, jax.Array], described: Commands, sent: Commands, dt: float) -> Commands:
    """Return the commands that reach the actuators now.

    Parameters
    ----------
    settings : dict of Array
        Of this effect.
    described : Commands
        Delay of each kind, s.
    sent : Commands
        Lines of what was sent, the newest first, one entry a step.
    dt : float
        Step, s.
    """
    late = delays(settings, described)
    return Commands(*(delay_line.read(line, x / dt) for line, x in zip(sent, late, strict=True)))


def _act(settings: Mapping[str, float], signals: Signals, dt: float, kinds: dict[str, str]) -> Signals:
    """Return the positions late by what no description says; linear actuators pass a delay on."""

    def late(name: str) -> float:
        kind = kinds.get(name, "")
        of_kind = 0.0 if kind in signals else settings.get(kind, 0.0)  # of the one effector of that name
        return settings["extra"] + of_kind + settings.get(name, 0.0)

    return {n: delayed(x, dt, late(n)) for n, x in signals.items()}


def _for_vehicle(vehicle: Vehicle) -> dict[str, Parameter]:
    """Return a delay for each kind of effector, where there are several of it, and for each effector."""
    kinds = [e.kind for e in vehicle.effectors]
    several = {k: f"all of kind {k}" for k in _KINDS if kinds.count(k) > 1 and len(set(kinds)) > 1}
    places = {**several, **{e.name: f"{e.name} alone" for e in vehicle.effectors}}
    return {name: Parameter(0.0, "s", f"delay of {place}", 0.05, -0.1, 0.5) for name, place in places.items()}


EFFECT = Effect(
    id="actuator_delay",
    stage="command",
    meaning="Commands reach servos, tilt drives and motors late.",
    parameters={
        "extra": Parameter(
            0.0,
            "s",
            "delay beyond those that are described",
            0.05,
            -0.1,
            0.5,
            signs=(
                "Commands reach their actuators later than described",
                "Commands reach their actuators sooner than described",
            ),
        ),
        "strength": Parameter(1.0, "1", "factor of the delays of [simulation.actuators]", 0.0),
    },
    needs=("command",),
    states={"command": "rad or rad/s"},
    alternatives=True,
    jointly=_KINDS,
    in_loop=True,
    act=_act,
    for_vehicle=_for_vehicle,
)
