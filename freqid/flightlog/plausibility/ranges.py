"""Values that no flight has, and values beyond what the scenario states."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from freqid.core.errors import nearest
from freqid.core.record import Channel, FlightRecord
from freqid.core.scenario import Reference
from freqid.core.vehicle import Effector
from freqid.flightlog.plausibility.finding import Finding

# What the atmosphere, geometry and sensors allow, SI. Angles are what their definitions allow; rates and
# specific forces are twice the full scale of inertial sensors for flight control (2000 deg/s, 16 g); density
# is that of the standard atmosphere from 30 km to below sea level on the coldest day.
_G = 9.80665
RANGES: dict[str, tuple[float, float, str]] = {
    **{f"state/{n}": (-70.0, 70.0, "a gyro's") for n in "pqr"},
    **{f"state/a{n}": (-32 * _G, 32 * _G, "an accelerometer's") for n in "xyz"},
    **{f"state/{n}": (-1000.0, 1000.0, "an aircraft's") for n in ("u", "v", "w", "vn", "ve", "vd")},
    "state/theta": (-pi / 2 * 1.02, pi / 2 * 1.02, "a pitch angle's, in rad"),
    "state/alt": (-1000.0, 40e3, "an aircraft's"),
    "air/V": (-5.0, 1000.0, "an airspeed's"),
    "air/rho": (0.015, 1.8, "the atmosphere's"),
    "air/alpha": (-pi, pi, "a flow angle's, in rad"),
    "air/beta": (-pi, pi, "a flow angle's, in rad"),
    "air/mach": (-0.02, 3.0, "an aircraft's"),
}
BEYOND = 0.02  # of its travel that an effector may be logged beyond its limits: calibration and noise
FASTER = 1.1  # times its rate limit that an effector may be logged to move: a limit has two digits
NOISE_SIGMAS = 6.0
FEW = 0.01  # of the samples beyond a range: a glitch, and not the unit
SPIKE = 10.0  # times the 99.5 % quantile of the departures from the neighbours
MOST_SPIKES = 1e-3  # of the samples; what departs more often belongs to the signal
SPEEDS = {"kt": 0.514444, "ft/s": 0.3048, "km/h": 1 / 3.6, "mph": 0.44704}  # m/s
Stray = tuple[str, NDArray[np.intp], float, float]
CLOSE = 0.12  # a flown speed is about the reference's: what tells kt from mph


def physical(record: FlightRecord) -> Iterator[Finding]:
    """Yield channels with values that cannot be."""
    for name, (low, high, whose) in RANGES.items():
        if name not in record:
            continue
        channel = record.channel(name)
        outside = np.flatnonzero((channel.values < low) | (channel.values > high))
        if outside.size:
            worst = channel.values[outside[np.argmax(np.abs(channel.values[outside]))]]
            yield Finding(
                "error",
                "range",
                (name,),
                f"'{name}' is {worst:.4g} {channel.unit} at worst and outside {low:.4g} to {high:.4g} "
                f"{channel.unit}, which is {whose} range, in {_counted(outside, record)}",
                f'correct unit of [[channel]] name = "{name}" in the map (now {_logged(channel)})'
                if outside.size > FEW * record.time.size
                else f"cut the record there with --cut, or repair '{name}' first",
                {"samples": outside.size, "worst": float(worst), "low": low, "high": high},
                _span(outside, record),
            )


def spikes(record: FlightRecord, stray: Iterable[Stray]) -> Iterator[Finding]:
    """Yield channels with single samples far away from both neighbours, as `stray_samples` has them."""
    for name, at, largest, usual in stray:
        yield Finding(
            "warning",
            "spike",
            (name,),
            f"'{name}' has {at.size} single samples that leave their neighbours by up to {largest:.3g} "
            f"{record.channel(name).unit}, {largest / usual:.0f} times what 99.5 % of its samples do, first "
            f"at t = {record.time[at[0]]:.4g} s",
            f"repair '{name}' first, or cut the record there with --cut",
            {"samples": at.size, "largest": largest, "usual": usual},
            _span(at, record),
        )


def stray_samples(record: FlightRecord) -> Iterator[Stray]:
    """Yield channels, their stray samples, the largest departure from the neighbours and what is usual."""
    for name, channel in record.channels.items():
        if name.startswith(("excitation/", "command/", "response/")):
            continue  # these may step
        x = channel.values
        if x.size < 50 or np.ptp(x) == 0:
            continue
        away = median_filter(x, 5)
        away -= x  # in place, here and below: arrays of a long log fill the memory
        away = np.abs(away, out=away)[2:-2]
        largest = float(np.quantile(away, 0.995))
        moves = np.diff(x)
        moves = np.abs(moves, out=moves)
        usual = max(largest, float(np.median(moves[moves > 0], overwrite_input=True)))
        at = np.flatnonzero(away > SPIKE * usual) + 2
        if at.size and at.size <= max(1, MOST_SPIKES * x.size):
            yield name, at, float(away[at - 2].max()), usual


def bridged(record: FlightRecord, stray: Iterable[Stray]) -> FlightRecord:
    """Return a record in which few impossible or single stray samples are bridged by straight lines.

    For what compares whole channels: one sample of 65535 outweighs all others.
    """
    left_out: dict[str, set[int]] = {}
    for name, (low, high, _) in RANGES.items():
        if name in record:
            outside = np.flatnonzero((record[name] < low) | (record[name] > high))
            if 0 < outside.size <= FEW * record.time.size:
                left_out.setdefault(name, set()).update(outside.tolist())
    for name, at, _, _ in stray:
        left_out.setdefault(name, set()).update(at.tolist())
    if not left_out:
        return record
    channels = []
    for name, at in left_out.items():
        kept = np.setdiff1d(np.arange(record.time.size), list(at))
        values = np.interp(record.time, record.time[kept], record[name][kept])
        channels.append(replace(record.channel(name), values=values))
    return record.with_channels(*channels)


def stated(record: FlightRecord) -> Iterator[Finding]:
    """Yield effectors and commands beyond the limits, and faster than the rate limits, of the scenario."""
    for effector in record.vehicle.effectors if record.vehicle else ():
        for group in ("effector", "command"):
            name = f"{group}/{effector.name}"
            if name not in record or record.channel(name).unit != effector.unit:
                continue
            found = _beyond(record, record.channel(name), effector)
            if found is not None:
                yield found
            elif group == "effector" and effector.rate_limit is not None:
                yield from _too_fast(record, record.channel(name), effector, effector.rate_limit)


def unknown(record: FlightRecord) -> Iterator[Finding]:
    """Yield positions and commands of effectors that the scenario does not describe."""
    if record.vehicle is None or not record.vehicle.effectors:
        return
    described = [e.name for e in record.vehicle.effectors]
    for name in record.channels:
        group, _, of = name.partition("/")
        if group in ("effector", "command") and of not in described:
            yield Finding(
                "warning",
                "effector",
                (name,),
                f"'{name}' is of no effector of the scenario ({nearest(of, described)})",
                f'name [[channel]] name = "{name}" in the map as the scenario does, or describe it there as '
                "[[effector]]",
            )


def _beyond(record: FlightRecord, channel: Channel, effector: Effector) -> Finding | None:
    """Return how far a position is beyond its limits; an error from a whole travel on."""
    low, high = effector.limits
    travel = high - low
    if not np.isfinite(travel):
        return None
    past = np.maximum(low - channel.values, channel.values - high)
    if channel.name.startswith("command/") and past.max() < travel:
        return None  # what is commanded beyond the stops is clipped there, which `quicklook` reports
    outside = np.flatnonzero(past > BEYOND * travel)
    if not outside.size:
        return None
    worst = float(channel.values[np.argmax(past)])
    wrong = float(np.quantile(past, 0.99)) > travel
    return Finding(
        "error" if wrong else "warning",
        "limit",
        (channel.name,),
        f"'{channel.name}' reaches {worst:.4g} {channel.unit}, the scenario allows {low:g} to {high:g} "
        f"{channel.unit}; it is beyond in {_counted(outside, record)}",
        f'correct unit of [[channel]] name = "{channel.name}" in the map (now {_logged(channel)}), or limits '
        f'of [[effector]] name = "{effector.name}" in the scenario',
        {"samples": outside.size, "worst": worst, "low": low, "high": high},
        _span(outside, record),
    )


def _too_fast(record: FlightRecord, channel: Channel, effector: Effector, limit: float) -> Iterator[Finding]:
    """Yield a position that moves faster than stated, by more than its noise over two samples."""
    x, dt = channel.values, record.dt
    if x.size < 20:
        return
    noise = float(np.median(np.abs(np.diff(x, n=2)))) / 0.6745 / np.sqrt(6.0)
    rate = np.abs(x[2:] - x[:-2]) / (2 * dt)
    fast = np.flatnonzero(rate > FASTER * limit + NOISE_SIGMAS * noise / (np.sqrt(2.0) * dt)) + 1
    if fast.size:
        yield Finding(
            "warning",
            "rate limit",
            (channel.name,),
            f"'{channel.name}' moves at up to {rate.max():.4g} {channel.unit}/s, the scenario's rate limit "
            f"is {limit:g} {channel.unit}/s; it is faster in {_counted(fast, record)}",
            f'correct rate_limit of [[effector]] name = "{effector.name}" in the scenario, or the unit of '
            f"'{channel.name}' in the map",
            {"samples": fast.size, "fastest": float(rate.max()), "rate_limit": limit},
            _span(fast, record),
        )


def at_reference(record: FlightRecord, reference: Reference | None) -> Iterator[Finding]:
    """Yield an airspeed that differs from the reference condition's by the factor of another unit."""
    if reference is None or not reference.u > 0:
        return
    for name in ("air/V", "state/u"):
        if name not in record:
            continue
        mean = float(np.mean(record[name]))
        for unit, factor in SPEEDS.items():
            for ratio, said in ((1 / factor, unit), (factor, "m/s")):
                if abs(np.log(max(mean, 1e-9) / (ratio * reference.u))) < CLOSE / 2:
                    yield Finding(
                        "error",
                        "unit",
                        (name,),
                        f"'{name}' is {mean:.4g} m/s in the mean, {mean / reference.u:.3g} times the "
                        f"{reference.u:g} m/s of reference '{reference.id}', as if it were read in the wrong "
                        f"one of m/s and {unit}",
                        f'set unit = "{said}" of [[channel]] name = "{name}" in the map '
                        f"(now {_logged(record.channel(name))}), or name the reference that was flown",
                        {"mean": mean, "reference": reference.u, "ratio": mean / reference.u},
                    )
                    return


def _counted(at: NDArray[np.intp], record: FlightRecord) -> str:
    """Say how many samples, and from when to when."""
    first, last = record.time[at[0]], record.time[at[-1]]
    where = f"t = {first:.4g} s" if first == last else f"t = {first:.4g} to {last:.4g} s"
    return f"{at.size} of {record.time.size} samples, {where}"


def _span(at: NDArray[np.intp], record: FlightRecord) -> tuple[float, float]:
    return float(record.time[at[0]]), float(record.time[at[-1]])


def _logged(channel: Channel) -> str:
    """Return what the channel's source says of it."""
    return channel.source or f"in {channel.unit}"
