"""Bayes factors of all candidates at one error of form, each with its size integrated out.

Candidates whose columns and sizes are of the same number are weighed side by side: a stack has hundreds of
them, and is asked at hundreds of errors of form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from freqid.core.arrays import Array
from freqid.gap.infer.at_form import OwnProducts, Reduced
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.system import System

Index = NDArray[np.intp]

_SHARP = 1.0  # squared width of a cell in standard deviations of the likelihood, above which it is integrated
_NEGLIGIBLE = 15.0  # nats below the likeliest size
_AT_ONCE = 50_000  # numbers that stay in a processor's cache


@dataclass(frozen=True, eq=False)
class Scalars:
    """Candidates of one size each, with the same numbers of columns and of sizes.

    Attributes
    ----------
    candidates : tuple of int
    columns : ndarray of int, shape (candidate, column)
    weights : ndarray, shape (candidate, size, column)
        Of the columns at each size of the prior, ascending.
    cells : ndarray of bool, shape (candidate, size - 1)
        Between neighbours of one sign: the prior gives each the same probability.
    """

    candidates: tuple[int, ...]
    columns: Index
    weights: Array
    cells: NDArray[np.bool_]

    def factors(self, G: Array, g: Array) -> Array:
        """Return log mean likelihood ratios over the prior, shape (candidate, draw).

        Where the likelihood is wider than a cell the trapezoid rule is exact enough; where it is narrower,
        which strong effects make it, the Gaussian is integrated.

        Parameters
        ----------
        G : ndarray, shape (candidate, column, column)
            Inner products of each candidate's columns.
        g : ndarray, shape (candidate, column, draw)
        """
        few = max(_AT_ONCE // (self.weights.shape[1] * g.shape[2]), 1)
        if few < len(self.candidates):
            parts = [slice(k, k + few) for k in range(0, len(self.candidates), few)]
            return np.concatenate([self._some(part).factors(G[part], g[part]) for part in parts])
        w, cells = self.weights, self.cells
        ends = w @ g - 0.5 * ((w @ G) * w).sum(axis=2)[:, :, None]
        top = ends.max(axis=1)
        step = w[:, 1:] - w[:, :-1]
        curve = ((step @ G) * step).sum(axis=2)
        share = np.zeros(w.shape[:2])
        smooth = cells & (curve <= _SHARP)
        share[:, :-1] += 0.5 * smooth
        share[:, 1:] += 0.5 * smooth
        share[~cells.any(axis=1)] = 1.0  # no cell: the sizes themselves
        count = np.where(cells.any(axis=1), cells.sum(axis=1), w.shape[1])[:, None]
        # within a cell the exponent is above the higher end by an eighth of its curvature at most
        reach = (ends - top[:, None]).max(axis=2)
        near = np.maximum(reach[:, 1:], reach[:, :-1]) + curve / 8 > -_NEGLIGIBLE
        which, cell = np.nonzero(cells & (curve > _SHARP) & near)
        if not which.size:
            return top + np.log(_weighted(share, ends, top) / count)
        # the exponent in a cell, x from 0 to 1, is a + b x - c x^2 / 2
        a, after, c = ends[which, cell], ends[which, cell + 1], curve[which, cell][:, None]
        b = after - a + 0.5 * c
        peak = np.where((b > 0) & (b < c), a + 0.5 * b**2 / c, np.maximum(a, after))
        np.maximum.at(top, which, peak)
        at, draw = np.nonzero(peak > top[which] - _NEGLIGIBLE)
        a, b, c = a[at, draw], b[at, draw], c[at, 0]
        root = np.sqrt(c)
        low, high = -b / root, (c - b) / root
        low, high = np.where(low > 0, -high, low), np.where(low > 0, -low, high)  # the tail computed well
        outer, inner = log_ndtr(low), log_ndtr(high)
        inside = inner + np.log1p(-np.exp(outer - inner))
        value = a + 0.5 * b**2 / c + 0.5 * np.log(2 * np.pi / c) + inside
        total = _weighted(share, ends, top)
        np.add.at(total, (which[at], draw), np.exp(value - top[which[at], draw]))
        return top + np.log(total / count)

    def _some(self, part: slice) -> Scalars:
        return Scalars(self.candidates[part], self.columns[part], self.weights[part], self.cells[part])


def _weighted(share: Array, ends: Array, top: Array) -> Array:
    return (share[:, None] @ np.exp(ends - top[:, None]))[:, 0]


@dataclass(frozen=True, eq=False)
class Weighing:
    """How candidates are weighed: what does not depend on the data.

    Attributes
    ----------
    system : System
    """

    system: System

    @cached_property
    def scalars(self) -> list[int]:
        """Candidates of one size."""
        return [i for i, c in enumerate(self.system.candidates) if c.kind == "scalar"]

    @cached_property
    def vectors(self) -> list[int]:
        """Candidates of several sizes at once."""
        return [i for i, c in enumerate(self.system.candidates) if c.kind == "vector"]

    @cached_property
    def own_tolerance(self) -> Index:
        """Place of each candidate's own tolerance, -1 where there is none; shape (candidate,)."""
        at = {name: k for k, name in enumerate(self.system.tolerances)}
        own = [at.get(c.tolerance, -1) if c.spread else -1 for c in self.system.candidates]
        return np.array(own, dtype=np.intp)

    @cached_property
    def weights(self) -> list[Array]:
        """Of each scalar's columns at equally likely sizes, shape (size, column).

        Where its parameter has a tolerance, at those of both together.
        """
        of = self.system.candidates
        return [of[i].at_prior if self.own_tolerance[i] < 0 else of[i].at_sums for i in self.scalars]

    @cached_property
    def alike(self) -> list[Scalars]:
        """The scalars, those of the same shape together."""
        shapes: dict[tuple[int, ...], list[int]] = {}
        for k, w in enumerate(self.weights):
            shapes.setdefault(w.shape, []).append(k)
        return [self._together(places) for places in shapes.values()]

    @cached_property
    def effects(self) -> tuple[str, ...]:
        """Ids of the candidates' effects, each once."""
        return tuple(dict.fromkeys(c.effect for c in self.system.candidates))

    @cached_property
    def layout(self) -> list[Index]:
        """Columns of all candidates, those of the same shape together, shape (candidate, column) each."""
        return [one.columns for one in self.alike] + [self._columns(i)[None] for i in self.vectors]

    def places_of(self, effect: str) -> list[int]:
        """Return the candidates of an effect."""
        return self._by_effect[effect]

    def at(self, form_error: Form) -> OwnProducts:
        """Return what `by_place` needs of the system at an error of form."""
        return self.system.own_products(form_error, self.layout)

    def of_data(self, reduced: Reduced | OwnProducts) -> Array:
        """Return log Bayes factors of every candidate against no effect, of the data, shape (candidate,)."""
        return self.by_place(reduced, reduced.g[:, None], reduced.posterior.mean[:, None])[:, 0]

    def by_place(self, reduced: Reduced | OwnProducts, g: Array, mean: Array) -> Array:
        """Return log Bayes factors of every candidate against no effect, shape (candidate, draw).

        A tolerance of the same parameter only adds to the size of an effect: what both make is that of their
        sum. So sums are weighed, that tolerance held where it was asked for. Beside it, a tolerance of some
        sigmas the other way would leave what bends of a large size, as a change that nothing makes.

        Parameters
        ----------
        reduced : Reduced or OwnProducts
            Whose inner products are used.
        g : ndarray, shape (column, draw)
        mean : ndarray, shape (tolerance, draw)
            What the data say of the tolerances where there is no effect.
        """
        found = np.empty((len(self.system.candidates), g.shape[1]))
        own = reduced.own(self.layout)
        for one, G in zip(self.alike, own, strict=False):
            G, there, log = self._held(one.candidates, one.columns, G, g[one.columns], mean, reduced)
            found[list(one.candidates)] = one.factors(G, there) + log
        for i, G in zip(self.vectors, own[len(self.alike) :], strict=True):
            found[i] = _of_vector(self._candidate(i).prior, G[0], g[self.system.columns_of(i)])
        return found

    def of_place(self, index: int, reduced: Reduced) -> float:
        """Return the log Bayes factor of one candidate against no effect."""
        G, g, log = self.alone(index, reduced)
        if self._candidate(index).kind == "vector":
            return float(_of_vector(self._candidate(index).prior, G, g[:, None])[0])
        one = self._together([self.scalars.index(index)])
        return float(one.factors(G[None], g[None, :, None])[0, 0]) + log

    def alone(self, index: int, reduced: Reduced) -> tuple[Array, Array, float]:
        """Return inner products of one candidate, of it with the residual, and a log likelihood ratio.

        Of a scalar, for its sum with the tolerance of its parameter; the ratio is that of holding this.
        """
        columns = self._columns(index)[None]
        G, g = reduced.G[columns[0][:, None], columns[0]], reduced.g[columns[0]]
        if self._candidate(index).kind == "vector":
            return G, g, 0.0
        mean = reduced.posterior.mean[:, None]
        G, g, log = self._held((index,), columns, G[None], g[None, :, None], mean, reduced)
        return G[0], g[0, :, 0], float(log[0, 0])

    def _held(
        self,
        candidates: Sequence[int],
        columns: Index,
        G: Array,
        g: Array,
        mean: Array,
        reduced: Reduced | OwnProducts,
    ) -> tuple[Array, Array, Array]:
        """Return G and g of candidates whose own tolerances are held, and log likelihood ratios.

        Of a tolerance t with the density N(mean - slopes w, variance) once the data are known, and N(0, 1)
        before, the ratio of both is how much likelier the data are at that t than with it integrated out. It
        is held where lines were made straight: there the line of the tolerance is right, and the effect makes
        what it makes at a size beyond what it makes at that one (`System.asked_together`).
        """
        k = self.own_tolerance[list(candidates)]
        held = np.flatnonzero(k >= 0)
        log = np.zeros((len(k), g.shape[2]))
        if not held.size:
            return G, g, log
        known, k = reduced.posterior, k[held]
        root = np.sqrt(known.variance[k])
        slopes = known.slopes[k[:, None], columns[held]] / root[:, None]
        asked = self.system.asked[k]
        there = (mean[k] - asked[:, None]) / root[:, None]
        G, g = G.copy(), g.copy()
        G[held] += slopes[:, :, None] * slopes[:, None, :]
        g[held] += slopes[:, :, None] * there[:, None, :]
        log[held] = 0.5 * (asked**2)[:, None] - 0.5 * there**2 - np.log(root)[:, None]
        for n in held[asked != 0]:
            base = self.system.asked_together(candidates[n])
            log[n] -= base @ g[n] + 0.5 * base @ G[n] @ base
            g[n] += (G[n] @ base)[:, None]
        return G, g, log

    def by_effect(self, places: Array) -> Array:
        """Return log Bayes factors of effects, their prior shared by their places, shape (effect, ...)."""
        return np.array([log_mean(places[self.places_of(e)]) for e in self.effects])

    @cached_property
    def _by_effect(self) -> dict[str, list[int]]:
        found: dict[str, list[int]] = {}
        for i, c in enumerate(self.system.candidates):
            found.setdefault(c.effect, []).append(i)
        return found

    def _candidate(self, index: int):
        return self.system.candidates[index]

    def _columns(self, index: int) -> Index:
        return self.system.places([index])

    def _together(self, places: Sequence[int]) -> Scalars:
        """Return some of the scalars, all of one shape."""
        indices = [self.scalars[k] for k in places]
        priors = np.array([self._candidate(i).prior for i in indices])
        summed = self.own_tolerance[indices] >= 0  # of these zero is a size like others
        return Scalars(
            tuple(indices),
            np.array([self._columns(i) for i in indices]),
            np.array([self.weights[k] for k in places]),
            (np.sign(priors[:, 1:]) == np.sign(priors[:, :-1])) | summed[:, None],
        )


def _of_vector(prior: Array, G: Array, g: Array) -> Array:
    """Return log Bayes factors of a Gaussian vector, averaged over its prior's scales, shape (draw,)."""
    values, vectors = np.linalg.eigh(G)
    values = np.maximum(values, 0.0)
    y2, t2 = (vectors.T @ g) ** 2, prior[:, None] ** 2
    shrink = t2 / (1 + t2 * values)  # (scale, direction)
    return log_mean(0.5 * (shrink @ y2) - 0.5 * np.log1p(t2 * values).sum(axis=1)[:, None])


def log_mean(values: Array) -> Array:
    """Return the logarithm of the mean of exponentials over the first axis.

    As scipy's `logsumexp`, whose checks cost many times the sum on the short arrays of single draws.
    """
    top = values.max(axis=0)
    top = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        return top + np.log(np.exp(values - top).mean(axis=0))
