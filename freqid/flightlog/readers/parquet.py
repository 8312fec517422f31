"""Logs in Parquet, read one column at a time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError, UsageError
from freqid.core.extras import extra
from freqid.core.record import FlightRecord
from freqid.flightlog.column_map import ColumnMap, Place
from freqid.flightlog.mapped import assemble_map
from freqid.flightlog.read import Reader
from freqid.flightlog.signal import Signal, clock_of_table, column_index

_ROWS = 100_000  # read at a time, so that a column of a long log stands in memory once


def read_parquet(path: Path, column_map: ColumnMap | None, **options: Any) -> FlightRecord:
    """Read the mapped columns of a Parquet file.

    Parameters
    ----------
    path : Path
    column_map : ColumnMap
        Columns by name or number. None is refused.
    **options
        As in `assemble`.

    Raises
    ------
    DataError
        Where pyarrow is not installed, the file is no intact Parquet file, lacks a mapped column, or its
        columns do not make a record.
    UsageError
        Where there is no map; as `assemble`.
    """
    if column_map is None:
        raise UsageError(
            "a Parquet file needs a column map",
            where=str(path),
            remedy=f"make one with freqid import-log --list {path} > map.toml",
        )
    file = _Columns(Path(path))

    def pick(place: Place) -> NDArray[np.float64]:
        if place.column is None:
            raise DataError(f"'{place.variable}' is a variable, expected a column of a Parquet file")
        return file.numbers(place.column)

    return assemble_map(Path(path), "parquet", column_map, pick, **options)


class _Columns:
    """The columns of an open file."""

    def __init__(self, path: Path) -> None:
        pyarrow = extra("pyarrow", "parquet", str(path))
        parquet = extra("pyarrow.parquet", "parquet", str(path))
        self._faults = (pyarrow.ArrowException, OSError, ValueError)
        try:
            self._file = parquet.ParquetFile(path)
        except self._faults as error:
            said = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise DataError(
                f"no intact Parquet file ({said})", where=str(path), remedy="export the log again"
            ) from None
        self.names: list[str] = self._file.schema_arrow.names

    def numbers(self, column: int | str) -> NDArray[np.float64]:
        """Return one column as numbers, NaN where it is null; of dates, s since 1970."""
        import pyarrow as pa

        name = self.names[column_index(column, self.names)]
        try:
            pa.default_memory_pool().release_unused()  # of the column before
            result, done = np.empty(self._file.metadata.num_rows), 0
            for batch in self._file.iter_batches(_ROWS, columns=[name], use_threads=False):
                values = batch.column(0)
                date = pa.types.is_timestamp(values.type)
                if date:
                    values = values.cast(pa.timestamp("ns")).cast(pa.int64())
                if pa.types.is_boolean(values.type):
                    values = values.cast(pa.int8())
                if not (pa.types.is_floating(values.type) or pa.types.is_integer(values.type)):
                    raise DataError(f"column '{name}' holds {values.type}, expected numbers")
                values = values.cast(pa.float64(), safe=False).fill_null(np.nan)
                # Its own to_numpy loads pandas, which takes as much memory as four columns.
                numbers = np.frombuffer(values.buffers()[1], np.float64, len(values), 8 * values.offset)
                result[done : done + len(values)] = 1e-9 * numbers if date else numbers
                done += len(values)
            return result
        except self._faults as error:
            raise DataError(
                f"column '{name}' cannot be read ({type(error).__name__})", remedy="export the log again"
            ) from None


def parquet_signals(path: Path) -> Iterator[Signal]:
    """Yield the numeric columns with the clock that their names give; for listing."""
    file = _Columns(Path(path))
    columns = []
    for name in file.names:
        try:
            columns.append((name, "", file.numbers(name)))
        except DataError:
            continue  # text, or a name that is there twice
    yield from clock_of_table(columns)


READER = Reader((".parquet",), read_parquet, signals=parquet_signals)
