"""Flight records of freqid itself, to be cut, split or resampled."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from freqid.core.errors import UsageError
from freqid.core.record import FlightRecord, read_record
from freqid.core.vehicle import Vehicle
from freqid.flightlog.column_map import ColumnMap
from freqid.flightlog.read import Reader
from freqid.flightlog.resample import resample


def read_own(
    path: Path,
    column_map: ColumnMap | None,
    *,
    cut: tuple[float, float] | None = None,
    resample_hz: float | None = None,
    despike: bool = False,
    vehicle: Vehicle | None = None,
) -> FlightRecord:
    """Read a record that freqid wrote.

    Parameters
    ----------
    path : Path
    column_map : None
        A record says what its channels are.
    cut, resample_hz, vehicle
        As in `freqid.flightlog.read.read_log`; the record's own vehicle where none is given.

    Raises
    ------
    UsageError
        Where a map is given, or the cut or rate is at fault.
    DataError
        Where the file is no intact record.
    """
    if column_map is not None:
        raise UsageError(
            "a flight record names its channels itself", where=str(path), remedy="leave the column map out"
        )
    if despike:
        raise UsageError(
            "a flight record has no spikes left out any more", where=str(path), remedy="despike its log"
        )
    record = read_record(path)
    # dropouts were those of the log, of which the record is one whole stretch
    about = {n: x for n, x in record.provenance.items() if n not in ("dropouts", "whole_spans_s")}
    record = replace(record, provenance=about)
    if cut is not None:
        record = record.cut(*cut)
    if resample_hz is not None:
        record = resample(record, resample_hz)
    return replace(record, vehicle=vehicle) if vehicle is not None else record


READER = Reader(suffixes=(".h5",), read=read_own)
