"""Channels that a log holds in another form: attitude, velocity over the ground, rotor speeds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import pi

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import ATTITUDE, VELOCITY
from freqid.core.errors import DataError
from freqid.core.units import to_si
from freqid.dynamics.frames import level_from_body
from freqid.flightlog.column_map import ColumnMap, RotorPlace, VelocityPlace
from freqid.flightlog.resample import LONGEST_GAP
from freqid.flightlog.signal import NotLogged, Signal

Fetch = Callable[[str], Signal]


def derived(column_map: ColumnMap, fetch: Fetch) -> Iterator[Signal]:
    """Yield the channels that a map derives, in their names, units and clocks.

    Parameters
    ----------
    column_map : ColumnMap
    fetch : callable
        Returns the signal of a column; raises NotLogged where the log has none.

    Raises
    ------
    DataError
        Where the log lacks what a channel is made from, or it does not fit.
    """
    if column_map.attitude:
        angles = _euler(_quaternion(column_map, fetch)[1])
        first = fetch(column_map.attitude.quaternion[0])
        for name, x in zip(ATTITUDE, angles, strict=True):
            yield Signal(name, first.time, x, "rad", "from the quaternion")
    if column_map.velocity:
        yield from _body_velocity(column_map, column_map.velocity, fetch)
    for rotor in column_map.rotor:
        found = _rotor_speed(rotor, fetch, table=column_map.time is not None)
        if found is not None:
            yield found


def _quaternion(column_map: ColumnMap, fetch: Fetch) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the clock, shape (sample,), and the unit quaternions w x y z, shape (4, sample)."""
    assert column_map.attitude is not None
    signals = [fetch(column) for column in column_map.attitude.quaternion]
    q = _together(signals)
    length = np.linalg.norm(q, axis=0)
    wrong = np.abs(length - 1) > 0.05  # single precision leaves 1e-7; 5 % is another quantity
    if wrong.any():
        at = float(signals[0].time[np.argmax(wrong)])
        raise DataError(
            f"the quaternion has length {length[np.argmax(wrong)]:.3g} at t = {at:.6g} s, expected 1",
            remedy="correct the columns of [attitude]",
        )
    return signals[0].time, q / length


def _euler(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return roll, pitch and heading, shape (3, sample), rad, of quaternions from body to north, east, down.

    References
    ----------
    Stevens, Lewis & Johnson, Aircraft Control and Simulation, 3rd ed., eq. 1.8-18.
    """
    w, x, y, z = q
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    return np.array([roll, pitch, np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))])


def _body_velocity(column_map: ColumnMap, place: VelocityPlace, fetch: Fetch) -> Iterator[Signal]:
    """Yield u v w: the velocity over the ground, less the wind where it is logged, turned into body axes."""
    velocities = [fetch(column) for column in place.ned]
    time = velocities[0].time
    if place.attitude is None:
        attitude = _euler(np.array(_turned(time, *_quaternion(column_map, fetch))))
    else:
        factor = to_si(place.attitude_unit, "rad", "[velocity] attitude_unit").factor
        angles = [fetch(column) for column in place.attitude]
        attitude = np.array([at(time, s.time, _unwrapped(factor * s.values)) for s in angles])
    wind = np.zeros((3, time.size))
    note = "velocity over the ground turned into body axes, still air assumed"
    if place.wind is not None:
        try:
            for row, column in enumerate(place.wind):
                estimate = fetch(column)
                known = np.isfinite(estimate.values)
                if not known.any():
                    raise DataError(f"'{column}' has no value", remedy="leave wind out of the map")
                # slow, so held beyond its ends
                wind[row] = np.interp(time, estimate.time[known], estimate.values[known])
            note = "velocity over the ground less the logged wind, turned into body axes"
        except NotLogged:
            wind[:] = 0.0
    body = np.einsum("ji...,j...->i...", level_from_body(attitude), _together(velocities) - wind)
    for name, x in zip(VELOCITY, body, strict=True):
        yield Signal(name, time, x, "m/s", note)


def _turned(
    time: NDArray[np.float64], own: NDArray[np.float64], q: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Return quaternions at other times, shape (4, sample); q and -q are one attitude: signs are aligned."""
    known = np.isfinite(q).all(axis=0)
    own, q = own[known], q[:, known]
    flips = np.sign(np.einsum("ij,ij->j", q[:, 1:], q[:, :-1]))
    continuous = q * np.concatenate([[1.0], np.cumprod(np.where(flips < 0, -1.0, 1.0))])
    between = np.array([at(time, own, row) for row in continuous])
    return list(between / np.linalg.norm(between, axis=0))


def _together(signals: Sequence[Signal]) -> NDArray[np.float64]:
    """Return values on the first one's clock, shape (signal, sample)."""
    time = signals[0].time
    return np.array(
        [s.values if np.array_equal(s.time, time) else at(time, s.time, s.values) for s in signals]
    )


def _unwrapped(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an angle without its jumps by a turn, NaN where it is blank."""
    found, known = np.full(angle.shape, np.nan), np.isfinite(angle)
    found[known] = np.unwrap(angle[known])
    return found


def _rotor_speed(rotor: RotorPlace, fetch: Fetch, *, table: bool) -> Signal | None:
    """Return a rotor's speed from telemetry, else from its command; None for a rotor that the log has not."""
    name = f"effector/{rotor.name}"
    if rotor.telemetry is not None:
        try:
            speed = fetch(rotor.telemetry)
        except NotLogged:
            speed = None
        if speed is not None and np.nan_to_num(speed.values).any():  # absent ESCs report zero
            return Signal(
                name,
                speed.time,
                np.abs(rotor.telemetry_scale * speed.values),
                rotor.telemetry_unit,
                f"ESC telemetry {rotor.telemetry}",
            )
    if rotor.command is None:
        return None
    try:
        command = fetch(rotor.command)
    except NotLogged:
        return None
    share = (command.values - rotor.off) / (rotor.full - rotor.off)
    if not np.isfinite(share).any() or not share[np.isfinite(share)].any():
        return None
    share = np.where(share < 0, 0.0, share)  # what is below the off command is a motor that stands
    if not table:  # an autopilot logs a command that is not driven as NaN; a table has blank cells
        share = np.nan_to_num(share)
    note = f"no ESC telemetry: command {rotor.command}"
    relative = rotor.full_speed_rpm is None or rotor.full_voltage is None
    voltage = None
    if rotor.voltage is not None:
        try:
            voltage = fetch(rotor.voltage)
        except NotLogged:
            note += ", battery voltage not logged"
    if voltage is not None:
        known = np.isfinite(voltage.values)
        if not known.any():
            raise DataError(f"'{rotor.voltage}' has no value", remedy="leave voltage out of the map")
        level = rotor.full_voltage or float(np.mean(voltage.values[known]))
        share = share * np.interp(command.time, voltage.time[known], voltage.values[known]) / level
        note += f" times {rotor.voltage} over {level:.4g} V"
    if relative:
        return Signal(name, command.time, share, "1", note + ", relative speed")
    assert rotor.full_speed_rpm is not None
    return Signal(name, command.time, share * rotor.full_speed_rpm * 2 * pi / 60, "rad/s", note)


def at(
    time: NDArray[np.float64], own: NDArray[np.float64], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return a signal at other times by straight lines; NaN beyond its ends and inside its dropouts."""
    known = np.isfinite(values)
    own, values = own[known], values[known]
    if own.size < 2:
        return np.full(time.shape, np.nan)
    between = np.interp(time, own, values, left=np.nan, right=np.nan)
    steps = np.diff(own)
    after = np.clip(np.searchsorted(own, time), 1, own.size - 1)
    bridged = (steps[after - 1] > LONGEST_GAP * np.median(steps)) & ~np.isin(time, own)
    return np.where(bridged, np.nan, between)
