"""Bias and trend removal before a transform, with what was removed kept for the time domain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import dst, idst

from freqid.core.errors import UsageError
from freqid.identify.spectra.fourier import as_channels

TrendKind = Literal["none", "mean", "endpoints", "line"]


@dataclass(frozen=True, eq=False)
class Detrended:
    """Channels without their trend: original = x + bias + slope t, with t = 0 at the first sample.

    Attributes
    ----------
    x : ndarray, shape (channel, sample)
        What is left, unit of the channel.
    bias : ndarray, shape (channel,)
        Removed value at t = 0, unit of the channel.
    slope : ndarray, shape (channel,)
        Removed slope, unit of the channel per s.
    """

    x: NDArray[np.float64]
    bias: NDArray[np.float64]
    slope: NDArray[np.float64]


def remove_trend(x: ArrayLike, dt: float, kind: TrendKind = "endpoints") -> Detrended:
    """Return the channels with a constant or a straight line removed.

    A trend that stays puts `1/f` leakage on the low lines and, after a transform, can no longer be told
    from the dynamics there; removed, it can be recovered from the time domain.

    Parameters
    ----------
    x : array_like of float, shape (channel, sample)
        Samples, any unit; two samples or more for a line.
    dt : float
        Sampling interval, s.
    kind : {"none", "mean", "endpoints", "line"}
        "mean" the average; "endpoints" the line through the first and the last sample, which leaves a
        channel that is continuous when it is repeated; "line" the line of least squares.

    Returns
    -------
    Detrended
        What is left, and the bias and slope that were removed.

    Raises
    ------
    UsageError
        The kind is unknown, or x is not (channel, sample) with two samples or more.
    DataError
        A sample is NaN or infinite.

    References
    ----------
    Klein & Morelli, Aircraft System Identification, 2nd ed., chapter 7.
    """
    x = as_channels(x, least=2)
    t = dt * np.arange(x.shape[1])
    bias, slope = np.zeros(len(x)), np.zeros(len(x))
    if kind == "mean":
        bias = x.mean(axis=1)
    elif kind == "endpoints":
        bias = x[:, 0].copy()
        slope = (x[:, -1] - bias) / t[-1]
    elif kind == "line":
        centred = t - t.mean()
        slope = x @ centred / (centred @ centred)
        bias = x.mean(axis=1) - slope * t.mean()
    elif kind != "none":
        raise UsageError(f"the trend to remove is 'none', 'mean', 'endpoints' or 'line', not {kind!r}")
    return Detrended(x - bias[:, None] - slope[:, None] * t, bias, slope)


def trend_columns(frequencies_hz: ArrayLike, duration: float) -> NDArray[np.complex128]:
    """Return the finite Fourier integrals of a constant and of a straight line, as far as they differ from 0.

    Whatever line is removed from a channel, its end points or its slope are noisy; with these columns in
    a regression the estimates do not depend on it at all.

    Parameters
    ----------
    frequencies_hz : array_like, shape (frequency,)
        Positive frequencies, Hz.
    duration : float
        Length T of the record, s.

    Returns
    -------
    columns : ndarray of complex, shape (1 or 2, frequency)
        Transforms of 1 and of ``t / T - 1/2``, in s; on harmonics of 1/T the first is zero and left out.
    """
    omega = 2 * np.pi * np.asarray(frequencies_hz, dtype=float)
    last = np.exp(-1j * omega * duration)
    constant = (1 - last) / (1j * omega)
    line = (constant / duration - last) / (1j * omega) - constant / 2
    flat = np.max(np.abs(constant)) < 1e-9 * duration
    return np.array([line] if flat else [constant, line])


def up_to(x: ArrayLike, dt: float, highest_hz: float) -> NDArray[np.float64]:
    """Return channels without what lies above a frequency, for histories beside a fit that ends there.

    Parameters
    ----------
    x : array_like of float, shape (channel, sample)
        Samples, any unit.
    dt : float
        Sampling interval, s.
    highest_hz : float
        Highest frequency that stays, Hz.

    Returns
    -------
    ndarray, shape (channel, sample)

    Notes
    -----
    The line through the ends is kept as it is and the rest reflected to an odd periodic signal, so that
    nothing jumps where the record ends (Klein & Morelli, 2nd ed., chapter 11); no phase is added.
    """
    flat = remove_trend(x, dt, "endpoints")
    n = flat.x.shape[1] - 1
    sines = dst(flat.x[:, 1:-1], type=1, axis=1)
    sines[:, np.arange(1, n) / (2 * n * dt) > highest_hz] = 0.0
    kept = np.zeros_like(flat.x)
    kept[:, 1:-1] = idst(sines, type=1, axis=1)
    return np.asarray(x, dtype=float) - flat.x + kept
