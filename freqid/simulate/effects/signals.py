"""Whole signals delayed and lagged, as effects on commands and on logs do it."""

from __future__ import annotations

import numpy as np

from freqid.core.arrays import Array


def delayed(values: Array, dt: float, delay: float) -> Array:
    """Return signals, shape (..., sample), a time later, s; first and last values are held outside.

    Cubic between samples, so that a fraction of a sample costs a band-limited signal nothing.
    """
    if delay == 0:
        return values
    from scipy.interpolate import CubicSpline

    time = dt * np.arange(values.shape[-1])
    return CubicSpline(time, values, axis=-1)(np.clip(time - delay, 0.0, time[-1]))


def logged_late(values: Array, dt: float, age: float) -> Array:
    """Return signals, shape (..., sample), as a log holds them whose values are older than their time, s.

    A log is cut out of a flight that went on. Beyond its ends a signal goes on as it came, turned about its
    last value (odd extension). Held instead, a rate would stop there: an impulse of moment that is in all
    lines.
    """
    if age == 0:
        return values
    from scipy.interpolate import CubicSpline

    count = values.shape[-1]
    beyond = min(int(np.ceil(abs(age) / dt)) + 2, count - 1)
    before = 2 * values[..., :1] - values[..., beyond:0:-1]
    after = 2 * values[..., -1:] - values[..., -2 : -beyond - 2 : -1]
    time = dt * np.arange(-beyond, count + beyond)
    whole = CubicSpline(time, np.concatenate([before, values, after], axis=-1), axis=-1)
    return whole(dt * np.arange(count) - age)


def lagged(values: Array, dt: float, time_constant: float) -> Array:
    """Return signals, shape (..., sample), through a first-order lag that starts in its steady state.

    Exact for cubic splines through the samples. Straight lines between samples 0.04 s apart take 2 % off an
    amplitude at 2 Hz: as much as a lag of 16 ms does, which was then given as a delay.
    """
    if time_constant <= 0:
        return values
    from scipy.interpolate import CubicSpline
    from scipy.signal import lfilter

    cubic, square, slope, level = CubicSpline(dt * np.arange(values.shape[-1]), values, axis=-1).c
    steady = _steady(level, slope, 2 * square, 6 * cubic, time_constant)
    ends = (
        level + dt * (slope + dt * (square + dt * cubic)),
        slope + dt * (2 * square + 3 * dt * cubic),
        2 * square + 6 * dt * cubic,
    )
    decay = np.exp(-dt / time_constant)
    # between two samples the memory decays to what follows a cubic without any
    pushed = np.moveaxis(_steady(*ends, 6 * cubic, time_constant) - decay * steady, 0, -1)
    start = values[..., :1]  # the memory after an endless past of the first value
    return lfilter([1.0], [1.0, -decay], np.concatenate([start, pushed], axis=-1), axis=-1)


def _steady(level: Array, slope: Array, curve: Array, third: Array, time_constant: float) -> Array:
    """Return what a lag makes of a cubic once its start is forgotten, from the cubic's derivatives."""
    t = time_constant
    return level - t * (slope - t * (curve - t * third))
