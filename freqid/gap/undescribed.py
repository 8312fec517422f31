"""A vehicle for records and simulations that describe none."""

from __future__ import annotations

from freqid.core.record import Channel, FlightRecord
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle


def without_vehicle(name: str, record: FlightRecord | None = None) -> Vehicle:
    """Return a vehicle for records and simulations that describe none and need none: unit mass, no rotors.

    A record's inputs, its own or those that were commanded, become effectors: of speeds rotors, of forces
    thrusts, all others surfaces, sticks among them.
    """
    one = Inertia(xx=1.0, yy=1.0, zz=1.0)
    kinds = {"rad/s": "rotor", "N": "thrust"}
    found: dict[str, Channel] = {}
    if record is not None:
        for group in ("command", "effector"):
            found |= {n: record.channel(f"{group}/{n}") for n in record.group(group)}
    effectors = [
        Effector(
            name=n,
            kind=kinds.get(c.unit, "surface"),  # type: ignore[arg-type]
            limits=(float(c.values.min()) - 1.0, float(c.values.max()) + 1.0),
        )
        for n, c in found.items()
    ]
    return Vehicle(
        name=name, mass_properties=MassProperties(mass_kg=1.0, inertia=one), effectors=tuple(effectors)
    )
