"""The highest rate at which a servo moves its surface."""

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

_FASTEST = 1e9  # rad/s, in place of no limit at all


def limits(settings: dict[str, jax.Array], described: jax.Array) -> jax.Array:
    """Return the rate limits of servos, rad/s, shape (surface,): the described ones or this one."""
    return jnp.minimum(described, 1 / jnp.maximum(settings["slowness"], 1 / _FASTEST))


def _act(settings: Mapping[str, float], signals: Signals, dt: float, kinds: dict[str, str]) -> Signals:
    """Return the positions of surfaces that chase the described ones no faster than the limit."""
    found = dict(signals)
    for name in (n for n in signals if kinds.get(n) == "surface"):
        slowness = settings["slowness"] + settings.get(name, 0.0)
        if slowness > 0:
            found[name] = _chased(signals[name], dt / slowness)
    return found


def _for_vehicle(vehicle: Vehicle) -> dict[str, Parameter]:
    """Return a limit for each surface."""
    return one_each(vehicle, EFFECT.parameters["slowness"], ("surface",))


def _chased(values: NDArray[np.float64], most: float) -> NDArray[np.float64]:
    if np.abs(np.diff(values)).max(initial=0.0) <= most:
        return values
    found, at = np.empty_like(values), float(values[0])
    for i, aim in enumerate(values.tolist()):
        at += min(max(aim - at, -most), most)
        found[i] = at
    return found


EFFECT = Effect(
    id="rate_limit",
    stage="command",
    meaning="A servo moves its surface no faster than a limit.",
    parameters={
        "slowness": Parameter(0.0, "s/rad", "one over the limit; 2 s/rad is 0.5 rad/s", 2.0, 0.0, 100.0)
    },
    needs=("command", "surface"),
    alternatives=True,
    sizes=(0.25, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 8.0, 16.0, 32.0),
    in_loop=True,
    act=_act,
    for_vehicle=_for_vehicle,
)
