"""Control surfaces that do less than their deflection says: gaps, flexing, ice, damage."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import numpy as np
from numpy.typing import NDArray

from freqid.core.vehicle import Vehicle
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.effects.places import spread

Signals = dict[str, NDArray[np.float64]]


def effective_deflections(settings: dict[str, jax.Array], order: jax.Array, surface: jax.Array) -> jax.Array:
    """Return the deflections that the air feels, rad, shape (surface,); `order` as in `places.spread`."""
    return (1 - spread(settings, "loss", order)) * surface


def _feel(settings: Mapping[str, float], signals: Signals, dt: float, kinds: dict[str, str]) -> Signals:
    """Return the deflections that the air feels of the measured ones."""
    del dt
    found = dict(signals)
    for name in (n for n in signals if kinds.get(n) == "surface"):
        loss = settings["loss"] + settings.get(name, 0.0)
        found[name] = (1 - loss) * signals[name]
    return found


def _for_vehicle(vehicle: Vehicle) -> dict[str, Parameter]:
    """Return a loss for each surface."""
    names = [e.name for e in vehicle.effectors if e.kind == "surface"]
    return {
        n: Parameter(0.0, "1", f"share of the deflection of {n} that is lost", 0.15, -1.0, 1.0) for n in names
    }


EFFECT = Effect(
    id="surface_effectiveness",
    stage="command",
    meaning="The air feels less of a control surface than its measured deflection.",
    parameters={
        "loss": Parameter(
            0.0,
            "1",
            "share of every surface's deflection that is lost",
            0.1,
            -1.0,
            1.0,
            signs=(
                "The air feels less of a control surface than its measured deflection",
                "The air feels more of a control surface than its measured deflection",
            ),
        )
    },
    needs=("surface", "effector"),
    alternatives=True,
    feel=_feel,
    for_vehicle=_for_vehicle,
)
