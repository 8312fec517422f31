"""A flight record on disk (``format="freqid-record"``)."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import h5py
import msgspec

from freqid.core import store
from freqid.core.channels import effector_unit, si_unit, split
from freqid.core.errors import DataError
from freqid.core.record import Channel, Configuration, FlightRecord
from freqid.core.units import to_si
from freqid.core.vehicle import MassProperties, Vehicle

FORMAT = "freqid-record"


def write_record(path: Path, record: FlightRecord, scenario_sha256: str = "", *, kind: str = FORMAT) -> None:
    """Write a record, whole or not at all.

    Parameters
    ----------
    path : Path
    record : FlightRecord
    scenario_sha256 : str
        Of the scenario that described the vehicle.
    kind : str
        Format that the file says it has.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """

    def fill(file: h5py.File) -> None:
        time = store.put(file, "time", record.time, "s")
        time.make_scale("time")
        for channel in record.channels.values():
            group, name = split(channel.name)
            dataset = store.put(file.require_group(group), name, channel.values, channel.unit)
            dataset.dims[0].attach_scale(time)
            dataset.attrs["native_rate_hz"] = channel.native_rate_hz
            dataset.attrs["source"] = channel.source
            if channel.position_m is not None:
                dataset.attrs["position_m"] = channel.position_m
        # HDF5 lists by name; the order in which the channels were logged is kept here
        store.put_json(file, "channel_order", list(record.channels))
        file.attrs["reference"] = record.reference
        store.put_json(file, "configuration", asdict(record.configuration))
        store.put_json(file, "provenance", record.provenance)
        if record.vehicle is not None:
            store.put_json(file, "vehicle", msgspec.to_builtins(record.vehicle))
        if record.mass_properties is not None:
            store.put_json(file, "mass_properties", msgspec.to_builtins(record.mass_properties))

    store.write(path, kind, fill, scenario_sha256)


def read_record(path: Path, *, kind: str = FORMAT) -> FlightRecord:
    """Read a record, or another `kind` of file of the same layout.

    Raises
    ------
    DataError
        Where the file is no intact record.
    """
    with store.reading(path, kind) as file:
        channels = {}
        for name in store.get_json(file, "channel_order") or _listed(file):
            dataset = store.dataset(file, name)
            unit = store.get_text(dataset, "units")
            if not unit:
                raise DataError(f"channel '{name}' has no unit", remedy="add the attribute 'units'")
            position = store.floats(dataset, "position_m")
            (native_rate_hz,) = store.floats(dataset, "native_rate_hz")
            si = si_unit(name) or effector_unit(unit)
            convert = to_si(unit, si, name)
            if len(position) not in (0, 3):
                raise DataError(
                    f"channel '{name}' has a position_m of {len(position)} numbers, expected three"
                )
            channels[name] = Channel(
                name=name,
                unit=si,
                values=convert.factor * store.array(file, name) + convert.offset,
                native_rate_hz=native_rate_hz,
                source=store.get_text(dataset, "source"),
                position_m=(position[0], position[1], position[2]) if position else None,
            )
        vehicle = store.get_json(file, "vehicle")
        mass = store.get_json(file, "mass_properties")
        return FlightRecord(
            time=store.array(file, "time"),
            channels=channels,
            vehicle=None if vehicle is None else msgspec.convert(vehicle, Vehicle),
            mass_properties=None if mass is None else msgspec.convert(mass, MassProperties),
            reference=store.get_text(file, "reference"),
            configuration=Configuration(**(store.get_json(file, "configuration") or {})),
            provenance=store.get_json(file, "provenance") or {},
        )


def _listed(file: h5py.File) -> list[str]:
    """Return the channels of a file that another program wrote without their order."""
    return [f"{g}/{n}" for g, group in file.items() if isinstance(group, h5py.Group) for n in group]
