"""Logs as text tables: comma, semicolon, tab or white space between numbers, with or without a header."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.record import FlightRecord
from freqid.flightlog.assemble import assemble_map
from freqid.flightlog.column_map import ColumnMap, Place
from freqid.flightlog.read import Reader

_FOREIGN = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")  # control characters that no text table holds


def read_csv(path: Path, column_map: ColumnMap | None, **options: Any) -> FlightRecord:
    """Read a text table.

    Parameters
    ----------
    path : Path
        UTF-8 or Latin-1 text. The first line is a header unless all its fields are numbers.
    column_map : ColumnMap
        None is refused.
    **options
        `cut`, `resample_hz`, `vehicle` as in `assemble`.

    Raises
    ------
    DataError
        Where the file is missing, empty, binary or ragged, a mapped column is missing or holds what is no
        number (with the line), or the columns do not make a record.
    UsageError
        Where there is no map; as `assemble`.
    """
    if column_map is None:
        raise UsageError(
            "a text table needs a column map", where=str(path), remedy="write one (docs/flight-logs.md)"
        )
    try:
        table, header, first_line = _read_table(Path(path))
    except DataError as error:
        raise error.at(str(path)) from None

    def pick(place: Place) -> NDArray[np.float64]:
        if place.variable is not None:
            raise DataError(f"'{place.variable}' is a variable, expected a column of a text table")
        assert place.column is not None  # a place without a variable has one
        return _numbers(table, _index(place.column, header, table.shape[1]), first_line)

    return assemble_map(Path(path), "csv", column_map, pick, **options)


def _read_table(path: Path) -> tuple[pd.DataFrame, list[str], int]:
    """Return the table, its header (empty where there is none) and the line number of its first row."""
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror})", remedy="check the path") from None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")  # headers with a degree sign, as older Windows tools write them
    foreign = _FOREIGN.search(text)
    if foreign:
        raise DataError(
            f"is no text table: found byte {ord(foreign[0]):#04x}", remedy="export the log as UTF-8 text"
        )
    lines = text.replace("\r\n", "\n").replace("\r", "\n").rstrip().split("\n")
    first = next((i for i, line in enumerate(lines) if line.strip()), None)
    if first is None:
        raise DataError("is empty", remedy="export the log again")
    delimiter = next((d for d in "\t;," if d in lines[first]), None)
    try:
        fields = next(csv.reader([lines[first]], delimiter=delimiter)) if delimiter else lines[first].split()
    except csv.Error as error:
        raise DataError(f"line {first + 1} is no header ({error})", remedy="export the log again") from None
    header = [] if all(_is_number(f) for f in fields) else [f.strip().strip('"') for f in fields]
    first += bool(header)
    rows = lines[first:]
    if not rows:
        raise DataError("has a header but no rows", remedy="export the log again")
    for number, row in enumerate(rows, start=first + 1):
        found = row.count(delimiter) + 1 if delimiter else len(row.split())
        if found != len(fields):
            raise DataError(
                f"line {number} has {found} fields, expected {len(fields)} as in the first line",
                remedy="the file is truncated or damaged there; repair or cut it",
            )
    try:
        table = pd.read_csv(
            io.StringIO("\n".join(rows)),
            sep=delimiter or r"\s+",
            header=None,
            quoting=csv.QUOTE_NONE,
            skip_blank_lines=False,
            skipinitialspace=True,
            low_memory=False,
        )
    except (ValueError, OverflowError) as error:
        raise DataError(f"is no readable table ({error})", remedy="export the log again") from None
    if table.shape != (len(rows), len(fields)):
        raise DataError(
            f"reads as {table.shape[0]} rows of {table.shape[1]} fields, "
            f"expected {len(rows)} of {len(fields)}",
            remedy="export the log again",
        )
    return table, header, first + 1


def _index(column: int | str, header: list[str], width: int) -> int:
    """Return the position of a column in the table, counted from 0."""
    if isinstance(column, int):
        if column > width:
            raise DataError(
                f"column {column} is missing, the table has {width}", remedy="correct the column map"
            )
        return column - 1
    if not header:
        raise DataError(
            f"column '{column}' is asked for by name, but the table has no header",
            remedy="map its columns by number",
        )
    if column not in header:
        raise DataError(f"column '{column}' is missing", remedy=nearest(column, header))
    if header.count(column) > 1:
        raise DataError(
            f"{header.count(column)} columns are named '{column}'", remedy="map the wanted one by number"
        )
    return header.index(column)


def _numbers(table: pd.DataFrame, index: int, first_line: int) -> NDArray[np.float64]:
    """Return one column as numbers; the first cell that is none is named by its line."""
    column = table.iloc[:, index]
    if pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column):
        return column.to_numpy(dtype=np.float64)
    # Rarely needed, so slow and plain: quoted numbers, and the search for the offending cell.
    result = np.full(len(column), np.nan)
    for row, cell in enumerate(column):
        if pd.isna(cell):
            continue
        text = str(cell).strip().strip('"')
        if not _is_number(text):
            shown = text if len(text) <= 40 else text[:37] + "..."
            raise DataError(
                f"line {first_line + row}, column {index + 1}: found '{shown}', expected a number",
                remedy="decimals are written with a point; blank cells are left empty",
            )
        result[row] = float(text)
    return result


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text  # Python reads 1_000, no logger writes it


READER = Reader((".csv", ".tsv", ".txt", ".asc", ".dat"), read_csv)
