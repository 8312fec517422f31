"""The stack at one error of form: inner products, data, and candidates beside tolerances.

What does not depend on the data is made once, however often lines are made straight elsewhere: that only
moves the data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor

from freqid.core.arrays import Array
from freqid.gap.infer.block_matrices import Form, rooted

_FREE = 1e-9  # of a free column's energy: what is left of it


class Posterior(NamedTuple):
    """What the data say of the tolerances, in sigmas.

    Attributes
    ----------
    mean : ndarray, shape (tolerance, ...)
        Without an effect.
    slopes : ndarray, shape (tolerance, column)
        By which it is less for each column in the data.
    variance : ndarray, shape (tolerance,)
    """

    mean: Array
    slopes: Array
    variance: Array


@dataclass(frozen=True, eq=False)
class Reduced:
    """Candidates in the metric of noise, unknowns, form and tolerances, at one error of form.

    Attributes
    ----------
    G : ndarray, shape (column, column)
    g : ndarray, shape (column,)
        Of the residual.
    log_evidence : float
        Of no effect, less what all sizes of form have in common.
    posterior : Posterior
    """

    G: Array
    g: Array
    log_evidence: float
    posterior: Posterior

    def own(self, layout: Sequence[NDArray[np.intp]]) -> list[Array]:
        """Return each candidate's inner products alone; `layout` as in `OwnProducts`."""
        return [self.G[c[:, :, None], c[:, None, :]] for c in layout]

    def freed(self, directions: Array) -> Reduced:
        """Return what is left once weights of columns are free, shape (freed, column).

        The log evidence is that at their likeliest size.
        """
        across, projected = directions @ self.G, directions @ self.g
        own = across @ directions.T
        size = np.sqrt(np.maximum(np.diag(own), np.finfo(float).tiny))  # each counts alike, however small
        across, projected = across / size[:, None], projected / size
        own = own / size[:, None] / size + _FREE * np.eye(len(own))
        solved = np.linalg.solve(own, np.concatenate([across, projected[:, None]], axis=1))
        mean, slopes, variance = self.posterior
        moved = slopes @ (directions / size[:, None]).T
        return Reduced(
            self.G - across.T @ solved[:, :-1],
            self.g - across.T @ solved[:, -1],
            self.log_evidence + 0.5 * float(projected @ solved[:, -1]),
            Posterior(
                mean - moved @ solved[:, -1],
                slopes - moved @ solved[:, :-1],
                variance + (moved * np.linalg.solve(own, moved.T).T).sum(axis=1),
            ),
        )

    def given(self, weights: Array) -> Reduced:
        """Return what is left once some weights of columns are known to be in the data."""
        moved = self.G @ weights
        log = self.log_evidence + float(weights @ self.g - 0.5 * weights @ moved)
        known = self.posterior
        known = known._replace(mean=known.mean - known.slopes @ weights)
        return Reduced(self.G, self.g - moved, log, known)


@dataclass(frozen=True, eq=False)
class OwnProducts:
    """The part of `Reduced` that Bayes factors of single candidates need: a hundredth of it.

    Attributes
    ----------
    products : list of ndarray, shape (candidate, column, column)
        Inner products of each candidate's columns, candidates of the same number of columns together.
    g : ndarray, shape (column,)
        Of the residual, of all candidates.
    log_evidence : float
    posterior : Posterior
        As in `Reduced`.
    """

    products: list[Array]
    g: Array
    log_evidence: float
    posterior: Posterior

    def own(self, layout: Sequence[NDArray[np.intp]]) -> list[Array]:
        """Return `products`; `layout`, columns of shape (candidate, column), is what they were made for."""
        return self.products


class DataAt(NamedTuple):
    """What all data are at one error of form.

    Attributes
    ----------
    columns : ndarray, shape (n,)
        The residual's inner products with the columns of `AtForm`.
    energy : float
        With itself.
    """

    columns: Array
    energy: float

    def less(self, gram: Array, at: NDArray[np.intp] | slice, weights: Array) -> DataAt:
        """Return them less some columns at weights, `gram` the inner products of all columns."""
        moved = self.columns - gram[:, at] @ weights
        return DataAt(moved, self.energy - float(weights @ (self.columns[at] + moved[at])))


@dataclass(frozen=True, eq=False)
class BesideTolerances:
    """Tolerances and shared errors of form, of one sigma each, integrated out of all else.

    Attributes
    ----------
    rows : ndarray, shape (n - column, n)
        Inner products of ``[T, A]`` with ``[X, T, A]``, as in `AtForm`.
    candidates, tolerances : int
        Columns of X and of T.
    half : float
        As in `AtForm`.
    """

    rows: Array
    candidates: int
    tolerances: int
    half: float

    @cached_property
    def root(self) -> tuple[Array, float]:
        """``L^-1`` of ``L L' = 1 + P``, P the products of T and A, and half its log determinant."""
        return rooted(self.rows[:, self.candidates :])

    @cached_property
    def across(self) -> Array:
        """What candidates' inner products lose, as a root, shape (n - column, column)."""
        return self.root[0] @ self.rows[:, : self.candidates]

    @cached_property
    def untold(self) -> Posterior:
        """What is known of the tolerances but for what the data say of them."""
        stated = self.root[0][:, : self.tolerances]
        return Posterior(np.zeros(self.tolerances), stated.T @ self.across, (stated**2).sum(axis=0))

    def told(self, data: DataAt) -> tuple[Array, float, Posterior]:
        """Return g, the log evidence of no effect, and the posterior, as in `Reduced`."""
        inverse, half = self.root
        own = inverse @ data.columns[self.candidates :]
        known = self.untold._replace(mean=inverse[:, : self.tolerances].T @ own)
        log_evidence = -0.5 * (data.energy - float(own @ own)) - self.half - half
        return data.columns[: self.candidates] - self.across.T @ own, log_evidence, known


@dataclass(frozen=True, eq=False)
class AtForm:
    """All blocks at one error of form, tolerances not yet integrated out: what does not depend on the data.

    Attributes
    ----------
    gram : ndarray, shape (n, n)
        Inner products of ``[X, T, A]``, shared errors of form at their size; without A where they have none.
    candidates, tolerances : int
        Columns of X and of T.
    half : float
        Half a log determinant, less the logarithm of the prior.
    """

    gram: Array
    candidates: int
    tolerances: int
    half: float

    @cached_property
    def beside(self) -> BesideTolerances:
        """Tolerances and shared errors of form, integrated out."""
        return BesideTolerances(self.gram[self.candidates :], self.candidates, self.tolerances, self.half)

    @cached_property
    def G(self) -> Array:
        """Inner products of X beside tolerances, shape (column, column)."""
        across = self.beside.across
        return self.gram[: self.candidates, : self.candidates] - across.T @ across

    @cached_property
    def alike(self) -> tuple[Array, bool]:
        """Cholesky factor of one plus the products of A."""
        inner = self.gram[self.candidates + self.tolerances :, self.candidates + self.tolerances :]
        return cho_factor(np.eye(len(inner)) + inner)

    def some(self, columns: NDArray[np.intp], candidates: int, tolerances: int) -> AtForm:
        """Return it with some of the columns, so many of X and of T."""
        return AtForm(self.gram[np.ix_(columns, columns)], candidates, tolerances, self.half)

    def with_data(self, data: DataAt) -> Reduced:
        """Return candidates beside tolerances of one sigma each."""
        return Reduced(self.G, *self.beside.told(data))


@dataclass(frozen=True, eq=False)
class Kept:
    """What was made of a stack so far, by error of form."""

    metric: dict[Form, AtForm] = field(default_factory=dict)
    data: dict[Form, DataAt] = field(default_factory=dict)
    reduced: dict[Form, Reduced] = field(default_factory=dict)
