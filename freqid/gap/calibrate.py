"""What evidence is worth: probabilities that hold, sets that cover, and when two names are one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logsumexp
from scipy.stats import norm

from freqid.core.diagnosis import Interval, Which
from freqid.gap.attribute import NONE, OTHER, Judged, prior, priors, statistic
from freqid.gap.evidence import Evidence
from freqid.gap.signature import GIVEN
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]

APART = 5.4
"""Expected separation ``lambda (1 - c)`` from which two effects are told apart in 95 of 100 cases."""

NAMED = 0.75
"""Probability from which an effect, with those that it cannot be told from, is given as the answer."""

CONSIDERED = 0.005
"""Probability from which an effect can share a name with the likeliest."""

_UNCALLED = 0.49  # of all effects together where no gap is called: none stays the likeliest
_PAIR_ODDS = 20.0  # of a pair against any other explanation, with what is expected beforehand
_AS_GOOD = 2.0  # half misfit, beyond one for each parameter, by which a fit may be the worse and yet as good


@dataclass(frozen=True)
class Table:
    """How evidence becomes probability.

    Attributes
    ----------
    form_error : float
        Relative misfit of a candidate that is right but of another formula than the truth.
    temperature : float
    other, none : float
        Added to their logarithms.
    missed, missed_slope : float
        Where no gap is called, the logarithm of the odds that there is one all the same, too small to be
        found: that where the statistic of `freqid.gap.attribute.existence` is zero, and its rise with that.
    pair_gain : float
        By how much two effects must explain more than the better of them, as a share of its evidence, where
        they act in the same rows.
    set_level, uncalled_set_level : float
        Cumulative probability that the set is filled to, where a gap is called and where none is.
    calibrated : bool
        Whether the numbers come from known cases.
    source : str
        Which these are.
    """

    form_error: float = 0.15
    temperature: float = 1.0
    other: float = 0.0
    none: float = 0.0
    missed: float = -2.0
    missed_slope: float = 0.5
    pair_gain: float = 0.10
    set_level: float = 0.90
    uncalled_set_level: float = 0.90
    calibrated: bool = False
    source: str = ""

    def level(self, exists: bool) -> float:
        """Return the cumulative probability that the set is filled to."""
        return self.set_level if exists else self.uncalled_set_level


def probabilities(judged: Sequence[Judged], table: Table, exists: bool) -> dict[str, float]:
    """Return the probability of every single effect, of *other* and of *none*, likeliest first."""
    singles = [j for j in judged if "+" not in j.name]
    names = [j.name for j in singles]
    evidence = np.array([[j.evidence for j in singles]])
    each = chances(names, evidence, np.array([exists]), table)[0]
    found = dict(zip((*names, NONE), each.tolist(), strict=True))
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def chances(names: Sequence[str], evidence: Array, exists: NDArray[np.bool_], table: Table) -> Array:
    """Return the probabilities of explanations in many cases at once.

    Parameters
    ----------
    names : sequence of str
        Effects and *other*.
    evidence : ndarray, shape (case, name)
        Log Bayes factors against no effect; NaN for what was not judged.
    exists : ndarray of bool, shape (case,)
        Whether a gap was called.
    table : Table

    Returns
    -------
    ndarray, shape (case, name + 1)
        The last is of *none*.

    Notes
    -----
    Evidence counts in full while the gap is small. A large gap shows that the right candidate's formula is
    not the truth's, so differences of evidence are judged by the size of the largest: with a relative form
    error e they are divided by ``1 + e^2 max``.
    """
    judged = np.isfinite(evidence)
    largest = np.max(evidence, axis=1, initial=0.0, where=judged, keepdims=True)
    soft = table.temperature * (1 + table.form_error**2 * largest)
    logs = np.full((len(evidence), len(names) + 1), table.none)
    shift = np.array([table.other if name == OTHER else 0.0 for name in names])
    logs[:, :-1] = np.where(judged, evidence / soft, -np.inf) + priors(names, judged) + shift
    found = np.exp(logs - logsumexp(logs, axis=1, keepdims=True))
    # the null's own draws say that nothing is there, or that it is too small to be found
    share = expit(table.missed + table.missed_slope * statistic(names, evidence[~exists]))
    share = np.minimum(share, _UNCALLED)
    rest = np.maximum(found[~exists, :-1].sum(axis=1), 1e-300)
    found[~exists, :-1] *= (share / rest)[:, None]
    found[~exists, -1] = 1 - share
    return found


def aliases(
    judged: Sequence[Judged], evidence: Evidence, among: Sequence[str]
) -> tuple[tuple[str, ...], ...]:
    """Return groups of effects that these data are not expected to separate."""
    known = {j.name: j for j in judged if j.name in among}

    def apart(a: str, b: str) -> float:
        size = max(known[a].estimate.detectability, known[b].estimate.detectability)
        return size * (1 - evidence.alignment(known[a].best, known[b].best))

    return joined(list(known), apart)


def _as_good(judged: Sequence[Judged], evidence: Evidence, leading: str, besides: Sequence[str]) -> list[str]:
    """Return further effects that fit as well as the leading one, for each of their parameters.

    What is unlikely only because its size would be unusual is not told apart by data.
    """
    gain = {
        j.name: float(evidence.likelihood_gain(j.best)[0]) - len(j.best.columns)
        for j in judged
        if "+" not in j.name and j.name != OTHER
    }
    close = [n for n, x in gain.items() if x > gain.get(leading, np.inf) - _AS_GOOD and n not in besides]
    return [n for n in close if aliases(judged, evidence, (leading, n))]


def joined(names: Sequence[str], apart: Callable[[str, str], float]) -> tuple[tuple[str, ...], ...]:
    """Return groups of names whose expected separation is below `APART`."""
    groups: list[set[str]] = []
    for a, b in combinations(names, 2):
        if apart(a, b) < APART:
            group = {a, b}.union(*(g for g in groups if g & {a, b}))
            groups = [g for g in groups if not g & {a, b}] + [group]
    return tuple(tuple(sorted(g)) for g in groups)


def which(
    judged: Sequence[Judged],
    evidence: Evidence,
    library: Mapping[str, Effect],
    not_tested: Mapping[str, str],
    exists: bool,
    interval: float,
    table: Table = Table(),
    overlap: float = 1.0,
) -> Which:
    """Return which effect it is, with what confidence, and what it cannot be told from.

    Parameters
    ----------
    judged : sequence of Judged
    evidence : Evidence
    library : dict of Effect
    not_tested : dict of str
    exists : bool
    interval : float
        Of the parameters.
    table : Table
    overlap : float
        Of the strongest pair's effects, as in `freqid.gap.overlap`.
    """
    chances = probabilities(judged, table, exists)
    likely = {n: p for n, p in chances.items() if p > CONSIDERED and n not in (NONE, OTHER)}
    considered = [*likely, *_as_good(judged, evidence, next(iter(likely), ""), tuple(likely))]
    groups = aliases(judged, evidence, considered) if exists else ()
    return Which(
        probabilities=chances,
        set=filled(chances, table.level(exists)),
        aliases=groups,
        not_tested=dict(not_tested),
        parameters={j.name: _intervals(j, evidence, library, interval) for j in judged if j.name in library},
        calibrated=table.calibrated,
        calibrated_by=table.source if table.calibrated else "",
        pair=pair_called({j.name: j.evidence for j in judged}, table, overlap) if exists else (),
        named=named(chances, groups) if exists else (),
    )


def named(chances: Mapping[str, float], groups: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return the likeliest effect and those of its group, or nothing where they are not likely enough."""
    top = max(chances, key=lambda n: chances[n])
    if top in (NONE, OTHER):
        return ()
    group = next((tuple(g) for g in groups if top in g), (top,))
    return group if sum(chances.get(n, 0.0) for n in group) >= NAMED else ()


def filled(chances: Mapping[str, float], level: float) -> tuple[str, ...]:
    """Return the likeliest names until they hold a probability."""
    names, total = [], 0.0
    for name, p in sorted(chances.items(), key=lambda item: -item[1]):
        names.append(name)
        total += p
        if total >= level:
            break
    return tuple(names)


def pair_called(evidence: Mapping[str, float], table: Table, overlap: float = 1.0) -> tuple[str, ...]:
    """Return two effects that together say much more than either, or nothing.

    A pair has to make good what it is less expected beforehand than a single effect or *other*, and twenty to
    one on top. Where the better of its effects is large, it has to say more than a wrong formula of that
    could make in rows of the other.

    Parameters
    ----------
    evidence : dict of float
        Log Bayes factors by name, of pairs as ``one+other``.
    table : Table
    overlap : float
        Of the strongest pair's effects, as in `freqid.gap.overlap`.
    """
    singles = {n: x for n, x in evidence.items() if "+" not in n and n != OTHER}
    pairs = {n: x for n, x in evidence.items() if "+" in n}
    if not pairs or not singles:
        return ()
    best, alone = max(pairs, key=lambda n: pairs[n]), max(singles.values())
    rivals = (x + prior(n, len(singles)) for n, x in evidence.items() if n not in pairs)
    ahead = pairs[best] + prior(best, len(singles)) - max(rivals)
    more = pairs[best] - alone > overlap * table.pair_gain * alone
    return tuple(best.split("+")) if more and ahead > np.log(_PAIR_ODDS) else ()


def _intervals(
    judged: Judged, evidence: Evidence, library: Mapping[str, Effect], interval: float
) -> dict[str, Interval]:
    """Return the parameters of the variant that data prefer, to first order."""
    every = (*evidence.signatures, *evidence.tolerances)
    reach = float(norm.ppf((1 + interval) / 2))
    effect, found = library[judged.name], {}
    sigma = np.sqrt(np.diag(judged.estimate.covariance))
    for column, value, one in zip(judged.best.columns, judged.estimate.value, sigma, strict=True):
        name = every[column - 1].partition(":")[2].partition(GIVEN)[0]
        unit = effect.parameters[name].unit
        found[name] = Interval(float(value), float(value - reach * one), float(value + reach * one), unit)
    return found
