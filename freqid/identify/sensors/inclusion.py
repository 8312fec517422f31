"""Is an error there at all? Estimates averaged over with and without it, by what the data say of each."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from freqid.core.arrays import Array

MOST = 12  # errors that are put on trial together; 2^12 combinations


class Averaged(NamedTuple):
    """Parameters after some of them were put on trial.

    Attributes
    ----------
    estimate : ndarray, shape (p,)
    covariance : ndarray, shape (p, p)
        Within the combinations and between them.
    probability : ndarray, shape (p,)
        That a parameter is there; one for those that were not on trial.
    """

    estimate: Array
    covariance: Array
    probability: Array


def average_over_inclusion(estimate: Array, covariance: Array, size: Array, tried: Array) -> Averaged:
    """Average over every combination of parameters being there or zero.

    Parameters
    ----------
    estimate, covariance : ndarray, shape (p,) and (p, p)
        With all parameters free.
    size : ndarray, shape (p,)
        One sigma of each parameter beforehand, if it is there.
    tried : ndarray of bool, shape (p,)
        Parameters that may be zero; as likely as not, beforehand. Of more than `MOST` those are tried that
        are the fewest standard errors from zero, for the others there is no question.

    Returns
    -------
    Averaged

    Notes
    -----
    With S a combination and P_S its prior covariance, the estimates of the tried ones are normal with
    covariance ``C + P_S``: that is the evidence, and the mean given S is ``P_S (C + P_S)^-1 estimate``.
    Exact for a normal likelihood. The others follow by regression on the tried ones.

    References
    ----------
    Hoeting, Madigan, Raftery & Volinsky, "Bayesian model averaging", Statistical Science 14, 1999; George &
    McCulloch, J. American Statistical Association 88, 1993 (spike and slab).
    """
    rows = np.flatnonzero(tried)
    if not rows.size:
        return Averaged(estimate, covariance, np.ones(estimate.size))
    if rows.size > MOST:
        away = np.abs(estimate[rows]) / np.sqrt(np.diag(covariance)[rows])
        rows = np.sort(rows[np.argsort(away)[:MOST]])
    own, value = covariance[np.ix_(rows, rows)], estimate[rows]
    there = np.array(list(product((0.0, 1.0), repeat=rows.size)))
    log_weight, means, spreads = np.empty(len(there)), np.empty_like(there), []
    for i, present in enumerate(there):
        prior = np.diag(present * size[rows] ** 2)
        factor = np.linalg.cholesky(own + prior)
        solved = np.linalg.solve(factor, np.column_stack([value, prior]))
        log_weight[i] = -(solved[:, 0] @ solved[:, 0]) / 2 - np.log(np.diag(factor)).sum()
        means[i] = solved[:, 1:].T @ solved[:, 0]
        spreads.append(prior - solved[:, 1:].T @ solved[:, 1:])
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    mean = weight @ means
    spread = np.einsum("c,cij->ij", weight, np.array(spreads))
    spread += np.einsum("c,ci,cj->ij", weight, means - mean, means - mean)
    gain = np.linalg.solve(own, covariance[rows]).T
    averaged = estimate + gain @ (mean - value)
    probability = np.ones(estimate.size)
    probability[rows] = weight @ there
    return Averaged(averaged, covariance + gain @ (spread - own) @ gain.T, probability)
