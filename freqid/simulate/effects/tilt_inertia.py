"""How much of the vehicle's mass and inertia goes with its tilting wings."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec.structs import replace

from freqid.core.vehicle import Vehicle, Wing
from freqid.simulate.effects.effect import Effect, Parameter


def _load(settings: Mapping[str, float], vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with more mass in its wings; as a whole it stays what it is as it was weighed.

    At a fraction of -1 nothing tilts: centre of gravity and inertia stay those of the weighing.
    """
    more = 1 + settings["fraction"]

    def heavier(wing: Wing) -> Wing:
        own = wing.inertia
        scaled = {name: more * getattr(own, name) for name in own.__struct_fields__}
        return replace(wing, mass_kg=more * wing.mass_kg, inertia=replace(own, **scaled))

    return replace(vehicle, wings=tuple(heavier(wing) for wing in vehicle.wings))


EFFECT = Effect(
    id="tilt_inertia",
    stage="mass",
    meaning="The wings carry more or less of the vehicle's mass along when they tilt than is described.",
    parameters={
        "fraction": Parameter(
            0.0,
            "1",
            "of the wings' described mass and inertia on top",
            0.1,
            -1.0,
            1.0,
            signs=(
                "The wings carry more of the vehicle's mass along when they tilt than is described",
                "The wings carry less of the vehicle's mass along when they tilt than is described",
            ),
        )
    },
    needs=("wing",),
    load=_load,
)
