"""How loud sensors are: a record parted into motion and white noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import ATTITUDE, FLOW, FORCES, RATES, VELOCITY
from freqid.core.record import FlightRecord
from freqid.identify.spectra.smoothing import Smoothed, smooth

_LINES_OF_FLOOR = 100
_SLOW = 0.9  # of the record's rate: a sensor below it was joined by straight lines
_FEWEST = 8  # samples that a smoothing takes


def sensor_noise(record: FlightRecord, names: Sequence[str]) -> dict[str, float]:
    """Return the standard deviation of white noise of channels, by name: what their spectra level off at."""
    values = record.matrix(names)
    for row, name in zip(values, names, strict=True):
        if name in ("state/phi", "state/psi"):
            row[:] = np.unwrap(row)
    rates = [record.channel(n).native_rate_hz for n in names]
    found, sigma = _smoothed(values, record.dt, rates), {}
    for i, name in enumerate(names):
        floor = _floor(values[i] - found.x[i], rates[i], record.dt, found.cutoff_hz[i])
        sigma[name] = float(found.noise_std[i]) if floor is None else floor
    return sigma


def _smoothed(values: Array, dt: float, rates: Sequence[float]) -> Smoothed:
    """Return channels parted into motion and noise, those of slow sensors by the samples that they took.

    Joined by straight lines their noise falls with frequency as motion does, and would pass for it.
    """
    found = smooth(values, dt)
    parts = [found.x, found.noise_std, found.cutoff_hz]
    for i in (i for i, rate in enumerate(rates) if rate * dt < _SLOW):
        time = dt * np.arange(values.shape[1])
        taken = np.interp(np.arange(0, time[-1], 1 / rates[i]), time, values[i])
        if taken.size >= _FEWEST:
            cutoff = float(smooth(taken[None], 1 / rates[i]).cutoff_hz[0])
            own = smooth(values[i : i + 1], dt, cutoff)
            for part, value in zip(parts, (own.x, own.noise_std, own.cutoff_hz), strict=True):
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


def noisy_channels(record: FlightRecord) -> list[str]:
    """Return the measured channels that a residual may depend on.

    An effector that is logged exactly as it was commanded has no sensor: what looks like noise in it was
    flown, by feedback of noise or by quick commands.
    """
    given = [f"{group}/{n}" for group in ("effector", "response") for n in record.group(group)]
    names = (*VELOCITY, *RATES, *FORCES, *ATTITUDE, *FLOW, *given)
    return [n for n in names if n in record and not _as_commanded(record, n)]


def _as_commanded(record: FlightRecord, name: str) -> bool:
    group, _, effector = name.partition("/")
    sent = f"command/{effector}"
    return group == "effector" and sent in record and np.array_equal(record[name], record[sent])
