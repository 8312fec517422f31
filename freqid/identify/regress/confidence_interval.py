"""Confidence intervals of parameters: quantiles of Student's t times standard errors, about estimates."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from freqid.core.arrays import Array


def confidence_interval(
    estimate: ArrayLike, std_error: ArrayLike, *, level: float = 0.95, degrees_of_freedom: ArrayLike = np.inf
) -> tuple[Array, Array]:
    """Return lower and upper confidence limits of parameters.

    Parameters
    ----------
    estimate, std_error : array_like
        Of one shape, or shapes that broadcast; an unknown standard error is NaN and makes NaN limits.
    level : float
        Probability that an interval holds its true parameter.
    degrees_of_freedom : array_like
        Of the variance behind each standard error; infinite where that is known, which is the normal
        distribution.

    Returns
    -------
    lower, upper : ndarray
    """
    centre = np.asarray(estimate, dtype=float)
    half = half_width(std_error, level=level, degrees_of_freedom=degrees_of_freedom)
    return centre - half, centre + half


def half_width(
    std_error: ArrayLike = 1.0, *, level: float = 0.95, degrees_of_freedom: ArrayLike = np.inf
) -> Array:
    """Return how far an interval reaches to either side of its estimate; parameters as there.

    References
    ----------
    Klein & Morelli, *Aircraft System Identification*, 2nd ed., chapter 5, confidence intervals.
    """
    dof = np.asarray(degrees_of_freedom, dtype=float)
    quantile = np.asarray(stdtrit(dof, 0.5 + level / 2), dtype=float)
    return np.multiply(quantile, std_error)
