"""Explanations: which effects the evidence supports, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import logsumexp

from freqid.core.arrays import Array
from freqid.gap.infer.at_form import Reduced
from freqid.gap.infer.evidence import (
    BEHIND,
    FINALISTS,
    Estimate,
    Evidence,
    directions,
    estimate,
    weights_of,
)
from freqid.gap.infer.forms import forms_beside
from freqid.gap.infer.joint_sizes import as_sums, joint_estimates, slopes
from freqid.gap.infer.linearise import Linearised
from freqid.gap.infer.system import System
from freqid.gap.infer.weighing import log_mean
from freqid.gap.model.candidate import OTHER
from freqid.gap.settings import INTERVAL, MOST_ROUNDS, SEPARATE, SETTLED

_MOST = 3  # effects of one explanation
_CLOSE = 0.1  # of an interval: a size that has moved less stays


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
        return weights_of(system, zip(self.places, self.estimates, strict=True))


Compute = Callable[[Linearised, Explanation, list[tuple[int, Estimate]], bool], Linearised]


def explain(
    start: Linearised,
    first: Sequence[str],
    terms: Sequence[str] = (),
    *,
    asked: bool = False,
    compute: Compute | None = None,
) -> tuple[Explanation, Linearised]:
    """Return effects and those that the evidence supports beside them, and what was computed about these.

    The likeliest place's columns are freed, and all others are asked again, until one more effect, whichever
    it is, raises the evidence by less than `SEPARATE` nats: as with the first one, the odds are shared by all
    that are asked. What one effect alone leaves looks like an error of form in every row where the second
    acts: so the errors of form that are possible are looked for anew beside each effect that is found. The
    likeliest of the others are computed at their size beside it before one is chosen. And the best single
    effect need not be one of the best two: each of those found is asked for again beside the others, where
    another one may take its place, or none.

    Columns are straight lines about the sizes at which they were computed, and two explanations have other
    sizes, also of the tolerances. So lines about one only propose another: which of the two the data prefer
    is decided with each at sizes of its own.

    Parameters
    ----------
    start : Linearised
    first : sequence of str
        Effect ids.
    terms : sequence of str
        That have an error of form.
    asked : bool
        Whether the first effects stay whatever the others are.
    compute : callable, optional
        Returns what an explanation's effects, and other estimates beside it, are once they are computed again
        at their sizes, with lines drawn anew or with those that there are.
    """
    search = _Search(tuple(terms), len(first) if asked else 0, compute)
    places = [start.evidence.best_place(e) for e in first]
    gains = [start.evidence.effect[e] for e in first]
    at = search.settled(start, places)
    while frozenset(places) not in search.known:
        search.known[frozenset(places)] = at
        needed, other = search.exchanged(at, places)
        if needed != places:
            at, places = other, needed
            if len(places) < len(gains):
                alone = at.evidence.effect
                gains = [alone[at.system.candidates[i].effect] for i in places]
            continue
        if len(places) >= _MOST:
            break
        at = search.known[frozenset(places)] = search.asked(at, places)
        every = _beside(at.evidence, places)
        if _raised(every) < SEPARATE:
            break
        more = [*places, every[0][1]]
        there = search.settled(at, more)
        new, old = _explanation(there.system, more), _explanation(at.system, places)
        gain = _worth(there.system, new, -1) - _at_sizes(at.system, old)
        if _raised([(gain, every[0][1]), *every[1:]]) < SEPARATE:
            break
        at, places, gains = there, more, [*gains, gain]
    return _explanation(at.system, places, gains), at


@dataclass(frozen=True, eq=False)
class _Search:
    """How explanations are computed and compared.

    Attributes
    ----------
    terms : tuple of str
    kept : int
        First effects that stay.
    compute : callable, optional
    known : dict of Linearised
        Explanations by their places.
    """

    terms: tuple[str, ...]
    kept: int
    compute: Compute | None
    known: dict[frozenset[int], Linearised] = field(default_factory=dict)

    def settled(self, at: Linearised, places: list[int]) -> Linearised:
        """Return what is computed about effects at the sizes that they have together, once these stay.

        And once the data are no likelier by another round: explanations are compared where all have settled.
        Where sizes stay, a round keeps its lines first, as in `Linearised.settled`.
        """
        if self.compute is None:
            return at
        about, before, anew = _explanation(at.system, places), -np.inf, True
        for _ in range(2 * MOST_ROUNDS):
            at = self.compute(at, about, [], anew)
            now = _explanation(at.system, places)
            here = _at_sizes(at.system, now)
            gained, before = here - before, here
            each = zip(about.estimates, now.estimates, strict=True)
            stay = all(np.all(np.abs(a.size - e.size) <= _CLOSE * e.width) for a, e in each)
            if stay and abs(gained) < SETTLED:
                break
            about, anew = now, not (stay and anew)
        return at

    def asked(self, at: Linearised, places: list[int]) -> Linearised:
        """Return what is computed once the likeliest others are near their sizes beside effects.

        The effects that are there settle anew first, at the errors of form that are possible beside them, as
        each one more does before it is compared with them.
        """
        there = self._with_forms_beside(at, places)
        at = at if there is at else self.settled(there, places)
        found = _finalists(at.evidence, places)
        if self.compute is None or not found:
            return at
        given = _weights(at.evidence, places)
        others = [(i, estimate(at.evidence, i, INTERVAL, given=given)) for _, i in found]
        return self.compute(at, _explanation(at.system, places), others, False)

    def exchanged(self, at: Linearised, places: list[int]) -> tuple[list[int], Linearised]:
        """Return places without one that the others do not need, or with a better one in its stead."""
        if len(places) < 2:
            return places, at
        now = _explanation(at.system, places)
        for k in range(self.kept, len(places)):
            others = places[:k] + places[k + 1 :]
            without = self.known.get(frozenset(others))
            if without is None or without.system.form_errors != at.system.form_errors:
                without = self.settled(at, others)
            alone, candidates = _explanation(without.system, others), at.system.candidates
            left = _at_sizes(without.system, alone)
            rivals = [one for one in _beside(without.evidence, others) if one[1] != places[k]]
            apart = [one for one in rivals if candidates[one[1]].effect != candidates[places[k]].effect]
            worth = _worth(at.system, now, k) - left
            if _raised([(worth, places[k]), *apart]) < SEPARATE:
                return others, without
            if rivals and rivals[0][0] > worth:
                new = [*others[:k], rivals[0][1], *others[k:]]
                there = self.settled(without, new)
                if _worth(there.system, _explanation(there.system, new), k) - left > worth:
                    return new, there
        return places, at

    def _with_forms_beside(self, at: Linearised, places: list[int]) -> Linearised:
        """Return it with more errors of form: the likeliest beside effects, and beside a second one."""
        evidence, system = at.evidence, at.system
        if not self.terms:
            return at
        first, given = free(evidence, places), _weights(evidence, places)
        explanations = [first]
        for _, i in _finalists(evidence, places):
            explanations.append(np.concatenate([first, directions(evidence, i, given)]))
        forms = forms_beside(system, self.terms, explanations)
        if forms == system.form_errors:
            return at
        return replace(at, system=replace(system, form_errors=forms))  # small matrices stay


def _explanation(system: System, places: list[int], gains: Sequence[float] = ()) -> Explanation:
    return Explanation(tuple(places), tuple(gains), joint_estimates(system, places))


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
    least = max(gains[0][0] - BEHIND, 0.0) if gains else 0.0
    return [one for one in gains[:FINALISTS] if one[0] >= least]


def _weights(evidence: Evidence, places: list[int]) -> Array:
    """Return the weights of all columns where some effects are as they are estimated together."""
    return _explanation(evidence.system, places).weights(evidence.system)


def free(evidence: Evidence, places: list[int]) -> Array:
    """Return the freed columns' weights of some effects, shape (freed, column)."""
    return np.concatenate([directions(evidence, i) for i in places])


def _at_sizes(system: System, explanation: Explanation) -> float:
    """Return the log evidence of effects near their sizes, as they are estimated there."""
    few = as_sums(system, explanation.places)
    there = list(enumerate(explanation.estimates))
    found = float(logsumexp([left.log_evidence for left in _near(few, there)]))
    return found - _promised(system, explanation)


def _worth(system: System, explanation: Explanation, k: int) -> float:
    """Return the log evidence of effects near their sizes, that of one and its place integrated out."""
    places, candidates = explanation.places, system.candidates
    own = candidates[places[k]].effect
    rivals = [i for i, c in enumerate(candidates) if c.effect == own and i != places[k]]
    few = as_sums(system, places, rivals)
    others = [(j, e) for j, e in enumerate(explanation.estimates) if places[j] != places[k]]
    joint = [left.log_evidence + few.weighing.of_data(left) for left in _near(few, others)]
    every = [k % len(places), *range(len(places), len(places) + len(rivals))]
    return float(log_mean(logsumexp(joint, axis=0)[every])) - _promised(system, explanation)


def _promised(system: System, explanation: Explanation) -> float:
    """Return the nats by which lines say that data are likelier at some sizes than they are where asked.

    Lines that have settled say nothing of the kind. Others may say much that is not there: an explanation is
    worth what it was found to be.
    """
    about = system.about
    if about is None or {i for i, _ in about.acting} != set(explanation.places):
        return 0.0
    weights, own = explanation.weights(system), system.own_tolerances(explanation.places)
    fitted = system.likeliest_tolerances(about.form_error, weights, own)
    return max(about.misfit - system.misfit(about.form_error, fitted, weights), 0.0)


def _near(evidence: Evidence, there: Sequence[tuple[int, Estimate]]) -> list[Reduced]:
    """Return what is left at each error of form once effects are about their sizes.

    Free to be a little larger or smaller there: freer, lines make of one effect what another does.

    Parameters
    ----------
    evidence : Evidence
    there : sequence of (int, Estimate)
        Candidates with their sizes.
    """
    system = evidence.system
    given, free = np.zeros(system.columns), []
    for i, e in there:
        at = system.columns_of(i)
        given[at] = e.weights
        free.append(np.zeros((e.size.size, system.columns)))
        free[-1][:, at] = slopes(e.candidate, e.size)
    freed = np.concatenate(free)
    return [system.reduced(f).given(given).freed(freed) for f in system.form_errors]


def _given(evidence: Evidence, places: list[int]) -> dict[str, tuple[float, int]]:
    """Return by effect the nats that it gains beside others near their sizes, and its best place."""
    weighing = evidence.weighing
    estimates = joint_estimates(evidence.system, places)
    none, by_place = [], []
    for left in _near(evidence, list(zip(places, estimates, strict=True))):
        none.append(left.log_evidence)
        by_place.append(weighing.of_data(left))
    joint = logsumexp(np.array(none)[:, None] + np.array(by_place), axis=0) - logsumexp(none)
    gains = weighing.by_effect(joint)
    return {
        e: (float(gain), max(weighing.places_of(e), key=lambda i: joint[i]))
        for e, gain in zip(weighing.effects, gains, strict=True)
    }
