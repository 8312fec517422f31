"""Resampling onto a uniform clock: band-limited, alike for all channels, never across a dropout.

Every channel may have its own clock. Each passes one linear-phase low-pass, so that inputs and outputs
keep their relation, phase included. The value at time t is the sum of the samples under a sinc with a
Kaiser window, its band edge below the lower of the two Nyquist frequencies: it removes what would alias when
the rate falls, and the images when it rises. What fits no uniform grid is put onto one by a cubic spline.
"""

from __future__ import annotations

import hashlib
from collections.abc import MutableMapping
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.sparse import csr_array
from scipy.special import i0e

from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord

PASS = 0.8  # of the lower Nyquist frequency: what passes unchanged
LONGEST_GAP = 3.5  # native sample intervals that a spline may bridge
# Intervals of the slowest channel. The filter settles within 25 at either end: a shorter piece is all ends.
SHORTEST_PIECE = 50
_ATTENUATION_DB = 100.0
_FASTEST = 10.0  # times the log's own rate: above it a request is a slip
_JITTER = 1e-3  # of a sample: closer than this to a uniform grid is on it
_CROWDED = 1e-3  # of the usual interval: closer samples are one sample logged twice
_WRAPPED = ("state/phi", "state/psi")
# What is held at a time beside the log itself, to bound the memory of long records:
_TOGETHER = 1 << 21  # samples filtered
_BLOCK = 1 << 17  # weights
_SPLINED = 1 << 16  # samples under one spline
# Samples that a piece of a spline reaches beyond its own: a sample's influence at least halves with each knot
# between, as off-diagonal terms of the tridiagonal system are at most half of the diagonal ones together.
_OVERLAP = 64
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
    found = onto_grid({n: (record.time, c.values) for n, c in record.channels.items()}, rate_hz)
    channels = {n: replace(c, values=found.values[n]) for n, c in record.channels.items()}
    history = {"rate_hz": rate_hz, "from_hz": 1 / record.dt, "method": METHOD, "filled_samples": {}}
    return replace(
        record, time=found.time, channels=channels, provenance={**record.provenance, "resampled": history}
    )


@dataclass(frozen=True)
class Gridded:
    """Channels on one uniform clock, and what it took to put them there.

    Attributes
    ----------
    time : ndarray, shape (new sample,)
        s.
    values : dict of str to ndarray, shape (new sample,)
    native_rate_hz : dict of str to float
        From each channel's own median interval.
    filled : dict of str to int
        Samples bridged inside channels, by channel, where there are any.
    jitter_s : dict of str to float
        RMS deviation of a channel's intervals from their median, s, dropouts and missing samples left out.
    dropouts : tuple of (str, float, float)
        Channel, last sample before and first one after, s; of channels that share a clock the first one.
    spans : tuple of (float, float)
        All stretches, s, that no channel drops out of and that are long enough to be filtered; `time` is
        the longest of them.
    """

    time: NDArray[np.float64]
    values: dict[str, NDArray[np.float64]]
    native_rate_hz: dict[str, float]
    filled: dict[str, int]
    jitter_s: dict[str, float]
    dropouts: tuple[tuple[str, float, float], ...]
    spans: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class _Clock:
    """The times of channels that were sampled together; `kept` says which samples of their array they are."""

    names: list[str]
    kept: NDArray[np.bool_] | slice
    own: NDArray[np.float64]
    step: float

    def runs(self) -> list[tuple[float, float]]:
        """Return the stretches without a dropout."""
        ends = np.flatnonzero(np.diff(self.own) > LONGEST_GAP * self.step)
        starts = self.own[np.concatenate([[0], ends + 1])]
        stops = self.own[np.concatenate([ends, [self.own.size - 1]])]
        return list(zip(starts.tolist(), stops.tolist(), strict=True))

    def dropouts(self, first: float, last: float) -> list[tuple[str, float, float]]:
        """Return the dropouts, those before the first and after the last sample included."""
        edges = np.concatenate([[first], self.own, [last]])
        at = np.flatnonzero(np.diff(edges) > LONGEST_GAP * self.step)
        return [(self.names[0], float(edges[i]), float(edges[i + 1])) for i in at]

    def jitter(self) -> float:
        """Return the RMS deviation of single intervals from the median, s."""
        steps = np.diff(self.own)
        single = steps[steps < 1.5 * self.step]
        return float(np.sqrt(np.mean((single - self.step) ** 2)))


def onto_grid(
    signals: MutableMapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]], rate_hz: float
) -> Gridded:
    """Put channels, each with its own clock, onto one uniform clock.

    Parameters
    ----------
    signals : mutable mapping of str to (time, values), each of shape (sample,)
        Time increases, s; values are NaN where the channel has no sample of its own. Emptied while it is
        read: a long log need not stand in memory twice.
    rate_hz : float

    Returns
    -------
    Gridded
        From the latest first to the earliest last sample of any channel: nothing is extrapolated. Where
        a channel drops out for longer than a few of its samples, the longest stretch that all have.

    Raises
    ------
    UsageError
        Where the rate is not positive, or beyond ten times the log's.
    DataError
        For nearly repeated times; a channel that is infinite or hardly there; channels that have no
        stretch in common.
    """
    names = list(signals)
    fastest, earliest, latest = 0.0, [], []
    clocks: dict[tuple[int, bytes], _Clock] = {}
    for name, (time, x) in signals.items():
        if np.isinf(x).any():
            raise DataError(f"channel '{name}' is infinite at t = {time[np.isinf(x)][0]:.6g} s")
        earliest.append(float(time[0]))
        latest.append(float(time[-1]))
        missing = np.isnan(x)
        mask = hashlib.sha1(missing.tobytes()).digest() if missing.any() else b""
        if (id(time), mask) in clocks:
            clocks[id(time), mask].names.append(name)
            continue
        kept = ~missing if mask else slice(None)
        step = _native_step(time[kept], name)
        fastest = max(fastest, 1 / float(np.median(np.diff(time))))
        clocks[id(time), mask] = _Clock([name], kept, time[kept], step)
    if not 0 < rate_hz <= _FASTEST * fastest:
        raise UsageError(
            f"the resampling rate is {rate_hz:g} Hz, expected more than 0 and at most "
            f"{_FASTEST * fastest:g} Hz for a log of {fastest:.6g} Hz"
        )
    first, last = min(earliest), max(latest)
    spans = _common_spans(list(clocks.values()))
    start, stop = max(spans, key=lambda span: span[1] - span[0])
    count = int(np.floor((stop - start) * rate_hz + 1e-6)) + 1
    if count < 2:
        raise DataError(
            f"{stop - start:.3g} s of log give fewer than two samples at {rate_hz:g} Hz",
            remedy="raise the rate",
        )
    grid = start + np.arange(count) / rate_hz
    values, native, filled, jitter = {}, {}, {}, {}
    for clock in clocks.values():
        low, high = next(run for run in clock.runs() if run[0] <= start and stop <= run[1])
        rows = slice(*np.searchsorted(clock.own, [low, np.nextafter(high, np.inf)]))
        own = clock.own[rows]
        native |= dict.fromkeys(clock.names, 1 / clock.step)
        jitter |= dict.fromkeys(clock.names, clock.jitter())
        bridged = int(np.rint(np.diff(own) / clock.step - 1).sum())
        filled |= dict.fromkeys(clock.names, bridged) if bridged else {}
        even = np.linspace(own[0], own[-1], max(2, own.size + bridged))
        uneven = even.size != own.size or np.abs(own - even).max() > _JITTER * clock.step
        at_once = max(1, _TOGETHER // max(own.size, count))
        for block in (clock.names[i : i + at_once] for i in range(0, len(clock.names), at_once)):
            stacked = np.array([_own_values(name, *signals.pop(name), clock.kept, rows) for name in block])
            if uneven:
                stacked = _splined(own, stacked, even)
            values |= zip(block, _band_limited(even, stacked, grid, rate_hz), strict=True)
    dropouts = [gap for clock in clocks.values() for gap in clock.dropouts(first, last)]
    return Gridded(
        grid, {name: values[name] for name in names}, native, filled, jitter, tuple(dropouts), spans
    )


def _own_values(
    name: str,
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    kept: NDArray[np.bool_] | slice,
    rows: slice,
) -> NDArray[np.float64]:
    """Return the samples of one channel in a stretch; angles that go round are unwrapped."""
    own = values[kept][rows]
    return np.unwrap(own) if name in _WRAPPED else own


def _common_spans(clocks: list[_Clock]) -> tuple[tuple[float, float], ...]:
    """Return the stretches, s, in which no channel drops out and that are long enough to be filtered."""
    spans = clocks[0].runs()
    for clock in clocks[1:]:
        runs = clock.runs()
        both = [(max(a[0], b[0]), min(a[1], b[1])) for a in spans for b in runs]
        spans = [(start, stop) for start, stop in both if start < stop]
        if not spans:
            raise DataError(
                f"channels '{clocks[0].names[0]}' and '{clock.names[0]}' have no stretch of time in common "
                "in which no channel drops out",
                remedy="leave one of them out of the map",
            )
    slowest = max(clock.step for clock in clocks)
    long = [span for span in spans if span[1] - span[0] >= SHORTEST_PIECE * slowest]
    return tuple(long or [max(spans, key=lambda span: span[1] - span[0])])


def _native_step(own: NDArray[np.float64], name: str) -> float:
    """Return a channel's median interval, s, after refusing crowded samples."""
    if own.size < 2:
        raise DataError(
            f"channel '{name}' has {own.size} samples, expected at least two",
            remedy="leave it out of the map",
        )
    steps = np.diff(own)
    step = float(np.median(steps))
    if steps.min() < _CROWDED * step:
        at = int(np.argmin(steps))
        raise DataError(
            f"time almost repeats at t = {own[at]:.6g} s: the next sample follows after {steps[at]:.3g} s, "
            f"expected about {step:.4g} s",
            remedy="repair the clock of the log or cut around the fault",
        )
    return step


def _splined(
    own: NDArray[np.float64], values: NDArray[np.float64], even: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Evaluate the cubic spline through samples, shape (channel, sample), at times inside; in pieces."""
    result = np.empty((len(values), even.size))
    for first in range(0, own.size - 1, _SPLINED):
        last = min(first + _SPLINED, own.size - 1)
        low, high = max(first - _OVERLAP, 0), min(last + _OVERLAP, own.size - 1) + 1
        start = 0 if first == 0 else np.searchsorted(even, own[first])
        stop = even.size if last == own.size - 1 else np.searchsorted(even, own[last])
        piece = CubicSpline(own[low:high], values[:, low:high], axis=1)
        result[:, start:stop] = piece(even[start:stop])
    return result


def _band_limited(
    even: NDArray[np.float64], values: NDArray[np.float64], grid: NDArray[np.float64], rate_hz: float
) -> NDArray[np.float64]:
    """Evaluate uniform samples at other times through the windowed sinc; the samples are overwritten.

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
    beta = 0.1102 * (_ATTENUATION_DB - 8.7)  # Kaiser's, above 50 dB
    half_width = 0.5 * (_ATTENUATION_DB - 7.95) / (14.36 * transition)
    half = int(np.ceil(half_width / step))
    # Without the line through its ends a record is continued by odd reflection with no step in
    # value or slope; what is straight comes back exactly.
    first, rise = values[:, :1].copy(), values[:, -1:] - values[:, :1]
    values -= first
    values -= rise * ((even - even[0]) / (even[-1] - even[0]))
    padded = np.pad(values.T, ((half + 1, half + 1), (0, 0)), mode="reflect", reflect_type="odd")
    padded = np.ascontiguousarray(padded)
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
        result[rows] = cast(NDArray[np.float64], filter_rows @ padded)
    return result.T + first + rise * (grid - even[0]) / (even[-1] - even[0])
