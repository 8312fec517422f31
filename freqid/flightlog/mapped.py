"""What a column map names, picked out of a log and assembled: one way for all kinds of logs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError, UsageError
from freqid.core.record import Configuration, FlightRecord
from freqid.core.units import to_si
from freqid.flightlog.assemble import Column, assemble
from freqid.flightlog.column_map import ChannelPlace, ColumnMap, Place
from freqid.flightlog.derive import derived
from freqid.flightlog.signal import NotLogged, Signal


def assemble_map(
    path: Path,
    reader: str,
    column_map: ColumnMap,
    pick: Callable[[Place], NDArray[np.float64] | Signal],
    **options: Any,
) -> FlightRecord:
    """Assemble what a column map names; `pick` returns the values at one of its places, or a whole signal.

    Parameters
    ----------
    path, reader
        As in `assemble`.
    column_map : ColumnMap
    pick : callable
        Raises DataError where the log has no such place.
    **options
        Passed to `assemble`.
    """

    def picked(place: Place) -> NDArray[np.float64] | Signal:
        try:
            return pick(place)
        except DataError as error:
            raise error.at(str(path)) from None

    def column(name: str, place: Any, raw: NDArray[np.float64] | Signal, source: str) -> Column:
        sign = getattr(place, "sign", 1)
        scale, offset = getattr(place, "scale", 1.0), getattr(place, "offset", 0.0)
        values = raw.values if isinstance(raw, Signal) else raw
        if (scale, offset) != (1.0, 0.0):
            values = scale * values + offset
            source += f", {scale:g} x logged{f' {offset:+g}' if offset else ''}"
        return Column(
            name=name,
            values=values,
            unit=place.unit,
            source=f"{Path(path).name}: {source}, {place.unit}{', sign -1' if sign < 0 else ''}",
            sign=sign,
            position_m=getattr(place, "position_m", None),
            rate_hz=getattr(place, "rate_hz", None),
            time=raw.time if isinstance(raw, Signal) else None,
        )

    weeks = _weeks(column_map, picked)
    clock, start, about = _log_clock(column_map, picked, weeks)
    log_clock = None if clock is None else clock.values  # already s
    own_clocks: dict[int | str, tuple[NDArray[np.float64], NDArray[np.bool_]]] = {}

    def on_own_clock(place: ChannelPlace, values: NDArray[np.float64]) -> Signal:
        """Return values by the column that the channel names as its clock; rows without a time are none."""
        assert place.time is not None
        if place.time not in own_clocks:
            if reader == "matlab" and isinstance(place.time, str):
                spot = Place(variable=place.time, unit="s")
            else:
                spot = Place(column=place.time, unit="s")
            seconds = _seconds(picked(spot), column_map, weeks) - start
            there = np.isfinite(seconds)
            own_clocks[place.time] = seconds[there], there
        time, there = own_clocks[place.time]
        if values.shape != there.shape:
            raise DataError(
                f"channel '{place.name}' has {values.size} values, its clock {there.size}", where=str(path)
            )
        return Signal(place.name, time, values[there])

    def fetch(name: str) -> Signal:
        raw = picked(Place(column=name, unit="1"))
        if isinstance(raw, Signal):
            return raw
        if log_clock is None:
            raise UsageError("the map has no [time]", where=str(path), remedy="say which column is the clock")
        return Signal(name, log_clock, raw)

    absent: list[str] = []

    def columns() -> Iterator[Column]:
        for place in column_map.channel:
            found = _first_logged(place, picked)
            if found is None:
                absent.append(place.name)
                continue
            raw, source = found
            if place.time is not None and not isinstance(raw, Signal):
                raw = on_own_clock(place, raw)
            if log_clock is None and not isinstance(raw, Signal):
                raise UsageError(
                    "the map has no [time]", where=str(path), remedy="say which column is the clock"
                )
            yield column(place.name, place, raw, source)
        for signal in derived(column_map, fetch):
            time = None if signal.time is log_clock else signal.time
            source = f"{Path(path).name}: {signal.note}, {signal.unit}"
            yield Column(signal.name, signal.values, signal.unit, source, time=time)

    entries = column_map.record
    history = options.pop("provenance", None) or {}
    options["configuration"] = Configuration(
        *(
            stated or logged
            for stated, logged in zip(
                (entries.tail, entries.firmware, entries.parameter_hash),
                options.pop("configuration", ("", "", "")),
                strict=True,
            )
        )
    )
    record = assemble(
        path,
        reader,
        clock,
        columns(),
        [column(p.name, p, picked(p), _spot(p)) for p in column_map.mass_property],
        reference=entries.reference,
        provenance={**history, **about},
        **options,
    )
    if absent:
        record = replace(record, provenance={**record.provenance, "not_logged": absent})
    return record


def _spot(place: Place) -> str:
    """Return where a quantity stands, in words."""
    spot = [f"column {place.column!r}"] if place.column is not None else []
    spot += [f"variable {place.variable!r}"] if place.variable is not None else []
    return " of ".join(spot)


def _first_logged(
    place: ChannelPlace, picked: Callable[[Place], NDArray[np.float64] | Signal]
) -> tuple[NDArray[np.float64] | Signal, str] | None:
    """Return what is at the first of a channel's places that the log has, and its name, or None."""
    missing: NotLogged | None = None
    for tried in (place, *(msgspec.structs.replace(place, column=name) for name in place.otherwise)):
        try:
            raw = picked(tried)
        except NotLogged as error:
            missing = missing or error
            continue
        values = raw.values if isinstance(raw, Signal) else raw
        if place.optional and not np.isfinite(values).any():
            continue
        return raw, (raw.note if isinstance(raw, Signal) else "") or _spot(tried)
    if place.optional:
        return None
    assert missing is not None
    raise missing


_EPOCH = {"unix": datetime(1970, 1, 1, tzinfo=UTC), "gps": datetime(1980, 1, 6, tzinfo=UTC)}


Pick = Callable[[Place], NDArray[np.float64] | Signal]


def _weeks(column_map: ColumnMap, picked: Pick) -> NDArray[np.float64] | None:
    """Return the GPS week of each row, where the map has it."""
    if column_map.time is None or column_map.time.week is None:
        return None
    found = picked(Place(column=column_map.time.week, unit="1"))
    return found.values if isinstance(found, Signal) else found


def _seconds(
    raw: NDArray[np.float64] | Signal, column_map: ColumnMap, weeks: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Return a clock in s, GPS weeks added; dates are s since 1970 already."""
    if column_map.time is None:
        raise UsageError("the map has no [time]", remedy="say in which unit the clocks count")
    values = raw.values if isinstance(raw, Signal) else raw
    if column_map.time.unit != "date":
        values = to_si(column_map.time.unit, "s", "time").factor * values
    if weeks is None:
        return values
    if weeks.shape != values.shape:
        raise DataError(
            f"'{column_map.time.week}' has {weeks.size} weeks for a clock of {values.size} values"
        )
    return values + 604800.0 * weeks


def _log_clock(
    column_map: ColumnMap, picked: Pick, weeks: NDArray[np.float64] | None
) -> tuple[Column | None, float, dict[str, Any]]:
    """Return the clock of the map, s, what was taken off it, and the date that it starts at."""
    place = column_map.time
    if place is None:
        return None, 0.0, {}
    seconds, epoch = _seconds(picked(place), column_map, weeks), place.epoch
    if place.unit == "date":
        epoch = "unix"
    if place.week is not None:
        epoch = "gps"
    finite = seconds[np.isfinite(seconds)]
    if not epoch or not finite.size:
        return Column("time", seconds, "s", "time"), 0.0, {}
    start = float(finite[0])
    try:
        began = (_EPOCH[epoch] + timedelta(seconds=start)).isoformat()
    except OverflowError:
        raise DataError(
            f"time starts {start:.4g} s after the epoch '{epoch}', which is no date",
            remedy="correct its unit",
        ) from None
    kind = "UTC" if epoch == "unix" else "GPS time, leap seconds not taken out"
    return Column("time", seconds - start, "s", "time"), start, {"clock_start": f"{began} ({kind})"}
