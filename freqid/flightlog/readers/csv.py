"""Logs as text tables: comma, semicolon, tab or white space between numbers, with or without a header.

A table is read twice and never held as text: once line by line for its shape, once in blocks of rows for the
columns that are wanted.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord
from freqid.core.units import parse_unit
from freqid.flightlog.column_map import ColumnMap, Place
from freqid.flightlog.mapped import assemble_map
from freqid.flightlog.read import Reader
from freqid.flightlog.shelf import Shelf
from freqid.flightlog.signal import Signal, clock_of_table, column_index

if TYPE_CHECKING:  # other logs are read without it
    import pandas as pd

_FOREIGN = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")  # control characters that no text table holds
_BRACKETS = re.compile(r"^[(\[{]\s*(.*?)\s*[)\]}]$")
_PREAMBLE = 200  # lines in which a table must begin
_ROWS = 10_000  # read at a time
_SPACES = re.compile(r"[ \t]+")


@dataclass(frozen=True)
class Table:
    """The shape of a text table.

    Attributes
    ----------
    path : Path
    encoding : str
    delimiter : str, optional
        None for white space.
    header : list of str
        Empty where there is none.
    units : list of str
        Of a row of units under the header; empty where there is none.
    first_line : int
        Of the numbers, counted from 1.
    rows, width : int
    """

    path: Path
    encoding: str
    delimiter: str | None
    header: list[str]
    units: list[str]
    first_line: int
    rows: int
    width: int

    def columns(self, wanted: Sequence[int], dates: Sequence[int] = ()) -> Shelf:
        """Return columns by their number, counted from 0; those in `dates` as seconds since 1970.

        Raises
        ------
        DataError
            Naming the first cell that is no number by its line.
        """
        import pandas as pd

        wanted = sorted(set(wanted))
        result, done = Shelf(), 0
        for index in wanted:
            result.reserve(index, self.rows)
        if not wanted:
            return result
        try:
            blocks = pd.read_csv(
                self.path,
                sep=self.delimiter or r"\s+",
                header=None,
                skiprows=self.first_line - 1,
                nrows=self.rows,
                usecols=wanted,
                dtype=dict.fromkeys(dates, str),
                encoding=self.encoding,
                quoting=csv.QUOTE_NONE,
                skip_blank_lines=False,
                skipinitialspace=True,
                low_memory=False,
                chunksize=_ROWS,
            )
            with blocks:
                for block in blocks:
                    stop = done + len(block)
                    for index in wanted:
                        cells = block[index]
                        convert = _dates if index in dates else _numbers
                        result.fill(index, done, convert(cells, self.first_line + done, index))
                    done = stop
        except (ValueError, OverflowError) as error:
            raise DataError(f"is no readable table ({error})", remedy="export the log again") from None
        if done != self.rows:
            raise DataError(f"reads as {done} rows, expected {self.rows}", remedy="export the log again")
        return result

    def index(self, column: int | str) -> int:
        """Return the position of a column, counted from 0.

        Raises
        ------
        NotLogged
            Where the table has none of that name or number.
        DataError
            Where it has two of them, or no header.
        """
        if isinstance(column, str) and not self.header:
            raise DataError(
                f"column '{column}' is asked for by name, but the table has no header",
                remedy="map its columns by number",
            )
        return column_index(column, self.header or [""] * self.width)


def read_csv(path: Path, column_map: ColumnMap | None, **options: Any) -> FlightRecord:
    """Read a text table.

    Parameters
    ----------
    path : Path
        UTF-8 or Latin-1 text: lines before the table are skipped; then a header, unless all its fields are
        numbers, and perhaps a row of units.
    column_map : ColumnMap
        None is refused.
    **options
        As in `assemble`.

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
            "a text table needs a column map",
            where=str(path),
            remedy=f"make one with freqid import-log --list {path} > map.toml",
        )
    try:
        table = open_table(Path(path))
        numbers, uses = _wanted(table, column_map)
        kept = set(column_map.sources())
    except DataError as error:
        raise error.at(str(path)) from None

    def pick(place: Place) -> NDArray[np.float64]:
        if place.variable is not None:
            raise DataError(f"'{place.variable}' is a variable, expected a column of a text table")
        assert place.column is not None  # a place without a variable has one
        index = table.index(place.column)
        uses[index] -= 1
        # A column is dropped with its last use, so that a long log need not stand in memory twice.
        return numbers[index] if uses[index] or place.column in kept else numbers.pop(index)

    return assemble_map(Path(path), "csv", column_map, pick, **options)


def _wanted(table: Table, column_map: ColumnMap) -> tuple[Shelf, dict[int, int]]:
    """Return the mapped columns that the table has, and how often the map names each."""
    uses: dict[int, int] = {}
    for column in (*column_map.columns(), *column_map.sources()):
        try:
            index = table.index(column)
        except DataError:
            continue  # said when the channel is made, which may do without
        uses[index] = uses.get(index, 0) + 1
    dates: list[int] = []
    if column_map.time is not None and column_map.time.unit == "date":
        named = [column_map.time.column, *(c.time for c in column_map.channel)]
        dates = [table.index(column) for column in named if column is not None]
    return table.columns(list(uses), dates), uses


def open_table(path: Path) -> Table:
    """Find where a table begins, and check that all its lines have as many fields.

    Raises
    ------
    DataError
        Where the file is missing, empty, binary or ragged.
    """
    try:
        return _scanned(path, "utf-8-sig")
    except UnicodeDecodeError:
        return _scanned(path, "latin-1")  # headers with a degree sign, as older Windows tools write them


def _scanned(path: Path, encoding: str) -> Table:
    with _lines(path, encoding) as lines:
        head: list[str] = []
        for line in lines:
            head.append(line)
            if len(head) == _PREAMBLE:
                break
    if not any(line.strip() for line in head):
        raise DataError("is empty", remedy="export the log again")
    at, delimiter = _start_of(head)
    fields = _fields(head[at], delimiter)
    header: list[str] = []
    units: list[str] = []
    if not all(_is_number(f) for f in fields):
        header = [f.strip().strip('"').strip() for f in fields]
        header[0] = header[0].lstrip("#%").strip()
        at += 1
        below = _fields(head[at], delimiter) if at < len(head) else []
        if _are_units(below, len(header)):
            units = [_unit_in(f) for f in below]
            at += 1
    width, rows, blank = len(fields), 0, 0
    with _lines(path, encoding) as lines:
        for number, line in enumerate(lines, start=1):
            if number <= at:
                continue
            if not line.strip():
                blank = blank or number
                continue
            found = line.count(delimiter) + 1 if delimiter else len(_SPACES.split(line.strip(" \t\n")))
            if blank or found != width:
                raise DataError(
                    f"line {blank or number} has {0 if blank else found} fields, expected {width} as in the "
                    "first line",
                    remedy="the file is truncated or damaged there; repair or cut it",
                )
            rows += 1
    if not rows:
        raise DataError("has a header but no rows", remedy="export the log again")
    return Table(path, encoding, delimiter, header, units, at + 1, rows, width)


class _lines:
    """The lines of a text file, whichever line ends it has; control characters are refused."""

    def __init__(self, path: Path, encoding: str) -> None:
        try:
            self.file = open(path, encoding=encoding, newline=None)  # noqa: SIM115 - closed in __exit__
        except OSError as error:
            raise DataError(f"cannot be read ({error.strerror})", remedy="check the path") from None

    def __enter__(self) -> Iterator[str]:
        return self._checked()

    def __exit__(self, *_: object) -> None:
        self.file.close()

    def _checked(self) -> Iterator[str]:
        for line in self.file:
            foreign = _FOREIGN.search(line)
            if foreign:
                raise DataError(
                    f"is no text table: found byte {ord(foreign[0]):#04x}",
                    remedy="export the log as UTF-8 text",
                )
            yield line


def _start_of(head: list[str]) -> tuple[int, str | None]:
    """Return the line, counted from 0, at which a table's header or numbers begin, and the delimiter.

    The first line that is not blank, unless the first line of numbers has another number of fields: then what
    stands before is a preamble, and its last line, or the one before a row of units, is the header.
    """
    first = next(i for i, line in enumerate(head) if line.strip())
    delimiter = _delimiter(head[first])
    width = len(_fields(head[first], delimiter))
    for i in range(first + 1, len(head)):
        own = _delimiter(head[i])
        fields = _fields(head[i], own)
        if not _are_numbers(fields) or (len(fields) == 1 and width > 1):
            continue
        if len(fields) == width and own == delimiter:
            return first, delimiter
        above = i - 1
        while above > first and not head[above].strip():
            above -= 1
        if len(_fields(head[above], own)) != len(fields):
            return i, own
        higher = above - 1
        if _are_units(_fields(head[above], own), len(fields)) and higher >= first:
            return (higher if len(_fields(head[higher], own)) == len(fields) else above), own
        return above, own
    return first, delimiter


def _delimiter(line: str) -> str | None:
    return next((d for d in "\t;," if d in line.strip(" \n")), None)


def _fields(line: str, delimiter: str | None) -> list[str]:
    line = line.rstrip("\n")
    if delimiter is None:
        return _SPACES.split(line.strip(" \t"))
    try:
        return next(csv.reader([line], delimiter=delimiter), [""])
    except csv.Error as error:
        raise DataError(f"has a line that is no header ({error})", remedy="export the log again") from None


def _are_numbers(fields: Sequence[str]) -> bool:
    """Tell whether fields are a row of a table: numbers, dates and blanks, not blanks alone."""
    filled = [f.strip().strip('"') for f in fields if f.strip()]
    return bool(filled) and all(_is_number(f) or _is_date(f) for f in filled)


def _are_units(fields: Sequence[str], width: int) -> bool:
    """Tell whether fields are a row of units, in brackets or not."""
    if len(fields) != width or _are_numbers(fields):
        return False
    texts = [_unit_in(f) for f in fields]
    return any(texts) and all(not t or t == "-" or _is_unit(t) for t in texts)


def _unit_in(field: str) -> str:
    text = field.strip().strip('"').strip().lstrip("#%").strip()
    inside = _BRACKETS.match(text)
    return inside[1] if inside else text


def _is_unit(text: str) -> bool:
    try:
        parse_unit(text)
    except DataError:
        return False
    return True


def _numbers(column: pd.Series, first_line: int, index: int) -> NDArray[np.float64]:
    """Return one column as numbers; the first cell that is none is named by its line."""
    import pandas as pd

    if pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column):
        return column.to_numpy(dtype=np.float64)
    # Rarely needed, so slow and plain: quoted numbers, and the search for the offending cell.
    result = np.full(len(column), np.nan)
    for row, cell in enumerate(column):
        if pd.isna(cell):
            continue
        text = str(cell).strip().strip('"')
        if not _is_number(text):
            raise DataError(
                f"line {first_line + row}, column {index + 1}: found '{_short(text)}', expected a number",
                remedy="decimals are written with a point; blank cells are left empty",
            )
        result[row] = float(text)
    return result


def _dates(column: pd.Series, first_line: int, index: int) -> NDArray[np.float64]:
    """Return dates and times of day as seconds since 1970, without a zone taken as UTC."""
    import pandas as pd

    found = pd.to_datetime(column.str.strip().str.strip('"'), format="ISO8601", utc=True, errors="coerce")
    wrong = np.flatnonzero(found.isna() & column.notna())
    if wrong.size:
        text = _short(str(column.iloc[wrong[0]]))
        raise DataError(
            f"line {first_line + wrong[0]}, column {index + 1}: found '{text}', "
            "expected a date such as 2026-05-01 12:30:00.02"
        )
    return found.to_numpy(dtype="datetime64[ns]").astype(np.float64) * 1e-9


def _short(text: str) -> str:
    return text if len(text) <= 40 else text[:37] + "..."


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text  # Python reads 1_000, no logger writes it


def _is_date(text: str) -> bool:
    return bool(re.match(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d", text))


def csv_signals(path: Path) -> Iterator[Signal]:
    """Yield the numeric columns of a table with the clock that its names give; for listing."""
    try:
        table = open_table(Path(path))
    except DataError as error:
        raise error.at(str(path)) from None
    names = table.header or [str(i + 1) for i in range(table.width)]
    units = table.units or [""] * table.width
    columns: dict[int, NDArray[np.float64]] = {}
    for index in range(table.width):
        try:
            columns[index] = table.columns([index])[index]
        except DataError:  # text, perhaps dates
            try:
                columns[index] = table.columns([index], [index])[index]
            except DataError:
                continue
    yield from clock_of_table([(names[i], units[i], x) for i, x in columns.items()])


READER = Reader((".csv", ".tsv", ".txt", ".asc", ".dat"), read_csv, signals=csv_signals)
