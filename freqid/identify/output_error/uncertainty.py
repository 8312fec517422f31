"""Cramer-Rao bounds of maximum-likelihood estimates, and the same corrected for coloured residuals.

A problem near its optimum is a regression: columns are the derivatives of the outputs, in units of the noise.
Every output of every manoeuvre is a stretch with a spectrum of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

from freqid.core.arrays import Array, Complex
from freqid.identify.regress.covariance_corrections import (
    correct_coloured_lines,
    correct_coloured_samples,
    correct_line_spacing,
)
from freqid.identify.regress.regression import LeastSquares, least_squares

Residuals = Literal["coloured", "white"]


class Uncertainty(NamedTuple):
    """The regression of a problem near its optimum, by what its residuals are taken to be."""

    white: LeastSquares
    coloured: LeastSquares

    def of(self, residuals: Residuals) -> LeastSquares:
        """Return the one for residuals that are coloured, or white."""
        return self.coloured if residuals == "coloured" else self.white


def uncertainty_in_time(
    residual: Array, columns: Array, samples: Sequence[int], names: Sequence[str]
) -> Uncertainty:
    """Return the uncertainty of estimates in time.

    Parameters
    ----------
    residual : ndarray, shape (E,)
        In units of the noise, one stretch after another.
    columns : ndarray, shape (f, E)
        Its derivatives, likewise.
    samples : sequence of int
        Of each stretch.
    names : sequence of str, length f
    """
    fit = least_squares(columns, residual[None], names=names)
    return Uncertainty(fit, correct_coloured_samples(fit, samples=samples))


def uncertainty_on_lines(
    residual: Complex,
    columns: Complex,
    lines: Sequence[Array],
    durations: Sequence[float],
    names: Sequence[str],
) -> Uncertainty:
    """Return the uncertainty of estimates on complex lines.

    Parameters
    ----------
    residual, columns : ndarray of complex, shape (E,) and (f, E)
    lines : sequence of ndarray
        Frequencies of each stretch, Hz.
    durations : sequence of float
        Length of each stretch's record, s.
    names : sequence of str, length f
    """
    fit = least_squares(columns, residual[None], names=names)
    given = list(lines), list(map(float, durations))
    return Uncertainty(correct_line_spacing(fit, *given), correct_coloured_lines(fit, *given))
