"""Multivariate orthogonal functions: candidates made orthogonal, chosen by predicted squared error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from freqid.core.arrays import Array
from freqid.identify.regress.structure import Step, prepare_candidates


@dataclass(frozen=True)
class OrthogonalModel:
    """A model of one response in orthogonal functions, and the same model in ordinary terms.

    Parameters
    ----------
    terms : tuple of str, length m
        Chosen candidates, in the order in which they were made orthogonal.
    steps : tuple of Step
        Every function in that order, the rejected ones too: the curve whose least predicted squared
        error decides.
    coefficient : ndarray, shape (m,)
        Coefficients of the orthogonal functions, unit of the response per unit of the term.
    coefficient_std_error : ndarray, shape (m,)
        Their standard errors, white residuals assumed; the coefficients do not correlate.
    transform : ndarray, shape (m, m)
        Upper unit triangular T: the estimates of the ordinary terms are T times the coefficients.

    Notes
    -----
    The orthogonal functions themselves are P = T^T X for chosen terms X of shape (m, M), less the
    nuisance columns.
    """

    terms: tuple[str, ...]
    steps: tuple[Step, ...]
    coefficient: Array
    coefficient_std_error: Array
    transform: Array

    @property
    def estimate(self) -> Array:
        """Parameters of the ordinary terms, shape (m,)."""
        return self.transform @ self.coefficient

    @property
    def covariance(self) -> Array:
        """Covariance of the parameters of the ordinary terms, shape (m, m)."""
        scaled = self.transform * self.coefficient_std_error
        return scaled @ scaled.T

    @property
    def std_error(self) -> Array:
        """Standard errors of the parameters of the ordinary terms, shape (m,)."""
        return np.sqrt(np.diag(self.covariance))


def orthogonal_functions(
    candidates: ArrayLike,
    response: ArrayLike,
    *,
    names: Sequence[str] | None = None,
    nuisance: ArrayLike | None = None,
    independent_share: float = 1.0,
) -> OrthogonalModel:
    """Choose the terms of one response's model through multivariate orthogonal functions.

    Parameters
    ----------
    candidates : array_like, shape (p, M), complex or real
        Candidate regressors on M lines or samples.
    response : array_like, shape (M,) or (1, M), complex or real
        The response.
    names : sequence of str, optional
        Names of the candidates.
    nuisance : array_like, shape (q, M), optional
        Columns that every model has: a constant, end terms.
    independent_share : float
        Independent equations per equation: min(1, T df) for lines df apart.

    Returns
    -------
    OrthogonalModel
        Chosen terms, the curve of predicted squared error, estimates in both forms.

    Raises
    ------
    DataError
        A channel is not finite, or zero throughout, or too few equations.
    UsageError
        Shapes or names do not agree.

    Notes
    -----
    The candidate that explains most of what is left is made orthogonal to the functions before it, again
    and again; a candidate that they already contain is passed over. As functions are orthogonal, each
    lowers the squared residual by its own amount whatever the others, and the predicted squared error has
    a least value, where the model ends. No threshold has to be set.

    References
    ----------
    Morelli, "Global Nonlinear Aerodynamic Modeling Using Multivariate Orthogonal Functions", J. Aircraft
    32(2), 1995; Klein & Morelli, *Aircraft System Identification*, 2nd ed., ch. 5.
    """
    problem = prepare_candidates(candidates, response, names, nuisance, independent_share)
    order: list[int] = []
    steps: list[Step] = []
    square = float(problem.response @ problem.response)
    error = [problem.pse(square, 0)]
    squares = [square]
    while len(order) < len(problem.names) and problem.freedom(len(order) + 1) >= 1:
        _, residual, gain = problem.remaining(order)
        best = int(np.argmax(gain))
        if gain[best] <= 0:
            break
        order.append(best)
        square = max(float(residual @ residual) - gain[best], 0.0)
        f = problem.partial_f(gain[best], square, len(order))
        steps.append(problem.step("add", problem.names[best], f, square, len(order)))
        error.append(steps[-1].pse)
        squares.append(square)
    m = int(np.argmin(error))
    chosen = order[:m]
    basis, factor = np.linalg.qr(problem.columns[chosen].T)
    # X = Q R = P G with P = Q diag(R) orthogonal and G = diag(R)^-1 R unit triangular.
    diagonal = np.diag(factor)
    coefficient = basis.T @ problem.response / diagonal
    variance = squares[m] / (len(problem.response) - problem.n_nuisance - m)
    return OrthogonalModel(
        terms=tuple(problem.names[i] for i in chosen),
        steps=tuple(steps),
        coefficient=coefficient,
        coefficient_std_error=np.sqrt(variance) / np.abs(diagonal),
        transform=np.linalg.inv(factor / diagonal[:, None]).astype(np.float64),
    )
