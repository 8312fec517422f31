"""A record parted into motion and white noise: what signatures are computed from, how loud sensors are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from freqid.core.arrays import Array
from freqid.core.record import FlightRecord
from freqid.identify.spectra.smoothing import Smoothed, smooth

MOTION = ("u", "v", "w", "p", "q", "r")
FELT = ("ax", "ay", "az")
ATTITUDE = ("phi", "theta", "psi")

_NO_NOISE = 1e-3  # Hz: cutoff of a channel in which no noise is left
_LINES_OF_FLOOR = 100
_SLOW = 0.9  # of the record's rate: a sensor below it was joined by straight lines
_FEWEST = 8  # samples that a smoothing takes


@dataclass(frozen=True, eq=False)
class Quiet:
    """A record whose channels are parted into motion and white noise.

    Attributes
    ----------
    record : FlightRecord
        Motion alone, as far as it stands out of the noise.
    sigma : dict of float
        Standard deviation of the noise by channel.
    cutoff_hz : dict of float
        Frequency from which on noise is the stronger, by channel.
    """

    record: FlightRecord
    sigma: dict[str, float]
    cutoff_hz: dict[str, float]


def without_sensor_noise(
    record: FlightRecord,
    names: Sequence[str],
    expected: Mapping[str, Array] | None = None,
    flown: Mapping[str, Array] | None = None,
) -> Quiet:
    """Return a record without the noise of some channels.

    Signatures are computed from it: what noise would put into them is in the residual too, and would pass
    for an effect.

    Parameters
    ----------
    record : FlightRecord
    names : sequence of str
    expected : dict of ndarray, optional
        Histories without noise that some channels should be close to; only what they differ by is smoothed,
        and of noise within the band next to nothing stays.
    flown : dict of ndarray, optional
        What the injected signals alone would have made, by channel (`freqid.gap.driven`): it stands in for
        the log, but for a straight line. Neither noise nor gusts are in it. Commands stay as they were sent:
        they are known, and what an actuator makes of them is no noise.
    """
    names, expected = list(names), expected or {}
    values = record.matrix(names)
    base = np.zeros_like(values)
    for i, name in enumerate(names):
        if name in ("state/phi", "state/psi"):
            values[i] = np.unwrap(values[i])
        base[i] = expected.get(name, base[i])
    rates = [record.channel(n).native_rate_hz for n in names]
    found = _smoothed(values - base, record.dt, rates)
    kept, cutoff = base + found.x, found.cutoff_hz.copy()
    instead = _standing_in(record, names, values, flown or {})
    for i, own in instead.items():
        kept[i], cutoff[i] = own, _NO_NOISE
    channels = [replace(record.channel(n), values=x) for n, x in zip(names, kept, strict=True)]
    floor = [
        _floor(x, rate, record.dt, c)
        for x, rate, c in zip(values - kept, rates, found.cutoff_hz, strict=True)
    ]
    sigma = [f if f is not None else s for f, s in zip(floor, found.noise_std.tolist(), strict=True)]
    return Quiet(
        record.with_channels(*channels),
        dict(zip(names, sigma, strict=True)),
        dict(zip(names, cutoff.tolist(), strict=True)),
    )


def _standing_in(
    record: FlightRecord, names: Sequence[str], values: Array, flown: Mapping[str, Array]
) -> dict[int, Array]:
    """Return what stands in for rows of values, by row, about the straight lines of the log."""
    time = record.time - record.time.mean()
    found: dict[int, Array] = {}
    for i, name in enumerate(names):
        if name in flown:
            own = np.unwrap(flown[name]) if name in ("state/phi", "state/psi") else flown[name]
            found[i] = own + np.polyval(np.polyfit(time, values[i] - own, 1), time)
    return found


def _smoothed(values: Array, dt: float, rates: Sequence[float]) -> Smoothed:
    """Return channels parted into motion and noise, those of slow sensors by the samples that they took.

    Joined by straight lines their noise falls with frequency as motion does, and would pass for it.
    """
    found = smooth(values, dt)
    parts = [found.x, found.derivative, found.noise_std, found.cutoff_hz]
    for i in (i for i, rate in enumerate(rates) if rate * dt < _SLOW):
        time = dt * np.arange(values.shape[1])
        taken = np.interp(np.arange(0, time[-1], 1 / rates[i]), time, values[i])
        if taken.size >= _FEWEST:
            cutoff = float(smooth(taken[None], 1 / rates[i]).cutoff_hz[0])
            own = smooth(values[i : i + 1], dt, cutoff)
            for part, value in zip(parts, (own.x, own.derivative, own.noise_std, own.cutoff_hz), strict=True):
                part[i] = value[0]
    return found


def _floor(left: Array, native_hz: float, dt: float, cutoff_hz: float) -> float | None:
    """Return the standard deviation of white noise as strong as what is well above a cutoff.

    Beyond it a slow sensor's samples, joined by straight lines, hold less; below it there is motion. None
    where too few lines are in between.
    """
    power = np.abs(np.fft.rfft(left - left.mean())) ** 2 / left.size
    hz = np.fft.rfftfreq(left.size, dt)
    top = 0.4 * min(native_hz, 1 / dt)
    if native_hz * dt < _SLOW:
        # what straight lines between samples leave of noise
        power = power / np.maximum(np.sinc(hz / native_hz) ** 4, 0.1)
    between = (hz > 2 * cutoff_hz) & (hz < top)
    return float(np.sqrt(power[between].mean())) if between.sum() >= _LINES_OF_FLOOR else None


def sensor_noise(record: FlightRecord, names: Sequence[str]) -> dict[str, float]:
    """Return the standard deviation of white noise of channels, by name: what their spectra level off at."""
    return without_sensor_noise(record, names).sigma


def noisy_channels(record: FlightRecord) -> list[str]:
    """Return the measured channels that a residual may depend on.

    An effector that is logged exactly as it was commanded has no sensor: what looks like noise in it was
    flown, by feedback of noise or by quick commands.
    """
    states = [f"state/{n}" for n in (*MOTION, *FELT, *ATTITUDE)]
    air = [f"air/{n}" for n in ("V", "alpha", "beta")]
    given = [f"{group}/{n}" for group in ("effector", "response") for n in record.group(group)]
    return [n for n in (*states, *air, *given) if n in record and not _as_commanded(record, n)]


def _as_commanded(record: FlightRecord, name: str) -> bool:
    group, _, effector = name.partition("/")
    sent = f"command/{effector}"
    return group == "effector" and sent in record and np.array_equal(record[name], record[sent])
