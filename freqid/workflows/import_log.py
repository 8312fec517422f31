"""A log of another tool becomes a flight record, and a record a file of another tool."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

from freqid.core.errors import DataError
from freqid.core.record import FlightRecord, read_record
from freqid.core.scenario import Scenario
from freqid.flightlog import read
from freqid.flightlog.column_map import ColumnMap
from freqid.flightlog.cut import find_maneuvers
from freqid.flightlog.plausibility.check import check_plausibility
from freqid.flightlog.sidpac import write_sidpac
from freqid.workflows.inputs import File, scenario_of


def read_log(
    path: File,
    columns: ColumnMap | File | None = None,
    *,
    scenario: Scenario | File | None = None,
    at: str = "",
    cut: tuple[float, float] | None = None,
    resample_hz: float | None = None,
    plausibility: Literal["refuse", "report", "off"] = "refuse",
) -> FlightRecord:
    """Read a flight log: CSV, MATLAB (v5 to v7.3), or SIDPAC's 90 columns.

    Parameters
    ----------
    path : path
        ``.csv .tsv .txt .asc .dat`` text tables, ``.mat``, or ``.h5`` of a record.
    columns : path or ColumnMap, optional
        Map of columns to channels (docs/flight-logs.md); needed for all but SIDPAC's own layout.
    scenario : Scenario, path or name, optional
        Describes the vehicle.
    at : str
        Id of the reference condition that was flown.
    cut : tuple of 2 floats, optional
        Start and stop on the log's clock, s; applied before anything is checked.
    resample_hz : float, optional
        Put all channels on this rate; without it the log must be uniform and complete.
    plausibility : {"refuse", "report", "off"}
        Check units, signs, columns, limits and frozen channels (docs/flight-logs.md). What is found is in the
        record's provenance; ``"refuse"`` raises for errors.

    Returns
    -------
    FlightRecord
        SI units, uniform time; nothing is repaired or resampled unasked.

    Raises
    ------
    DataError
        Where the log is missing, damaged, not uniform, not finite or of an unknown kind, or contradicts
        itself.
    UsageError
        Where a map is needed and none is given, or the map, cut or condition is at fault.

    Examples
    --------
    >>> flight = read_log("flight.csv", columns="columns.toml", scenario=scenario, at="u20")
    >>> flight
    <FlightRecord at 'u20': 21 channels, 60 s at 50 Hz>
    """
    described = scenario_of(scenario) if scenario is not None else None
    if described and at:
        described.reference_of(at)
    record = read.read_log(
        Path(path),
        columns,
        cut=cut,
        resample_hz=resample_hz,
        vehicle=described.aircraft() if described else None,
    )
    record = replace(record, reference=at) if at else record
    if plausibility == "off":
        return record
    report = check_plausibility(record, described.reference_of(at) if described and at else None)
    if plausibility == "refuse":
        report.refuse(str(path))
    return replace(record, provenance={**record.provenance, "plausibility": report.to_dict()})


def split_flight(record: FlightRecord, *, name: str = "") -> list[FlightRecord]:
    """Find the manoeuvres of a record and return each by itself, with some trim before and after.

    Parameters
    ----------
    record : FlightRecord
        With effectors, commands or excitations.
    name : str
        Of the log, for errors.

    Returns
    -------
    list of FlightRecord

    Raises
    ------
    DataError
        Where the record holds no manoeuvre.

    Examples
    --------
    >>> [piece.duration for piece in split_flight(flight)]  # doctest: +SKIP
    [62.0, 61.98]
    """
    spans = find_maneuvers(record)
    if not spans:
        raise DataError("no manoeuvre was found", where=name or None, remedy="cut it by hand with --cut")
    return [record.cut(*span) for span in spans]


def export_log(record: FlightRecord | File, path: File) -> tuple[str, ...]:
    """Write a record as a MATLAB file in the 90-column SIDPAC layout, in SIDPAC's units.

    Parameters
    ----------
    record : FlightRecord or path
    path : path
        Of the MATLAB file.

    Returns
    -------
    tuple of str
        Channels that SIDPAC has no column for.

    Raises
    ------
    DataError
        Where the record cannot be read or the folder not be written.

    Examples
    --------
    >>> export_log(flight, "flight.mat")  # doctest: +SKIP
    ('excitation/de',)
    """
    flight = record if isinstance(record, FlightRecord) else read_record(Path(record))
    return write_sidpac(flight, Path(path))
