"""The front wing's wake at the rear wing, and both wings' wakes at the tail."""

from __future__ import annotations

import jax

from ..quantities import Wake
from .effect import Effect, Parameter

EFFECT = Effect(
    id="wing_wake",
    stage="airframe",
    meaning="The wake of a wing and its rotors turns and blows the flow at what lies behind it.",
    parameters={"strength": Parameter(1.0, "1", "share of the wake's velocity that is felt")},
    needs=("wing", "simulation.airframe.wake"),
    states={"downwash": "m/s", "blowing": "m/s"},
)


def received(settings: dict[str, jax.Array], wake: Wake) -> Wake:
    """Return the wake as it is felt."""
    return Wake(settings["strength"] * wake.downwash, settings["strength"] * wake.blowing)
