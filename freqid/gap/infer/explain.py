"""Explanations: which effects the evidence supports, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from freqid.core.arrays import Array
from freqid.gap.infer.evidence import Estimate, Evidence, directions, estimate, weigh
from freqid.gap.infer.forms import forms_beside
from freqid.gap.infer.joint_sizes import joint_estimates
from freqid.gap.infer.system import System
from freqid.gap.infer.weighing import log_mean
from freqid.gap.model.candidate import OTHER
from freqid.gap.settings import INTERVAL, SEPARATE

_MOST = 3  # effects of one explanation
_SETTLING = 6  # times at most that effects are computed again until their sizes stay
_CLOSE = 0.1  # of an interval: a size that has moved less stays
_FINALISTS = 6  # effects that are computed again near their estimated size
_BEHIND = 10.0  # nats behind the leading one, from which an effect is no finalist


@dataclass(frozen=True, eq=False)
class Explanation:
    """Effects that together explain a gap, in the order in which they were found.

    Attributes
    ----------
    places : tuple of int
        Candidates.
    gains : tuple of float
        Nats by which each raised the evidence when it was added, given those before it; alone where one of
        these was dropped. The effects may have been exchanged since.
    estimates : tuple of Estimate
        Of each alone where there is one; jointly where there are several.
    """

    places: tuple[int, ...]
    gains: tuple[float, ...]
    estimates: tuple[Estimate, ...]

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids."""
        return tuple(e.candidate.effect for e in self.estimates)

    def interacting(self, system: System) -> list[Explanation]:
        """Return each effect by itself where one changes what another does, else nothing."""
        if not any(system.candidates[i].beside or system.candidates[i].after for i in self.places):
            return []
        each = zip(self.places, self.gains, self.estimates, strict=True)
        return [Explanation((i,), (gain,), (e,)) for i, gain, e in each]

    def weights(self, system: System) -> Array:
        """Return the weights of a system's columns at the estimated sizes, shape (column,)."""
        weights = np.zeros(system.columns)
        for i, e in zip(self.places, self.estimates, strict=True):
            c = system.candidates[i]
            weights[system.columns_of(i)] = c.weights(float(e.size[0])) if c.kind == "scalar" else e.weights
        return weights


def likeliest(evidence: Evidence) -> list[int]:
    """Return the best places of the effects of a library that lead, the likeliest first."""
    ranked = sorted((e for e in evidence.effect if e != OTHER), key=lambda e: -evidence.effect[e])
    best = max(evidence.effect.values(), default=0.0)
    return [evidence.best_place(e) for e in ranked[:_FINALISTS] if best - evidence.effect[e] <= _BEHIND]


Compute = Callable[[Evidence, Explanation, list[tuple[int, Estimate]]], Evidence]


def explain(
    evidence: Evidence,
    first: Sequence[str],
    terms: Sequence[str] = (),
    *,
    asked: bool = False,
    compute: Compute | None = None,
) -> tuple[Explanation, Evidence]:
    """Return effects and those that the evidence supports beside them, and the evidence with these.

    The likeliest place's columns are freed, and all others are asked again, until one more effect, whichever
    it is, raises the evidence by less than `SEPARATE` nats: as with the first one, the odds are shared by all
    that are asked. What one effect alone leaves looks like an error of form in every row where the second
    acts: so the errors of form that are possible are looked for anew beside each effect that is found. The
    likeliest of the others are computed at their size beside it before one is chosen. And the best single
    effect need not be one of the best two: each of those found is asked for again beside the others, where
    another one may take its place, or none.

    Parameters
    ----------
    evidence : Evidence
    first : sequence of str
        Effect ids.
    terms : sequence of str
        That have an error of form.
    asked : bool
        Whether the first effects stay whatever the others are.
    compute : callable, optional
        Returns the evidence once an explanation's effects, and other estimates beside it, are computed again
        at their sizes.
    """
    places, gains = [evidence.best_place(e) for e in first], [evidence.effect[e] for e in first]
    computed: list[int] = []
    tried: set[frozenset[int]] = set()
    while True:
        if compute is not None and places != computed:
            computed, evidence = places, _settled(evidence, _explanation(evidence, places, gains), compute)
        if len(places) >= _MOST or frozenset(places) in tried:
            break
        tried.add(frozenset(places))
        evidence = _with_forms_beside(evidence, places, terms)
        found = _finalists(evidence, places)
        if compute is not None and found:
            given = _weights(evidence, places)
            others = [(i, estimate(evidence, i, INTERVAL, given=given)) for _, i in found]
            evidence = compute(evidence, _explanation(evidence, places, gains), others)
        every = _beside(evidence, places)
        if _raised(every) < SEPARATE:
            break
        gains.append(every[0][0])
        places = _exchanged(evidence, [*places, every[0][1]], first=len(first) if asked else 0)
        if len(places) < len(gains):
            gains = [evidence.effect[evidence.system.candidates[i].effect] for i in places]
    return _explanation(evidence, places, gains), evidence


def _settled(evidence: Evidence, explanation: Explanation, compute: Compute) -> Evidence:
    """Return the evidence about the sizes at which effects were computed, or nearly.

    Half way at a time from the second one on: what one leaves to the other would swing about the answer.
    Those that do not change each other need only be near.
    """
    at = explanation
    for done in range(_SETTLING):
        evidence = compute(evidence, at, [])
        if done > 0 and not any(evidence.system.candidates[i].beside for i in explanation.places):
            break
        now = joint_estimates(evidence, explanation.places)
        each = list(zip(at.estimates, now, strict=True))
        if all(np.all(np.abs(a.size - e.size) <= _CLOSE * e.width) for a, e in each):
            break
        at = replace(at, estimates=tuple(replace(e, size=(a.size + e.size) / 2) for a, e in each))
    return evidence


def _explanation(evidence: Evidence, places: list[int], gains: list[float]) -> Explanation:
    return Explanation(tuple(places), tuple(gains), joint_estimates(evidence, places))


def _beside(evidence: Evidence, places: list[int]) -> list[tuple[float, int]]:
    """Return the nats that each effect gains beside others, and its place, the largest first."""
    taken = {evidence.system.candidates[i].effect for i in places} | {OTHER}
    return sorted((gain for e, gain in _given(evidence, places).items() if e not in taken), reverse=True)


def _raised(every: Sequence[tuple[float, int]]) -> float:
    """Return the nats by which one more effect raises the evidence, whichever of all it is."""
    return float(log_mean(np.array([gain for gain, _ in every]))) if every else -np.inf


def _finalists(evidence: Evidence, places: list[int]) -> list[tuple[float, int]]:
    """Return the nats and the places of the effects that gain most beside others, none of these again."""
    gains = _beside(evidence, places)
    least = max(gains[0][0] - _BEHIND, 0.0) if gains else 0.0
    return [one for one in gains[:_FINALISTS] if one[0] >= least]


def _weights(evidence: Evidence, places: list[int]) -> Array:
    """Return the weights of all columns where some effects are as they are estimated together."""
    weights = np.zeros(evidence.system.columns)
    for i, e in zip(places, joint_estimates(evidence, places), strict=True):
        weights[evidence.system.columns_of(i)] += e.weights
    return weights


def _with_forms_beside(evidence: Evidence, places: list[int], terms: Sequence[str]) -> Evidence:
    """Return the evidence with more errors of form: the likeliest beside effects, and beside a second one."""
    system = evidence.system
    if not terms:
        return evidence
    first, given = free(evidence, places), _weights(evidence, places)
    explanations = [first]
    for _, i in _finalists(evidence, places):
        explanations.append(np.concatenate([first, directions(evidence, i, given)]))
    forms = forms_beside(system, terms, explanations)
    if forms == system.form_errors:
        return evidence
    return weigh(replace(system, form_errors=forms))  # small matrices that are made stay


def _exchanged(evidence: Evidence, places: list[int], first: int) -> list[int]:
    """Return places, each from a first one on the best beside the others; none that is no longer needed."""
    for _ in range(len(places)):
        before = list(places)
        for k in range(first, len(places)):
            others = places[:k] + places[k + 1 :]
            every = _beside(evidence, others)
            if _raised(every) < SEPARATE:
                return others
            places = [*places[:k], every[0][1], *places[k + 1 :]]
        if places == before:
            break
    return places


def free(evidence: Evidence, places: list[int]) -> Array:
    """Return the freed columns' weights of some effects, shape (freed, column)."""
    return np.concatenate([directions(evidence, i) for i in places])


def _given(evidence: Evidence, places: list[int]) -> dict[str, tuple[float, int]]:
    """Return by effect the nats that it gains once other candidates' columns are free, and its best place."""
    system, weighing = evidence.system, evidence.weighing
    freed = free(evidence, places)
    none, by_place = [], []
    for f in system.form_errors:
        left = system.reduced(f).freed(freed)
        none.append(left.log_evidence)
        by_place.append(weighing.by_place(left, left.g[:, None])[:, 0])
    joint = logsumexp(np.array(none)[:, None] + np.array(by_place), axis=0) - logsumexp(none)
    gains = weighing.by_effect(joint)
    return {
        e: (float(gain), max(weighing.places_of(e), key=lambda i: joint[i]))
        for e, gain in zip(weighing.effects, gains, strict=True)
    }
