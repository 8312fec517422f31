"""A log of another tool becomes a flight record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from freqid.core.errors import DataError
from freqid.core.record import FlightRecord, read_record
from freqid.core.results.design import SampledInputs, read_inputs
from freqid.core.scenario import Scenario
from freqid.flightlog import listing, read
from freqid.flightlog.column_map import ColumnMap
from freqid.flightlog.cut import find_maneuvers
from freqid.flightlog.listing import Listing
from freqid.flightlog.plausibility.check import check_plausibility
from freqid.identify.response import unlogged_excitation
from freqid.workflows.inputs import File, scenario_of


def read_log(
    path: File,
    columns: ColumnMap | File | None = None,
    *,
    scenario: Scenario | File | None = None,
    at: str = "",
    cut: tuple[float, float] | None = None,
    resample_hz: float | None = None,
    despike: bool = False,
    plausibility: Literal["refuse", "report", "off"] = "refuse",
) -> FlightRecord:
    """Read a flight log: CSV, Parquet, MATLAB (v5 to v7.3), SIDPAC's columns, PX4 ULog, ArduPilot DataFlash.

    Parameters
    ----------
    path : path
        ``.csv .tsv .txt .asc .dat`` text tables, ``.parquet``, ``.mat``, ``.ulg``, ``.bin``, or ``.h5`` of a
        record.
    columns : path, name or ColumnMap, optional
        Map of columns to channels (docs/flight-logs.md), or the name of one that comes with freqid, such as
        ``px4-multirotor``; needed for all but SIDPAC's own layout.
    scenario : Scenario, path or name, optional
        Describes the vehicle.
    at : str
        Id of the reference condition that was flown.
    cut : tuple of 2 floats, optional
        Start and stop on the log's clock, s; applied before anything is checked.
    resample_hz : float, optional
        Put all channels on this rate; without it the log must be uniform and complete, and have one clock.
    despike : bool
        Leave single outlying samples out; their number goes into the provenance.
    plausibility : {"refuse", "report", "off"}
        Check units, signs, columns, limits and frozen channels (docs/flight-logs.md). What is found is in the
        record's provenance; ``"refuse"`` raises for errors.

    Returns
    -------
    FlightRecord
        SI units, uniform time; nothing is repaired or resampled unasked. Where a channel drops out, the
        longest stretch without a dropout: `read_pieces` returns all.

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
        despike=despike,
        vehicle=described.aircraft() if described else None,
    )
    record = replace(record, reference=at) if at else record
    if plausibility == "off":
        return record
    report = check_plausibility(record, described.reference_of(at) if described and at else None)
    if plausibility == "refuse":
        report.refuse(str(path))
    return replace(record, provenance={**record.provenance, "plausibility": report.to_dict()})


def read_pieces(path: File, columns: ColumnMap | File | None = None, **options: Any) -> list[FlightRecord]:
    """Read a flight log whose channels drop out: every stretch that all channels have, in order.

    Parameters
    ----------
    path, columns, **options
        As in `read_log`.

    Returns
    -------
    list of FlightRecord
        One where nothing drops out.

    Raises
    ------
    DataError, UsageError
        As `read_log`.

    Examples
    --------
    >>> [piece.duration for piece in read_pieces("flight.csv", "map.toml", resample_hz=50)]  # doctest: +SKIP
    [41.2, 18.3]
    """
    longest = read_log(path, columns, **options)
    spans = longest.provenance.get("whole_spans_s", [])
    if len(spans) < 2:
        return [longest]
    options.pop("cut", None)
    return [
        longest if start <= longest.time[0] <= stop else read_log(path, columns, cut=(start, stop), **options)
        for start, stop in spans
    ]


def list_log(path: File, *, scenario: Scenario | File | None = None) -> Listing:
    """List the channels of a log with rates, units and gaps, and propose a column map.

    Parameters
    ----------
    path : path
    scenario : Scenario, path or name, optional
        Its effectors are looked for among the columns, whatever their case, and so are their commands
        (``CMD_``) and injected signals (``INJ_``).

    Returns
    -------
    Listing
        Its text is a column map with the channels as comments; ``channels`` has their figures.

    Raises
    ------
    DataError
        Where the file cannot be read or is of an unknown kind.
    UsageError
        Where it needs no map.

    Examples
    --------
    >>> Path("map.toml").write_text(str(list_log("flight.ulg")))  # doctest: +SKIP
    """
    effectors = [e.name for e in scenario_of(scenario).effector] if scenario is not None else []
    return listing.list_log(Path(path), effectors)


def align_excitation(record: FlightRecord | File, design: SampledInputs | File) -> FlightRecord:
    """Add an excitation that was flown but not logged: find its start and the drift of its clock.

    Parameters
    ----------
    record : FlightRecord or path
        With commands or effectors of the design.
    design : path or SampledInputs
        What was flown.

    Returns
    -------
    FlightRecord
        With ``excitation/<name>``; start, drift and their standard errors are in the provenance as
        ``excitation_aligned``.

    Raises
    ------
    DataError
        Where the design is not found in the record.

    Examples
    --------
    >>> align_excitation(flight, "design.h5").provenance["excitation_aligned"]["start_s"]  # doctest: +SKIP
    12.0374
    """
    flight = record if isinstance(record, FlightRecord) else read_record(Path(record))
    inputs = design if isinstance(design, SampledInputs) else read_inputs(Path(design))
    return unlogged_excitation.align_excitation(flight, inputs)[0]


def split_flight(records: FlightRecord | Sequence[FlightRecord], *, name: str = "") -> list[FlightRecord]:
    """Find the manoeuvres of a record and return each by itself, with some trim before and after.

    Parameters
    ----------
    records : FlightRecord, or a sequence of them
        With effectors, commands or excitations; of several stretches of a flight, some may hold no manoeuvre.
    name : str
        Of the log, for errors.

    Returns
    -------
    list of FlightRecord

    Raises
    ------
    DataError
        Where there is no manoeuvre.

    Examples
    --------
    >>> [piece.duration for piece in split_flight(flight)]  # doctest: +SKIP
    [62.0, 61.98]
    """
    found, why = [], "no record is given"
    for record in [records] if isinstance(records, FlightRecord) else records:
        try:
            found += [record.cut(*span) for span in find_maneuvers(record)]
        except DataError as error:  # it holds no manoeuvre
            why = error.message
    if not found:
        raise DataError(why, where=name or None, remedy="cut it by hand with --cut")
    return found
