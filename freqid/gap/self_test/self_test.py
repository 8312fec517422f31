"""The diagnosis tried where the truth is known: each effect in one's own simulation along one's flights.

References
----------
S. R. Cook, A. Gelman, D. B. Rubin, "Validation of software for Bayesian models using posterior quantiles",
Journal of Computational and Graphical Statistics 15, 2006 (a method tried on data that its own model draws).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError
from freqid.core.results.diagnosis import GapDiagnosis
from freqid.core.results.gap_self_test import (
    ENDS,
    SEVERAL,
    Rate,
    Reliability,
    ReliabilityBin,
    SelfTest,
    SmallestSize,
    Stratum,
)
from freqid.gap.diagnose import Findings
from freqid.gap.infer.evidence import NONE
from freqid.gap.infer.null_draws import Drawn, threshold_of
from freqid.gap.model.candidate import OTHER
from freqid.gap.self_test.answers import Answer, DrawnData, Weighed, answers
from freqid.gap.self_test.insertions import Inserted, insert
from freqid.gap.self_test.smallest import smallest_sizes
from freqid.simulate.effects.effect import Effect

DETECTABILITIES = (15.0, 50.0, 200.0)
DRAWS = 100
"""For each inserted effect and detectability, shared by its places."""

_NULL_DRAWS = 500
_BINS = (0.0, 0.5, 0.75, 0.9, 0.97, 1.0)
_SEED = 1  # another than that of the draws which the threshold is from


def self_test(
    findings: Findings,
    library: Mapping[str, Effect],
    *,
    draws: int = DRAWS,
    tell: Callable[[str], None] = lambda _: None,
) -> SelfTest:
    """Try a diagnosis on each of its effects, inserted along the flown trajectories.

    Noise, tolerances and error of form are drawn; an answer is what `infer.which` makes of them, as of the
    records. Three steps of a diagnosis are not taken: columns are not computed again near an estimated
    size, no second effect is looked for, and nothing is closed on manoeuvres that were left out, which may
    withdraw a name.

    Parameters
    ----------
    findings : Findings
        Of the diagnosis.
    library : dict of Effect
        That it asked about.
    draws : int
        For each inserted effect and detectability.
    tell : callable, optional
        Called with what is being done.

    Raises
    ------
    DataError
        Where no effect can be inserted.
    """
    f, evidence = findings, findings.evidence
    tell("inserting effects")
    inserted = insert(evidence, f.blocks, f.columns, library, DETECTABILITIES, _SEED)
    if not inserted.insertions:
        raise DataError("no effect can be inserted into these manoeuvres, so there is no self-test")
    pool = DrawnData.of(evidence, inserted.system, _NULL_DRAWS, _SEED)
    tell("weighing draws with effects")
    nothing = Weighed.of(evidence, pool.data)
    null = answers(nothing, NONE, [-1] * pool.count, f.threshold)
    by_goal: dict[float, list[Answer]] = {goal: [] for goal in DETECTABILITIES}
    outside: list[Answer] = []
    for effect in evidence.weighing.effects:
        if effect == OTHER:
            continue
        lacking = nothing.without(effect) if len(evidence.weighing.effects) > 1 else None
        threshold = threshold_of(lacking.statistics(), f.diagnosis.gap.level) if lacking else np.inf
        for goal in DETECTABILITIES:
            weighed, which = _weighed(findings, inserted, pool, effect, goal, draws)
            if weighed is None:
                continue
            by_goal[goal] += answers(weighed, effect, which, f.threshold)
            if lacking:
                outside += answers(weighed.without(effect), effect, which, threshold)
    tell("looking for the smallest sizes")
    small = smallest_sizes(evidence, pool, f.threshold)
    every = [a for group in by_goal.values() for a in group]
    return SelfTest(
        draws=draws,
        level=f.diagnosis.gap.level,
        form_error=f.diagnosis.gap.form_error,
        smallest=tuple(small),
        strata=tuple(_stratum(goal, group) for goal, group in by_goal.items() if group),
        false_alarm=Rate.over(a.called for a in null),
        false_name=Rate.over(bool(a.named) for a in null),
        outside=_outside(outside),
        reliability=reliability(every),
        not_inserted=inserted.not_inserted,
    )


def with_self_test(diagnosis: GapDiagnosis, test: SelfTest) -> GapDiagnosis:
    """Return a diagnosis that holds its self-test.

    Whether its probabilities are calibrated is the self-test's to say, and the smallest sizes that are found
    are those of the draws, at the most visible place of each effect.
    """
    gap, which = diagnosis.gap, diagnosis.which
    first: dict[str, SmallestSize] = {}
    for one in test.smallest:
        if np.isfinite(one.size):
            first.setdefault(one.effect, one)
    gap = replace(
        gap,
        smallest_detectable=gap.smallest_detectable | {n: s.size for n, s in first.items()},
        unit=gap.unit | {n: s.unit for n, s in first.items()},
    )
    which = replace(which, calibrated=test.calibrated, calibrated_by="self-test")
    return replace(diagnosis, which=which, gap=gap, self_test=test)


def _weighed(
    findings: Findings, inserted: Inserted, pool: DrawnData, effect: str, goal: float, draws: int
) -> tuple[Weighed | None, list[int]]:
    """Return draws with an effect in them, weighed, its places in turn; and the insertion of each."""
    system = findings.evidence.system
    each = [
        k
        for k, i in enumerate(inserted.insertions)
        if i.goal == goal and system.candidates[i.candidate].effect == effect
    ]
    if not each:
        return None, []
    which = [each[d % len(each)] for d in range(draws)]
    at: NDArray[np.intp] = np.arange(draws) % pool.count
    parts = []
    for k in each:
        own = at[[d for d, w in enumerate(which) if w == k]]
        parts.append(pool.with_effect(inserted.insertions[k].weights, own))
    data = {
        f: Drawn(*(np.concatenate(each, axis=-1) for each in zip(*(p[f] for p in parts), strict=True)))
        for f in parts[0]
    }
    return Weighed.of(findings.evidence, data), sorted(which, key=each.index)


def _stratum(goal: float, group: Sequence[Answer]) -> Stratum:
    table: dict[str, dict[str, int]] = {}
    for a in group:
        row = table.setdefault(a.truth, {})
        row[a.word] = row.get(a.word, 0) + 1
    called = [a for a in group if a.called]
    named = [a for a in called if a.named]
    return Stratum(
        goal,
        table,
        Rate.over(a.called for a in group),
        Rate.over(bool(a.named) for a in called),
        Rate.over(a.right for a in named),
        Rate.over(a.covered for a in called),
        float(np.mean([a.truth_probability for a in called])) if called else float("nan"),
    )


def _outside(group: Sequence[Answer]) -> dict[str, Rate]:
    """Return what is answered to effects that the library lacks."""
    words = [a.word for a in group]
    return {"named": Rate.over(w not in ENDS for w in words)} | {
        kind: Rate.over(w == kind for w in words) for kind in (OTHER, SEVERAL, NONE)
    }


def reliability(group: Sequence[Answer]) -> Reliability:
    """Return whether the probabilities of the likeliest effects are how often they are the truth.

    Parameters
    ----------
    group : sequence of Answer
        Of draws with an effect; those that are not called a gap do not count.
    """
    called = [a for a in group if a.called]
    if not called:
        return Reliability(float("nan"), Rate.over(()), float("nan"), 0)
    off: dict[int, list[float]] = {}
    for a in called:
        off.setdefault(a.insertion, []).append(float(a.leading) - a.probability)
    total = sum(map(sum, off.values()))
    mean = total / len(called)
    # sums over insertions, of what is left of the mean: draws of one insertion are alike
    error = float(np.sqrt(sum((sum(x) - mean * len(x)) ** 2 for x in off.values())) / len(called))
    bins = []
    for low, high in pairwise(_BINS):
        own = [a for a in called if low <= a.probability < high or (high == 1.0 and a.probability >= 1.0)]
        given = float(np.mean([a.probability for a in own])) if own else float("nan")
        bins.append(ReliabilityBin(low, high, given, Rate.over(a.leading for a in own)))
    return Reliability(
        probability=float(np.mean([a.probability for a in called])),
        right=Rate.over(a.leading for a in called),
        error=error,
        insertions=len(off),
        bins=tuple(bins),
    )
