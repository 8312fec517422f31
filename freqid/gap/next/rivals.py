"""The explanations that a diagnosis leaves possible, and how far an experiment sets them apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.gap.diagnose import Findings
from freqid.gap.infer.at_form import Kept
from freqid.gap.infer.block_matrices import BlockMatrices, Form
from freqid.gap.infer.evidence import NONE, Estimate, Evidence, estimate
from freqid.gap.infer.system import System
from freqid.gap.model.candidate import OTHER, Candidate
from freqid.gap.settings import INTERVAL

Index = NDArray[np.intp]
Pair = tuple[str, str]

_MOST = 5  # effects that are told apart: the likeliest
_PLACES = 4  # of one effect: the likeliest
_BEHIND = 10.0  # nats behind an effect's likeliest place, from which data exclude a place
_SIZES = 5  # columns of a place, of an effect that is not proportional to its size: about its estimate
_GRID = 401  # sizes of such an effect that are compared
_TOLERANCES = (6, 12, 24)  # how many are tried, those that look most like the rivals first
_LITTLE = 0.1  # share of a separation that tolerances may add which are left out
_SAME = 1e-4  # share of a change's energy: two changes that differ by less are the same


@dataclass(frozen=True, eq=False)
class RivalExplanations:
    """What is to be told apart.

    Attributes
    ----------
    groups : tuple of tuple of str
        Effects of which one is right, by id, the likeliest first.
    pairs : tuple of tuple of str
        All pairs within the groups.
    system : System
        Of the blocks that were used, with the columns of these effects alone.
    places : dict of tuple of int
        Candidates of that system by effect, the likeliest first.
    estimates : dict of ndarray
        Size of each effect at its likeliest place.
    form_error : Form
        The simulation's, as the data give it.
    """

    groups: tuple[tuple[str, ...], ...]
    pairs: tuple[Pair, ...]
    system: System
    places: Mapping[str, tuple[int, ...]]
    estimates: Mapping[str, Array]
    form_error: Form

    def candidate(self, effect: str) -> Candidate:
        """Return an effect at its likeliest place."""
        return self.system.candidates[self.places[effect][0]]

    def sizes(self, effect: str) -> dict[str, float]:
        """Return an effect's estimate by parameter; those of a group have the same."""
        names = self.candidate(effect).place.parameters
        return dict(zip(names, np.broadcast_to(self.estimates[effect], len(names)).tolist(), strict=True))

    def with_flight(self, flight: BlockMatrices) -> System:
        """Return the stack with one block more."""
        s = self.system
        return replace(s, blocks=[*s.blocks, flight], _kept=Kept())

    @cached_property
    def tolerances(self) -> tuple[str, ...]:
        """Tolerances that separations depend on, at most 24; where they are fewer, the rest adds a tenth."""
        gram = self.system.gram(self.form_error)
        n, count = self.system.columns, len(self.system.tolerances)
        own = np.diag(gram)[n : n + count]
        look = np.zeros(count)
        for effect in self.places:
            at, w = self._weighted(effect, self.estimates[effect])
            energy = float(w @ gram[at, at] @ w)
            look = np.maximum(look, (gram[n : n + count, at] @ w) ** 2 / (1 + own) / max(energy, 1e-300))
        ranked = np.argsort(-look)
        chosen = ranked[:0]
        for most in _TOLERANCES:
            chosen = ranked[:most]
            fewer = self.separations(_with_tolerances(self.system, chosen))
            if all(fewer[p] <= (1 + _LITTLE) * x for p, x in self.now.items()):
                break
        return tuple(self.system.tolerances[i] for i in sorted(chosen))

    @cached_property
    def now(self) -> dict[Pair, float]:
        """Expected separation of each pair by the flights that were used."""
        return self.separations(self.system)

    def separations(self, system: System) -> dict[Pair, float]:
        """Return the expected separation of each pair by a stack.

        Whichever of two effects is true: the energy of its change, in the metric of noise, unknowns, form and
        tolerances, that the other one cannot make at any place and size within its range. The lesser of both
        ways round.

        Parameters
        ----------
        system : System
            `system`, or one with more blocks.
        """
        return {pair: min(left for left, _ in self._both_ways(system, pair)) for pair in self.pairs}

    def same(self, system: System) -> set[Pair]:
        """Return the pairs that make the same change, so that more of such data cannot tell them apart."""
        found = set()
        for pair in self.pairs:
            if any(left <= _SAME * whole for left, whole in self._both_ways(system, pair)):
                found.add(pair)
        return found

    def _both_ways(self, system: System, pair: Pair) -> list[tuple[float, float]]:
        """Return what the other one leaves of each one's change, and all of that change."""
        G = system.reduced(self.form_error).G
        sizes = self._sized[pair]
        return [self._left(G, a, sizes[a], b) for a, b in (pair, pair[::-1])]

    @cached_property
    def _sized(self) -> dict[Pair, dict[str, Array]]:
        """Sizes at which pairs are compared: the fainter effect is made as plain as the other one.

        A gap was seen, so whichever is true makes one of that size; the estimate of an effect that fits badly
        is faint, and would pass for one that no experiment shows.
        """
        G = self.system.reduced(self.form_error).G
        found = {}
        for pair in self.pairs:
            energy = {n: max(self._energy(G, n, self.estimates[n]), 1e-300) for n in pair}
            factor = {n: np.sqrt(max(energy.values()) / e) for n, e in energy.items()}
            found[pair] = {n: _within(self.candidate(n), factor[n] * self.estimates[n]) for n in pair}
        return found

    def _weighted(self, effect: str, size: Array) -> tuple[slice, Array]:
        """Return an effect's columns at its likeliest place, and their weights at a size."""
        return self.system.columns_of(self.places[effect][0]), _weights(self.candidate(effect), size)

    def _energy(self, G: Array, effect: str, size: Array) -> float:
        at, w = self._weighted(effect, size)
        return float(w @ G[at, at] @ w)

    def _left(self, G: Array, true: str, size: Array, claimed: str) -> tuple[float, float]:
        """Return the energy of a change that a claimed effect leaves, and all of it."""
        at, w = self._weighted(true, size)
        whole, copied = float(w @ G[at, at] @ w), 0.0
        for i in self.places[claimed]:
            own = self.system.columns_of(i)
            copied = max(copied, _copied(self.system.candidates[i], G[own, own], G[own, at] @ w))
        return max(whole - copied, 0.0), whole


def rivals_of(findings: Findings) -> RivalExplanations | None:
    """Return what a diagnosis leaves to be told apart; None where one effect remains or no gap is called.

    Groups are its groups of effects that the data cannot tell apart, and its set. *Other* cannot be
    predicted; two effects that the verdict finds together are no rivals of each other.

    Parameters
    ----------
    findings : Findings
    """
    which, evidence = findings.diagnosis.which, findings.evidence
    if not findings.diagnosis.gap.exists:
        return None
    chance = which.probabilities
    known = {e for e in evidence.effect if e not in (NONE, OTHER)}
    likely = sorted((n for n in which.set if n in known), key=lambda n: -chance.get(n, 0.0))
    groups = [tuple(n for n in g if n in known) for g in which.aliases if set(g) & set(likely)]
    if not any(set(likely) <= set(g) for g in groups):
        groups.append(tuple(likely))
    groups = [tuple(sorted(g, key=lambda n: -chance.get(n, 0.0))[:_MOST]) for g in groups if len(g) > 1]
    together = set(which.pair)
    pairs = dict.fromkeys(p for g in groups for p in combinations(sorted(g), 2) if not set(p) <= together)
    groups = [g for g in groups if any(set(p) <= set(g) for p in pairs)]
    if not pairs:
        return None
    names = tuple(dict.fromkeys(n for g in groups for n in g))
    likeliest = {n: _likely_places(evidence, n) for n in names}
    every = [i for places in likeliest.values() for i in places]
    estimates = {i: estimate(evidence, i, INTERVAL) for i in every}
    return RivalExplanations(
        tuple(groups),
        tuple(pairs),
        _part(evidence.system, {i: _columns_about(e) for i, e in estimates.items()}),
        {n: tuple(every.index(i) for i in places) for n, places in likeliest.items()},
        {n: estimates[places[0]].size for n, places in likeliest.items()},
        evidence.form_error(),
    )


def _likely_places(evidence: Evidence, effect: str) -> tuple[int, ...]:
    ranked = sorted(evidence.weighing.places_of(effect), key=lambda i: -evidence.candidate[i])
    best = evidence.candidate[ranked[0]]
    return tuple(i for i in ranked[:_PLACES] if best - evidence.candidate[i] < _BEHIND)


def _columns_about(found: Estimate) -> Index:
    """Return the columns of a candidate at sizes about its estimate: all where these are few."""
    c = found.candidate
    if c.kind == "vector" or c.curve is not None or c.sizes.size <= _SIZES:
        return np.arange(c.sizes.size)
    low, high = np.searchsorted(c.sizes, [float(found.lo[0]), float(found.hi[0])])
    first, last = max(low - 1, 0), min(high, c.sizes.size - 1)
    return np.unique(np.round(np.linspace(first, last, _SIZES)).astype(int))


def _part(system: System, columns: Mapping[int, Index]) -> System:
    """Return a stack with some columns of some candidates alone."""
    n, chosen, at = system.columns, [], []
    for i, wanted in columns.items():
        c = system.candidates[i]
        chosen.append(replace(c, sizes=c.sizes[wanted], columns=[z[wanted] for z in c.columns]))
        at.append(int(system.start[i]) + wanted)
    kept = np.concatenate([*at, np.arange(n, n + len(system.tolerances))])
    return replace(system, candidates=chosen, blocks=[_kept(b, kept) for b in system.blocks], _kept=Kept())


def _with_tolerances(system: System, chosen: Index) -> System:
    """Return a stack with some of its tolerances alone."""
    n = system.columns
    kept = np.concatenate([np.arange(n), n + chosen]).astype(int)
    names = tuple(system.tolerances[i] for i in chosen)
    return replace(system, tolerances=names, blocks=[_kept(b, kept) for b in system.blocks], _kept=Kept())


def _kept(block: BlockMatrices, at: Index) -> BlockMatrices:
    at = np.concatenate([at, np.arange(block.count, len(block.gram))])  # and the shared errors of form
    return block.some(at)


def _weights(candidate: Candidate, size: Array) -> Array:
    return candidate.weights(float(size[0])) if candidate.kind == "scalar" else size / candidate.sizes


def _range(candidate: Candidate) -> tuple[float, float]:
    """Return the sizes between which a scalar effect is looked for."""
    return min(float(candidate.prior.min()), 0.0), max(float(candidate.prior.max()), 0.0)


def _within(candidate: Candidate, size: Array) -> Array:
    return np.clip(size, *_range(candidate)) if candidate.kind == "scalar" else size


def _copied(candidate: Candidate, own: Array, across: Array) -> float:
    """Return the most of a change's energy that a candidate takes away, at any of its sizes.

    Parameters
    ----------
    candidate : Candidate
    own : ndarray, shape (column, column)
        Inner products of its columns.
    across : ndarray, shape (column,)
        Those with the change.
    """
    if candidate.kind == "vector":  # as far as its widest prior lets it
        return float(across @ np.linalg.solve(own + np.eye(len(own)) / candidate.prior.max() ** 2, across))
    low, high = _range(candidate)
    sizes = np.union1d(np.linspace(low, high, _GRID), candidate.prior)
    if candidate.sizes.size == 1 and own[0, 0] > 0:
        sizes = np.append(sizes, np.clip(candidate.sizes[0] * across[0] / own[0, 0], low, high))
    w = candidate.weights(sizes)
    return float(np.max(2 * w @ across - np.einsum("sc,cd,sd->s", w, own, w)))
