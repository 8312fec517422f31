"""The flights that a diagnosis is made from: told apart, and matched with the simulation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.core.channels import WRENCH
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.vehicle import Vehicle
from freqid.gap.connect.flow import with_velocity
from freqid.gap.simulation import Simulation
from freqid.gap.stack.lines import lines_of
from freqid.gap.stack.rows import measured_part
from freqid.gap.stack.sensor_noise import noisy_channels, sensor_noise
from freqid.gap.undescribed import without_vehicle

BAND_HZ = (0.05, 2.0)
"""Where nothing was injected and no band is stated."""

_NO_NOISE = 1e-4  # of a channel's range: noise below it is what digits and smoothing leave
_FEWEST = 50  # samples, of a manoeuvre of which anything can be told
_MASS = 0.03  # of the mass, from which two that are stated differ


def vehicle_of(
    records: Sequence[FlightRecord], simulation: Simulation, stated: Vehicle | None = None
) -> Vehicle | None:
    """Return the vehicle in place of the records' own; None where each record describes its own.

    Parameters
    ----------
    records : sequence of FlightRecord
    simulation : Simulation
    stated : Vehicle, optional
        Of a scenario that is given.

    Raises
    ------
    DataError
        Where nobody describes a vehicle and the wrench has to be rebuilt from the motion.
    """
    if stated is not None or all(r.vehicle is not None for r in records):
        return stated
    if simulation.vehicle is not None:
        return simulation.vehicle
    rebuilt = [
        n
        for n in simulation.responses
        if (n in WRENCH or n.startswith("C")) and any(f"response/{n}" not in r for r in records)
    ]
    if rebuilt:
        raise DataError(
            f"nobody describes the vehicle, whose mass and inertia {rebuilt[0]} is rebuilt with",
            remedy="give --scenario, or import the records with one",
        )
    return without_vehicle("unnamed vehicle", records[0])


def maneuvers(
    records: Sequence[FlightRecord],
    names: Sequence[str],
    simulation: Simulation,
    vehicle: Vehicle | None = None,
) -> list[Maneuver]:
    """Return manoeuvres that fit each other and the simulation.

    Parameters
    ----------
    records : sequence of FlightRecord
        For a scenario's simulation those that hold V, alpha and beta get u v w from them.
    names : sequence of str
        Their files.
    simulation : Simulation
    vehicle : Vehicle, optional
        Of `vehicle_of`.

    Raises
    ------
    UsageError
        Where two records hold the same flight.
    DataError
        Where vehicles do not match, or a record is too short or too still to tell anything.
    """
    # a scenario needs u v w; others would gain relations that their sensors only copy
    if simulation.kind == "scenario":
        records = [with_velocity(record) for record in records]
    found = [
        Maneuver.of(r, vehicle or r.vehicle or simulation.vehicle or without_vehicle("unnamed vehicle", r))
        for r in records
    ]
    for record, name in zip(records, names, strict=True):
        _refuse_without_motion(record, name)
        _refuse_stuck(record, name)
    _refuse_duplicates(records, names)
    first = found[0].vehicle
    for m, name in zip(found[1:], names[1:], strict=True):
        if m.vehicle.effector_kinds != first.effector_kinds:
            raise DataError(
                f"is of vehicle '{m.vehicle.name}', whose effectors are not those of '{first.name}' in "
                f"{names[0]}",
                where=name,
                remedy="diagnose the flights of one vehicle at a time",
            )
    its = simulation.vehicle
    for m, name in zip(found, names, strict=True):
        if its is None or not its.effector_kinds:
            continue
        lacking = [n for n in its.effector_kinds if f"effector/{n}" not in m.record]
        if lacking:
            shown = ", ".join(lacking[:6]) + (", ..." if len(lacking) > 6 else "")
            if m.record.vehicle and m.record.vehicle.effector_kinds == its.effector_kinds:
                raise DataError(
                    f"has no position of {shown} (effector/{lacking[0]}), which {simulation.name} needs",
                    where=name,
                    remedy="log it, or map the column that holds it",
                )
            raise DataError(
                f"is of vehicle '{m.vehicle.name}' and has no position of {shown}, which {simulation.name} "
                f"of vehicle '{its.name}' needs",
                where=name,
                remedy="give the simulation of the vehicle that flew",
            )
    return found


def differing(found: Sequence[Maneuver], simulation: Simulation) -> list[str]:
    """Return remarks on vehicles that differ from the simulation's in name or mass."""
    its, said = simulation.vehicle, []
    if its is None:
        return []
    vehicle = found[0].vehicle
    if vehicle.name and its.name and vehicle.name != its.name:
        said.append(f"the records are of vehicle '{vehicle.name}', the simulation of '{its.name}'")
    flown, simulated = vehicle.mass_properties.mass_kg, its.mass_properties.mass_kg
    if abs(flown - simulated) > _MASS * simulated:
        said.append(
            f"the flights' mass is {flown:.4g} kg, the simulation's {simulated:.4g} kg: measured loads are "
            "rebuilt with the former"
        )
    return said


def injected_band(records: Sequence[FlightRecord]) -> tuple[float, float]:
    """Return the band, Hz, that the injected signals of all records drive; `BAND_HZ` without any."""
    driven = []
    for record in records:
        lines = lines_of(record, 0.4 / record.dt)
        driven += list(lines.hz[lines.driven])
    if not driven:
        return BAND_HZ
    return max(0.8 * min(driven), 1e-3), 1.05 * max(driven)


def _refuse_without_motion(record: FlightRecord, name: str) -> None:
    """Refuse a record from whose samples neither motion nor noise can be told."""
    if record.time.size < _FEWEST:
        raise DataError(
            f"has {record.time.size} samples, expected {_FEWEST} or more: its noise cannot be told",
            where=name,
            remedy="give the whole manoeuvre",
        )
    states = [f"state/{n}" for n in record.group("state")]
    if states and not any(np.ptp(record[n]) > 0 for n in states):
        raise DataError(
            "none of its states moves, so neither motion nor noise can be told",
            where=name,
            remedy="see that the log's columns were read as what they are",
        )


def _refuse_stuck(record: FlightRecord, name: str) -> None:
    """Refuse a record of an effector whose position is one number while a signal is injected into it."""
    for e in record.group("effector"):
        injected = f"excitation/{e}"
        if injected in record and np.ptp(record[injected]) > 0 and not np.ptp(record[f"effector/{e}"]) > 0:
            raise DataError(
                f"effector/{e} stands still while the signal injected into it moves",
                where=name,
                remedy="see that the log's columns were read as what they are, or leave out the position",
            )


def refuse_unmeasured(found: Sequence[Maneuver], names: Sequence[str], simulation: Simulation) -> None:
    """Refuse manoeuvres that lack what the responses are measured with.

    Parameters
    ----------
    found : sequence of Maneuver
    names : sequence of str
        Their files.
    simulation : Simulation

    Raises
    ------
    DataError
    """
    for m, name in zip(found, names, strict=True):
        try:
            measured_part(m, simulation.responses, ())
        except DataError as error:
            raise error.at(name) from None


def refuse_without_noise(records: Sequence[FlightRecord], names: Sequence[str]) -> None:
    """Refuse a record none of whose measured channels has noise: nothing says what counts as a gap.

    Raises
    ------
    DataError
    """
    for record, name in zip(records, names, strict=True):
        moving = [n for n in noisy_channels(record) if np.ptp(record[n]) > 0]
        sigma = sensor_noise(record, moving) if moving else {}
        if any(s > _NO_NOISE * np.ptp(record[n]) for n, s in sigma.items()):
            continue
        raise DataError(
            "its samples show no noise, so what counts as a gap cannot be told",
            where=name,
            remedy="give the log as the sensors took it, not smoothed; a simulated one with sensors' noise",
        )


def _refuse_duplicates(records: Sequence[FlightRecord], names: Sequence[str]) -> None:
    for i, record in enumerate(records):
        for other, name in zip(records[:i], names, strict=False):
            if _same(record, other):
                raise UsageError(
                    f"holds the same flight as {name}",
                    where=names[i],
                    remedy="name each flight once; a flight that was used cannot be held out",
                )


def _same(one: FlightRecord, other: FlightRecord) -> bool:
    return (
        one.time.size == other.time.size
        and set(one.channels) == set(other.channels)
        and all(np.array_equal(one[n], other[n]) for n in one.channels)
    )
