"""The dead time between a command and its arrival at the actuator."""

from __future__ import annotations

import jax

from ..actuators import Commands
from .effect import Effect, Parameter

EFFECT = Effect(
    id="actuator_delay",
    stage="command",
    meaning="Commands reach servos, tilt drives and motors late.",
    parameters={"strength": Parameter(1.0, "1", "factor of the delays of [simulation.actuators]")},
    needs=("simulation.actuators",),
    states={"command": "rad or rad/s"},
)


def delays(settings: dict[str, jax.Array], described: Commands) -> Commands:
    """Return the delay of each kind of command, s."""
    return Commands(*(settings["strength"] * delay for delay in described))
