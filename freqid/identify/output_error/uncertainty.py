"""Cramer-Rao bounds of maximum-likelihood estimates, corrected for coloured residuals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.identify.regress.covariance_corrections import (
    correct_coloured_lines,
    correct_coloured_samples,
    correct_line_spacing,
)
from freqid.identify.regress.regression import LeastSquares, least_squares

Residuals = Literal["coloured", "white"]


def uncertainty_in_time(
    residual: Array, columns: Array, samples: Sequence[int], names: Sequence[str], residuals: Residuals
) -> LeastSquares:
    """Return the regression that the problem is near its optimum, with the covariance that holds.

    Parameters
    ----------
    residual : ndarray, shape (E,)
        In units of the noise, one output of one manoeuvre after another.
    columns : ndarray, shape (f, E)
        Its derivatives, likewise.
    samples : sequence of int
        Of each stretch: every output of every manoeuvre has a spectrum of its own.
    names : sequence of str, length f
    residuals : {"coloured", "white"}
        What the covariance allows the residual to be; white gives the Cramer-Rao bounds.
    """
    fit = least_squares(columns, residual[None], names=names)
    return correct_coloured_samples(fit, samples=samples) if residuals == "coloured" else fit


def uncertainty_on_lines(
    residual: Complex,
    columns: Complex,
    lines: Sequence[Array],
    durations: Sequence[float],
    names: Sequence[str],
    residuals: Residuals,
) -> LeastSquares:
    """Return the same on complex lines.

    Parameters
    ----------
    residual, columns : ndarray of complex, shape (E,) and (f, E)
    lines : sequence of ndarray
        Frequencies of each stretch, Hz.
    durations : sequence of float
        Length of each stretch's record, s.
    names, residuals
        As `uncertainty_in_time`.
    """
    fit = least_squares(columns, residual[None], names=names)
    correct = correct_coloured_lines if residuals == "coloured" else correct_line_spacing
    return correct(fit, list(lines), list(map(float, durations)))


def standard_errors(fit: LeastSquares) -> Array:
    """Return the standard errors, shape (f,)."""
    return np.asarray(fit.std_error[0])
