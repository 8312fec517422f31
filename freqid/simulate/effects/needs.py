"""Whether an effect can be computed with what is known."""

from __future__ import annotations

from collections.abc import Collection

from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.simulate.effects.effect import Effect


def unmet(
    effect: Effect,
    vehicle: Vehicle | None,
    record: FlightRecord | None = None,
    parts: Collection[str] = (),
) -> list[str]:
    """Return which of an effect's needs are not there, in its own words.

    Parameters
    ----------
    effect : Effect
    vehicle : Vehicle or None
    record : FlightRecord, optional
        Where absent, channels are not asked for.
    parts : collection of str
        Sections of ``[simulation]`` that the simulation has, as `freqid.gap.simulation.Simulation` says.
    """
    return [need for need in effect.needs if not _met(need, vehicle, record, parts)]


def _met(need: str, vehicle: Vehicle | None, record: FlightRecord | None, parts: Collection[str]) -> bool:
    if " or " in need:
        return any(_met(one, vehicle, record, parts) for one in need.split(" or "))
    if need.startswith("simulation."):
        return need in parts
    if "/" in need:
        return record is None or need in record
    if need in ("command", "effector", "excitation"):
        return record is None or bool(record.group(need))
    if vehicle is None:
        return False
    if need.startswith("vehicle."):
        return getattr(vehicle, need.partition(".")[2], None) is not None
    thing, _, field = need.partition(".")
    if thing == "wing":
        return bool(vehicle.wings)
    if thing == "rotor" and field:
        return any(getattr(rotor, field, None) is not None for rotor in vehicle.rotors)
    return thing in vehicle.effector_kinds.values()
