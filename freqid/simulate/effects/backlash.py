"""Play in the linkage between a servo and its surface."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from freqid.core.vehicle import Vehicle
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.effects.places import one_each

Signals = dict[str, NDArray[np.float64]]


def dragged(settings: dict[str, jax.Array], surface: jax.Array, servo: jax.Array) -> jax.Array:
    """Return where surfaces are, rad, shape (surface,): where they were, unless the servo drags them."""
    half = settings["width"] / 2
    return jnp.clip(surface, servo - half, servo + half)


def _feel(settings: Mapping[str, float], signals: Signals, dt: float, kinds: dict[str, str]) -> Signals:
    """Return the positions of surfaces that are dragged by the measured ones of their servos."""
    del dt
    found = dict(signals)
    for name in (n for n in signals if kinds.get(n) == "surface"):
        half = (settings["width"] + settings.get(name, 0.0)) / 2
        if half > 0:
            found[name] = _played(signals[name], half)
    return found


def _for_vehicle(vehicle: Vehicle) -> dict[str, Parameter]:
    """Return a play for each surface."""
    return one_each(vehicle, EFFECT.parameters["width"], ("surface",))


def _played(values: NDArray[np.float64], half: float) -> NDArray[np.float64]:
    found, at = np.empty_like(values), float(values[0])
    for i, servo in enumerate(values.tolist()):
        at = min(max(at, servo - half), servo + half)
        found[i] = at
    return found


EFFECT = Effect(
    id="backlash",
    stage="command",
    meaning="A surface rests inside the play of its linkage until the servo drags it along.",
    parameters={"width": Parameter(0.0, "rad", "of the play, from one side to the other", 0.02, 0.0, 0.5)},
    needs=("surface", "effector"),
    states={"surface": "rad"},
    alternatives=True,
    sizes=(0.0005, 0.001, 0.002, 0.004, 0.008, 0.016, 0.05),
    feel=_feel,
    for_vehicle=_for_vehicle,
)
