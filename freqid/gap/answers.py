"""What the diagnosis answers in draws of the null to which effects were added."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqid.core.gap_self_test import SEVERAL, Rate, Stratum
from freqid.gap.attribute import NONE, OTHER, averaged, statistic
from freqid.gap.calibrate import APART, CONSIDERED, Table, filled, joined
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
        first = each.argmax(axis=0)
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


@dataclass(frozen=True, eq=False)
class Answers:
    """Answers, case by case.

    Attributes
    ----------
    answer : tuple of str
    detected, named, right, covered : ndarray of bool, shape (case,)
        As in `core.gap_self_test.Stratum`.
    """

    answer: tuple[str, ...]
    detected: Flags
    named: Flags
    right: Flags
    covered: Flags


class Teller:
    """Says what the diagnosis would say, and remembers how much alike two variants are.

    Parameters
    ----------
    evidence : Evidence
    library : dict of Effect
    """

    def __init__(self, evidence: Evidence, library: Mapping[str, Effect]) -> None:
        self._evidence = evidence
        self._options = explanations(evidence, library)
        self._known: dict[tuple[str, int, str, int], float] = {}

    def answers(self, weighed: Weighed, threshold: float, tables: Sequence[Table], fold: Numbers) -> Answers:
        """Return what is answered in each case, with the table of the case's fold."""
        cases = weighed.cases(threshold)
        told, named, right, covered = [], [], [], []
        by_table = [cases.chances(table) for table in tables]
        for i, truth in enumerate(weighed.truth):
            table = tables[fold[i]]
            chances = dict(zip((*weighed.names, NONE), by_table[fold[i]][i].tolist(), strict=True))
            names = filled(chances, table.set_level)
            good = {n for n, yes in zip((*weighed.names, NONE), cases.right[i], strict=True) if yes}
            covered.append(bool(good & set(names)))
            group = self._group(names[0], weighed, i, chances)
            one = names[0] not in (NONE, OTHER) and set(names) <= group and bool(cases.exists[i])
            named.append(one)
            right.append(one and bool(good & group))
            if one:
                told.append(truth if right[-1] and truth not in (NONE, OTHER) else names[0])
            elif not cases.exists[i] or names[0] == NONE:
                told.append(NONE)
            else:
                told.append(OTHER if names == (OTHER,) else SEVERAL)
        return Answers(tuple(told), cases.exists, *(np.array(x, dtype=bool) for x in (named, right, covered)))

    def _group(self, first: str, weighed: Weighed, case: int, chances: Mapping[str, float]) -> set[str]:
        """Return the names that the likeliest is given together with."""
        considered = [n for n, p in chances.items() if p > CONSIDERED and n not in (NONE, OTHER)]
        if first not in considered:
            return {first}

        def apart(a: str, b: str) -> float:
            i, j = weighed.names.index(a), weighed.names.index(b)
            size = max(weighed.size[case, i], weighed.size[case, j])
            return size * (1 - self._alignment(a, int(weighed.best[case, i]), b, int(weighed.best[case, j])))

        return next((set(g) for g in joined(considered, apart) if first in g), {first})

    def _alignment(self, a: str, i: int, b: str, j: int) -> float:
        key = (a, i, b, j)
        if key not in self._known:
            self._known[key] = self._evidence.alignment(self._options[a][i], self._options[b][j])
        return self._known[key]


def stratum(detectability: float, weighed: Weighed, answers: Answers) -> Stratum:
    """Return the answers counted."""
    counts: dict[str, dict[str, int]] = {}
    for truth, answer in zip(weighed.truth, answers.answer, strict=True):
        row = counts.setdefault(truth, {})
        row[answer] = row.get(answer, 0) + 1
    return Stratum(
        detectability=detectability,
        answers=counts,
        detected=Rate.over(answers.detected),
        named=Rate.over(answers.named[answers.detected]),
        right=Rate.over(answers.right[answers.named]),
        covered=Rate.over(answers.covered[answers.detected]),
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
        for h in hypotheses:
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
