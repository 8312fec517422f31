"""The smallest size of an effect that is called a gap in 95 of 100 draws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqid.core.results.gap_self_test import SmallestSize
from freqid.gap.infer.evidence import Evidence
from freqid.gap.infer.seen_sizes import size_at
from freqid.gap.model.candidate import OTHER
from freqid.gap.self_test.answers import DrawnData, Weighed, only_candidates

POWER = 0.95
"""Share of draws in which a size has to be called a gap."""

_STEPS = 7  # of halving the range of detectability, in its logarithm: to 5 % of it
_LOW, _HIGH = 2.0, 500.0  # detectabilities between which is looked; beyond, a size counts as not found
_DRAWS = 200
_PARTS = (30, _DRAWS)  # draws after which a size may already have missed too many


def smallest_sizes(
    evidence: Evidence, draws: DrawnData, threshold: float, *, every: bool = False
) -> list[SmallestSize]:
    """Return the smallest sizes found, of each effect at its most and its least visible place.

    A gap is called here where the effect's own evidence, shared by all effects, is above the threshold. What
    other effects take for themselves comes on top, so that the sizes are on the safe side, by about a
    twentieth. Sizes between those that the diagnosis has columns for are interpolated.

    Parameters
    ----------
    evidence : Evidence
    draws : DrawnData
        Without an effect.
    threshold : float
        Of the statistic.
    every : bool, optional
        Whether places between the two are wanted too.
    """
    system, weighing, found = evidence.system, evidence.weighing, []
    for effect in weighing.effects:
        places = [i for i in weighing.places_of(effect) if system.candidates[i].kind == "scalar"]
        if effect == OTHER or not places:
            continue
        needed = threshold + np.log(len(weighing.effects))
        search = _Search(evidence, only_candidates(evidence, weighing.places_of(effect)), draws, needed)
        each = sorted((search.smallest(i) for i in places), key=_rank)
        found += each if every else list(dict.fromkeys((each[0], each[-1])))
    return found


def _rank(one: SmallestSize) -> float:
    """Return the share of its range that a place's smallest size is; those not found come last."""
    return one.size / one.largest if np.isfinite(one.size) else np.inf


@dataclass(frozen=True, eq=False)
class _Search:
    """Draws weighed by the places of one effect alone.

    Attributes
    ----------
    evidence : Evidence
        Of all candidates.
    alone : Evidence
        Of the places of one effect.
    draws : DrawnData
    needed : float
        Log Bayes factor of the effect, from which a gap is called.
    """

    evidence: Evidence
    alone: Evidence
    draws: DrawnData
    needed: float

    def smallest(self, index: int) -> SmallestSize:
        """Return the smallest size found of one place; of two signs, the one that needs the larger size."""
        c = self.evidence.system.candidates[index]
        signs = np.unique(np.sign(c.prior))
        if c.sizes.size == 1:
            signs = signs[-1:]  # proportional: either sign is seen alike
        each = [self._of_sign(index, float(sign)) for sign in signs]
        return max(each, key=lambda one: one.size if np.isfinite(one.size) else np.inf)

    def _of_sign(self, index: int, sign: float) -> SmallestSize:
        c = self.evidence.system.candidates[index]
        low, high = np.log(_LOW), np.log(_HIGH)
        for _ in range(_STEPS):
            middle = (low + high) / 2
            size = self._size(index, sign, float(np.exp(middle)))
            enough = not np.isfinite(size) or self._found(index, size)
            low, high = (low, middle) if enough else (middle, high)
        size = self._size(index, sign, float(np.exp(high)))
        if np.isfinite(size) and not self._found(index, size):
            size = np.nan
        largest = float(np.abs(c.prior[np.sign(c.prior) == sign]).max())
        return SmallestSize(
            c.effect,
            c.place.label,
            c.unit,
            abs(size),
            float(np.exp(high)) if np.isfinite(size) else np.nan,
            largest,
        )

    def _size(self, index: int, sign: float, goal: float) -> float:
        """Return the size of a detectability; NaN where none within the range of the prior has it."""
        system = self.evidence.system
        c, at = system.candidates[index], system.columns_of(index)
        G = system.reduced(self.evidence.form_error()).G[at, at]
        size = size_at(c, G, goal, sign)
        return size if abs(size) <= np.abs(c.prior).max() else np.nan

    def _found(self, index: int, size: float) -> bool:
        """Return whether a size is called a gap in a share `POWER` of the draws.

        Most sizes that are asked about are missed in nearly all draws, so few draws are looked at first.
        """
        system = self.evidence.system
        c = system.candidates[index]
        weights = np.zeros(self.draws.system.columns)
        weights[system.columns_of(index)] = c.weights(size)
        places = self.evidence.weighing.places_of(c.effect)
        at = system.places(places)
        count = min(_DRAWS, self.draws.count)
        called = done = 0
        for end in _PARTS:
            part = np.arange(done, min(end, count))
            if part.size:
                own = self.draws.with_effect(weights, part, at)
                called += int((Weighed.of(self.alone, own).effects()[0] >= self.needed).sum())
            done = min(end, count)
            if (called + count - done) / count < POWER:
                return False
        return True
