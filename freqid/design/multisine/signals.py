"""What a multisine is: its lines, its samples, its peaks and the moments at which it may start.

Everywhere here a signal is ``u(theta) = sum_k amplitude_k sin(index_k theta + phase_k)`` with the angle
``theta = 2 pi t / T`` running once around the fundamental period T; a factor is free of units and of T.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, floor, isclose, log10

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import irfft, next_fast_len

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.results.design import MultisineDesign

_LEAST = 1e-300  # bounds below it are none: a float no longer holds their four digits


def at_most(value: float) -> str:
    """Write a bound with four digits, none of them rounded up: as written it is kept."""
    return f"{_rounded(value, floor):.4g}"


def at_least(value: float) -> str:
    """Write a bound with four digits, none of them rounded down."""
    return f"{_rounded(value, ceil):.4g}"


def _rounded(value: float, towards: Callable[[float], int]) -> float:
    if abs(value) < _LEAST:
        return 0.0 if towards is floor else _LEAST
    digits = 3 - floor(log10(value))
    # A bound that has four digits already is kept, though it is a little off in binary.
    nearest = round(value, digits)
    return nearest if isclose(nearest, value, rel_tol=1e-9) else towards(value * 10.0**digits) / 10.0**digits


def band_lines(design: MultisineDesign) -> NDArray[np.int64]:
    """Return the harmonics of 1/T in the design's band, excited or not: the lines of an identification.

    Returns
    -------
    ndarray of int, shape (line,)
        Ascending.

    Raises
    ------
    UsageError
        Where a signal has a harmonic outside the band.
    """
    low, high = (limit * design.period_s for limit in design.band_hz)
    lines = np.arange(max(int(np.ceil(low - 1e-9)), 1), int(np.floor(high + 1e-9)) + 1)
    for signal in design.signals:
        stray = np.setdiff1d(signal.index, lines)
        if stray.size:
            raise UsageError(
                f"harmonic {stray[0]} of '{signal.name}', {stray[0] / design.period_s:g} Hz, is outside the "
                f"band of {design.band_hz[0]:g} to {design.band_hz[1]:g} Hz",
                remedy="widen band_hz or drop the harmonic",
            )
    return lines


def tones(design: MultisineDesign, lines: NDArray[np.int64]) -> NDArray[np.complex128]:
    """Return complex amplitudes c, ``u(t) = sum_k Im(c_k exp(j 2 pi k t / T))``, shape (effector, line).

    Parameters
    ----------
    design : MultisineDesign
    lines : ndarray of int, shape (line,)
        Ascending harmonics, among them all of the design's.
    """
    c = np.zeros((len(design.signals), lines.size), dtype=complex)
    for row, signal in zip(c, design.signals, strict=True):
        # Added, not set: tones that a user lists twice on a harmonic add up in flight too.
        np.add.at(row, np.searchsorted(lines, signal.index), signal.amplitude * np.exp(1j * signal.phase))
    return c


PEAK_POINTS = 64
"""Samples per shortest period at which peaks are judged: what lies between is then below 0.12 %."""


def samples_per_period(index: ArrayLike, points: int) -> int:
    """Return a fast transform length with at least `points` samples per period of the highest harmonic."""
    return next_fast_len(points * int(np.max(np.asarray(index))), real=True)


def sample(index: ArrayLike, amplitude: ArrayLike, phase: ArrayLike, samples: int) -> Array:
    """Sample one fundamental period uniformly, from its start and without its end.

    Parameters
    ----------
    index : array_like of int, shape (tone,)
        Harmonics of 1/T, >= 1 and < samples / 2; tones on one harmonic add up.
    amplitude : array_like, shape (..., tone)
        In the unit of the signal; complex where a frequency response has turned the tones.
    phase : array_like, shape (..., tone)
        rad.
    samples : int

    Returns
    -------
    signal : ndarray, shape (..., samples)
    """
    tone = np.asarray(amplitude) * np.exp(1j * np.asarray(phase))
    line = np.zeros((*tone.shape[:-1], samples // 2 + 1), dtype=complex)
    # A sine is -j/2 at its positive line.
    np.add.at(line, (..., np.asarray(index)), -0.5j * samples * tone)  # type: ignore[arg-type]
    return irfft(line, samples, axis=-1)


def _peaks(index: ArrayLike, amplitude: ArrayLike, phase: ArrayLike) -> tuple[Array, Array, Array]:
    """Return highest value, lowest value and rms."""
    index = np.asarray(index)
    index = index // np.gcd.reduce(index)  # the same wave, drawn once instead of gcd times
    signal = sample(index, amplitude, phase, samples_per_period(index, PEAK_POINTS))
    return signal.max(-1), signal.min(-1), np.sqrt(0.5 * np.sum(np.square(amplitude), axis=-1))


def relative_peak_factor(index: ArrayLike, amplitude: ArrayLike, phase: ArrayLike) -> Array:
    """Return ``(max u - min u) / (2 sqrt(2) rms u)``: 1 for a sine, 0.707 for a square wave.

    Parameters
    ----------
    index : array_like of int, shape (tone,)
    amplitude, phase : array_like, shape (..., tone)
        Unit of the signal; rad.

    Returns
    -------
    factor : ndarray, shape (...)

    References
    ----------
    Klein and Morelli, Aircraft System Identification, 2nd ed., chapter 9.
    """
    top, bottom, rms = _peaks(index, amplitude, phase)
    return (top - bottom) / (2.0 * np.sqrt(2.0) * rms)


def crest_factor(index: ArrayLike, amplitude: ArrayLike, phase: ArrayLike) -> Array:
    """Return ``max |u| / rms u``: 1.414 for a sine; arguments as `relative_peak_factor`."""
    top, bottom, rms = _peaks(index, amplitude, phase)
    return np.maximum(top, -bottom) / rms


def zero_crossings(index: ArrayLike, amplitude: ArrayLike, phase: ArrayLike) -> tuple[Array, Array]:
    """Find the angles at which a signal may start and end at zero.

    Any of them leaves spectrum, rms and peaks as they are, so whoever adds signals up may choose.

    Parameters
    ----------
    index : array_like of int, shape (tone,)
    amplitude, phase : array_like, shape (tone,)

    Returns
    -------
    angle : ndarray, shape (crossing,)
        rad in [0, 2 pi), rising; at least two, because the mean is zero.
    slope : ndarray, shape (crossing,)
        du/dtheta there, in units of the signal per rad.
    """
    index, amplitude, phase = np.asarray(index), np.asarray(amplitude), np.asarray(phase)
    samples = samples_per_period(index, PEAK_POINTS)
    positive = sample(index, amplitude, phase, samples) >= 0.0
    left = np.flatnonzero(positive != np.roll(positive, -1))
    step = 2.0 * np.pi / samples
    low, high = left * step, (left + 1) * step
    for _ in range(60):  # halving: cannot fail, and reaches the last bit
        middle = 0.5 * (low + high)
        above = np.sin(np.outer(middle, index) + phase) @ amplitude >= 0.0
        same = above == positive[left]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    angle = np.mod(0.5 * (low + high), 2.0 * np.pi)
    slope = np.cos(np.outer(angle, index) + phase) @ (amplitude * index)
    order = np.argsort(angle)
    return angle[order], slope[order]


def start_at_zero(index: ArrayLike, amplitude: ArrayLike, phase: ArrayLike) -> Array:
    """Shift a signal in time so that it starts and ends at zero, where it moves most gently.

    Parameters
    ----------
    index : array_like of int, shape (tone,)
    amplitude, phase : array_like, shape (tone,)

    Returns
    -------
    phase : ndarray, shape (tone,)
        rad in [-pi, pi).
    """
    angle, slope = zero_crossings(index, amplitude, phase)
    shifted = np.asarray(phase) + np.asarray(index) * angle[np.argmin(np.abs(slope))]
    return np.mod(shifted + np.pi, 2.0 * np.pi) - np.pi
