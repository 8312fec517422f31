"""Where the manoeuvres of a record are: between its steady stretches."""

from __future__ import annotations

from math import radians

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from freqid.core.channels import RATES
from freqid.core.errors import DataError
from freqid.core.record import FlightRecord

WINDOW_S = 1.0  # over which movement is measured
STEADY_S = 2.0  # shortest stretch that counts as trim
# Movement within one window that any channel may show in trim, by SI unit.
FLOORS = {"rad": radians(0.5), "rad/s": radians(2.0), "1": 0.01, "m": 0.0025}
SHARE = 0.05  # of the median size: the floor of rotor speeds and thrusts
_Movements = dict[str, tuple[NDArray[np.float64], float]]


def find_maneuvers(record: FlightRecord, margin_s: float = 1.0) -> tuple[tuple[float, float], ...]:
    """Return the manoeuvres of a record, each with some trim before and after it.

    Parameters
    ----------
    record : FlightRecord
    margin_s : float
        Trim kept on either side, s, where there is as much; half a window of quiet is always there.

    Returns
    -------
    tuple of (start, stop), s
        The stretches between trims in which an effector, command or excitation moves. Neither trim nor
        manoeuvre are stretches where only the aircraft moves, in a gust say, and corrections of the
        trim: inputs for no longer than a window, and by less than half of the largest swing of
        any input in that unit.

    Raises
    ------
    DataError
        Where the record has no effector, command or excitation, or none of them moves.

    Notes
    -----
    Trim is where no effector and no rate moves for at least `STEADY_S`. A channel moves where its
    peak-to-peak within a centred window of `WINDOW_S` exceeds ``max(floor, min(4 P05, max / 4))``: P05 is
    the 5 % quantile of that measure over the record, so that turbulence and an active controller do not
    hide the trim; a quarter of the largest keeps a record that is all manoeuvre from being taken for a
    quiet one. Injected signals have no floor but 0.1 % of their largest value. The floors are in `FLOORS`
    and `SHARE`.
    """
    starts, stops = _steady(record)
    first, last = np.concatenate([[0], stops]), np.concatenate([starts, [record.time.size]])
    movements = {name: _movement(record, name) for name in _inputs(record)}
    margin = round(margin_s / record.dt)
    found = []
    for i, (low, high) in enumerate(zip(first, last, strict=True)):
        if _is_input(record, movements, low, high):
            before = low - starts[i - 1] if i else 0
            after = stops[i] - high if i < len(stops) else 0
            found.append((low - min(margin, before // 2), high + min(margin, after // 2)))
    if not found:
        raise DataError("no manoeuvre found: no effector, command or excitation moves", remedy="state --cut")
    return _spans(record, *np.array(found).T)


def _is_input(record: FlightRecord, movements: _Movements, low: int, high: int) -> bool:
    """Tell whether inputs move in a stretch by more than a short, small correction of the trim."""
    for name, (swing, threshold) in movements.items():
        unit = record.channel(name).unit
        largest = max(other.max() for n, (other, _) in movements.items() if record.channel(n).unit == unit)
        moving = swing[low:high] > threshold
        if moving.sum() * record.dt > WINDOW_S or (moving.any() and swing[low:high].max() >= 0.5 * largest):
            return True
    return False


def _steady(record: FlightRecord) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return first and one-past-last sample of every trim stretch."""
    rates = [name for name in RATES if name in record]
    movements = [_movement(record, name) for name in (*_inputs(record), *rates)]
    moves = np.logical_or.reduce([swing > threshold for swing, threshold in movements])
    quiet = np.concatenate([[False], ~moves, [False]]).astype(np.int8)
    starts, stops = np.flatnonzero(np.diff(quiet) == 1), np.flatnonzero(np.diff(quiet) == -1)
    long = (stops - starts) * record.dt >= STEADY_S
    return starts[long], stops[long]


def _inputs(record: FlightRecord) -> list[str]:
    """Return the channels that make a manoeuvre: excitations where logged, else effectors, else commands."""
    for group in ("excitation", "effector", "command"):
        names = record.group(group)
        if names:
            return [f"{group}/{name}" for name in names]
    raise DataError(
        "the record has no effector, command or excitation to find manoeuvres by", remedy="state --cut"
    )


def _movement(record: FlightRecord, name: str) -> tuple[NDArray[np.float64], float]:
    """Return a channel's peak-to-peak in the window around each sample, and what of it counts as movement."""
    channel = record.channel(name)
    size = max(3, round(WINDOW_S / record.dt) | 1)
    swing = maximum_filter1d(channel.values, size) - minimum_filter1d(channel.values, size)
    if name.startswith("excitation/"):
        return swing, 1e-3 * float(np.abs(channel.values).max())
    floor = FLOORS.get(channel.unit, 0.0)
    if not name.startswith("state/") and channel.unit in ("rad/s", "N"):
        floor = SHARE * float(np.median(np.abs(channel.values)))
    return swing, max(floor, min(4 * float(np.quantile(swing, 0.05)), 0.25 * float(swing.max())))


def _spans(
    record: FlightRecord, starts: NDArray[np.intp], stops: NDArray[np.intp]
) -> tuple[tuple[float, float], ...]:
    """Return sample ranges as times, both ends inside the range."""
    return tuple(
        (float(record.time[a]), float(record.time[b - 1])) for a, b in zip(starts, stops, strict=True)
    )
