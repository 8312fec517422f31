"""What every tuning case draws within the tolerances that a diagnosis states, for each flight or for all."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from freqid.core.vehicle import Vehicle
from freqid.gap.model.tolerance import DEFAULT, EACH_FLIGHT, TIMING
from freqid.simulate.effects.effect import Effect

Settings = dict[str, dict[str, float]]

MASS = ("mass", "cg_offset", "inertia")


def drawn(
    library: Mapping[str, Effect], vehicle: Vehicle | None, clock: float, rng: np.random.Generator
) -> Settings:
    """Return departures of mass, sensors and timing that all flights of a case share, by effect.

    Parameters
    ----------
    library : dict of Effect
    vehicle : Vehicle or None
        For parameters by effector.
    clock : float
        One sigma of timing, s.
    rng : Generator
    """
    found: Settings = {}
    sigmas = {**DEFAULT, **dict.fromkeys(TIMING, clock)}
    for identifier, sigma in sigmas.items():
        effect = library[identifier]
        if effect.stage == "command":
            continue  # how commands become late differs between the two simulations
        named = {n: p for n, p in effect.of(vehicle).parameters.items() if p.scale and n in effect.parameters}
        found[identifier] = {n: float(sigma * rng.standard_normal()) for n in named}
    return found


def drawn_for_a_flight(rng: np.random.Generator) -> Settings:
    """Return offsets of sensors and a steady wind, another in each flight."""
    found: Settings = {}
    for name, sigma in EACH_FLIGHT.items():
        effect, _, parameter = name.partition(".")
        found.setdefault(effect, {})[parameter] = float(sigma * rng.standard_normal())
    return found


def added(*several: Mapping[str, Mapping[str, float]]) -> Settings:
    """Return settings that act together."""
    found: Settings = {}
    for one in several:
        for effect, values in one.items():
            mine = found.setdefault(effect, {})
            for name, value in values.items():
                mine[name] = mine.get(name, 0.0) + value
    return found
