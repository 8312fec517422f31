"""A design found in a log: when it starts, which inputs are there, and what the effectors made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.signal import detrend

from freqid.core.arrays import Array, Complex
from freqid.core.record import FlightRecord
from freqid.core.results.design import MultisineDesign, SampledInputs

LATEST_S = 0.6  # of a position after its command: more is no actuator
OUTSIDE = 0.1  # s before its cause that the search for a lag begins, so that noise may be seen on both sides
LAGS = 281  # tried within
FALSE_ALARM = 1e-4  # that an input is called present though its channel is unrelated
GROUPS = ("excitation", "command", "effector")


@dataclass(frozen=True)
class Start:
    """When a design starts in a record.

    Attributes
    ----------
    time_s : float
        On the record's clock.
    likeness : float
        Sum of the products over the sizes, 1 where channels are the design's signals and nothing else.
    """

    time_s: float
    likeness: float


@dataclass(frozen=True)
class Gain:
    """One signal as a gain and a lag times another, on lines.

    Attributes
    ----------
    gain, lag_s : float
    coherence : float
        Share of the first signal's energy that gain and lag explain.
    p_value : float
        Of that coherence were the two unrelated: ``(1 - coherence)^(M - 1)`` on M lines, which holds for
        Gaussian lines and is next to exact for random phases.
    """

    gain: float
    lag_s: float
    coherence: float
    p_value: float


def source_of(record: FlightRecord, name: str, groups: Sequence[str] = GROUPS) -> str:
    """Return the channel that an effector's injection is best seen in; empty where there is none."""
    return next((f"{g}/{name}" for g in groups if f"{g}/{name}" in record), "")


def on_clock(inputs: SampledInputs, time: Array, start_s: float) -> Array:
    """Return a design's signals at a record's times, shape (effector, sample): zero where none is flown."""
    since = time - start_s
    return np.array([np.interp(since, inputs.time, row, left=0.0, right=0.0) for row in inputs.values])


def find_start(record: FlightRecord, inputs: SampledInputs) -> Start | None:
    """Return when a design starts, by the correlation of all its signals with their channels at once.

    Parameters
    ----------
    record : FlightRecord
    inputs : SampledInputs

    Returns
    -------
    Start or None
        None where no channel belongs to the design. The start may lie before the record.
    """
    pairs = [(source_of(record, n), row) for n, row in zip(inputs.names, inputs.values, strict=True)]
    pairs = [(source, row) for source, row in pairs if source]
    if not pairs:
        return None
    dt = record.dt
    grid = np.arange(0.0, inputs.time[-1] + 0.5 * dt, dt)
    logged = [record[n] if n.startswith("excitation/") else detrend(record[n]) for n, _ in pairs]
    flown = [np.interp(grid, inputs.time, row) for _, row in pairs]
    total = correlations(np.array(logged), np.array(flown)).sum(axis=0)
    size = total.size
    best = int(np.argmax(total))
    left, middle, right = total[best - 1], total[best], total[(best + 1) % size]
    bend = left - 2 * middle + right
    part = 0.5 * (left - right) / bend if bend < 0 else 0.0
    shift = best + part - (size if best >= record.time.size else 0)
    return Start(float(record.time[0] + shift * dt), float(middle / len(pairs)))


def correlations(logged: Array, flown: Array) -> Array:
    """Return how like logged signals are to flown ones at every shift, 1 where equal.

    Parameters
    ----------
    logged : ndarray, shape (effector, sample)
    flown : ndarray, shape (effector, step)
        At the same rate.

    Returns
    -------
    ndarray, shape (effector, shift)
        Shifts of 0, 1, ... samples; those from ``sample`` on are less than zero, by the length of the axis.
        Zero for a signal that is zero.
    """
    size = next_fast_len(logged.shape[1] + flown.shape[1], real=True)
    product = np.fft.irfft(np.fft.rfft(logged, size) * np.fft.rfft(flown, size).conj(), size)
    scale = np.sqrt(np.sum(logged**2, axis=1) * np.sum(flown**2, axis=1))[:, None]
    return product / np.where(scale > 0, scale, np.inf)


def flown_span(record: FlightRecord, design: object, inputs: SampledInputs, start_s: float) -> slice:
    """Return the samples in which a design is flown: of multisines whole periods, the last ones in the log.

    Whole periods keep the lines of different inputs apart. Less than one is returned as it is.
    """
    last = min(start_s + float(inputs.time[-1]), float(record.time[-1]))
    first = max(start_s, float(record.time[0]))
    if isinstance(design, MultisineDesign):
        whole = int((last - first + 2 * record.dt) / design.period_s)
        if whole:
            first = last - whole * design.period_s
    low, high = np.searchsorted(record.time, [first - 0.5 * record.dt, last + 0.5 * record.dt])
    return slice(int(low), int(high))


def own_lines(
    design: object, inputs: SampledInputs, duration: float, band_hz: tuple[float, float]
) -> dict[str, Array]:
    """Return the lines of each input, Hz: its harmonics, or all that its samples resolve in the band."""
    if isinstance(design, MultisineDesign):
        return {s.name: np.unique(s.index) / design.period_s for s in design.signals}
    f = np.arange(max(1, int(np.ceil(band_hz[0] * duration))), int(band_hz[1] * duration) + 1) / duration
    return dict.fromkeys(inputs.names, f)


def line_transforms(x: Array, time: Array, lines_hz: Array) -> Complex:
    """Return the finite Fourier sums of rows on lines, shape (row, line), a straight line taken away."""
    phasor = np.exp(-2j * np.pi * np.outer(time - time[0], lines_hz))
    return detrend(np.atleast_2d(x)) @ phasor * (time[1] - time[0])


def gain_of(output: Complex, input_: Complex, lines_hz: Array, *, latest_s: float = LATEST_S) -> Gain:
    """Return the gain and lag that best make one transform of another, shape (line,) each.

    Parameters
    ----------
    output, input_ : ndarray of complex, shape (line,)
    lines_hz : ndarray, shape (line,)
    latest_s : float
        Longest lag; zero to try none.
    """
    lags = np.linspace(-OUTSIDE, latest_s, LAGS) if latest_s else np.zeros(1)
    energy_in, energy_out = float(np.sum(np.abs(input_) ** 2)), float(np.sum(np.abs(output) ** 2))
    if energy_in <= 0 or energy_out <= 0:
        return Gain(0.0, 0.0, 0.0, 1.0)
    cross = output * input_.conj()
    product = np.real(np.exp(2j * np.pi * np.outer(lags, lines_hz)) @ cross)
    best = int(np.argmax(product))
    lag, most = float(lags[best]), float(product[best])
    if 0 < best < lags.size - 1:
        a, b, c = product[best - 1 : best + 2]
        bend = a - 2 * b + c
        lag += float(0.5 * (a - c) / bend * (lags[1] - lags[0])) if bend < 0 else 0.0
    coherence = min(most**2 / (energy_in * energy_out), 1.0) if most > 0 else 0.0
    tries = max(1.0, lags.size * float(lags[-1] - lags[0]) / LAGS * 2 * float(lines_hz[-1]))
    p = float((1 - coherence) ** max(lines_hz.size - 1, 1))
    return Gain(most / energy_in, lag, coherence, min(1.0, tries * p))


def in_other_channels(
    record: FlightRecord, span: slice, names: Sequence[str], wanted: Mapping[str, tuple[Complex, Array]]
) -> dict[str, str]:
    """Return, by input, another effector's channel that holds its signal."""
    time, found = record.time[span], {}
    for name, (signal, lines) in wanted.items():
        best: tuple[float, str] = (0.0, "")
        for other in names:
            source = source_of(record, other)
            if other == name or not source:
                continue
            there = line_transforms(record[source][span], time, lines)[0]
            look = gain_of(there, signal, lines, latest_s=0.0)
            opposite = gain_of(-there, signal, lines, latest_s=0.0)
            look = max(look, opposite, key=lambda g: g.coherence)
            if look.p_value < FALSE_ALARM / max(len(names), 1):
                best = max(best, (look.coherence * abs(look.gain), source))
        if best[1]:
            found[name] = best[1]
    return found


def share_at_limit(x: NDArray, limits: tuple[float, float], slack: float) -> float:
    """Return the share of samples within `slack` of a limit, or beyond."""
    return float(np.mean((x <= limits[0] + slack) | (x >= limits[1] - slack)))


def share_too_fast(x: NDArray, dt: float, limit: float) -> float:
    """Return the share of samples at which a signal moves as fast as its limit, over two samples."""
    if x.size < 3:
        return 0.0
    return float(np.mean(np.abs(x[2:] - x[:-2]) / (2 * dt) >= limit))
