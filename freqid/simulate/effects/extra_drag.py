"""Drag that no one described: landing gear, payload, dirt."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
from numpy.typing import NDArray

from freqid.simulate.effects import along
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.loads.quantities import Wrench

_STILL = 1e-6  # m2/s2, keeps the derivative of the speed defined at rest


def _force(coefficient: Any, velocity: Any, rho: Any, area: Any) -> Any:
    """Return ``-rho V S CD / 2`` times the velocity, N, for one instant or a whole record."""
    speed = ((velocity**2).sum(0) + _STILL) ** 0.5
    return -0.5 * coefficient * rho * speed * area * velocity


def _add(settings: dict[str, jax.Array], situation: Any) -> Wrench:
    geometry, flow = situation.parameters.geometry, situation.flow
    force = _force(settings["coefficient"], flow.velocity, flow.rho, geometry.area)
    return Wrench.of(force, geometry.centre)


def _replay(settings: Mapping[str, float], replay: Any) -> NDArray[Any]:
    record, vehicle = replay.record, replay.vehicle
    force = _force(settings["coefficient"], along.velocity(record), record["air/rho"], vehicle.area_m2)
    return along.wrench(replay, force, vehicle.mass_properties.cg_m)


EFFECT = Effect(
    id="extra_drag",
    stage="airframe",
    meaning="The air holds the vehicle back more than described, at its centre of gravity.",
    parameters={
        "coefficient": Parameter(
            0.0,
            "1",
            "of that drag, on the reference area",
            0.02,
            -1.0,
            1.0,
            signs=(
                "The air holds the vehicle back more than described",
                "The air holds the vehicle back less than described",
            ),
        )
    },
    needs=("vehicle.area_m2", "state/u", "state/v", "state/w", "air/rho"),
    add=_add,
    replay=_replay,
)
