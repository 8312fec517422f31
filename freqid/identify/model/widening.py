"""A response's model with a larger covariance than its fit has: for what was chosen or found before it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from freqid.core.arrays import Array
from freqid.core.results.point import ResponseModel


def with_covariance(response: ResponseModel, covariance: Array) -> ResponseModel:
    """Return a response with another covariance of its parameters.

    Parameters
    ----------
    response : ResponseModel
    covariance : ndarray, shape (p, p)

    Returns
    -------
    ResponseModel
        Its limits keep their Student factors.
    """
    std_error = np.sqrt(np.diag(covariance))
    ratio = std_error / response.std_error
    return replace(
        response,
        covariance=covariance,
        std_error=std_error,
        lower=response.estimate - ratio * (response.estimate - response.lower),
        upper=response.estimate + ratio * (response.upper - response.estimate),
        t_statistic=response.t_statistic / ratio,
        correlation=covariance / np.outer(std_error, std_error),
    )
