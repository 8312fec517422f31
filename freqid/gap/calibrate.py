"""What evidence is worth: probabilities that hold, sets that cover, and when two names are one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp
from scipy.stats import norm

from freqid.core.diagnosis import Interval, Which
from freqid.gap.attribute import NONE, OTHER, Judged, prior
from freqid.gap.evidence import Evidence
from freqid.gap.signature import GIVEN
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]

APART = 5.4
"""Expected separation ``lambda (1 - c)`` from which two effects are told apart in 95 of 100 cases."""

_CONSIDERED = 0.005  # probability from which an effect can share a name with the likeliest


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
    pair_gain : float
        By how much two effects must explain more than the better of them, as a share of its evidence.
    set_level : float
        Cumulative probability that the set is filled to.
    calibrated : bool
        Whether the numbers come from open cases.
    """

    form_error: float = 0.15
    temperature: float = 1.0
    other: float = 0.0
    none: float = 0.0
    pair_gain: float = 0.15
    set_level: float = 0.90
    calibrated: bool = False


def probabilities(judged: Sequence[Judged], table: Table, exists: bool) -> dict[str, float]:
    """Return the probability of every single effect, of *other* and of *none*.

    Notes
    -----
    Evidence counts in full while the gap is small. A large gap shows that the right candidate's formula is
    not the truth's, so differences of evidence are judged by the size of the largest: with a relative form
    error e they are divided by ``1 + e^2 max``.
    """
    singles = [j for j in judged if "+" not in j.name]
    largest = max((j.evidence for j in singles), default=0.0)
    soft = table.temperature * (1 + table.form_error**2 * max(largest, 0.0))
    logs = {
        j.name: j.evidence / soft + prior(j.name, len(singles)) + (table.other if j.name == OTHER else 0.0)
        for j in singles
    }
    logs[NONE] = table.none
    total = logsumexp(list(logs.values()))
    found = {name: float(np.exp(value - total)) for name, value in logs.items()}
    if not exists:
        # the null's own draws say that nothing is there: what is left for effects is what the level allows
        rest = sum(p for n, p in found.items() if n != NONE)
        keep = min(rest, 0.1)
        found = {n: (1 - keep if n == NONE else p * keep / max(rest, 1e-300)) for n, p in found.items()}
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def aliases(
    judged: Sequence[Judged], evidence: Evidence, among: Sequence[str]
) -> tuple[tuple[str, ...], ...]:
    """Return groups of effects that these data are not expected to separate."""
    known = {j.name: j for j in judged if j.name in among}
    groups: list[set[str]] = []
    for a, b in combinations(known, 2):
        c = evidence.alignment(known[a].best, known[b].best)
        size = max(known[a].estimate.detectability, known[b].estimate.detectability)
        if size * (1 - c) < APART:
            joined = {a, b}.union(*(g for g in groups if g & {a, b}))
            groups = [g for g in groups if not g & {a, b}] + [joined]
    return tuple(tuple(sorted(g)) for g in groups)


def which(
    judged: Sequence[Judged],
    evidence: Evidence,
    library: Mapping[str, Effect],
    not_tested: Mapping[str, str],
    exists: bool,
    interval: float,
    table: Table = Table(),
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
    """
    chances = probabilities(judged, table, exists)
    considered = [n for n, p in chances.items() if p > _CONSIDERED and n not in (NONE, OTHER)]
    groups = aliases(judged, evidence, considered) if exists else ()
    return Which(
        probabilities=chances,
        set=filled(chances, table.set_level),
        aliases=groups,
        not_tested=dict(not_tested),
        parameters={j.name: _intervals(j, evidence, library, interval) for j in judged if j.name in library},
        calibrated=table.calibrated,
        pair=_pair(judged, table) if exists else (),
    )


def filled(chances: Mapping[str, float], level: float) -> tuple[str, ...]:
    """Return the likeliest names until they hold a probability."""
    names, total = [], 0.0
    for name, p in sorted(chances.items(), key=lambda item: -item[1]):
        names.append(name)
        total += p
        if total >= level:
            break
    return tuple(names)


def _pair(judged: Sequence[Judged], table: Table) -> tuple[str, ...]:
    """Return two effects that together say much more than either, or nothing."""
    singles = {j.name: j.evidence for j in judged if "+" not in j.name}
    pairs = [j for j in judged if "+" in j.name]
    if not pairs or not singles:
        return ()
    best = max(pairs, key=lambda j: j.evidence)
    alone = max(e for n, e in singles.items() if n != OTHER)
    gain = best.evidence - alone
    return tuple(best.name.split("+")) if gain > max(8.0, table.pair_gain * alone) else ()


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
