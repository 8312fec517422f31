"""A propeller that thrusts less at its speed than the others: worn, nicked or badly set."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import numpy as np
from numpy.typing import NDArray

from freqid.core.vehicle import Vehicle
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.effects.places import spread

Signals = dict[str, NDArray[np.float64]]


def sound_speeds(settings: dict[str, jax.Array], order: jax.Array, speed: jax.Array) -> jax.Array:
    """Return the speeds at which sound propellers would do what these do, rad/s, shape (rotor,).

    Thrust goes with the square of the speed, so half of the loss: 0.25 takes 23 %, and 1 leaves a rotor that
    still turns. `order` as in `places.spread`.
    """
    return (1 - spread(settings, "loss", order) / 2) * speed


def _feel(settings: Mapping[str, float], signals: Signals, dt: float, kinds: dict[str, str]) -> Signals:
    """Return the speeds of sound propellers that would do what these do at the measured ones."""
    del dt
    found = dict(signals)
    for name in (n for n in signals if kinds.get(n) == "rotor"):
        loss = settings["loss"] + settings.get(name, 0.0)
        found[name] = (1 - loss / 2) * signals[name]
    return found


def _for_vehicle(vehicle: Vehicle) -> dict[str, Parameter]:
    """Return a loss for each rotor."""
    names = [e.name for e in vehicle.effectors if e.kind == "rotor"]
    return {n: Parameter(0.0, "1", f"share of the thrust of {n} that is lost", 0.1, -1.0, 1.0) for n in names}


EFFECT = Effect(
    id="weak_rotor",
    stage="airframe",
    meaning="A propeller thrusts less than its measured speed says.",
    parameters={
        "loss": Parameter(
            0.0,
            "1",
            "share of every rotor's thrust that is lost",
            0.05,
            -1.0,
            1.0,
            signs=(
                "A propeller thrusts less than its measured speed says",
                "A propeller thrusts more than its measured speed says",
            ),
        )
    },
    needs=("rotor", "effector"),
    alternatives=True,
    feel=_feel,
    for_vehicle=_for_vehicle,
)
