"""The time that the circulation about a wing takes to follow its angle of attack."""

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

_SLOPE = 4.5  # per rad: lift curve of a wing of usual aspect ratio
_STILL = 0.01  # m2/s2
# A flight follows a shorter lag by a share of this one, which agrees in the first order of the lag and
# keeps the integration stable down to no lag at all.
_SHORTEST = 0.01  # s


def _force(velocity: Any, rho: Any, area: Any) -> Any:
    """Return the normal force of wings in steady flow, N, positive down: proportional to V w."""
    speed = ((velocity**2).sum(0) + _STILL) ** 0.5
    return -0.5 * _SLOPE * rho * area * speed * velocity[2]


def _now(situation: Any) -> jax.Array:
    flow = situation.flow
    return _force(flow.velocity, flow.rho, situation.parameters.geometry.area)


def _start(settings: dict[str, jax.Array], situation: Any) -> dict[str, jax.Array]:
    del settings
    return {"force": _now(situation)}


def _rate(settings: dict[str, jax.Array], situation: Any) -> dict[str, jax.Array]:
    late = _now(situation) - situation.memory["force"]
    return {"force": late / jnp.maximum(settings["time_constant"], _SHORTEST)}


def _add(settings: dict[str, jax.Array], situation: Any) -> Wrench:
    share = jnp.clip(settings["time_constant"] / _SHORTEST, 0.0, 1.0)
    missing = share * (situation.memory["force"] - _now(situation))
    force = jnp.stack([0 * missing, 0 * missing, missing])
    return Wrench.of(force, situation.parameters.geometry.centre)


def _replay(settings: Mapping[str, float], replay: Any) -> NDArray[Any]:
    record, vehicle = replay.record, replay.vehicle
    steady = _force(along.velocity(record), record["air/rho"], vehicle.area_m2)
    missing = replay.lagged(steady, settings["time_constant"]) - steady
    force = np.stack([0 * missing, 0 * missing, missing])
    return along.wrench(replay, force, vehicle.mass_properties.cg_m)


EFFECT = Effect(
    id="unsteady_lift",
    stage="airframe",
    meaning="Lift follows the angle of attack after a first-order lag.",
    parameters={
        "time_constant": Parameter(0.0, "s", "of the lag; about two chords travelled", 0.05, 0.0, 2.0)
    },
    needs=("wing or surface", "vehicle.area_m2", "state/u", "state/v", "state/w", "air/rho"),
    states={"force": "N"},
    add=_add,
    start=_start,
    rate=_rate,
    replay=_replay,
)
