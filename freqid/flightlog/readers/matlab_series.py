"""Samples beside their times: a timeseries or a timetable of MATLAB as plain Python.

- A timeseries has one array of samples and, in its ``TimeInfo``, the times themselves, or of uniform times
  start, increment and length alone.
- A timetable has a cell of variables with a row for every time, and row times that are durations or
  datetimes, or of uniform times origin and step or rate alone. Save versions 5 to 8 have the same fields.

Both become structs with times in s and time along the rows.

References
----------
.. [1] The MathWorks, class definitions of ``timeseries`` (10.1 and 10.2) and ``tsdata.timemetadata``.
.. [2] The documentation of mat-io, "Field contents": what MATLAB saves of timetable, datetime and duration.
"""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from freqid.flightlog.readers.mat5 import Allowance, MatlabObject

SERIES, TABLE = "timeseries", "timetable"
_SECONDS = {
    **{"nanoseconds": 1e-9, "microseconds": 1e-6, "milliseconds": 1e-3, "seconds": 1.0, "s": 1.0},
    **{"minutes": 60.0, "hours": 3600.0, "days": 86400.0, "weeks": 604800.0},
}
_NEWEST = 8  # version of timetables that are known; a later one may say that it suffices to know this
_NUMBERS = "fiubc"


class Timetable(dict[str, Any]):
    """Variables of a timetable by their names, and last the row times, s, by the name of their dimension.

    Attributes
    ----------
    clock : str
        Name of the row times.
    absolute : bool
        Whether they count from 1970, as datetimes do; a datetime without a zone is taken for UTC.
    stated : dict of str to (str, str)
        By variable, what it is called, where that is no name here, and its unit.
    """

    def __init__(self) -> None:
        super().__init__()
        self.clock = ""
        self.absolute = False
        self.stated: dict[str, tuple[str, str]] = {}


class SeriesReader:
    """Makes structs of objects with samples and times; uniform clocks that several share are one array.

    Parameters
    ----------
    allowance : Allowance
        That what is made is taken from.
    """

    def __init__(self, allowance: Allowance) -> None:
        self._allowance = allowance
        self._uniform: dict[tuple[float, ...], NDArray[np.float64]] = {}

    def timeseries(self, properties: dict[str, Any]) -> dict[str, Any] | MatlabObject:
        """Return ``Name``, ``Time``, ``Data`` and ``DataInfo`` of a timeseries by its properties."""
        clock, about = fields(properties.get("TimeInfo")), properties.get("DataInfo")
        # MATLAB itself asks Storage_ first, which is an object.
        samples = next((x for n in ("Storage_", "Data_") if _size(x := properties.get(n))), np.empty((0, 0)))
        if not _is_numbers(samples):
            kind = class_of(samples) or "another kind"
            return MatlabObject(SERIES, f"with samples of {kind}, which only MATLAB can read")
        unit = text(clock.get("Units")) or "seconds"
        if unit.lower() not in _SECONDS:
            return MatlabObject(SERIES, f"with times in '{unit}', which is no unit of time")
        time = self._time(properties, clock, samples.shape)
        rows = None if time is None else _rows(samples, time.size)
        if time is None or rows is None:
            times = "without times" if time is None else f"with {time.size} times"
            return MatlabObject(SERIES, f"{times} to samples of shape {_shape(samples)}")
        self._allowance.take(rows.nbytes)
        of_data = fields(about).get("Units")
        return {
            "Name": text(properties.get("Name")),
            "Time": time if unit.lower() in ("seconds", "s") else _SECONDS[unit.lower()] * time,
            "Data": rows[:, 0] if rows.shape[1] == 1 else rows,
            "DataInfo": {"Units": text(of_data) or text(fields(of_data).get("Name"))},
        }

    def _time(
        self, properties: dict[str, Any], clock: dict[str, Any], shape: tuple[int, ...]
    ) -> NDArray[np.float64] | None:
        """Return the times, or None; never more than there are samples."""
        start, step, count = (number(clock.get(n)) for n in ("Start_", "Increment_", "Length"))
        uniform = bool(np.isfinite(start) and np.isfinite(step)) and count in (1, *shape)
        # MATLAB asks TimeInfo alone; Time_ of the series itself is what is left of the first releases.
        for stored in (clock.get("Time_"), None if uniform else properties.get("Time_")):
            if isinstance(stored, np.ndarray) and stored.size and stored.dtype.kind in "fiu":
                return np.ravel(stored).astype(np.float64)
        if count == 0 and 0 in shape:
            return np.empty(0)
        return self._clock(start, int(count), step=step) if uniform else None

    def _clock(
        self, start: float, count: int, *, step: float = 0.0, rate: float = 0.0
    ) -> NDArray[np.float64]:
        """Return a uniform clock, by its step, s, or its rate, Hz: k / 3 is not k times a rounded step."""
        key = start, count, step, rate
        if key not in self._uniform:
            self._allowance.take(8 * count)
            samples = np.arange(count, dtype=np.float64)
            self._uniform[key] = start + (samples / rate if rate else step * samples)
        return self._uniform[key]

    def timetable(self, held: dict[str, Any], plain: Callable[[Any], Any]) -> Timetable | MatlabObject:
        """Return the variables and the row times of a timetable.

        Parameters
        ----------
        held : dict
            What it saves of itself.
        plain : callable
            Reads a variable that is an object. Of variables that are neither numbers nor objects nothing is
            kept.
        """
        columns, names = held.get("data"), _names(held, "var")
        count = number(held.get("numRows"))
        if (
            not isinstance(columns, np.ndarray)
            or len(names) != columns.size
            or not (count >= 0 and count.is_integer())
            or number(held.get("minCompatibleVersion")) > _NEWEST
        ):
            return MatlabObject(TABLE, "in a layout that only MATLAB can read")
        found = held.get("rowTimes")
        step = fields(found).get("stepSize")
        if class_of(step) == "calendarDuration":
            return MatlabObject(TABLE, "whose row times step by a calendar duration, which is no fixed time")
        odd = next((x for x in columns.ravel("F") if _is_numbers(x) and x.shape[0] != count), None)
        if odd is not None:
            return MatlabObject(TABLE, f"with {int(count)} rows to a variable of shape {_shape(odd)}")
        time = self._row_times(found, int(count))
        if time is None:
            return MatlabObject(TABLE, f"without row times in s to its {int(count)} rows")
        table, units = Timetable(), [text(unit) for unit in _cells(held.get("varUnits"))]
        units += [""] * (len(names) - len(units))
        for name, unit, column in zip(names, units, columns.ravel("F"), strict=False):
            key = key_of(name, table)
            table.stated[key] = name if key != name else "", unit
            if _is_numbers(column):
                self._allowance.take(column.nbytes)
                rows = column.reshape(int(count), prod(column.shape[1:]), order="F")
                table[key] = rows[:, 0] if rows.shape[1] == 1 else rows
            else:
                table[key] = plain(column) if class_of(column) else {}
        table.clock = key_of(next(iter(_names(held, "dim")), ""), table)
        table[table.clock] = time
        table.absolute = "datetime" in (class_of(found), class_of(fields(found).get("origin")))
        return table

    def _row_times(self, found: Any, count: int) -> NDArray[np.float64] | None:
        stored = _seconds(found)
        if stored is not None:
            return stored if stored.size == count else None
        regular = fields(found)
        origin, step = _seconds(regular.get("origin")), _seconds(regular.get("stepSize"))
        if origin is None or origin.size != 1 or step is None or step.size != 1:
            return None
        rate = number(regular.get("sampleRate")) if number(regular.get("specifiedAsRate")) == 1 else 0.0
        start, advance = float(origin[0]), float(step[0])
        if not np.isfinite([start, advance, rate]).all():
            return None
        return self._clock(start, count, step=advance, rate=rate)


def _seconds(found: Any) -> NDArray[np.float64] | None:
    """Return the s of durations, or the s since 1970 of datetimes, or None."""
    place = {"duration": "millis", "datetime": "data"}.get(class_of(found), "")
    held = fields(found).get(place)
    if not _is_numbers(held):
        return None
    # The imaginary part of a datetime is what its real part is rounded by.
    return np.ravel(np.real(held) + np.imag(held)).astype(np.float64) / 1e3


def _rows(samples: NDArray[Any], count: int) -> NDArray[Any] | None:
    """Return samples with time along the rows, or None where no axis is as long as the clock.

    MATLAB has time along the rows of a matrix and along the last axis of a larger array; before 2011
    either could be otherwise.
    """
    if count == 0:
        return np.empty((0, 1)) if not samples.size else None
    if count == 1:
        return samples.reshape(1, -1, order="F")
    first, last = samples.shape[0] == count, samples.shape[-1] == count
    if not (first or last):
        return None
    if last and (samples.ndim > 2 or not first):
        samples = np.moveaxis(samples, -1, 0)
    return samples.reshape(count, -1, order="F")


def key_of(name: str, held: dict[str, Any]) -> str:
    """Return what the next member of a struct is called: by its number where its name can be no path."""
    usable = name and name not in held and not set(name) & set(".(){}")
    return name if usable else f"{{{len(held) + 1}}}"


def class_of(found: Any) -> str:
    """Return the class of an object; of anything else, an empty text."""
    return str(getattr(found, "classname", "") or "")


def fields(found: Any) -> dict[str, Any]:
    """Return the fields of a struct or an object; of one that saves itself as a struct, of that."""
    own = getattr(found, "properties", None)
    if isinstance(own, dict):
        return {**own, **fields(own.get("any"))}
    if isinstance(found, np.ndarray) and found.dtype.names and found.size == 1:
        row = found.ravel()[0]
        return {name: row[name] for name in found.dtype.names}
    return {}


def text(found: Any) -> str:
    """Return a line of text; anything else is empty."""
    if isinstance(found, np.ndarray) and found.dtype.kind == "U" and found.size == 1:
        return str(found.ravel()[0]).strip()
    return ""


def number(found: Any) -> float:
    """Return a scalar, or NaN."""
    if isinstance(found, np.ndarray) and found.size == 1 and found.dtype.kind in "fiub":
        return float(found.ravel()[0])
    return float("nan")


def _names(held: dict[str, Any], kind: str) -> list[str]:
    """Return the names of variables or dimensions as they were given.

    Since R2019b they may be no identifiers, since R2025a longer than 63 letters; then the names in the usual
    place are made up or cut.
    """
    use = f"use{kind.capitalize()}Names"
    form = next((end for end in ("2048", "Orig") if number(held.get(use + end)) == 1), "")
    return [text(name) for name in _cells(held.get(f"{kind}Names{form}"))]


def _cells(found: Any) -> list[Any]:
    return list(found.ravel("F")) if isinstance(found, np.ndarray) and found.dtype.kind == "O" else []


def _is_numbers(found: Any) -> TypeGuard[NDArray[Any]]:
    return isinstance(found, np.ndarray) and found.dtype.kind in _NUMBERS


def _size(found: Any) -> int:
    """Return how much is there: an object counts as one, and a property that is absent as nothing."""
    return found.size if isinstance(found, np.ndarray) else int(found is not None)


def _shape(samples: NDArray[Any]) -> str:
    return " x ".join(map(str, samples.shape))
