"""Resampling onto a uniform clock: band-limited, alike for all channels, refused where it would invent data.

Every channel passes one linear-phase low-pass, so that inputs and outputs keep their relation, phase
included. The value at time t is the sum of the samples under a sinc with a Kaiser window, its band edge
below the lower of the two Nyquist frequencies: it removes what would alias when the rate falls, and
the images when it rises. What fits no uniform grid is first put onto one by a cubic spline.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import kaiser_beta
from scipy.sparse import csr_array
from scipy.special import i0e

from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord

PASS = 0.8  # of the lower Nyquist frequency: what passes unchanged
LONGEST_GAP = 3.5  # native sample intervals that a spline may bridge
_ATTENUATION_DB = 100.0
_FASTEST = 10.0  # times the log's own rate: above it a request is a slip
_JITTER = 1e-3  # of a sample: closer than this to a uniform grid is on it
_CROWDED = 1e-3  # of the usual interval: closer samples are one sample logged twice
_WRAPPED = ("state/phi", "state/psi")
_BLOCK = 1 << 20  # weights at a time, to bound the memory of long records
METHOD = (
    f"zero-phase windowed sinc, Kaiser {_ATTENUATION_DB:g} dB, pass band {PASS:g} of the lower Nyquist "
    "frequency; cubic spline onto a grid first where samples are missing or not uniform"
)


def resample(
    record: FlightRecord, rate_hz: float, band_hz: tuple[float, float] | None = None
) -> FlightRecord:
    """Return a record at another rate.

    Parameters
    ----------
    record : FlightRecord
    rate_hz : float
        New sample rate.
    band_hz : tuple of 2 floats, optional
        Band that will be analysed; the result is refused where it cannot carry it.

    Raises
    ------
    UsageError
        Where the rate is out of range, or its pass band ends inside `band_hz`.
    DataError
        Where `band_hz` reaches above a channel's native Nyquist frequency.

    Notes
    -----
    Channels keep their native rate; roll and heading angles are unwrapped, so that no sample falls
    between 359 and 0 degrees. The method and the rate go into the record's provenance.
    """
    if band_hz is not None:
        record.check_band(record.channels, band_hz[1])
        if band_hz[1] > 0.5 * PASS * rate_hz:
            raise UsageError(
                f"a rate of {rate_hz:g} Hz passes up to {0.5 * PASS * rate_hz:g} Hz, "
                f"expected {band_hz[1]:g} Hz as the band asks",
                remedy=f"resample to {2 * band_hz[1] / PASS:g} Hz or more",
            )
    values = {name: channel.values for name, channel in record.channels.items()}
    time, resampled, _, _ = onto_grid(record.time, values, rate_hz)
    channels = {n: replace(c, values=resampled[n]) for n, c in record.channels.items()}
    history = {"rate_hz": rate_hz, "from_hz": 1 / record.dt, "method": METHOD, "filled_samples": {}}
    return replace(
        record, time=time, channels=channels, provenance={**record.provenance, "resampled": history}
    )


def onto_grid(
    time: NDArray[np.float64], values: Mapping[str, NDArray[np.float64]], rate_hz: float
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]], dict[str, float], dict[str, int]]:
    """Put channels onto one uniform clock.

    Parameters
    ----------
    time : ndarray, shape (sample,)
        Increasing, s.
    values : mapping of str to ndarray, shape (sample,)
        NaN where a channel has no sample of its own.
    rate_hz : float

    Returns
    -------
    time : ndarray, shape (new sample,)
        From the latest first to the earliest last sample of any channel: nothing is extrapolated.
    values : dict of str to ndarray, shape (new sample,)
    native_rate_hz : dict of str to float
        From each channel's own median interval.
    filled : dict of str to int
        Samples bridged inside channels, by channel, where there are any.

    Raises
    ------
    UsageError
        Where the rate is not positive, or beyond ten times the log's.
    DataError
        For a dropout longer than a few native samples, with its time and length; nearly
        repeated times; a channel that is infinite or hardly there.
    """
    log_rate = 1 / float(np.median(np.diff(time)))
    if not 0 < rate_hz <= _FASTEST * log_rate:
        raise UsageError(
            f"the resampling rate is {rate_hz:g} Hz, expected more than 0 and at most "
            f"{_FASTEST * log_rate:g} Hz for a log of {log_rate:.6g} Hz"
        )
    groups: dict[bytes, list[str]] = {}
    for name, x in values.items():
        if np.isinf(x).any():
            raise DataError(f"channel '{name}' is infinite at t = {time[np.isinf(x)][0]:.6g} s")
        groups.setdefault(np.isnan(x).tobytes(), []).append(name)
    native, filled, own_times = {}, {}, {}
    for names in groups.values():
        kept = ~np.isnan(values[names[0]])
        own = time[kept]
        step = _native_step(time, own, names[0])
        own_times[names[0]] = kept, own, step
        native |= dict.fromkeys(names, 1 / step)
        bridged = int(np.rint(np.diff(own) / step - 1).sum())
        filled |= dict.fromkeys(names, bridged) if bridged else {}
    start = max(own[0] for _, own, _ in own_times.values())
    stop = min(own[-1] for _, own, _ in own_times.values())
    count = int(np.floor((stop - start) * rate_hz + 1e-6)) + 1
    if count < 2:
        raise DataError(
            f"{stop - start:.3g} s of log give fewer than two samples at {rate_hz:g} Hz",
            remedy="raise the rate",
        )
    grid = start + np.arange(count) / rate_hz
    result = {}
    for names in groups.values():
        kept, own, step = own_times[names[0]]
        stacked = np.array([np.unwrap(values[n][kept]) if n in _WRAPPED else values[n][kept] for n in names])
        even = np.linspace(own[0], own[-1], round((own[-1] - own[0]) / step) + 1)
        if even.size != own.size or np.abs(own - even).max() > _JITTER * step:
            stacked = CubicSpline(own, stacked, axis=1)(even)
        result |= zip(names, _band_limited(even, stacked, grid, rate_hz), strict=True)
    return grid, {name: result[name] for name in values}, native, filled


def _native_step(time: NDArray[np.float64], own: NDArray[np.float64], name: str) -> float:
    """Return a channel's median interval, s, after refusing dropouts and crowded samples."""
    if own.size < 2:
        raise DataError(
            f"channel '{name}' has {own.size} samples, expected at least two",
            remedy="leave it out of the map",
        )
    steps = np.diff(own)
    step = float(np.median(steps))
    # The stretches before the first and after the last sample are dropouts too.
    edges = np.concatenate([time[:1], own, time[-1:]])
    gaps = np.diff(edges)
    worst = int(np.argmax(gaps))
    if gaps[worst] > LONGEST_GAP * step:
        raise DataError(
            f"channel '{name}' drops out for {gaps[worst]:.4g} s after t = {edges[worst]:.6g} s "
            f"where its usual interval is {step:.4g} s",
            remedy="cut around the dropout",
        )
    if steps.min() < _CROWDED * step:
        at = int(np.argmin(steps))
        raise DataError(
            f"time almost repeats at t = {own[at]:.6g} s: the next sample follows after {steps[at]:.3g} s, "
            f"expected about {step:.4g} s",
            remedy="repair the clock of the log or cut around the fault",
        )
    return step


def _band_limited(
    even: NDArray[np.float64], values: NDArray[np.float64], grid: NDArray[np.float64], rate_hz: float
) -> NDArray[np.float64]:
    """Evaluate uniform samples at other times through the windowed sinc.

    Parameters
    ----------
    even : ndarray, shape (sample,)
        Uniform times, s.
    values : ndarray, shape (channel, sample)
    grid : ndarray, shape (new sample,)
    rate_hz : float
        Of `grid`.

    Returns
    -------
    ndarray, shape (channel, new sample)

    References
    ----------
    .. [1] J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function",
       IEEE ISCAS, 1974: the filter length that an attenuation and a transition width take.
    """
    step = (even[-1] - even[0]) / (even.size - 1)
    slower = min(rate_hz, 1 / step)
    transition = 0.5 * (1 - PASS) * slower
    edge = 0.5 * slower - 0.5 * transition
    beta = kaiser_beta(_ATTENUATION_DB)
    half_width = 0.5 * (_ATTENUATION_DB - 7.95) / (14.36 * transition)
    half = int(np.ceil(half_width / step))
    # Without the line through its ends a record is continued by odd reflection with no step in
    # value or slope; what is straight comes back exactly.
    ramp = (even - even[0]) / (even[-1] - even[0])
    first, last = values[:, :1], values[:, -1:]
    padded = np.pad(
        values - first - (last - first) * ramp,
        ((0, 0), (half + 1, half + 1)),
        mode="reflect",
        reflect_type="odd",
    ).T.copy()
    result = np.empty((grid.size, len(values)))
    taps = np.arange(-half, half + 1)
    for rows in np.array_split(np.arange(grid.size), grid.size * taps.size // _BLOCK + 1):
        position = (grid[rows] - even[0]) / step
        nearest = np.rint(position).astype(np.intp)
        away = (taps + (nearest - position)[:, None]) * step
        inside = np.sqrt(np.maximum(0.0, 1 - (away / half_width) ** 2))
        window = np.where(inside > 0, i0e(beta * inside) * np.exp(beta * (inside - 1)), 0.0)
        weights = np.sinc(2 * edge * away) * window
        weights /= weights.sum(axis=1, keepdims=True)
        columns = nearest[:, None] + taps + (half + 1)
        ends = np.arange(rows.size + 1) * taps.size
        filter_rows = csr_array((weights.ravel(), columns.ravel(), ends), shape=(rows.size, len(padded)))
        result[rows] = filter_rows @ padded
    return result.T + first + (last - first) * (grid - even[0]) / (even[-1] - even[0])
