"""One door for every log: which reader a file needs is told by its content, then by its suffix."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.flightlog.column_map import ColumnMap, read_column_map
from freqid.flightlog.csv import read_csv
from freqid.flightlog.matlab import load_variables, read_matlab
from freqid.flightlog.sidpac import is_sidpac, read_sidpac

_TEXT = (".csv", ".tsv", ".txt", ".asc", ".dat")
_PLANNED = {
    b"ULog\x01\x12\x35": "a PX4 ULog file",
    b"\xa3\x95": "an ArduPilot DataFlash file",
}


def read_log(
    path: Path,
    column_map: ColumnMap | Path | str | None = None,
    *,
    cut: tuple[float, float] | None = None,
    resample_hz: float | None = None,
    vehicle: Vehicle | None = None,
) -> FlightRecord:
    """Read a flight log of any kind that freqid knows.

    Parameters
    ----------
    path : Path
        ``.csv .tsv .txt .asc .dat`` text tables, or ``.mat``.
    column_map : ColumnMap or path, optional
        Needed for all but SIDPAC's own layout, which is recognised by its 90 columns.
    cut : tuple of 2 floats, optional
        Start and stop on the log's clock, s. Applied before anything is checked or resampled.
    resample_hz : float, optional
        Rate of the record; without it the log must be uniform and complete.
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
    options: dict[str, Any] = {"cut": cut, "resample_hz": resample_hz, "vehicle": vehicle}
    if isinstance(column_map, (str, Path)):
        column_map = read_column_map(Path(column_map))
    suffix = path.suffix.lower()
    _refuse_planned(path, suffix)
    if suffix == ".mat":
        if column_map is not None:
            return read_matlab(path, column_map, **options)
        variables = load_variables(path)
        if is_sidpac(variables):
            return read_sidpac(path, **options)
        raise UsageError(
            f"is not in the SIDPAC layout and no column map is given (its variables: "
            f"{', '.join(sorted(variables)[:8]) or 'none'})",
            where=str(path),
            remedy="write a map (docs/flight-logs.md)",
        )
    if suffix in _TEXT:
        if column_map is None:
            raise UsageError(
                "a text table needs a column map", where=str(path), remedy="write one (docs/flight-logs.md)"
            )
        return read_csv(path, column_map, **options)
    raise DataError(
        f"a log of kind '{suffix or 'no suffix'}' is not known, expected {' '.join(_TEXT)} or .mat",
        where=str(path),
        remedy="export it as one of these",
    )


def _refuse_planned(path: Path, suffix: str) -> None:
    """Say clearly which logs are planned but not read yet."""
    try:
        with open(path, "rb") as file:
            head = file.read(8)
    except OSError as error:
        raise DataError(
            f"cannot be read ({error.strerror})", where=str(path), remedy="check the path"
        ) from None
    kind = next((kind for magic, kind in _PLANNED.items() if head.startswith(magic)), None)
    kind = kind or {".ulg": "a PX4 ULog file", ".bin": "an ArduPilot DataFlash file"}.get(suffix)
    if kind:
        raise DataError(
            f"is {kind}: planned, not yet read",
            where=str(path),
            remedy="convert it to CSV and map its columns",
        )
