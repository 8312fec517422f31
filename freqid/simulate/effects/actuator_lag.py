"""The time that the servos of the control surfaces take to follow."""

from __future__ import annotations

import jax

from .effect import Effect, Parameter

EFFECT = Effect(
    id="actuator_lag",
    stage="command",
    meaning="A control surface follows its command with the dynamics of its servo.",
    parameters={"strength": Parameter(1.0, "1", "share of the distance between command and servo")},
    needs=("simulation.actuators.surface",),
    states={"position": "rad", "rate": "rad/s"},
)


def position(settings: dict[str, jax.Array], servo: jax.Array, command: jax.Array) -> jax.Array:
    """Return where surfaces are, rad, shape (surface,): at their servos, or ahead of them by command."""
    return command + settings["strength"] * (servo - command)
