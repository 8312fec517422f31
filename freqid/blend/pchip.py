"""Shape-preserving cubics through knots, with their derivative with respect to the knot values."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from freqid.core.arrays import Array

# Places around the knot values, in standard errors, over which weights are averaged: fixed once for all.
_AROUND = np.random.default_rng(0).standard_normal((8, 64))


class Pchip:
    """Several channels through the same knots, each by its own shape-preserving cubic.

    Parameters
    ----------
    knots : array_like, shape (knot,)
        Increasing; two or more.
    values : array_like, shape (channel, knot)
    spread : array_like, shape (channel, knot), optional
        Standard errors of the values, over which the weights are averaged.

    Notes
    -----
    Nothing is extrapolated: outside the knots every result is nan.

    The slope at a knot is a weighted harmonic mean of those of the chords beside it, and zero where they
    differ in sign, so the interpolant is *not* linear in the knot values: the weight of a knot depends
    on the values around it, and one set of cardinal functions for all channels does not exist. Where
    noise may turn a chord, the derivative at the values found is itself a matter of chance. Its mean over
    the noise is the best linear approximation there is (Stein's identity), and is estimated here.

    References
    ----------
    Fritsch & Butland, SIAM J. Sci. Stat. Comput. 5(2), 1984: slopes inside. Moler, Numerical Computing
    with MATLAB, ch. 3: the limited three-point slopes at the ends.
    """

    def __init__(self, knots: ArrayLike, values: ArrayLike, spread: ArrayLike | None = None):
        self.knots = np.asarray(knots, dtype=float)
        self.values = np.asarray(values, dtype=float)
        self._spread = None if spread is None else np.asarray(spread, dtype=float)
        with np.errstate(over="ignore"):  # over a chord that is all but level; the slope there is zero
            self._cubic = PchipInterpolator(self.knots, self.values, axis=1, extrapolate=False)

    def __call__(self, s: ArrayLike, order: int = 0) -> Array:
        """Return values, or their derivative of an order with respect to s, shape (channel, n)."""
        return self._cubic(np.asarray(s, dtype=float), nu=order)

    def weights(self, s: ArrayLike) -> Array:
        """Return the derivative of the values at s with respect to the knot values.

        Parameters
        ----------
        s : array_like, shape (n,)

        Returns
        -------
        ndarray, shape (channel, knot, n)
            Element (c, k, i) is d value_c(s_i) / d values[c, k].
        """
        s, identity = np.asarray(s, dtype=float), np.eye(self.knots.size)
        level, tilt = (
            CubicHermiteSpline(self.knots, *ends, extrapolate=False)(s)
            for ends in ((identity, 0 * identity), (0 * identity, identity))
        )
        return level.T + np.swapaxes(self.slope_weights, 1, 2) @ tilt.T

    @cached_property
    def slope_weights(self) -> Array:
        """Derivative of the slopes with respect to the values, shape (channel, knot of slope, knot)."""
        if self._spread is None:
            return _slope_weights(self.knots, self.values)
        offsets = self._spread * _AROUND[:, None, np.arange(self.knots.size) % 64]
        around = [self.values + sign * one for one in offsets for sign in (1, -1)]
        return np.mean([_slope_weights(self.knots, values) for values in around], axis=0)


def _slope_weights(knots: Array, values: Array) -> Array:
    """Return the derivative of the slopes with respect to the values, shape (channel, knot, knot)."""
    step, n = np.diff(knots), knots.size
    chord = np.diff(values, axis=1) / step
    by_chord = np.zeros((len(values), n, n - 1))
    if n == 2:
        by_chord[:] = 1.0
    else:
        inside = np.arange(1, n - 1)
        left, right = chord[:, :-1], chord[:, 1:]
        w_left, w_right = step[:-1] + 2 * step[1:], 2 * step[:-1] + step[1:]
        alike = left * right > 0
        left, right = np.where(alike, left, 1.0), np.where(alike, right, 1.0)
        # slope = (w_left + w_right) / (w_left / left + w_right / right)
        shared = (w_left + w_right) / (w_left / left + w_right / right) ** 2
        by_chord[:, inside, inside - 1] = np.where(alike, shared * w_left / left**2, 0.0)
        by_chord[:, inside, inside] = np.where(alike, shared * w_right / right**2, 0.0)
        for at, near, far in ((0, 0, 1), (n - 1, n - 2, n - 3)):
            ends = _end_weights(step[near], step[far], chord[:, near], chord[:, far])
            by_chord[:, at, [near, far]] = ends.T
    by_value = np.zeros((n - 1, n))
    rows = np.arange(n - 1)
    by_value[rows, rows], by_value[rows, rows + 1] = -1 / step, 1 / step
    return by_chord @ by_value


def _end_weights(near_step: float, far_step: float, near: Array, far: Array) -> Array:
    """Return the derivative of an end slope with respect to its two chords, shape (2, channel)."""
    weights = np.array([2 * near_step + far_step, -near_step]) / (near_step + far_step)
    slope = weights[0] * near + weights[1] * far
    turned = np.sign(slope) != np.sign(near)
    steep = ~turned & (np.sign(near) != np.sign(far)) & (np.abs(slope) > 3 * np.abs(near))
    return np.array(
        [
            np.where(turned, 0.0, np.where(steep, 3.0, weights[0])),
            np.where(turned | steep, 0.0, weights[1]),
        ]
    )
