"""Explanations: which effects the evidence supports, one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from freqid.gap.infer.evidence import Estimate, Evidence, estimate, weigh
from freqid.gap.infer.forms import likely_forms
from freqid.gap.model.candidates import OTHER
from freqid.gap.settings import INTERVAL, SEPARATE

Array = NDArray[np.float64]

_MOST = 3  # effects of one explanation


@dataclass(frozen=True, eq=False)
class Explanation:
    """Effects that together explain a gap, in the order in which they were found.

    Attributes
    ----------
    places : tuple of int
        Candidates.
    gains : tuple of float
        Nats by which each raised the evidence, given those before it.
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


def explain(
    evidence: Evidence, first: str, rows: Sequence[str] = (), *, asked: bool = False, most: int = _MOST
) -> tuple[Explanation, Evidence]:
    """Return an effect and those that the evidence supports beside it, and the evidence with them.

    The likeliest place's columns are freed (a scalar effect in its direction at its estimated size, a vector
    effect whole), and all others are asked again, until none gains `SEPARATE` nats. What one effect alone
    leaves looks like an error of form in every row where the second acts: so the errors of form that are
    possible are looked for anew beside each effect that is found. And the best single effect need not be one
    of the best two: each of those found is asked for again beside the others.

    Parameters
    ----------
    evidence : Evidence
    first : str
        Effect id.
    rows : sequence of str
        That have an error of form.
    asked : bool
        Whether the first effect stays whatever the others are.
    most : int
    """
    places = [evidence.best_place(first)]
    gains = [evidence.effect[first]]
    while len(places) < most:
        evidence = _with_forms_beside(evidence, places, rows)
        found = _best_beside(evidence, places)
        if found is None or found[0] < SEPARATE:
            break
        gains.append(found[0])
        places = _exchanged(evidence, [*places, found[1]], first=1 if asked else 0)
    return Explanation(tuple(places), tuple(gains), _jointly(evidence, places)), evidence


def again(evidence: Evidence, explanation: Explanation) -> Explanation:
    """Return an explanation with its sizes estimated anew on other evidence of the same candidates."""
    return replace(explanation, estimates=_jointly(evidence, list(explanation.places)))


def _with_forms_beside(evidence: Evidence, places: list[int], rows: Sequence[str]) -> Evidence:
    """Return the evidence with the errors of form too that are possible once some candidates are free."""
    system = evidence.system
    if not rows:
        return evidence
    forms = likely_forms(system, rows, directions(evidence, places))
    every = tuple(dict.fromkeys([*system.form_errors, *forms]))
    return weigh(replace(system, form_errors=every))  # small matrices that are made stay


def _best_beside(evidence: Evidence, places: list[int]) -> tuple[float, int] | None:
    """Return the nats and the place of the effect that gains most beside others, none of these again."""
    taken = {evidence.system.candidates[i].effect for i in places} | {OTHER}
    gains = {e: gain for e, gain in _given(evidence, places).items() if e not in taken}
    return max(gains.values()) if gains else None


def _exchanged(evidence: Evidence, places: list[int], first: int) -> list[int]:
    """Return places, each from a first one on the best beside the others."""
    for _ in range(len(places)):
        before = list(places)
        for k in range(first, len(places)):
            others = places[:k] + places[k + 1 :]
            best = _best_beside(evidence, others)
            if best is not None:
                places = [*places[:k], best[1], *places[k + 1 :]]
        if places == before:
            break
    return places


def directions(evidence: Evidence, places: list[int]) -> Array:
    """Return the freed columns' weights, shape (freed, column)."""
    system = evidence.system
    found = []
    for i in places:
        c, at = system.candidates[i], system.columns_of(i)
        if c.kind == "vector":
            block = np.zeros((c.sizes.size, system.columns))
            block[:, at] = np.eye(c.sizes.size)
        else:
            block = np.zeros((1, system.columns))
            block[0, at] = estimate(evidence, i, INTERVAL).weights
        found.append(block)
    return np.concatenate(found)


def _given(evidence: Evidence, places: list[int]) -> dict[str, tuple[float, int]]:
    """Return by effect the nats that it gains once other candidates' columns are free, and its best place."""
    system, weighing = evidence.system, evidence.weighing
    free = directions(evidence, places)
    none, by_place = [], []
    for f in system.form_errors:
        left = system.reduced(f).freed(free)
        none.append(left.log_evidence)
        by_place.append(weighing.by_place(left, left.g[:, None])[:, 0])
    joint = logsumexp(np.array(none)[:, None] + np.array(by_place), axis=0) - logsumexp(none)
    gains = weighing.by_effect(joint)
    return {
        e: (float(gain), max(weighing.places_of(e), key=lambda i: joint[i]))
        for e, gain in zip(weighing.effects, gains, strict=True)
    }


def _jointly(evidence: Evidence, places: list[int]) -> tuple[Estimate, ...]:
    """Return estimates of several candidates at once: each given the others, until they agree."""
    if len(places) == 1:
        return (estimate(evidence, places[0], INTERVAL),)
    system = evidence.system
    found = [estimate(evidence, i, INTERVAL) for i in places]
    for _ in range(4):
        for k, i in enumerate(places):
            weights = np.zeros(system.columns)
            for other, e in zip(places, found, strict=True):
                if other != i:
                    weights[system.columns_of(other)] += e.weights
            found[k] = estimate(evidence, i, INTERVAL, given=weights)
    return tuple(found)
