"""Evidence of every candidate, with its size, its place and the simulation's error of form integrated out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from scipy.special import logsumexp, ndtri

from freqid.core.arrays import Array
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.system import System
from freqid.gap.infer.weighing import Weighing, log_mean
from freqid.gap.model.candidate import OTHER, Candidate
from freqid.gap.model.form import PRODUCTS, row_of
from freqid.gap.settings import INTERVAL

_FINE = 1001  # sizes at which a posterior is drawn
_NEAR = 0.2  # of a size, on either side: how a change that is not proportional changes there

NONE = "none"
FINALISTS = 6
"""Effects at most that are computed again near their estimated size."""

BEHIND = 10.0
"""Nats behind the leading effect, from which another is no finalist."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the data say of every candidate and of every error of form.

    Attributes
    ----------
    weighing : Weighing
    none : ndarray, shape (form,)
        Log evidence of no effect at each error of form.
    places : ndarray, shape (form, candidate)
        Log Bayes factors against no effect at the same error of form.
    without : float
        Nats by which no effect is likelier where tolerances are straight without one.
    """

    weighing: Weighing
    none: Array
    places: Array
    without: float = 0.0

    @property
    def system(self) -> System:
        """The stack."""
        return self.weighing.system

    @cached_property
    def log_none(self) -> float:
        """Log evidence of no effect, the error of form integrated out."""
        return float(logsumexp(self.none) - np.log(self.none.size))

    @cached_property
    def candidate(self) -> Array:
        """Log Bayes factor of every candidate, shape (candidate,)."""
        joint = logsumexp(self.none[:, None] + self.places, axis=0) - np.log(self.none.size)
        return joint - self.log_none

    @cached_property
    def effect(self) -> dict[str, float]:
        """Log Bayes factor by effect id."""
        return dict(zip(self.weighing.effects, self.weighing.by_effect(self.candidate), strict=True))

    @cached_property
    def statistic(self) -> float:
        """Log Bayes factor of a gap against none: all effects alike."""
        if not self.effect:
            return -np.inf
        return float(log_mean(np.array(list(self.effect.values())))) - self.without

    @cached_property
    def likeliest(self) -> list[int]:
        """The best places of the effects of a library that lead, the likeliest first."""
        ranked = sorted((e for e in self.effect if e != OTHER), key=lambda e: -self.effect[e])
        best = max(self.effect.values(), default=0.0)
        return [self.best_place(e) for e in ranked[:FINALISTS] if best - self.effect[e] <= BEHIND]

    def best_place(self, effect: str) -> int:
        """Return the likeliest candidate of an effect."""
        return max(self.weighing.places_of(effect), key=lambda i: self.candidate[i])

    def form_weights(self, candidate: int | None = None) -> Array:
        """Return the posterior of the error of form, shape (form,), given a candidate, else over all."""
        if candidate is not None:
            log = self.none + self.places[:, candidate]
        else:
            effects = np.array([self.weighing.by_effect(row) for row in self.places])
            gap = log_mean(effects.T) if effects.size else np.full(self.none.size, -np.inf)
            log = self.none + np.logaddexp(0.0, gap)
        return np.exp(log - logsumexp(log))

    def form_sizes(self, terms: Sequence[str]) -> dict[str, float]:
        """Return the error of form of each row, as share of its load or movement, by the row's name.

        Root mean square over the terms of its first order, each counted by its energy in the data, and over
        the posterior.

        Parameters
        ----------
        terms : sequence of str
            That have a form, in the order of the sizes.
        """
        sizes = np.array([f.loads for f in self.system.form_errors])
        power = np.zeros(len(terms))
        for b in self.system.blocks:
            np.add.at(power, b.form_row, b.form_power)
        square = self.form_weights() @ sizes**2 * power
        rows = np.array([row_of(name) for name in terms])
        first = np.array([not name.endswith(PRODUCTS) for name in terms], dtype=bool)
        found = {}
        for row in dict.fromkeys(rows.tolist()):
            at = (rows == row) & first
            found[row] = float(np.sqrt(square[at].sum() / power[at].sum())) if power[at].any() else 0.0
        return found

    def form_error(self, candidate: int | None = None) -> Form:
        """Return the likeliest error of form."""
        return self.system.form_errors[int(np.argmax(self.form_weights(candidate)))]


def weigh(system: System, *, once: bool = False) -> Evidence:
    """Return what the data say of every candidate.

    Parameters
    ----------
    system : System
    once : bool
        Nothing else will be asked at these errors of form: products between candidates are not made.
    """
    weighing = Weighing(system)
    none, places = [], []
    for f in system.form_errors:
        own = weighing.at(f) if once else system.reduced(f)
        none.append(own.log_evidence)
        places.append(weighing.of_data(own))
    return Evidence(weighing, np.array(none), np.array(places))


@dataclass(frozen=True, eq=False)
class Estimate:
    """A candidate's size, the error of form integrated out.

    Attributes
    ----------
    candidate : Candidate
    size : ndarray
        Of a scalar, shape (1,); of a vector by parameter.
    lo, hi : ndarray
        Interval at the level asked for, same shape.
    at_bound : bool
        Whether the interval ends where the prior does, so that the data do not bound it.
    room : float or ndarray
        What a tolerance of the same parameter adds to the interval on either side, in quadrature.
    """

    candidate: Candidate
    size: Array
    lo: Array
    hi: Array
    at_bound: bool
    room: float | Array = 0.0

    @property
    def width(self) -> Array:
        """Of the interval without what a tolerance of the same parameter adds."""
        return np.sqrt(np.maximum((self.hi - self.lo) ** 2 - (2 * self.room) ** 2, 0.0))

    @property
    def weights(self) -> Array:
        """Of the candidate's columns."""
        if self.candidate.kind == "scalar":
            return self.candidate.weights(float(self.size[0]))
        return self.size / self.candidate.sizes


def weights_of(system: System, acting: Iterable[tuple[int, Estimate]]) -> Array:
    """Return the weights of a system's columns where some candidates have their sizes, shape (column,)."""
    weights = np.zeros(system.columns)
    for i, e in acting:
        c = system.candidates[i]
        weights[system.columns_of(i)] = c.weights(float(e.size[0])) if c.kind == "scalar" else e.weights
    return weights


def estimate(evidence: Evidence, index: int, level: float, given: Array | None = None) -> Estimate:
    """Return the size of a candidate with an interval at a level.

    Parameters
    ----------
    evidence : Evidence
    index : int
        Of the candidate.
    level : float
    given : ndarray, shape (column,), optional
        Weights of other candidates' columns that are taken as known to be in the data.
    """
    c = evidence.system.candidates[index]
    mix, beside = _form_beside(evidence, index, given)
    if c.kind == "vector":
        return _vector_estimate(evidence, index, level, mix, given)
    fine, w = _fine(c)
    density = _density(evidence, index, mix, beside, given, fine, w)
    seen = np.flatnonzero(density > 1e-9 * density.max())
    # once more, fine enough for however sharp the data are
    near = np.linspace(fine[max(seen[0] - 1, 0)], fine[min(seen[-1] + 1, fine.size - 1)], _FINE)
    density = _density(evidence, index, mix, beside, given, near, c.weights(near))
    mass = np.cumsum(density) / density.sum()
    lo, hi = (float(np.interp(q, mass, near)) for q in ((1 - level) / 2, (1 + level) / 2))
    mean = float((density * near).sum() / density.sum())
    edges = [e for e in (c.prior.min(), c.prior.max()) if np.sign(e) == np.sign(mean)]
    at_bound = any(
        abs(mean - e) < 0.1 * abs(e) and min(abs(lo - e), abs(hi - e)) < 0.01 * abs(e) for e in edges
    )
    return Estimate(c, np.array([mean]), np.array([lo]), np.array([hi]), at_bound)


def directions(evidence: Evidence, index: int, given: Array | None = None) -> Array:
    """Return one sigma of a candidate's columns about its estimate, shape (direction, column).

    A vector effect at its likeliest prior scale; a scalar one as it is at its size, and as it changes there:
    beside others it has another size, which is not a share of the same change where that is not proportional.

    Parameters
    ----------
    evidence : Evidence
    index : int
        Of the candidate.
    given : ndarray, shape (column,), optional
        Weights of other candidates' columns that are taken as known to be in the data.
    """
    c, at = evidence.system.candidates[index], evidence.system.columns_of(index)
    found = estimate(evidence, index, INTERVAL, given)
    if c.kind == "vector":
        rms = float(np.sqrt(np.mean(found.weights**2)))
        own = np.eye(c.sizes.size) * c.prior[np.argmin(np.abs(np.log(c.prior / max(rms, 1e-300))))]
    else:
        size = float(found.size[0])
        own = np.array([c.weights(size)])
        if c.sizes.size > 1:
            own = np.array([own[0], c.weights((1 + _NEAR) * size) - c.weights((1 - _NEAR) * size)])
    block = np.zeros((len(own), evidence.system.columns))
    block[:, at] = own
    return block


def _form_beside(evidence: Evidence, index: int, given: Array | None) -> tuple[Array, Array]:
    """Return the posterior of the error of form beside a candidate and what is given, and log Bayes factors.

    Both of shape (form,); the Bayes factors are the candidate's once the given columns are taken off.
    """
    if given is None:
        return evidence.form_weights(index), evidence.places[:, index]
    log, beside = np.empty((2, evidence.none.size))
    for k, f in enumerate(evidence.system.form_errors):
        left = evidence.system.reduced(f).given(given)
        beside[k] = evidence.weighing.of_place(index, left)
        log[k] = left.log_evidence + beside[k]
    return np.exp(log - logsumexp(log)), beside


def _density(
    evidence: Evidence, index: int, mix: Array, beside: Array, given: Array | None, sizes: Array, w: Array
) -> Array:
    """Return the posterior density of a scalar's size with a flat prior, times a constant, shape (size,)."""
    system = evidence.system
    log = np.full((len(mix), sizes.size), -np.inf)
    for k, f in enumerate(system.form_errors):
        if mix[k] > 1e-6:
            left = system.reduced(f) if given is None else system.reduced(f).given(given)
            G, g, ratio = evidence.weighing.alone(index, left)
            log[k] = np.log(mix[k]) + w @ g - 0.5 * ((w @ G) * w).sum(axis=1) + ratio - beside[k]
    log -= log.max()
    return np.exp(logsumexp(log, axis=0)) * np.gradient(sizes)


def _vector_estimate(
    evidence: Evidence, index: int, level: float, mix: Array, given: Array | None
) -> Estimate:
    system, c = evidence.system, evidence.system.candidates[index]
    at = system.columns_of(index)
    mean, second = np.zeros(c.sizes.size), np.zeros(c.sizes.size)
    for k, f in enumerate(system.form_errors):
        if mix[k] < 1e-6:
            continue
        reduced = system.reduced(f)
        G = reduced.G[at, at]
        g = reduced.g[at] if given is None else reduced.g[at] - reduced.G[at] @ given
        log, means, variances = [], [], []
        for t in c.prior:
            precision = G + np.eye(len(G)) / t**2
            inverse = np.linalg.inv(precision)
            means.append(inverse @ g)
            variances.append(np.diag(inverse))
            log.append(0.5 * g @ means[-1] - 0.5 * np.linalg.slogdet(np.eye(len(G)) + t**2 * G)[1])
        share = mix[k] * np.exp(np.array(log) - logsumexp(log))
        mean += share @ np.array(means)
        second += share @ (np.array(variances) + np.array(means) ** 2)
    spread = np.sqrt(np.maximum(second - mean**2, 0.0)) * ndtri((1 + level) / 2)
    size = mean * c.sizes
    return Estimate(c, size, size - spread * c.sizes, size + spread * c.sizes, False)


_GRIDS: WeakKeyDictionary[Candidate, tuple[Array, Array]] = WeakKeyDictionary()
"""Made once for each candidate, however many draws ask for them."""


def _fine(c: Candidate) -> tuple[Array, Array]:
    """Return an even grid of sizes over the prior's range, dense where data may be sharp, and its weights."""
    if c not in _GRIDS:
        low, high = min(c.prior.min(), 0.0), max(c.prior.max(), 0.0)
        fine = np.union1d(np.linspace(low, high, 2001), c.prior)
        _GRIDS[c] = fine, c.weights(fine)
    return _GRIDS[c]


def separation(evidence: Evidence, one: int, other: int) -> float:
    """Return the detectability of the first candidate's estimated change that the second cannot copy.

    ``lambda (1 - c^2)`` in the metric of noise and tolerances, with c their alignment.
    """
    system = evidence.system
    reduced = system.reduced(evidence.form_error(one))
    a, b = system.columns_of(one), system.columns_of(other)
    w = estimate(evidence, one, 0.9).weights
    own = float(w @ reduced.G[a, a] @ w)
    across, c = w @ reduced.G[a, b], system.candidates[other]
    if c.kind == "scalar":  # at its best single size: its columns are not free of each other
        _, sizes = _fine(c)
        left = np.einsum("sc,cd,sd->s", sizes, reduced.G[b, b], sizes) - 2 * sizes @ across
        return max(own + float(left.min()), 0.0)
    explained = float(across @ np.linalg.lstsq(reduced.G[b, b], across, rcond=1e-9)[0])
    return max(own - explained, 0.0)
