"""What a manoeuvre is to the models over advance ratio: a likelihood of its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.core.results.advance_ratio import LocalDerivatives


class Expansion(NamedTuple):
    """Second-order expansion of a manoeuvre's log likelihood.

    ``log p = constant - (theta - minimum)' information (theta - minimum) / 2``

    Attributes
    ----------
    minimum : ndarray, shape (p,)
    information : ndarray, shape (p, p)
        Own initial conditions and biases already eliminated.
    """

    minimum: Array
    information: Array


class LocalProblem(Protocol):
    """One manoeuvre as a function of p derivatives: equation error, output error, or estimates alone."""

    @property
    def names(self) -> tuple[str, ...]:
        """Derivatives that the manoeuvre tells."""
        ...

    def expand(self, theta: Array) -> Expansion:
        """Return the expansion about derivatives `theta`, shape (p,)."""
        ...

    def misfit(self, theta: Array) -> float:
        """Return twice the log likelihood that `theta` loses against the manoeuvre's own best fit."""
        ...


@dataclass(frozen=True, eq=False)
class EstimatedManeuver:
    """A manoeuvre of which estimates and their covariance are known: of linear regression, all there is.

    Attributes
    ----------
    names : tuple of str, length p
    estimate : ndarray, shape (p,)
    information : ndarray, shape (p, p)
        Inverse of the estimates' covariance.
    """

    names: tuple[str, ...]
    estimate: Array
    information: Array

    def expand(self, theta: Array) -> Expansion:
        """Return the expansion, which is the same everywhere."""
        return Expansion(self.estimate, self.information)

    def misfit(self, theta: Array) -> float:
        """Return the squared distance from the estimate in standard errors."""
        off = theta - self.estimate
        return float(off @ self.information @ off)


def estimated_maneuvers(local: LocalDerivatives) -> list[LocalProblem]:
    """Return local estimates as problems.

    Raises
    ------
    DataError
        Where a covariance is not positive definite, naming the manoeuvre.
    """
    problems: list[LocalProblem] = []
    for i, identifier in enumerate(local.ids):
        told = np.isfinite(local.estimate[i])
        covariance = local.covariance[i][np.ix_(told, told)]
        scale = np.sqrt(np.diag(covariance))
        try:
            # scaled, so that a singular matrix is told from one of small units
            root = np.linalg.cholesky(covariance / np.outer(scale, scale))
        except np.linalg.LinAlgError:
            raise DataError(
                "the covariance of its derivatives is not positive definite: it does not tell them apart",
                where=identifier,
                remedy="leave the manoeuvre out, or regressors that it does not move",
            ) from None
        half = np.linalg.solve(root, np.diag(1 / scale))
        names = tuple(n for n, t in zip(local.names, told, strict=True) if t)
        problems.append(EstimatedManeuver(names, local.estimate[i][told], half.T @ half))
    return problems


def places(problem: LocalProblem, names: Sequence[str]) -> NDArray[np.intp]:
    """Return the columns among `names` of a manoeuvre's derivatives, shape (p,)."""
    return np.array([list(names).index(name) for name in problem.names], dtype=np.intp)
