"""A centre of gravity that is not where the description has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace as changed

import numpy as np
from msgspec.structs import replace

from freqid.core.vehicle import Vehicle
from freqid.simulate.effects.effect import Effect, Parameter

_SHARE = 0.03  # of the chord, that a weighing with a load of unknown place leaves


def _load(settings: Mapping[str, float], vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with its centre of gravity moved; the inertia about it stays."""
    stated = vehicle.mass_properties
    place = np.add(stated.cg_m, [settings[axis] for axis in "xyz"])
    moved = replace(stated, cg_m=tuple(float(x) for x in place))
    return replace(vehicle, mass_properties=moved)


def _for_vehicle(vehicle: Vehicle) -> dict[str, Parameter]:
    """Return the parameters with a scale that goes with the chord."""
    if vehicle.chord_m is None:
        return {}
    return {name: changed(p, scale=_SHARE * vehicle.chord_m) for name, p in EFFECT.parameters.items()}


EFFECT = Effect(
    id="cg_offset",
    stage="mass",
    meaning="The centre of gravity is not where it is described.",
    parameters={
        "x": Parameter(
            0.0,
            "m",
            "forward of the described one; scale 3 % of the chord",
            0.01,
            signs=(
                "The centre of gravity is farther forward than it is described",
                "The centre of gravity is farther aft than it is described",
            ),
        ),
        "y": Parameter(
            0.0,
            "m",
            "to the right of it",
            0.01,
            signs=(
                "The centre of gravity is farther to the right than it is described",
                "The centre of gravity is farther to the left than it is described",
            ),
        ),
        "z": Parameter(
            0.0,
            "m",
            "below it",
            0.01,
            signs=(
                "The centre of gravity is lower than it is described",
                "The centre of gravity is higher than it is described",
            ),
        ),
    },
    load=_load,
    for_vehicle=_for_vehicle,
)
