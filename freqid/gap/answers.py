"""What the diagnosis answers in draws of the null to which effects were added."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from freqid.core.gap_self_test import SEVERAL, Rate, Stratum
from freqid.gap.attribute import NONE, OTHER
from freqid.gap.calibrate import CONSIDERED, Table, filled, joined
from freqid.gap.calibrate import named as named_of
from freqid.gap.evidence import Evidence
from freqid.gap.reach import explanations
from freqid.gap.weighed_draws import Flags, Numbers, Weighed
from freqid.simulate.effects.effect import Effect


@dataclass(frozen=True, eq=False)
class Answers:
    """Answers, case by case.

    Attributes
    ----------
    answer : tuple of str
    detected, named, right, covered : ndarray of bool, shape (case,)
        As in `core.gap_self_test.Stratum`.
    """

    answer: tuple[str, ...]
    detected: Flags
    named: Flags
    right: Flags
    covered: Flags


class Teller:
    """Says what the diagnosis would say, and remembers how much alike two variants are.

    Parameters
    ----------
    evidence : Evidence
    library : dict of Effect
    """

    def __init__(self, evidence: Evidence, library: Mapping[str, Effect]) -> None:
        self._evidence = evidence
        self._options = explanations(evidence, library)
        self._known: dict[tuple[str, int, str, int], float] = {}

    def answers(self, weighed: Weighed, threshold: float, tables: Sequence[Table], fold: Numbers) -> Answers:
        """Return what is answered in each case, with the table of the case's fold."""
        cases = weighed.cases(threshold)
        told, named, right, covered = [], [], [], []
        by_table = [cases.chances(table) for table in tables]
        for i, truth in enumerate(weighed.truth):
            table = tables[fold[i]]
            chances = dict(zip((*weighed.names, NONE), by_table[fold[i]][i].tolist(), strict=True))
            called = bool(cases.exists[i])
            names = filled(chances, table.level(called))
            good = {n for n, yes in zip((*weighed.names, NONE), cases.right[i], strict=True) if yes}
            covered.append(bool(good & set(names)))
            group = self._group(names[0], weighed, i, chances)
            one = called and bool(named_of(chances, (tuple(group),)))
            named.append(one)
            right.append(one and bool(good & group))
            if one:
                told.append(truth if right[-1] and truth not in (NONE, OTHER) else names[0])
            elif not called or names[0] == NONE:
                told.append(NONE)
            else:
                told.append(OTHER if names[0] == OTHER else SEVERAL)
        return Answers(tuple(told), cases.exists, *(np.array(x, dtype=bool) for x in (named, right, covered)))

    def _group(self, first: str, weighed: Weighed, case: int, chances: Mapping[str, float]) -> set[str]:
        """Return the names that the likeliest is given together with."""
        considered = [n for n, p in chances.items() if p > CONSIDERED and n not in (NONE, OTHER)]
        if first not in considered:
            return {first}

        def apart(a: str, b: str) -> float:
            i, j = weighed.names.index(a), weighed.names.index(b)
            size = max(weighed.size[case, i], weighed.size[case, j])
            return size * (1 - self._alignment(a, int(weighed.best[case, i]), b, int(weighed.best[case, j])))

        return next((set(g) for g in joined(considered, apart) if first in g), {first})

    def _alignment(self, a: str, i: int, b: str, j: int) -> float:
        key = (a, i, b, j)
        if key not in self._known:
            self._known[key] = self._evidence.alignment(self._options[a][i], self._options[b][j])
        return self._known[key]


def stratum(detectability: float, weighed: Weighed, answers: Answers) -> Stratum:
    """Return the answers counted."""
    counts: dict[str, dict[str, int]] = {}
    for truth, answer in zip(weighed.truth, answers.answer, strict=True):
        row = counts.setdefault(truth, {})
        row[answer] = row.get(answer, 0) + 1
    return Stratum(
        detectability=detectability,
        answers=counts,
        detected=Rate.over(answers.detected),
        named=Rate.over(answers.named[answers.detected]),
        right=Rate.over(answers.right[answers.named]),
        covered=Rate.over(answers.covered[answers.detected]),
    )
