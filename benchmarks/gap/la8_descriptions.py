"""Truths that are another description of the LA-8 class aircraft."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np

from freqid.core.record import FlightRecord
from freqid.core.scenario import Scenario


def section(scenario: Scenario, name: str, change: Callable[[dict[str, Any]], dict[str, Any]]) -> Scenario:
    """Return a scenario with ``[simulation.<name>]`` changed."""
    simulation = scenario.simulation
    found = change(msgspec.json.decode(msgspec.json.encode(getattr(simulation, name))))
    return msgspec.structs.replace(scenario, simulation=msgspec.structs.replace(simulation, **{name: found}))


def times(table: dict[str, Any], path: str, factor: float | tuple[float, ...]) -> dict[str, Any]:
    """Multiply one number of a table, or those of a list."""
    *way, last = path.split(".")
    at = table
    for name in way:
        at = at[name]
    old = at[last]
    at[last] = np.multiply(old, factor).tolist() if isinstance(old, list) else float(old * np.mean(factor))
    return table


def damped_servos(scenario: Scenario, size: float, place: str) -> Scenario:
    """Return an aircraft with servos damped more: as late as by a first-order lag of `size`, s."""
    del place

    def change(table: dict[str, Any]) -> dict[str, Any]:
        for kind in ("surface", "tilt"):
            table[kind]["damping"] += np.pi * table[kind]["frequency_hz"] * size
        return table

    return section(scenario, "actuators", change)


def slow_motors(scenario: Scenario, size: float, place: str) -> Scenario:
    """Return motors with longer time constants, in place of a lag before them."""
    del place

    def change(table: dict[str, Any]) -> dict[str, Any]:
        table["motor"]["rise_s"] += size
        table["motor"]["fall_s"] += size
        return table

    return section(scenario, "actuators", change)


def limits_apart(scenario: Scenario, size: float, place: str) -> Scenario:
    """Another rate limit for each surface, about ``1 / size``."""
    del place
    factors = iter(np.linspace(0.7, 1.3, 10))
    effectors = tuple(
        msgspec.structs.replace(e, rate_limit=min(e.rate_limit or np.inf, 1 / (size * next(factors))))
        if e.kind == "surface"
        else e
        for e in scenario.effector
    )
    return msgspec.structs.replace(scenario, effector=effectors)


def cut_surface(scenario: Scenario, size: float, place: str) -> Scenario:
    """Return an aircraft with a surface that has lost its inner end, not a share of its deflection."""

    def change(table: dict[str, Any]) -> dict[str, Any]:
        for surface in table["surface"]:
            if surface["name"] == place:
                inner, outer = sorted(surface["span_m"], key=abs)
                inner = inner + size * (outer - inner)
                surface["span_m"] = sorted([inner, outer])
        return table

    return section(scenario, "airframe", change)


def factors(part: str, factors: Callable[[float], Mapping[str, Any]]) -> Callable[..., Scenario]:
    """Return a change of numbers of a section, each by its own factor of the size; a place may say minus."""

    def scenario(scenario: Scenario, size: float, place: str) -> Scenario:
        def change(table: dict[str, Any]) -> dict[str, Any]:
            for path, factor in factors(-size if place == "-" else size).items():
                times(table, path, factor)
            return table

        return section(scenario, part, change)

    return scenario


def uneven_spin(scenario: Scenario, size: float, place: str) -> Scenario:
    """Front rotors heavier by more than rear ones."""
    size = -size if place == "-" else size
    rotors = tuple(
        msgspec.structs.replace(r, inertia=r.inertia * (1 + (1.4 if r.wing == "front" else 0.6) * size))
        for r in scenario.rotor
    )
    return msgspec.structs.replace(scenario, rotor=rotors)


def uneven_wings(scenario: Scenario, size: float, place: str) -> Scenario:
    """Return an aircraft with a front wing heavier by more than the rear one; the whole as it was weighed."""
    size = -size if place == "-" else size
    wings = []
    for wing in scenario.wing:
        more = 1 + (1.3 if wing.name == "front" else 0.7) * size
        own = wing.inertia
        scaled = {name: more * getattr(own, name) for name in own.__struct_fields__}
        wings.append(msgspec.structs.replace(wing, mass_kg=more * wing.mass_kg, inertia=type(own)(**scaled)))
    return msgspec.structs.replace(scenario, wing=tuple(wings))


def moved_accelerometer(scenario: Scenario, size: float, place: str) -> Scenario:
    """Return an aircraft with an accelerometer elsewhere; `as_stated` puts it back in the log."""

    def change(table: dict[str, Any]) -> dict[str, Any]:
        for suite in table.values():
            stated = suite["accelerometer"].get("position_m", (0.0, 0.0, 0.0))
            suite["accelerometer"]["position_m"] = np.add(stated, _along(size, place)).tolist()
        return table

    return section(scenario, "sensors", change)


def _along(size: float, place: str) -> np.ndarray:
    return size * np.eye(3)["xyz".index(place)]


def as_stated(record: FlightRecord, size: float, place: str) -> FlightRecord:
    channels = [record.channel(f"state/a{axis}") for axis in "xyz"]
    return record.with_channels(
        *(
            replace(c, position_m=tuple(np.subtract(c.position_m or (0, 0, 0), _along(size, place))))
            for c in channels
        )
    )


def icing(scenario: Scenario, size: float, place: str) -> Scenario:
    """Both wings: less lift for the angle and much more drag, together."""
    del place
    factors = {"aerofoil.lift_slope": 1 - 0.4 * size, "aerofoil.drag": 1 + 4 * size}

    def change(table: dict[str, Any]) -> dict[str, Any]:
        for path, factor in factors.items():
            times(table, path, factor)
        return table

    return section(scenario, "airframe", change)


def stop(scenario: Scenario, size: float, place: str) -> Scenario:
    """Return an aircraft with a surface that moves no further than one over the size, rad."""
    effectors = tuple(
        msgspec.structs.replace(e, limits=(-1 / size, 1 / size)) if e.name == place else e
        for e in scenario.effector
    )
    return msgspec.structs.replace(scenario, effector=effectors)
