"""Classic waveforms of amplitude one: doublets, 3-2-1-1 and other multisteps, frequency sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.design.multisine.bounds import at_least


def multistep(widths_s: Sequence[float], dt_s: float, *, rise_s: float = 0.0) -> Array:
    """Return steps of alternating sign and amplitude one, from zero to zero.

    Parameters
    ----------
    widths_s : sequence of float
        Duration of each step, s, rounded to whole samples.
    dt_s : float
        Sampling interval, s.
    rise_s : float
        Time of the ramp from zero to full deflection, s; steps are ramps where an actuator cannot jump.

    Returns
    -------
    ndarray, shape (sample,)
        The first sample is zero where the rise takes time, the last one always.

    Raises
    ------
    UsageError
        Where a step is shorter than one sample or than its ramps.

    References
    ----------
    Klein & Morelli, *Aircraft System Identification*, 2nd ed., ch. 9 (doublet, 2-1-1, 3-2-1-1).
    """
    edges = np.concatenate([[0], np.cumsum([round(width / dt_s) for width in widths_s])])
    shortest = dt_s * min(np.diff(edges).tolist(), default=0)
    least = max(dt_s, 2 * rise_s)
    if shortest < least * (1 - 1e-9):
        raise UsageError(
            f"the shortest step lasts {shortest:g} s, expected at least a sample, {dt_s:g} s, and twice the "
            f"rise of {rise_s:g} s",
            remedy=f"take a step_s of at least {at_least(least)} s, or shorten rise_s or dt_s",
        )
    levels = (-1.0) ** np.arange(len(widths_s))
    if rise_s == 0.0:
        return np.append(np.repeat(levels, np.diff(edges)), 0.0)
    # Every step is a trapezoid between its edges, so that those of a doublet still cancel.
    edges = edges * dt_s
    corners = np.column_stack([edges[:-1], edges[:-1] + rise_s, edges[1:] - rise_s, edges[1:]])
    heights = levels[:, None] * [0.0, 1.0, 1.0, 0.0]
    return np.interp(dt_s * np.arange(round(edges[-1] / dt_s) + 1), corners.ravel(), heights.ravel())


def doublet(width_s: float, dt_s: float, *, rise_s: float = 0.0) -> Array:
    """Return a doublet, one step up and one down of `width_s` each; see `multistep`."""
    return multistep((width_s, width_s), dt_s, rise_s=rise_s)


def three_two_one_one(unit_s: float, dt_s: float, *, rise_s: float = 0.0) -> Array:
    """Return steps of 3, 2, 1 and 1 times `unit_s`; see `multistep`."""
    return multistep((3 * unit_s, 2 * unit_s, unit_s, unit_s), dt_s, rise_s=rise_s)


def frequency_sweep(
    band_hz: tuple[float, float],
    duration_s: float,
    dt_s: float,
    *,
    fade_s: float,
    spacing: Literal["logarithmic", "linear"] = "logarithmic",
) -> Array:
    """Return a sine of amplitude one whose frequency rises through a band, from zero to zero.

    Parameters
    ----------
    band_hz : tuple of 2 floats
        First and last frequency, Hz.
    duration_s, dt_s : float
        s.
    fade_s : float
        Time over which the amplitude grows at the start and dies at the end, as half a raised cosine, s.
    spacing : {"logarithmic", "linear"}
        Equal time per octave, or per hertz.

    Returns
    -------
    ndarray, shape (sample,)

    Raises
    ------
    UsageError
        For a band that is not rising or above Nyquist, a record shorter than a period of the lowest
        frequency, or fades that do not fit.

    References
    ----------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., ch. 5 (automated sweeps).
    """
    low, high = band_hz
    if not 0 < low < high <= 0.5 / dt_s:
        raise UsageError(
            f"a sweep from {low:g} to {high:g} Hz is asked for, expected rising positive frequencies up to "
            f"Nyquist, {0.5 / dt_s:g} Hz",
            remedy="correct the band or sample faster",
        )
    if not (duration_s * low >= 1 and 0 < fade_s <= duration_s / 2):
        raise UsageError(
            f"a sweep of {duration_s:g} s with fades of {fade_s:g} s is asked for, expected a period of the "
            f"lowest frequency, {1 / low:g} s, or more, and fades of up to half the sweep",
            remedy="lengthen the sweep or correct fade_s",
        )
    time = dt_s * np.arange(round(duration_s / dt_s) + 1)
    if spacing == "linear":
        cycles = low * time + (high - low) * time**2 / (2 * duration_s)
    else:
        growth = np.log(high / low) / duration_s
        cycles = low * np.expm1(growth * time) / growth
    inside = np.clip(np.minimum(time, time[-1] - time) / fade_s, 0.0, 1.0)
    return np.sin(2 * np.pi * cycles) * np.sin(0.5 * np.pi * inside) ** 2
