"""CSV: parameters as a long table, one row a parameter and condition, and records as columns."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from freqid.blend.exports.plain import Model, rows
from freqid.core.record import FlightRecord
from freqid.core.store import replacing


def write_parameters(path: Path, models: Sequence[Model]) -> int:
    """Write the parameters of one or more models and return the number of rows.

    Parameters
    ----------
    path : Path
    models : sequence of models
        Their rows follow each other; a column that one of them does not have is empty there.

    Raises
    ------
    DataError
        Where the file cannot be written.
    """
    table = [row for model in models for row in rows(model)]
    columns = list(dict.fromkeys(name for row in table for name in row))
    last = [c for c in ("response", "parameter") if c in columns]
    if last:  # what is scheduled may differ between models: all of it stands before the parameter
        first = {name for row in table for name in list(row)[: list(row).index(last[0])]}
        columns = [c for c in columns if c in first] + [c for c in columns if c not in first]
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows({k: _exact(v) for k, v in row.items()} for row in table)
    return len(table)


def _exact(value: object) -> object:
    """Return a number with all its digits."""
    return repr(float(value)) if isinstance(value, float) else value


def write_record(path: Path, record: FlightRecord) -> int:
    """Write a record, one row a sample, columns ``time [s]`` and ``group/name [unit]``; return the rows.

    Raises
    ------
    DataError
        Where the file cannot be written.
    """
    head = ["time [s]", *(f"{name} [{c.unit}]" for name, c in record.channels.items())]
    columns = [record.time, *(c.values for c in record.channels.values())]
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        writer.writerows(zip(*(map(repr, column.tolist()) for column in columns), strict=True))
    return record.time.size
