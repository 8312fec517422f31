"""What noise makes of an estimate, read where nothing is excited: the lines between the harmonics.

Several periods of a multisine leave lines, 1/T_flown apart, that carry no excitation. What a model leaves
there is noise; on the harmonics it is noise and, the same in every period, what is not linear. A
covariance from the noise lines says how an estimate scatters from flight to flight; the ratio of the two
powers says how far the aircraft is from linear (docs/theory/regression.md).

References
----------
R. Pintelon, J. Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., Wiley, 2012,
ch. 4 (non-excited lines as detection lines).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.identify.regress.regression import LeastSquares

HALF_WIDTH = 8
"""Noise lines on either side of a harmonic that tell its noise; fewer follow a steeper spectrum, more
scatter less."""

_FLOOR = 0.2  # of the mean near by: a straight line through scattered power may reach zero and below


@dataclass(frozen=True, eq=False)
class Noise:
    """Power that a fit leaves on the noise lines of one manoeuvre.

    Attributes
    ----------
    lines_hz : ndarray, shape (K,)
    power : ndarray, shape (R, K)
        Squared magnitude of the residual's transform, unit of the response times s, squared.
    """

    lines_hz: Array
    power: Array


def noise_lines(harmonics_hz: Array, period_s: float, duration: float) -> Array:
    """Return the lines of a record that a multisine does not excite, near its harmonics.

    Parameters
    ----------
    harmonics_hz : ndarray, shape (M,)
        Lines of the regression, ascending.
    period_s : float
        Of the multisine.
    duration : float
        Of the record, s.

    Returns
    -------
    ndarray, shape (K,)
        Multiples of 1/duration apart from those of 1/period, from the lowest harmonic to `HALF_WIDTH`
        lines above the highest, Hz.

    Raises
    ------
    DataError
        Where the record is shorter than two periods.
    """
    # A record that was shortened by a channel's delay leaks less than 1e-4 of a residual's power to others.
    periods = int(np.floor(duration / period_s + 1e-2))
    if periods < 2:
        raise DataError(
            f"noise lines need two periods of {period_s:g} s or more, the record lasts {duration:.6g} s",
            remedy="fly two periods, or take residuals = 'coloured'",
        )
    span = periods * period_s
    first = np.ceil(harmonics_hz[0] * span - 1e-6) - 1
    last = np.floor(harmonics_hz[-1] * span + 1e-6) + HALF_WIDTH
    numbers = np.arange(max(first, periods + 1), last + 1)
    return numbers[numbers % periods != 0] / span


def correct_by_noise_lines(
    fit: LeastSquares, lines_hz: Sequence[Array], noise: Sequence[Noise]
) -> LeastSquares:
    """Return a fit with the covariance that noise alone gives its estimate.

    Parameters
    ----------
    fit : LeastSquares
        On the harmonics of a multisine, complex.
    lines_hz : sequence of ndarray
        Harmonics of each manoeuvre, one after another in the fit.
    noise : sequence of Noise
        Of the same manoeuvres, weighted as the fit's lines are.

    Returns
    -------
    LeastSquares

    Notes
    -----
    ``Cov = Re(D S D^H)``, D the dual of the columns and S(f) the power per real equation, by a straight line
    through the noise lines near f with triangular weights. A variance is then a weighted sum of powers
    that are nearly exponential: its degrees of freedom follow Satterthwaite.
    """
    smoothing = [_local_lines(f, n.lines_hz) for f, n in zip(lines_hz, noise, strict=True)]
    near = [_weights(f, n.lines_hz) @ n.power.T / 2 for f, n in zip(lines_hz, noise, strict=True)]
    spectrum = np.concatenate(
        [
            np.maximum(s @ n.power.T / 2, _FLOOR * mean)
            for s, n, mean in zip(smoothing, noise, near, strict=True)
        ]
    ).T
    dual = fit.dual
    covariance = np.stack([((dual * row) @ dual.conj().T).real for row in spectrum])
    ends = np.cumsum([f.size for f in lines_hz])[:-1]
    gains = [g @ s for g, s in zip(np.split(np.abs(dual) ** 2, ends, axis=1), smoothing, strict=True)]
    level = [_weights(n.lines_hz, n.lines_hz) @ n.power.T / 2 for n in noise]
    mean = sum(level_of.T @ g.T for level_of, g in zip(level, gains, strict=True))
    scatter = sum((level_of.T**2) @ (g**2).T for level_of, g in zip(level, gains, strict=True))
    return replace(
        fit, solution_covariance=covariance, degrees_of_freedom=np.maximum(2 * mean**2 / scatter, 1.0)
    )


def noise_power(lines_hz: Array, noise: Noise) -> Array:
    """Return the power of noise on harmonics: a weighted mean of the noise lines near by, shape (R, M).

    Parameters
    ----------
    lines_hz : ndarray, shape (M,)
    noise : Noise
    """
    return (_weights(lines_hz, noise.lines_hz) @ noise.power.T).T


def _weights(at: Array, lines: Array) -> Array:
    """Return triangular weights of lines near each frequency, rows that add up to one, shape (at, lines)."""
    reach = (HALF_WIDTH + 0.5) * np.min(np.diff(lines))
    distance = np.abs(lines - at[:, None])
    # at the ends of the band there are fewer lines on one side, so the window reaches as many on the other
    farthest = min(HALF_WIDTH, lines.size - 1)
    least = np.partition(distance, farthest, axis=1)[:, [farthest]]
    weight = np.maximum(1 - distance / np.maximum(reach, 1.01 * least), 0.0)
    return weight / weight.sum(axis=1, keepdims=True)


def _local_lines(at: Array, lines: Array) -> Array:
    """Return the weights of the value at each frequency of a straight line through the lines near it."""
    weight = _weights(at, lines)
    away = lines - at[:, None]
    first = np.sum(weight * away, axis=1, keepdims=True)
    second = np.sum(weight * away**2, axis=1, keepdims=True)
    return weight * (second - first * away) / (second - first**2)
