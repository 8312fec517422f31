"""The propellers' slipstreams over the wing that carries them."""

from __future__ import annotations

import jax

from ..propeller import Discs
from ..slipstream import Slipstreams, added_velocity
from .effect import Effect, Parameter

EFFECT = Effect(
    id="slipstream",
    stage="airframe",
    meaning="Propellers accelerate the air over the wing strips behind them.",
    parameters={"strength": Parameter(1.0, "1", "share of the added velocity that the strips feel")},
    needs=("rotor", "wing", "simulation.airframe.slipstream"),
)


def over_wing(
    settings: dict[str, jax.Array], slipstreams: Slipstreams, discs: Discs, rho: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Return what `slipstream.added_velocity` does, the velocity over the strips scaled."""
    added, at_disc = added_velocity(slipstreams, discs, rho)
    return settings["strength"] * added, at_disc
