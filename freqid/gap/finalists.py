"""The likeliest explanations weighed in full, where they fit best: first order misleads about large effects.

A delay of half a cycle is no straight line, and what first order leaves of it, another effect may explain. So
before a name is given, finalists are fitted as they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import ImpossibleSettings
from freqid.gap.attribute import LEAST_ODDS, OTHER, Judged, freer, paired, variants
from freqid.gap.changes import CHANGE, Values, departures, settings_of, sources_of_all
from freqid.gap.compare import Compared
from freqid.gap.descent import Sought, View, descend
from freqid.gap.evidence import Estimate, Evidence
from freqid.gap.gather import evidence_of
from freqid.gap.partners import beside
from freqid.gap.refit import starting
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]

_SINGLES = 5
_LEADING = 2  # singles beside which others are sought: of two effects, a third may explain most
_ROUNDS = 8
_SETTLED = 0.1  # standard errors


def weighed_in_full(
    judged: Sequence[Judged],
    evidence: Evidence,
    library: Mapping[str, Effect],
    compared: Sequence[Compared],
) -> list[Judged]:
    """Return explanations, the finalists among them as they fit best, strongest first.

    Parameters
    ----------
    judged : sequence of Judged
        To first order.
    evidence : Evidence
        That they come from.
    library : dict of Effect
        As on the vehicle.
    compared : sequence of Compared

    Returns
    -------
    list of Judged
        Null draws, which are small, stay as they are to first order.

    Notes
    -----
    Laplace's approximation: the logarithm of the Bayes factor against no effect is what the mode lowers half
    the misfit by, less half its squared distance from the prior's mean in standard deviations and the
    logarithm of how far data narrow the prior (D. J. C. MacKay, *Information Theory, Inference, and Learning
    Algorithms*, Cambridge, 2003, ch. 27).
    """
    singles = [j for j in judged if "+" not in j.name and j.name != OTHER and j.evidence > LEAST_ODDS]
    if not singles:
        return list(judged)
    first = {_effects(j): j for j in judged}
    full = [_in_full(j, evidence, library, compared, {}) for j in singles[:_SINGLES]]
    every = first | {_effects(j): j for j in full}
    for leading in sorted(full, key=lambda j: -j.evidence)[:_LEADING]:
        try:
            partners = beside(leading, evidence, library, compared)
        except ImpossibleSettings:  # to first order it is what nothing can be
            continue
        for partner, start in partners.items():
            both = frozenset((leading.name, partner))
            pair = first.get(both) or paired(leading, every[frozenset((partner,))], evidence)
            found = _in_full(pair, evidence, library, compared, start)
            # two fits of a pair that end at one mode are one way for it to be there
            every[both] = max(every.get(both, found), found, key=lambda j: j.evidence)
    return sorted(every.values(), key=lambda j: -j.evidence)


def _effects(judged: Judged) -> frozenset[str]:
    return frozenset(judged.name.split("+"))


def _in_full(
    judged: Judged,
    evidence: Evidence,
    library: Mapping[str, Effect],
    compared: Sequence[Compared],
    known: Values,
) -> Judged:
    """Return an explanation where it fits best, begun at settings that are known of some of its effects.

    As it was, where first order fits as well.
    """
    effects = [library[n] for n in judged.name.split("+")]
    trial = compared[0].trial
    start = {e.id: starting(e, evidence, judged.best, judged.estimate.value, trial) for e in effects}
    start |= {i: v for i, v in known.items() if i in start}
    sought = Sought.of(effects, start, trial.simulation)
    try:
        value, seen = descend(
            sought,
            lambda value: _view(compared, effects, sought, value),
            rounds=_ROUNDS,
            settled=_SETTLED,
            worse=0.0,
        )
    except ImpossibleSettings:
        return judged
    scaled = seen.covariance / np.outer(sought.scale, sought.scale)
    narrowed = -0.5 * float(np.linalg.slogdet(scaled)[1])
    weight = 0.5 * (float(evidence.metric[0, 0]) - seen.misfit) - narrowed
    at_first = float(evidence.evidences(judged.best)[0])
    if weight <= at_first:
        return judged
    ways = len(freer(judged.best, evidence) if len(effects) > 1 else variants(effects[0], evidence))
    columns = [evidence.signatures[c - 1] for c in judged.best.columns]
    estimate = judged.estimate
    if columns == [f"{i}:{n}" for i, n in sought.names]:
        estimate = Estimate(value - sought.centre, seen.covariance, weight, estimate.detectability)
    return replace(
        judged,
        evidence=_averaged(judged.evidence, at_first, weight, ways),
        estimate=estimate,
        settings=settings_of(sought.names, value),
    )


def _averaged(whole: float, before: float, after: float, ways: int) -> float:
    """Return the evidence of an explanation, the mean over its ways, once that of one of them has changed."""
    others = np.log(max(-np.expm1(before - np.log(ways) - whole), 1e-300))
    return float(np.logaddexp(whole + others, after - np.log(ways)))


def _view(compared: Sequence[Compared], effects: Sequence[Effect], sought: Sought, value: Array) -> View:
    """Return how badly data and prior agree with settings, and where they agree best to first order.

    All by what the injected signals made: an effect that scales what was measured, as another mass does,
    scales the noise in it too, and would be the better the less it leaves of that.
    """
    names, scale = sought.names, sought.scale
    taken = []
    for c in compared:
        made, columns = departures(c, effects, names, value, scale)
        taken.append((np.zeros(()), {CHANGE: made, **columns}))
    sources = {CHANGE: sources_of_all(effects, compared[0])}
    metric = evidence_of(compared, changes=taken, sources=sources, null=False).metric
    at = slice(2, 2 + len(names))
    off = (value - sought.centre) / scale
    misfit = float(metric[0, 0] - 2 * metric[0, 1] + metric[1, 1] + off @ off)
    covariance = np.asarray(np.linalg.inv(metric[at, at] + np.diag(1 / scale**2)), dtype=float)
    return View(misfit, covariance @ (metric[at, 0] - metric[at, 1] - off / scale), covariance)
