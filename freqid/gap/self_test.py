"""The diagnosis tried where the truth is known: each effect put into the user's own simulation and flights.

Everything downstream of an insertion is linear in a whitened metric, so an insertion is replayed once and
its inner products serve all draws of noise and tolerances. The draws are those of the null, and the judgement
is the diagnosis's own.

References
----------
S. R. Cook, A. Gelman, D. B. Rubin, "Validation of software for Bayesian models using posterior quantiles",
Journal of Computational and Graphical Statistics 15, 2006 (a method tried on data that its own model draws).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError
from freqid.core.gap_self_test import SEVERAL, Rate, SelfTest
from freqid.gap.answers import Answers, Teller, stratum
from freqid.gap.attribute import NONE, OTHER, Judged, critical, existence, variants
from freqid.gap.calibrate import Table
from freqid.gap.compare import Compared
from freqid.gap.evidence import Evidence, Hypothesis
from freqid.gap.fit_table import KnownCases, cross_fitted, fit_table
from freqid.gap.inserted import Inserted, Place, insert, places
from freqid.gap.reach import explanations, first_order_size, reach
from freqid.gap.weighed_draws import Weighed, weigh
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]

STRATA = (15.0, 50.0, 200.0)
FITTED = ("temperature", "other", "none")
"""What insertions can settle; of truths with another formula they know only what they are told."""

SOURCE = "self-test"

_FOLDS = 2
_OUTSIDE = 0.25  # weight of effects beyond the library beside those within it, as in the prior
_NEAR = (0.5, 2.0)  # of a stratum's detectability, from which an insertion is scaled to it
_MOST = 4000  # cases of each kind that a calibration is fitted to


@dataclass(frozen=True, eq=False)
class Tested:
    """A self-test, and the calibration that it gives.

    Attributes
    ----------
    result : SelfTest
    table : Table
    """

    result: SelfTest
    table: Table


def self_test(
    compared: Sequence[Compared],
    evidence: Evidence,
    judged: Sequence[Judged],
    library: Mapping[str, Effect],
    base: Table,
    level: float,
    *,
    seed: int = 0,
    tell: Callable[[str], None] = lambda _: None,
) -> Tested:
    """Try a diagnosis on each of its effects, inserted along the flown trajectories.

    Parameters
    ----------
    compared : sequence of Compared
    evidence : Evidence
        Of these manoeuvres; its null draws are what effects are added to.
    judged : sequence of Judged
    library : dict of Effect
        With the parameters that they have on the vehicle.
    base : Table
        From which the calibration is fitted; its form error is that of the insertions.
    level : float
        At which a gap is called.
    seed : int
    tell : callable, optional
        Called with what is being done.

    Raises
    ------
    DataError
        Where no effect can be inserted.
    """
    tell("inserting effects")
    known = {j.name: library[j.name] for j in judged if j.name in library}
    told = [evidence.signatures[j.best.columns[0] - 1] for j in judged if j.name in known]
    where = places(known, evidence, compared, told)
    inserted = insert(known, compared, evidence, where, STRATA, seed)
    if not inserted.insertions:
        raise DataError("no effect can be inserted into these manoeuvres, so there is no self-test")
    threshold = critical(existence(judged)[1], level)
    tell("weighing insertions")
    first_order = _first_order(evidence, known, where, threshold)
    found = reach(inserted.evidence, known, inserted.insertions, threshold, first_order)
    weighed = [
        weigh(inserted.evidence, known, _near(inserted, goal), goal, base.form_error, seed) for goal in STRATA
    ]
    null = weigh(evidence, known, (), 0.0, 0.0, seed)
    tell("calibrating")
    cases = _together([*weighed, null], threshold)
    folds = cross_fitted(cases[0], base, fold=cases[1], fitted=FITTED)
    table = fit_table(cases[0], base, fitted=FITTED, source=SOURCE)
    teller = Teller(inserted.evidence, known)
    answers = [teller.answers(w, threshold, folds, w.draw % _FOLDS) for w in weighed]
    result = SelfTest(
        draws=len(evidence.null),
        level=level,
        form_error=base.form_error,
        reach=tuple(found),
        strata=tuple(stratum(g, w, a) for g, w, a in zip(STRATA, weighed, answers, strict=True)),
        false_alarm=_false_alarm(existence(judged)[1], level),
        outside=_outside(teller, weighed, threshold, folds),
        table={n: getattr(table, n) for n in (*FITTED, "form_error", "set_level", "uncalled_set_level")},
        score={"before": _score(cases, [base] * _FOLDS), "after": _score(cases, folds)},
        not_inserted=_left(known, inserted),
    )
    return Tested(result, table)


def _near(inserted: Inserted, goal: float) -> list:
    """Return for each place the insertion that is nearest to a detectability, where one is near enough."""
    best = {}
    for one in inserted.insertions:
        ratio = one.detectability / goal
        if _NEAR[0] < ratio < _NEAR[1]:
            before = best.get(one.place)
            if before is None or abs(np.log(ratio)) < abs(np.log(before.detectability / goal)):
                best[one.place] = one
    return list(best.values())


def _first_order(
    evidence: Evidence, library: Mapping[str, Effect], where: Sequence[Place], threshold: float
) -> dict[str, float]:
    """Return by column of a signature the size that the formula states."""
    options = explanations(evidence, library)
    found = {}
    for place in where:
        alone = Hypothesis(place.effect, (evidence.column(place.column),), (place.expected,))
        count = len(variants(library[place.effect], evidence))
        found[place.column] = first_order_size(evidence, alone, threshold, len(options), count)
    return found


def _together(weighed: Sequence[Weighed], threshold: float) -> tuple[KnownCases, NDArray[np.intp]]:
    """Return cases of one weight for effects within the library, none, and a quarter of it for those beyond.

    With their folds, by draws of noise: cases of one draw are in one fold.
    """
    kinds: dict[str, list[Weighed]] = {"within": [], "none": [], "outside": []}
    for one in weighed:
        if one.truth and one.truth[0] == NONE:
            kinds["none"].append(one)
        elif one.truth:
            kinds["within"].append(one)
            kinds["outside"].append(one.outside())
    parts, folds = [], []
    for kind, group in kinds.items():
        total = sum(len(one.draw) for one in group)
        every = max(1, -(-total // _MOST))
        for one in group:
            cases, count = one.cases(threshold), len(one.draw)
            at = np.arange(0, count, every | 1)  # odd, so that draws of both folds are among them
            share = (_OUTSIDE if kind == "outside" else 1.0) * every / max(total, 1)
            part = cases.only(at)
            parts.append(replace(part, weight=np.full(len(at), share)))
            folds.append(one.draw[at] % _FOLDS)
    pooled = KnownCases(
        parts[0].names,
        *(np.concatenate([getattr(p, n) for p in parts]) for n in ("evidence", "right", "exists", "weight")),
    )
    return pooled, np.concatenate(folds)


def _score(cases: tuple[KnownCases, NDArray[np.intp]], tables: Sequence[Table]) -> float:
    """Return the mean score of cases by the table of their fold."""
    known, fold = cases
    each = [(known.only(fold == k), table) for k, table in enumerate(tables)]
    weight = [float(part.weight.sum()) for part, _ in each]
    return float(np.average([part.score(table) for part, table in each], weights=weight))


def _false_alarm(null: Array, level: float) -> Rate:
    """Return how often draws with nothing inserted are called a gap, each half by the other."""
    half = np.arange(len(null)) % 2 == 0
    return Rate.over(
        bool(x >= critical(null[half != side], level)) for side in (True, False) for x in null[half == side]
    )


def _outside(
    teller: Teller, weighed: Sequence[Weighed], threshold: float, tables: Sequence[Table]
) -> dict[str, Rate]:
    """Return what is answered to effects that the library lacks."""
    told: list[str] = []
    for one in weighed:
        out = one.outside()
        if out.truth:
            answers: Answers = teller.answers(out, threshold, tables, out.draw % _FOLDS)
            told += answers.answer
    kinds = {OTHER, SEVERAL, NONE}
    return {"named": Rate.over(a not in kinds for a in told)} | {
        kind: Rate.over(a == kind for a in told) for kind in (OTHER, SEVERAL, NONE)
    }


def _left(library: Mapping[str, Effect], inserted: Inserted) -> dict[str, str]:
    """Return why effects were not inserted."""
    there = {one.place.effect for one in inserted.insertions}
    why = "no size within its range changes these manoeuvres"
    return {n: inserted.failed.get(n, why) for n in library if n not in there}
