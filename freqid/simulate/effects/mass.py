"""A vehicle that is heavier than its description."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec.structs import replace

from freqid.core.vehicle import Vehicle
from freqid.simulate.effects.effect import Effect, Parameter


def _load(settings: Mapping[str, float], vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with its mass changed and nothing else: the change sits at its centre of gravity."""
    stated = vehicle.mass_properties
    heavier = replace(stated, mass_kg=(1 + settings["fraction"]) * stated.mass_kg)
    return replace(vehicle, mass_properties=heavier)


EFFECT = Effect(
    id="mass",
    stage="mass",
    meaning="The vehicle is heavier or lighter than it is described.",
    parameters={
        "fraction": Parameter(
            0.0,
            "1",
            "of the described mass that comes on top",
            0.05,
            -0.5,
            1.0,
            signs=(
                "The vehicle is heavier than it is described",
                "The vehicle is lighter than it is described",
            ),
        )
    },
    load=_load,
)
