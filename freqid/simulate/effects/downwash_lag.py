"""The time that the wings' downwash takes to reach the tail."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from freqid.simulate.effects import along
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.loads.quantities import Wrench

_SHORTEST = 0.01  # s
_STILL = 0.01  # m2/s2


def _force(strength: Any, ahead: Any, velocity: Any, rho: Any, area: Any) -> Any:
    """Return the force on the tail, N, positive down, by how far w is ahead of its lag, m/s.

    Downwash that has not arrived yet lifts the tail: ``-strength rho S V (w - w_late) / 2``.

    References
    ----------
    Klein & Morelli, Aircraft System Identification, 2nd ed., section 3 (the derivatives by alpha dot).
    """
    speed = ((velocity**2).sum(0) + _STILL) ** 0.5
    return -0.5 * strength * rho * area * speed * ahead


def _start(settings: dict[str, jax.Array], situation: Any) -> dict[str, jax.Array]:
    del settings
    return {"w": situation.flow.velocity[2]}


def _rate(settings: dict[str, jax.Array], situation: Any) -> dict[str, jax.Array]:
    ahead = situation.flow.velocity[2] - situation.memory["w"]
    return {"w": ahead / jnp.maximum(settings["delay"], _SHORTEST)}


def _add(settings: dict[str, jax.Array], situation: Any) -> Wrench:
    geometry, flow = situation.parameters.geometry, situation.flow
    ahead = flow.velocity[2] - situation.memory["w"]
    down = _force(settings["strength"], ahead, flow.velocity, flow.rho, geometry.area)
    force = jnp.stack([0 * down, 0 * down, down])
    behind = jnp.stack([settings["arm"] * geometry.chord, 0.0 * down, 0.0 * down])
    return Wrench.of(force, geometry.centre - behind)


def _replay(settings: Mapping[str, float], replay: Any) -> NDArray[Any]:
    record, vehicle = replay.record, replay.vehicle
    velocity = along.velocity(record)
    ahead = velocity[2] - replay.lagged(velocity[2], max(settings["delay"], _SHORTEST))
    down = _force(settings["strength"], ahead, velocity, record["air/rho"], vehicle.area_m2)
    place = np.array(vehicle.mass_properties.cg_m) - [settings["arm"] * vehicle.chord_m, 0.0, 0.0]
    return along.wrench(replay, np.stack([0 * down, 0 * down, down]), place)


EFFECT = Effect(
    id="downwash_lag",
    stage="airframe",
    meaning="The wings' downwash reaches the tail late.",
    parameters={
        "strength": Parameter(
            0.0,
            "1",
            "tail's lift slope times its share of the area times downwash over angle of attack",
            0.2,
            0.0,
        ),
        "delay": Parameter(0.1, "s", "time constant of the downwash", 0.05, _SHORTEST, 1.0),
        "arm": Parameter(3.0, "1", "distance of the tail behind the centre of gravity, over the chord", 0.0),
    },
    needs=(
        "wing or surface",
        "vehicle.area_m2",
        "vehicle.chord_m",
        "state/u",
        "state/v",
        "state/w",
        "air/rho",
    ),
    states={"w": "m/s"},
    add=_add,
    start=_start,
    rate=_rate,
    replay=_replay,
)
