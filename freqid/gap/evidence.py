"""The metric in which a gap is judged, and how strongly data speak for one explanation or another.

Everything is linear and Gaussian here: residual = signatures x parameters + tolerances + noise. With noise
made white and tolerances integrated over their prior, all that any comparison needs are inner products,
so data, signatures and draws of the null are reduced to them once, manoeuvre by manoeuvre.

References
----------
D. J. C. MacKay, *Information Theory, Inference, and Learning Algorithms*, Cambridge, 2003, ch. 28 (evidence
and Occam factors); C. E. Rasmussen and C. K. I. Williams, *Gaussian Processes for Machine Learning*, MIT,
2006, sec. 2.7 (explicit basis functions with a prior).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

Array = NDArray[np.float64]


_ROUNDING = 1e-12  # of a column's square
_SURE = 2.0  # standard deviations by which draws must be louder than the metric, to be believed

IN_MANEUVER, IN_ROW = "@", "#"
"""Between the name of a signature and the one manoeuvre, by number, or row in which a column has it."""


def everywhere(name: str) -> bool:
    """Return whether a column has its signature in all manoeuvres and rows."""
    return IN_MANEUVER not in name and IN_ROW not in name


@dataclass(frozen=True)
class Hypothesis:
    """An explanation: columns that may be needed, and what is expected of their coefficients.

    Attributes
    ----------
    name : str
        Effect ids joined by ``+``, or ``other``.
    columns : tuple of int
        Of the evidence.
    scale : tuple of float
        One sigma of each coefficient before any data.
    """

    name: str
    columns: tuple[int, ...]
    scale: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Estimate:
    """Coefficients of a hypothesis.

    Attributes
    ----------
    value : ndarray, shape (column,)
    covariance : ndarray, shape (column, column)
    evidence : float
        Logarithm of the Bayes factor against no effect.
    detectability : float
        ``s^T S^-1 s`` of the change that the estimate stands for.
    """

    value: Array
    covariance: Array
    evidence: float
    detectability: float


@dataclass(frozen=True, eq=False)
class Evidence:
    """Inner products of data, signatures, tolerances and null draws in the metric of noise.

    Attributes
    ----------
    gram : ndarray, shape (maneuver, n, n)
        Of white columns in the order data, signatures, tolerances, draws; what a manoeuvre alone may be
        wrong by is integrated over.
    signatures : tuple of str
        ``effect:parameter``.
    tolerances : tuple of str
        Each scaled to one sigma.
    null : ndarray, shape (draw, tolerance)
        Tolerances of the null draws, in sigma.
    rows : int
        White numbers in all manoeuvres.
    """

    gram: Array
    signatures: tuple[str, ...]
    tolerances: tuple[str, ...]
    null: Array
    rows: int

    def only(self, maneuvers: Sequence[int]) -> Evidence:
        """Return the evidence of some manoeuvres."""
        share = len(maneuvers) / len(self.gram)
        return Evidence(
            self.gram[list(maneuvers)], self.signatures, self.tolerances, self.null, int(self.rows * share)
        )

    def by_maneuver(self, names: Sequence[str]) -> Evidence:
        """Return the evidence with columns of some signatures in each manoeuvre alone, ``name@number``."""
        count, size, first = len(self.gram), self.gram.shape[1], 1 + len(self.signatures)
        if count < 2:
            return self
        at, extra = [self.column(n) for n in names], count * len(names)
        kept = np.r_[0:first, first + extra : size + extra]
        gram = np.zeros((count, size + extra, size + extra))
        before = np.concatenate([np.arange(size), at]).astype(int)
        for k in range(count):
            after = np.concatenate([kept, first + k * len(names) + np.arange(len(names))])
            gram[k][np.ix_(after, after)] = self.gram[k][np.ix_(before, before)]
        own = [f"{n}{IN_MANEUVER}{k}" for k in range(count) for n in names]
        return Evidence(gram, (*self.signatures, *own), self.tolerances, self.null, self.rows)

    def whole(self, hypothesis: Hypothesis) -> bool:
        """Return whether a hypothesis has one size in all manoeuvres and rows."""
        every = (*self.signatures, *self.tolerances)
        return all(everywhere(every[column - 1]) for column in hypothesis.columns)

    def without(self, tolerances: Collection[str]) -> Evidence:
        """Return the evidence where some tolerances are not allowed for."""
        first = 1 + len(self.signatures)
        left = np.array([name not in tolerances for name in self.tolerances], dtype=bool)
        at = np.ones(self.gram.shape[1], dtype=bool)
        at[first : first + left.size] = left
        names = tuple(name for name in self.tolerances if name not in tolerances)
        gram = self.gram[:, at][:, :, at]
        return Evidence(gram, self.signatures, names, self.null[:, left], self.rows)

    @cached_property
    def metric(self) -> Array:
        """Inner products with tolerances integrated over their prior, shape (n, n)."""
        whole = self.gram.sum(axis=0)
        at = slice(1 + len(self.signatures), 1 + len(self.signatures) + len(self.tolerances))
        inner = whole[at, at] + np.eye(len(self.tolerances))
        across = whole[at]
        return whole - across.T @ cho_solve(cho_factor(inner), across)

    def column(self, name: str) -> int:
        """Return the place of a signature or a tolerance in the metric."""
        if name in self.signatures:
            return 1 + self.signatures.index(name)
        return 1 + len(self.signatures) + self.tolerances.index(name)

    @cached_property
    def _with_data(self) -> Array:
        """Products of every column with the data and with each null draw, shape (n, 1 + draw)."""
        first = 1 + len(self.signatures)
        tolerances = self.metric[:, first : first + len(self.tolerances)]
        draws = self.metric[:, first + len(self.tolerances) :] + tolerances @ self.null.T
        return np.concatenate([self.metric[:, :1], draws], axis=1)

    @cached_property
    def null_energy(self) -> Array:
        """Whitened squared size of each null draw, tolerances and all, shape (draw,)."""
        first = 1 + len(self.signatures)
        mid = first + len(self.tolerances)
        noise = self.metric[mid:, mid:].diagonal()
        both = np.einsum("kt,tk->k", self.null, self.metric[first:mid, mid:])
        return (
            noise + 2 * both + np.einsum("kt,kt->k", self.null @ self.metric[first:mid, first:mid], self.null)
        )

    def null_products(self, column: int) -> Array:
        """Return the products of one column with each null draw, shape (draw,)."""
        return self._with_data[column, 1:]

    def estimate(self, hypothesis: Hypothesis) -> Estimate:
        """Return the coefficients that a hypothesis finds in the data."""
        gram, projected, prior = self._parts(hypothesis)
        factor = cho_factor(gram + np.diag(prior))
        value = cho_solve(factor, projected[:, 0])
        return Estimate(
            value=value,
            covariance=cho_solve(factor, np.eye(len(value))),
            evidence=float(self.evidences(hypothesis)[0]),
            detectability=float(value @ gram @ value),
        )

    def evidences(self, hypothesis: Hypothesis) -> Array:
        """Return the log Bayes factors of the data, first, and of every null draw, shape (1 + draw,)."""
        gram, projected, prior = self._parts(hypothesis)
        root = 1 / np.sqrt(prior)
        inner = np.eye(len(root)) + root[:, None] * gram * root
        factor = cho_factor(inner)
        scaled = root[:, None] * projected
        gain = 0.5 * np.einsum("ik,ik->k", scaled, cho_solve(factor, scaled))
        return gain - np.log(np.diag(factor[0])).sum()

    def detectabilities(self, hypothesis: Hypothesis) -> Array:
        """Return ``s^T S^-1 s`` of what is estimated of data and of each null draw, shape (1 + draw,)."""
        gram, projected, prior = self._parts(hypothesis)
        value = cho_solve(cho_factor(gram + np.diag(prior)), projected)
        return np.einsum("ik,ij,jk->k", value, gram, value)

    def grown(self, hypothesis: Hypothesis, columns: Sequence[int]) -> tuple[Array, Array, Array]:
        """Return the log Bayes factors of null draws to which a column is added some times.

        Returns
        -------
        constant, linear, square : ndarray, shapes (draw,), (column, draw), (column,)
            With a times the column it is ``constant + a linear + a^2 square``.
        """
        gram, projected, prior = self._parts(hypothesis)
        root = 1 / np.sqrt(prior)
        factor = cho_factor(np.eye(len(root)) + root[:, None] * gram * root)
        draws = root[:, None] * projected[:, 1:]
        added = root[:, None] * self.metric[np.ix_(list(hypothesis.columns), list(columns))]
        solved = cho_solve(factor, added)
        constant = 0.5 * np.einsum("ik,ik->k", draws, cho_solve(factor, draws))
        constant -= np.log(np.diag(factor[0])).sum()
        return constant, solved.T @ draws, 0.5 * np.einsum("ip,ip->p", added, solved)

    def with_added(self, draw: NDArray[np.intp], change: Array) -> Evidence:
        """Return evidence with other null draws: some of these with a change added to each.

        Parameters
        ----------
        draw : ndarray of int, shape (case,)
        change : ndarray, shape (n, case)
            Products of every column with what is added.
        """
        products = np.concatenate([self._with_data[:, :1], self._with_data[:, 1 + draw] + change], axis=1)
        plain = self._null_draws
        return _Added(self.gram, self.signatures, self.tolerances, self.null, self.rows, products, plain)

    def likelihood_gain(self, hypothesis: Hypothesis) -> Array:
        """Return by how much the best fit, without a prior, lowers half the misfit, shape (1 + draw,)."""
        gram, projected, _ = self._parts(hypothesis)
        solved = np.linalg.pinv(gram, rcond=1e-9, hermitian=True) @ projected
        return 0.5 * np.einsum("ik,ik->k", projected, solved)

    def alignment(self, one: Hypothesis, other: Hypothesis) -> float:
        """Return the largest canonical correlation of two hypotheses' changes, 0 to 1."""
        a, b = list(one.columns), list(other.columns)
        roots = [_inverse_root(self.metric[np.ix_(c, c)]) for c in (a, b)]
        across = roots[0] @ self.metric[np.ix_(a, b)] @ roots[1].T
        return float(min(np.linalg.svd(across, compute_uv=False)[0], 1.0)) if across.size else 0.0

    def _parts(self, hypothesis: Hypothesis) -> tuple[Array, Array, Array]:
        at = list(hypothesis.columns)
        gram = self.metric[np.ix_(at, at)]
        more = _excess(gram, self._null_draws[at])
        # a signature is the sum of its rows: without noise, rounding alone tells them apart
        gram = gram + _ROUNDING * np.diag(np.diag(gram))
        return gram / more, self._with_data[at] / more, 1 / np.square(hypothesis.scale)

    @property
    def _null_draws(self) -> Array:
        """Products of every column with each null draw, shape (n, draw)."""
        return self._with_data[:, 1:]


@dataclass(frozen=True, eq=False)
class _Added(Evidence):
    """Evidence whose null draws are given by their products with every column, shape (n, 1 + draw)."""

    products: Array
    plain: Array

    @cached_property
    def _with_data(self) -> Array:
        return self.products

    @property
    def _null_draws(self) -> Array:
        return self.plain


def _excess(gram: Array, draws: Array) -> float:
    """Return how many times the variance along some columns is that of the metric, one at least.

    By what null draws make of it, as far as their number shows: lines and rows of the metric are smooth, and
    a column that lives on a few of them may be louder.

    Parameters
    ----------
    gram : ndarray, shape (column, column)
    draws : ndarray, shape (column, draw)
        Products with each null draw.
    """
    onto = _inverse_root(gram) @ draws
    if not onto.size:
        return 1.0
    chance = 1 + _SURE * float(np.sqrt(2 / onto.size))
    return max(float(np.mean(onto**2)) / chance, 1.0)


def _inverse_root(gram: Array) -> Array:
    """Return R with ``R gram R^T = 1`` on the directions that gram has."""
    size, directions = np.linalg.eigh(gram)
    kept = size > 1e-9 * max(size[-1], 1e-300)
    return directions[:, kept].T / np.sqrt(size[kept])[:, None]
