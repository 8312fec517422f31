"""Explanations: which effects the evidence supports, one after the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from freqid.gap.infer.evidence import Estimate, Evidence, estimate
from freqid.gap.model.candidates import OTHER
from freqid.gap.settings import INTERVAL, SEPARATE

Array = NDArray[np.float64]

_MOST = 3  # effects of one explanation
_FREE = 1e-9  # of a column's energy: what is left of it once others are free


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


def explain(evidence: Evidence, first: str, *, most: int = _MOST) -> Explanation:
    """Return an effect and those that the evidence supports beside it.

    The likeliest place's columns are freed (a scalar effect in its direction at its estimated size, a vector
    effect whole), and all others are asked again, until none gains `SEPARATE` nats.

    Parameters
    ----------
    evidence : Evidence
    first : str
        Effect id.
    most : int
    """
    places = [evidence.best_place(first)]
    gains = [evidence.effect[first]]
    while len(places) < most:
        gain = _given(evidence, places)
        taken = {evidence.system.candidates[i].effect for i in places}
        ranked = [e for e in sorted(gain, key=lambda e: -gain[e][0]) if e not in taken and e != OTHER]
        if not ranked or gain[ranked[0]][0] < SEPARATE:
            break
        places.append(gain[ranked[0]][1])
        gains.append(gain[ranked[0]][0])
    return Explanation(tuple(places), tuple(gains), _jointly(evidence, places))


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
    from freqid.gap.infer.system import Reduced

    system, weighing = evidence.system, evidence.weighing
    free = directions(evidence, places)
    none, by_place = [], []
    for f in system.form_errors:
        reduced = system.reduced(f)
        own = free @ reduced.G @ free.T
        own = own + _FREE * np.trace(own) / len(own) * np.eye(len(own))
        across, projected = free @ reduced.G, free @ reduced.g
        solved = np.linalg.solve(own, np.concatenate([across, projected[:, None]], axis=1))
        G = reduced.G - across.T @ solved[:, :-1]
        g = reduced.g - across.T @ solved[:, -1]
        left = Reduced(G, g, reduced.log_evidence + 0.5 * float(projected @ solved[:, -1]))
        none.append(left.log_evidence)
        by_place.append(weighing.by_place(left, g[:, None])[:, 0])
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
