"""What a falling battery voltage takes from the rotors' speed."""

from __future__ import annotations

import jax

from .effect import Effect, Parameter

EFFECT = Effect(
    id="battery_sag",
    stage="command",
    meaning="A motor turns as fast as the voltage lets it: less under load and less as the battery empties.",
    parameters={"strength": Parameter(1.0, "1", "share of the change from the nominal voltage")},
    needs=("simulation.actuators.battery",),
    states={"charge": "1"},
)


def voltage_ratio(settings: dict[str, jax.Array], voltage: jax.Array, nominal: jax.Array) -> jax.Array:
    """Return the voltage that the motors feel over the nominal one."""
    return 1 + settings["strength"] * (voltage / nominal - 1)
