"""A load that the description lacks: mass with the centre of gravity and the inertia that go with it."""

from __future__ import annotations

from collections.abc import Mapping

from freqid.core.vehicle import Vehicle
from freqid.simulate.effects import cg_offset, inertia, mass
from freqid.simulate.effects.effect import Effect, Parameter

_PARTS = (mass.EFFECT, cg_offset.EFFECT, inertia.EFFECT)


def _load(settings: Mapping[str, float], vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with all its mass properties changed, inertia about its own centre of gravity."""
    for part in _PARTS:
        if part.load is not None:
            vehicle = part.load({name: settings[name] for name in part.parameters}, vehicle)
    return vehicle


def _for_vehicle(vehicle: Vehicle) -> dict[str, Parameter]:
    """Return the parameters with the scales of the single effects."""
    return {name: p for part in _PARTS for name, p in part.of(vehicle).parameters.items()}


EFFECT = Effect(
    id="mass_properties",
    stage="mass",
    meaning="Mass, centre of gravity and inertia are off together, as with a load that is not described.",
    parameters={name: p for part in _PARTS for name, p in part.parameters.items()},
    together=True,
    load=_load,
    for_vehicle=_for_vehicle,
)
