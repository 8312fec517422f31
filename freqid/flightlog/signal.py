"""One quantity as a log has it, before anything is converted."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError, nearest
from freqid.core.units import to_si


@dataclass(frozen=True)
class Signal:
    """One quantity of a log with the clock that it was sampled by.

    Attributes
    ----------
    name : str
        As a column map calls it.
    time : ndarray, shape (sample,)
        s, on the log's clock. Signals that were sampled together share one array.
    values : ndarray, shape (sample,)
        As logged, NaN where blank.
    unit : str
        As the log states it; empty where it does not.
    note : str
        How the values came to be, where they are not a column of the log; ``clock NAME`` where a variable is
        the clock of these alone.
    label : str
        What the log says that it is, where its name is a place.
    epoch : {"", "unix"}
        What its time counts from, where the log says so.
    """

    name: str
    time: NDArray[np.float64]
    values: NDArray[np.float64]
    unit: str = ""
    note: str = ""
    label: str = ""
    epoch: str = ""


class NotLogged(DataError):
    """The log has no such column, variable or message."""


def column_index(column: int | str, names: Sequence[str]) -> int:
    """Return the position of a table's column, counted from 0.

    Parameters
    ----------
    column : int or str
        Number, counted from 1, or name.
    names : sequence of str
        Of all columns.

    Raises
    ------
    NotLogged
        Where there is none of that name or number.
    DataError
        Where there are two of that name.
    """
    if isinstance(column, int):
        if column > len(names):
            raise NotLogged(
                f"column {column} is missing, the table has {len(names)}", remedy="correct the column map"
            )
        return column - 1
    if column not in names:
        raise NotLogged(f"column '{column}' is missing", remedy=nearest(column, names))
    count = sum(name == column for name in names)
    if count > 1:
        raise DataError(f"{count} columns are named '{column}'", remedy="map the wanted one by number")
    return list(names).index(column)


def clock_of_table(columns: Sequence[tuple[str, str, NDArray[np.float64]]]) -> Iterator[Signal]:
    """Yield the columns of a table as signals of the one column that is its clock.

    Parameters
    ----------
    columns : sequence of (name, unit, values)
        The first that increases throughout and is called after time is the clock, else the first that
        increases; it is yielded first, as itself.

    Raises
    ------
    DataError
        Where no column increases.
    """
    found = [i for i, (_, _, x) in enumerate(columns) if x.size > 1 and (np.diff(x) > 0).all()]
    if not found:
        raise DataError(
            "no column increases throughout, so none is the clock",
            remedy="mend the time column; it repeats or runs backward",
        )
    clock = next((i for i in found if looks_like_time(columns[i][0])), found[0])
    name, unit, raw = columns[clock]
    unit = unit or time_unit(name, raw)
    time = to_si(unit, "s", name).factor * raw
    yield Signal(name, time, raw, unit, "clock")
    for i, (name, unit, x) in enumerate(columns):
        if i != clock:
            yield Signal(name, time, x, unit)


def looks_like_time(name: str) -> bool:
    """Tell whether a column is called as clocks are."""
    return bool(
        re.match(
            r"(.*[/ _.])?(t|time|timestamp|elapsed|sec|seconds|tow|date)([^a-z]|us|ms|s$|$)", name.lower()
        )
    )


def time_unit(name: str, values: NDArray[np.float64]) -> str:
    """Return the unit of a clock by the end of its name, else by the rates that flight logs have."""
    ends = {"us": "us", "ms": "ms", "ns": "ns", "s": "s", "sec": "s"}
    last = re.split(r"[^a-z]+", name.lower().rstrip(")]} "))[-1]
    if last in ends and last != name.lower():
        return ends[last]
    step = float(np.median(np.diff(values)))
    return "s" if step < 5 else "ms" if step < 1500 else "us"
