"""What propellers do across their shafts in oblique flow: in-plane force and P-factor."""

from __future__ import annotations

import jax

from ..propeller import Discs
from .effect import Effect, Parameter

EFFECT = Effect(
    id="rotor_inplane_force",
    stage="airframe",
    meaning="A propeller in oblique flow is pushed along with it and thrusts more on its advancing side.",
    parameters={"strength": Parameter(1.0, "1", "share of the in-plane force and hub moment")},
    needs=("rotor", "simulation.airframe.propeller"),
)


def loads(settings: dict[str, jax.Array], discs: Discs) -> tuple[jax.Array, jax.Array]:
    """Return the in-plane force and the hub moment of each rotor, shape (rotor, 3), N and N m."""
    return settings["strength"] * discs.inplane_force, settings["strength"] * discs.hub_moment
