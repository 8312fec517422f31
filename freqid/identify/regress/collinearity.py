"""Which parameters the data cannot separate: condition indices, variance proportions and inflation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError

PERFECT = 1e-12
"""Ratio of singular values of unit columns below which columns count as exactly dependent: some 5000
rounding errors, and far below what the noise of any measured signal leaves."""


@dataclass(frozen=True)
class Collinearity:
    """Belsley's diagnostics of the columns of a regression, each scaled to unit length.

    Parameters
    ----------
    names : tuple of str, length n
        The columns: nuisance columns first, then regressors.
    condition_index : ndarray, shape (n,)
        Largest singular value over each singular value, ascending; the last is the condition number.
    direction : ndarray, shape (n, n)
        Row i: the combination of unit columns that belongs to condition index i (right singular vector).
    proportion : ndarray, shape (n, n)
        Row i, column j: the share of the variance of estimate j that comes from direction i (the
        variance-decomposition proportions). Every column sums to one.
    inflation : ndarray, shape (n,)
        Variance inflation factor of each column: 1 / (1 - R2) of that column regressed on the others.
        Of a regressor it is taken after the nuisance columns are projected out, which makes it the
        usual, centred factor where the nuisance column is a constant.

    References
    ----------
    Belsley, Kuh, Welsch, *Regression Diagnostics*, Wiley 1980, ch. 3; Klein & Morelli, *Aircraft System
    Identification*, 2nd ed., ch. 5 (data collinearity).
    """

    names: tuple[str, ...]
    condition_index: NDArray[np.float64]
    direction: NDArray[np.float64]
    proportion: NDArray[np.float64]
    inflation: NDArray[np.float64]

    @property
    def condition_number(self) -> float:
        """Ratio of the largest to the smallest singular value of the unit columns."""
        return float(self.condition_index[-1])

    def inseparable(
        self, *, condition_index: float = 30.0, proportion: float = 0.5
    ) -> tuple[tuple[str, ...], ...]:
        """Name the groups of parameters that these data cannot tell apart.

        Parameters
        ----------
        condition_index : float
            A direction is weak where its condition index exceeds this.
        proportion : float
            A parameter is involved where more than this share of its variance comes from the weak
            directions together.

        Returns
        -------
        tuple of tuple of str
            The groups, each of at least two names; empty where the data separate everything.

        Notes
        -----
        Where several directions are weak, the data fix the space they span but hardly the directions
        themselves, so one row of `proportion` can hide a dependence or mix two. Belsley therefore sums
        the proportions over such directions; the names found are then sorted into groups by the
        projector on the space, which does not depend on the mixing.
        """
        weak = self.condition_index > condition_index
        involved = np.flatnonzero(self.proportion[weak].sum(axis=0) > proportion)
        return _groups(self.names, self.direction[weak], involved)


def examine_columns(factor: NDArray[np.float64], names: Sequence[str], n_nuisance: int) -> Collinearity:
    """Examine the columns of a regression through their triangular factor.

    Parameters
    ----------
    factor : ndarray, shape (n, n)
        R of the QR decomposition of the columns, each scaled to unit length, nuisance columns first.
    names : sequence of str, length n
        Names of the columns.
    n_nuisance : int
        How many of the first columns are nuisance columns.

    Returns
    -------
    Collinearity
        The diagnostics.

    Raises
    ------
    DataError
        Where columns are exactly dependent; the sentence names them.
    """
    names = tuple(names)
    _, singular, direction = np.linalg.svd(factor)
    null = direction[singular < PERFECT * singular[0]]
    if len(null):
        groups = _groups(names, null, np.flatnonzero((null**2).sum(axis=0) > 1e-8))
        raise DataError(
            "; ".join(" and ".join(f"'{name}'" for name in group) for group in groups)
            + " are perfectly collinear over these data, so their parameters cannot be told apart",
            remedy="keep one of them, or excite them independently",
        )
    variance = (direction / singular[:, None]) ** 2
    total = variance.sum(axis=0)
    free = factor.copy()  # what the nuisance columns leave of each regressor
    free[:n_nuisance, n_nuisance:] = 0.0
    inflation = total * (free**2).sum(axis=0)
    return Collinearity(names, singular[0] / singular, direction, variance / total, inflation)


def _groups(
    names: tuple[str, ...], span: NDArray[np.float64], involved: NDArray[np.intp]
) -> tuple[tuple[str, ...], ...]:
    """Split the involved columns into sets that the projector on a row space connects."""
    if len(involved) < 2:
        return ()
    projector = span.T @ span
    length = np.sqrt(np.diag(projector))
    # m columns that all equal each other are connected by 1 / (m - 1), separate sets by nearly nothing.
    linked = np.abs(projector) > 0.5 / (len(involved) - 1) * np.outer(length, length)
    left, groups = [int(index) for index in involved], []
    while left:
        group: list[int] = [left.pop(0)]
        for member in group:  # grows while it is walked
            group += [other for other in left if linked[member, other]]
            left = [other for other in left if other not in group]
        if len(group) > 1:
            groups.append(tuple(names[index] for index in sorted(group)))
    return tuple(groups)
