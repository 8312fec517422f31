"""Whether residuals are white: what output error assumes of them, and filter error of its innovations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import kolmogorov

from freqid.core.arrays import Array

FALSE_ALARMS = 0.01
"""Chance that white residuals of a whole model are called coloured."""


def white_probability(residual: Array) -> float:
    """Return how likely a history as coloured as this is if it is white noise.

    Parameters
    ----------
    residual : ndarray, shape (N,)

    Returns
    -------
    float
        Of Bartlett's test: the largest distance of the cumulative periodogram from a straight line, which
        needs no choice of lags. One for a residual that is zero.

    References
    ----------
    Bartlett, *An Introduction to Stochastic Processes*, 1955, sec. 9.22; Brockwell & Davis, *Time Series:
    Theory and Methods*, 2nd ed., sec. 10.2.
    """
    power = np.abs(np.fft.rfft(residual - residual.mean())[1 : (residual.size + 1) // 2]) ** 2
    if not power.sum() > 0:
        return 1.0
    rising = np.cumsum(power) / power.sum()
    m = power.size
    even = np.arange(1, m + 1) / m
    distance = max(np.abs(rising - even).max(), np.abs(rising - even + 1 / m).max())
    return float(kolmogorov(np.sqrt(m) * distance))


def whiteness(outputs: Sequence[str], residuals: Sequence[Array]) -> dict[str, float]:
    """Return the probability by output, of its least white manoeuvre, all of them tried.

    Parameters
    ----------
    outputs : sequence of str, length k
    residuals : sequence of ndarray, shape (N, k)
        By manoeuvre.
    """
    count = len(residuals)
    return {
        name: min(1.0, count * min(white_probability(r[:, i]) for r in residuals))
        for i, name in enumerate(outputs)
    }


def coloured(probabilities: Mapping[str, float]) -> tuple[str, ...]:
    """Return the outputs whose residuals are not white, all outputs together at FALSE_ALARMS."""
    level = FALSE_ALARMS / max(len(probabilities), 1)
    return tuple(name for name, p in probabilities.items() if p < level)
