"""Which effect: probabilities, the set that holds the truth, what cannot be told apart, and the name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from freqid.gap.infer.evidence import NONE, Evidence, separation
from freqid.gap.model.candidate import OTHER

APART = (2 * 1.645) ** 2
"""Separation `lambda (1 - c^2)` from which the right one of two effects is the likelier in 95 of 100 cases.

Two changes that are d standard deviations of noise apart are confused with probability ``Phi(-d / 2)``.
"""


@dataclass(frozen=True)
class Ranking:
    """How likely each explanation is.

    Attributes
    ----------
    probabilities : dict of float
        By effect id, `NONE` and `OTHER`, likeliest first; they add up to one.
    credible : tuple of str
        Fewest that hold the truth with the level asked for.
    alike : tuple of str
        Those that these data cannot tell from the likeliest effect, which comes first.
    """

    probabilities: dict[str, float]
    credible: tuple[str, ...]
    alike: tuple[str, ...]


def rank(evidence: Evidence, exists: bool, level: float, temperature: float, p_none: float) -> Ranking:
    """Return how likely each explanation is.

    Parameters
    ----------
    evidence : Evidence
    exists : bool
        Whether a gap was called.
    level : float
        Of the set.
    temperature : float
        By which log Bayes factors are divided: the one number that calibration fits.
    p_none : float
        Probability of no gap.
    """
    names = list(evidence.effect)
    log = np.array([evidence.effect[n] for n in names]) / temperature
    share = np.exp(log - logsumexp(log)) * (1 - p_none)
    every = {**dict(zip(names, share.tolist(), strict=True)), NONE: p_none}
    every = dict(sorted(every.items(), key=lambda one: -one[1]))
    credible, mass = [], 0.0
    for name, probability in every.items():
        if mass >= level:
            break
        credible.append(name)
        mass += probability
    leading = next((n for n in every if n not in (NONE, OTHER)), "")
    alike = (leading, *_alike(evidence, leading)) if leading and exists else ()
    return Ranking(every, tuple(credible), alike)


def _alike(evidence: Evidence, leading: str) -> list[str]:
    """Return the effects that cannot be told from the leading one, and that the data leave possible."""
    index = evidence.best_place(leading)
    found = []
    for name in evidence.effect:
        if name in (leading, OTHER) or evidence.effect[leading] - evidence.effect[name] > APART / 2:
            continue
        if separation(evidence, index, evidence.best_place(name)) < APART:
            found.append(name)
    return found


def probability_of_none(evidence: Evidence) -> float:
    """Return how likely no gap is, at even odds before the data."""
    return float(1 / (1 + np.exp(np.clip(evidence.statistic, -50, 50))))


def groups_of(evidence: Evidence, among: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Return groups, of some effects, whose members these data cannot tell apart, each with two or more."""
    left = [n for n in among if n not in (NONE, OTHER)]
    found: list[tuple[str, ...]] = []
    while left:
        name = left.pop(0)
        index = evidence.best_place(name)
        group = [n for n in left if separation(evidence, index, evidence.best_place(n)) < APART]
        left = [n for n in left if n not in group]
        if group:
            found.append((name, *group))
    return tuple(found)


def detectable_sizes(evidence: Evidence, threshold: float) -> dict[str, tuple[float, str]]:
    """Return by effect the smallest size that is called a gap in 95 of 100 cases, and its unit.

    Of the effect as a whole where it has such a place, else at the least visible of the places where some
    size is seen; of two signs, the one that needs the larger size.

    An effect at a size with detectability ``lambda`` has, without noise, a log Bayes factor; noise moves
    that by ``sqrt(lambda)``, one standard deviation.

    Parameters
    ----------
    evidence : Evidence
    threshold : float
        Of the statistic.
    """
    system, weighing = evidence.system, evidence.weighing
    reduced = system.reduced(evidence.form_error())
    needed = threshold + np.log(len(weighing.effects))
    found: dict[str, tuple[float, float, str]] = {}
    whole = {c.effect for c in system.candidates if not c.place.label}
    for i in weighing.scalars:
        c, at = system.candidates[i], system.columns_of(i)
        weights = c.at_prior
        if c.effect in whole and c.place.label:
            continue
        places = np.log(len(weighing.places_of(c.effect)))
        energy = weights @ reduced.G[at, at] @ weights.T
        power = np.diag(energy)
        factor = logsumexp(energy - 0.5 * power[:, None], axis=0) - np.log(len(weights))
        seen = factor - places - 1.645 * np.sqrt(np.maximum(power, 0.0)) >= needed
        either = [np.abs(c.prior[seen & (np.sign(c.prior) == sign)]) for sign in np.unique(np.sign(c.prior))]
        if all(one.size for one in either):
            size = max(float(one.min()) for one in either)
            share = size / float(np.abs(c.prior).max())  # of the largest that is looked for
            found[c.effect] = max((share, size, c.unit), found.get(c.effect, (0.0, 0.0, "")))
    return {name: (size, unit) for name, (_, size, unit) in found.items()}
