"""Explanations that a diagnosis leaves standing, and how far an experiment is expected to set them apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from freqid.core.diagnosis import Which
from freqid.gap.attribute import NONE, OTHER, Judged, variants
from freqid.gap.evidence import Evidence
from freqid.gap.signature import GIVEN
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]

_MOST = 5  # names that are told apart: the likeliest
_SAME = 1e-4  # of a change's energy: less than this left by another effect is the same change


@dataclass(frozen=True)
class Explanation:
    """An effect at the size that data give it, or *none*.

    Attributes
    ----------
    name : str
        Effect id, or ``none``.
    value : dict of float
        Coefficient by signature.
    ways : tuple of tuple of str
        Signatures that it may show by, one group for each of its variants.
    """

    name: str
    value: dict[str, float] = field(default_factory=dict)
    ways: tuple[tuple[str, ...], ...] = ()

    @property
    def sizes(self) -> dict[str, float]:
        """Estimates by parameter."""
        return {n.partition(":")[2].partition(GIVEN)[0]: x for n, x in self.value.items()}

    def times(self, factor: float) -> Explanation:
        """Return the same effect at another size."""
        return replace(self, value={n: factor * x for n, x in self.value.items()})

    @property
    def signatures(self) -> tuple[str, ...]:
        """All that it may show by."""
        return tuple(dict.fromkeys(n for way in self.ways for n in way))


def left_standing(
    which: Which, judged: Sequence[Judged], evidence: Evidence, library: Mapping[str, Effect]
) -> tuple[list[Explanation], list[tuple[str, ...]]]:
    """Return the explanations that a diagnosis leaves, and the groups of names that are to be told apart.

    Parameters
    ----------
    which : Which
        Groups are its aliases that hold a name of the set, and the set; *other* cannot be predicted.
    judged : sequence of Judged
    evidence : Evidence
    library : dict of Effect
        As on the vehicle.
    """
    chance = which.probabilities
    likely = [n for n in sorted(which.set, key=lambda n: -chance.get(n, 0.0)) if n != OTHER]
    groups = [tuple(g) for g in which.aliases if set(g) & set(likely)]
    if len(likely) > 1 and not any(set(likely) <= set(g) for g in groups):
        groups.append(tuple(likely))
    best = {j.name: j for j in judged}
    known = {NONE, *(n for n in best if n in library)}
    cut = [sorted((n for n in g if n in known), key=lambda n: -chance.get(n, 0.0))[:_MOST] for g in groups]
    kept = [tuple(g) for g in cut if len(g) > 1]
    names = dict.fromkeys(n for g in kept for n in g)
    return [at_its_size(n, best, library, evidence) for n in names], kept


def at_its_size(
    name: str, best: Mapping[str, Judged], library: Mapping[str, Effect], evidence: Evidence
) -> Explanation:
    """Return one explanation of a diagnosis.

    Parameters
    ----------
    name : str
        Effect id, or ``none``.
    best : dict of Judged
        By effect id.
    library : dict of Effect
        As on the vehicle.
    evidence : Evidence
    """
    if name == NONE:
        return Explanation(NONE)
    every = (*evidence.signatures, *evidence.tolerances)
    judged = best[name]
    value = {
        every[column - 1]: float(x)
        for column, x in zip(judged.best.columns, judged.estimate.value, strict=True)
    }
    ways = tuple(
        tuple(every[c - 1] for c in h.columns) for h in variants(library[name], evidence) if evidence.whole(h)
    )
    return Explanation(name, value, ways)


def pairs_of(groups: Sequence[tuple[str, ...]]) -> list[tuple[str, str]]:
    """Return all pairs within groups, once each."""
    return list(dict.fromkeys((a, b) for g in groups for a, b in combinations(sorted(g), 2)))


def as_plain(evidence: Evidence, one: Explanation, other: Explanation) -> tuple[Explanation, Explanation]:
    """Return two explanations, the fainter at the size at which it is as plain in data as the other.

    A gap was seen, so whichever explanation is true makes one of that size; an estimate that is faint since
    it fits badly would pass for an effect that nothing shows.

    Parameters
    ----------
    evidence : Evidence
        Of the flights in which the gap was seen.
    one, other : Explanation
    """
    sizes = [_energy(evidence, x) for x in (one, other)]
    if min(sizes) <= 0:
        return one, other
    factors = [float(np.sqrt(max(sizes) / size)) for size in sizes]
    return one.times(factors[0]), other.times(factors[1])


def apart(evidence: Evidence, one: Explanation, other: Explanation) -> float:
    """Return how far data are expected to set two explanations apart: the lesser of both ways round.

    Whichever of them is true, half the energy of its change that the other, at any size, and tolerances
    cannot make. For one parameter each that is ``lambda (1 - c^2) / 2``, which for like changes is
    ``lambda (1 - c)``.

    Parameters
    ----------
    evidence : Evidence
        Of the experiment; data are not looked at.
    one, other : Explanation
    """
    return min(_left(evidence, one, other)[0], _left(evidence, other, one)[0])


def alike(evidence: Evidence, one: Explanation, other: Explanation) -> bool:
    """Return whether two make the same change, so that no amount of such data tells them apart."""
    for a, b in ((one, other), (other, one)):
        left, whole = _left(evidence, a, b)
        if left <= _SAME * whole < np.inf:
            return True
    return False


def _left(evidence: Evidence, true: Explanation, claimed: Explanation) -> tuple[float, float]:
    """Return half the energy of a change that another explanation leaves, and half of all of it."""
    if not true.value:  # nothing is there to be explained: the other is seen by what it would make
        return np.inf, np.inf
    at = [evidence.column(n) for n in true.value]
    size = np.array(list(true.value.values()))
    metric, whole = evidence.metric, _energy(evidence, true)
    lefts = [whole]
    for way in claimed.ways:
        columns = [evidence.column(n) for n in way]
        gram = metric[np.ix_(columns, columns)]
        scale = 1 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
        across = scale * (metric[np.ix_(columns, at)] @ size)
        inverse = np.linalg.pinv(scale[:, None] * gram * scale, rcond=1e-9, hermitian=True)
        lefts.append(whole - float(across @ inverse @ across))
    return 0.5 * max(min(lefts), 0.0), 0.5 * whole


def _energy(evidence: Evidence, explanation: Explanation) -> float:
    """Return the squared size of an explanation's change, ``lambda``."""
    at = [evidence.column(n) for n in explanation.value]
    size = np.array(list(explanation.value.values()))
    return float(size @ evidence.metric[np.ix_(at, at)] @ size)
