"""One door for every log: the first reader that knows a file, by its content or its suffix, reads it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path

import numpy as np

from freqid.core.errors import DataError
from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.flightlog.column_map import ColumnMap, read_column_map
from freqid.flightlog.signal import Signal

# Modules of `readers` in the order in which they are asked: layouts of their own before what needs a map.
_MODULES = ("ulog", "dataflash", "parquet", "sidpac", "matlab", "record", "csv")


@dataclass(frozen=True)
class Reader:
    """One kind of log; the module that reads it holds one of these as ``READER``.

    Attributes
    ----------
    suffixes : tuple of str
        That its files have, in lower case.
    read : callable
        ``read(path, column_map, *, cut, resample_hz, despike, vehicle) -> FlightRecord``; a reader of files
        that do not say what their columns are raises `UsageError` where the map is None.
    knows : callable, optional
        ``knows(path, column_map) -> bool``: whether a file of such a suffix is of this kind. All are where
        it is absent.
    signals : callable, optional
        ``signals(path) -> iterator of Signal``: all that a file holds, to be listed.
    """

    suffixes: tuple[str, ...]
    read: Callable[..., FlightRecord]
    knows: Callable[[Path, ColumnMap | None], bool] = lambda path, column_map: True
    signals: Callable[[Path], Iterator[Signal]] | None = None


@cache
def readers() -> tuple[Reader, ...]:
    """Return all readers in the order in which they are asked."""
    return tuple(import_module(f"{__package__}.readers.{name}").READER for name in _MODULES)


def read_log(
    path: Path,
    column_map: ColumnMap | Path | str | None = None,
    *,
    cut: tuple[float, float] | None = None,
    resample_hz: float | None = None,
    despike: bool = False,
    vehicle: Vehicle | None = None,
) -> FlightRecord:
    """Read a flight log of any kind that freqid knows.

    Parameters
    ----------
    path : Path
        ``.csv .tsv .txt .asc .dat`` text tables, ``.parquet``, ``.mat``, ``.ulg`` of PX4, ``.bin`` of
        ArduPilot, or ``.h5`` of a record.
    column_map : ColumnMap, path or name, optional
        A file or the name of a map that comes with freqid. Needed for all but SIDPAC's own layout, which is
        recognised by its 90 columns.
    cut : tuple of 2 floats, optional
        Start and stop on the log's clock, s. Applied before anything is checked or resampled.
    resample_hz : float, optional
        Rate of the record; without it the log must be uniform and complete, and have one clock. Of a log with
        dropouts, the longest stretch without one.
    despike : bool
        Leave single outlying samples out and count them; with `resample_hz`.
    vehicle : Vehicle, optional
        Gives the kinds of the effectors, and goes into the record.

    Raises
    ------
    DataError
        Where the file is missing, damaged, of an unknown kind, or holds no fit record.
    UsageError
        Where a map is needed and none is given, or the map, cut or rate is at fault.

    Examples
    --------
    >>> record = read_log("flight.mat")  # doctest: +SKIP
    >>> record = read_log("flight.csv", "maps/flight.toml", resample_hz=50)  # doctest: +SKIP
    """
    path = Path(path)
    if isinstance(column_map, (str, Path)):
        column_map = read_column_map(column_map)
    reader = reader_of(path, column_map)
    with np.errstate(all="ignore"):  # what overflows in a damaged log is refused because it is not finite
        return reader.read(
            path, column_map, cut=cut, resample_hz=resample_hz, despike=despike, vehicle=vehicle
        )


def reader_of(path: Path, column_map: ColumnMap | None = None) -> Reader:
    """Return the first reader that knows a file.

    Raises
    ------
    DataError
        Where the file is missing or of an unknown kind.
    """
    try:
        with open(path, "rb"):
            pass
    except OSError as error:
        raise DataError(
            f"cannot be read ({error.strerror})", where=str(path), remedy="check the path"
        ) from None
    suffix = path.suffix.lower()
    for reader in readers():
        if suffix in reader.suffixes and reader.knows(path, column_map):
            return reader
    *known, last = dict.fromkeys(s for reader in reversed(readers()) for s in reader.suffixes)
    raise DataError(
        f"a log of kind '{suffix or 'no suffix'}' is not known, expected {' '.join(known)} or {last}",
        where=str(path),
        remedy="export it as one of these",
    )
