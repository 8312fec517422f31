"""Whole signals delayed and lagged, as effects on commands and on logs do it."""

from __future__ import annotations

import numpy as np

from freqid.core.arrays import Array


def delayed(values: Array, dt: float, delay: float) -> Array:
    """Return a signal, shape (sample,), a time later, s; its first and last values are held outside.

    Cubic between samples, so that a fraction of a sample costs a band-limited signal nothing.
    """
    if delay == 0:
        return values
    from scipy.interpolate import CubicSpline

    time = dt * np.arange(values.size)
    return CubicSpline(time, values)(np.clip(time - delay, 0.0, time[-1]))


def lagged(values: Array, dt: float, time_constant: float) -> Array:
    """Return signals, shape (..., sample), through a first-order lag that starts in its steady state.

    Exact for signals that are straight between samples.
    """
    if time_constant <= 0:
        return values
    from scipy.signal import lfilter

    ratio = dt / time_constant
    decay = np.exp(-ratio)
    share = -np.expm1(-ratio) / ratio
    b, a = np.array([1 - share, share - decay]), np.array([1.0, -decay])
    start = (1 - b[0]) * values[..., :1]  # the memory after an endless past of the first value
    return lfilter(b, a, values, axis=-1, zi=start)[0]
