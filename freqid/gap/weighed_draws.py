"""How strongly draws of the null, to which effects were added, speak for each explanation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqid.gap.attribute import NONE, OTHER, averaged, statistic
from freqid.gap.calibrate import APART
from freqid.gap.evidence import Evidence, Hypothesis
from freqid.gap.fit_table import KnownCases
from freqid.gap.inserted import Insertion
from freqid.gap.reach import explanations
from freqid.gap.tolerance import DERIVATIVES, DYNAMICS
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Weighed:
    """Evidence in draws with effects added.

    Attributes
    ----------
    names : tuple of str
        Effects and *other*.
    truth : tuple of str
        Effect that was added, by case; *none* where nothing was.
    draw : ndarray of int, shape (case,)
        Of the null, that the case is made of.
    evidence : ndarray, shape (case, name)
    best : ndarray of int, shape (case, name)
        Variant that data prefer.
    size : ndarray, shape (case, name)
        Detectability of what that variant's estimate stands for.
    alike : ndarray of bool, shape (case, name)
        Names that the insertion cannot be told from: the truth and its aliases.
    """

    names: tuple[str, ...]
    truth: tuple[str, ...]
    draw: Numbers
    evidence: Array
    best: Numbers
    size: Array
    alike: Flags

    @property
    def right(self) -> Flags:
        """Names that count as right, the last being *none*, shape (case, name + 1)."""
        none = np.array([[t == NONE] for t in self.truth])
        return np.concatenate([self.alike, none], axis=1)

    def cases(self, threshold: float) -> KnownCases:
        """Return what a calibration is fitted to, a gap being called above a threshold."""
        exists = statistic(self.names, self.evidence) >= threshold
        return KnownCases(self.names, self.evidence, self.right, exists, np.ones(len(exists)))

    def outside(self) -> Weighed:
        """Return the cases with their effect taken out of the library, where it has no alias there."""
        alone = np.flatnonzero(self.alike.sum(axis=1) == 1)
        out = self.alike[alone]
        other = np.array([n == OTHER for n in self.names])
        return replace(
            self,
            truth=tuple(OTHER for _ in alone),
            draw=self.draw[alone],
            evidence=np.where(out, np.nan, self.evidence[alone]),
            best=self.best[alone],
            size=self.size[alone],
            alike=np.broadcast_to(other, out.shape),
        )


def weigh(
    evidence: Evidence,
    library: Mapping[str, Effect],
    insertions: Sequence[Insertion],
    detectability: float,
    form_error: float,
    seed: int,
) -> Weighed:
    """Weigh every null draw with every effect added, at one of the effect's places each.

    Parameters
    ----------
    evidence : Evidence
        With the insertions among its columns.
    library : dict of Effect
    insertions : sequence of Insertion
        Scaled to the detectability, so they should be near it; with none, the null draws themselves.
    detectability : float
    form_error : float
        Of its size, by which each insertion is made unlike its own formula: at random, as derivatives and
        actuators may be wrong.
    seed : int
    """
    count = len(evidence.null)
    truth, draw, change, like = [], [], [], []
    by_effect: dict[str, list[Insertion]] = {}
    for one in insertions:
        by_effect.setdefault(one.place.effect, []).append(one)
    options = explanations(evidence, library)
    names = tuple(options)
    alike = _alike(evidence, options, insertions, detectability)
    rng = np.random.default_rng([seed, 11])
    for effect, places in by_effect.items():
        for k in range(count):
            one = places[k % len(places)]
            factor = np.sqrt(detectability / one.detectability)
            truth.append(effect)
            draw.append(k)
            change.append(factor * evidence.metric[:, evidence.column(one.column)])
            like.append(alike[one.column])
    if insertions:
        added = np.array(change).T + form_error * np.sqrt(detectability) * _misfits(evidence, len(draw), rng)
        evidence = evidence.with_added(np.array(draw), added)
    else:
        truth, draw = [NONE] * count, list(range(count))
        like = [np.zeros(len(names), dtype=bool)] * count
    whole, best, size = [], [], []
    for name, hypotheses in options.items():
        each = np.array([evidence.evidences(h)[1:] for h in hypotheses])
        one_size = np.array([evidence.whole(h) for h in hypotheses])
        first = np.where(one_size[:, None], each, -np.inf).argmax(axis=0)
        whole.append(averaged(each))
        best.append(first)
        if name == OTHER:  # is no alias of anything
            size.append(np.zeros(len(first)))
        else:
            sizes = np.array([evidence.detectabilities(h)[1:] for h in hypotheses])
            size.append(sizes[first, np.arange(len(first))])
    return Weighed(
        names,
        tuple(truth),
        np.array(draw),
        np.array(whole).T,
        np.array(best).T,
        np.array(size).T,
        np.array(like),
    )


def _alike(
    evidence: Evidence,
    options: Mapping[str, Sequence[Hypothesis]],
    insertions: Sequence[Insertion],
    detectability: float,
) -> dict[str, Flags]:
    """Return the names that each insertion cannot be told from, by its column."""
    at = [evidence.column(one.column) for one in insertions]
    length = evidence.metric[at, at]
    alignment = np.zeros((len(options), len(at)))
    for i, (name, hypotheses) in enumerate(options.items()):
        if name == OTHER:
            continue
        for h in (h for h in hypotheses if evidence.whole(h)):
            columns = list(h.columns)
            across = evidence.metric[np.ix_(columns, at)]
            solved = np.linalg.pinv(evidence.metric[np.ix_(columns, columns)], rcond=1e-9, hermitian=True)
            share = np.einsum("ip,ij,jp->p", across, solved, across) / length
            alignment[i] = np.maximum(alignment[i], np.sqrt(np.clip(share, 0.0, 1.0)))
    close = detectability * (1 - alignment) < APART
    close[[name == OTHER for name in options]] = False
    for k, one in enumerate(insertions):
        close[list(options).index(one.place.effect), k] = True
    return {one.column: close[:, k] for k, one in enumerate(insertions)}


def _misfits(evidence: Evidence, count: int, rng: np.random.Generator) -> Array:
    """Return products of every column with random changes of length one, shape (n, count)."""
    kinds = (DERIVATIVES, DYNAMICS)
    at = [evidence.column(n) for n in evidence.tolerances if n.partition(":")[0] in kinds]
    mixed = rng.standard_normal((len(at), count))
    products = evidence.metric[:, at] @ mixed
    length = np.sqrt(np.maximum((products[at] * mixed).sum(axis=0), 1e-300))
    return products / length
