"""Tables fitted to cases that a known rule made, and sets counted one by one."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.gap.attribute import NONE, OTHER
from freqid.gap.calibrate import Table, filled
from freqid.gap.fit_table import KnownCases, cross_fitted, fit_table

NAMES = ("a", "b", "c", "d", OTHER)
PLAIN = Table(form_error=0.02)


def made(count, temperature=1.0, other=0.0, seed=0):
    """Return cases whose truths are drawn from the very probabilities that a table would give."""
    rng = np.random.default_rng(seed)
    evidence = rng.normal(3.0, 4.0, (count, len(NAMES)))
    logs = evidence / temperature
    logs[:, :4] -= np.log(5)
    logs[:, 4] += other - np.log(4)
    logs = np.concatenate([logs, np.zeros((count, 1))], axis=1)
    chances = np.exp(logs) / np.exp(logs).sum(axis=1, keepdims=True)
    truth = np.array([rng.choice(6, p=p) for p in chances])
    return KnownCases(NAMES, evidence, np.eye(6, dtype=bool)[truth], np.ones(count, bool), np.ones(count))


def test_the_rule_that_made_the_cases_is_found_again():
    cases = made(4000, temperature=3.0, other=1.5)
    found = fit_table(cases, PLAIN, fitted=("temperature", "other", "none"))
    assert found.temperature == pytest.approx(3.0, rel=0.15)
    assert found.other == pytest.approx(1.5, abs=0.3)
    assert found.none == pytest.approx(0.0, abs=0.3)
    assert found.calibrated
    assert found.form_error == PLAIN.form_error


def test_the_score_on_new_cases_is_better_than_before_and_near_the_best():
    new = made(4000, temperature=3.0, other=1.5, seed=1)
    found = fit_table(made(600, temperature=3.0, other=1.5), PLAIN, fitted=("temperature", "other", "none"))
    best = new.score(Table(form_error=0.0, temperature=3.0, other=1.5))
    assert new.score(PLAIN) > best + 0.02
    assert new.score(found) < best + 0.002


@pytest.mark.parametrize("coverage", [0.8, 0.9])
def test_sets_hold_the_truth_of_new_cases_as_often_as_stated(coverage):
    found = fit_table(made(800, temperature=3.0), PLAIN, fitted=("temperature",), coverage=coverage)
    new = made(3000, temperature=3.0, seed=5)
    held = 0
    for each, right in zip(new.chances(found), new.right, strict=True):
        chances = dict(zip((*NAMES, NONE), each.tolist(), strict=True))
        held += (*NAMES, NONE)[int(right.argmax())] in filled(chances, found.set_level)
    # a set ends with a whole name, so it may hold the truth somewhat more often
    assert coverage - 0.03 < held / 3000 < coverage + 0.06


def test_what_stands_above_the_truth_is_counted_as_by_hand():
    cases = KnownCases.of(
        [{"a": 5.0, "b": 3.0, OTHER: -9.0}, {"a": 5.0, "b": 3.0, OTHER: -9.0}, {"a": 1.0, OTHER: 0.0}],
        ["b", ("b", "a"), NONE],
        [True, True, True],
    )
    table = Table(form_error=0.0)
    each = cases.chances(table)
    assert each.sum(axis=1) == pytest.approx(1.0)
    assert each[2, cases.names.index("b")] == 0.0  # was not judged
    by_hand = np.exp([5.0 - np.log(3), 3.0 - np.log(3), -9.0 - np.log(4), 0.0])
    assert each[0] == pytest.approx(by_hand / by_hand.sum())
    above = cases.before(table)
    assert above[0] == pytest.approx(each[0, 0])
    assert above[1] == 0.0
    first = np.exp([1.0 - np.log(2), -np.log(4), 0.0])
    assert above[2] == pytest.approx(first[0] / first.sum())
    a, b, rest = each[0, 0], each[0, 1], (each[0, 2:] ** 2).sum()
    first_case = (1 - b) ** 2 + a**2 + rest
    second = (1 - a - b) ** 2 + rest  # either name is right
    third = (1 - each[2, -1]) ** 2 + (each[2, :-1] ** 2).sum()
    assert cases.score(table) == pytest.approx(np.mean([first_case, second, third]))


def test_a_truth_that_is_in_no_set_asks_for_all_of_it():
    cases = KnownCases.of([{"a": 5.0, OTHER: 0.0}] * 20, ["missing"] * 20, [True] * 20)
    assert fit_table(cases, PLAIN, fitted=()).set_level == 1.0


def test_weights_count_as_repetitions():
    cases = made(300, temperature=2.0, seed=3)
    twice = cases.only(np.repeat(np.arange(300), np.where(np.arange(300) < 100, 3, 1)))
    heavy = KnownCases(
        cases.names, cases.evidence, cases.right, cases.exists, np.where(np.arange(300) < 100, 3.0, 1.0)
    )
    table = Table(temperature=1.7)
    assert heavy.score(table) == pytest.approx(twice.score(table))


def test_a_fold_is_judged_by_a_table_that_has_not_seen_it():
    cases = made(600, seed=4)
    fold = np.arange(600) % 3
    tables = cross_fitted(cases, PLAIN, fold=fold, fitted=("temperature",))
    assert len(tables) == 3
    for k, table in enumerate(tables):
        alone = fit_table(cases.only(fold != k), PLAIN, fitted=("temperature",))
        assert table.temperature == alone.temperature
        assert table.set_level == alone.set_level


def test_without_cases_nothing_is_fitted():
    with pytest.raises(ValueError, match="no case"):
        fit_table(KnownCases.of([], [], []))
    with pytest.raises(ValueError, match="1 cases, 2 truths"):
        KnownCases.of([{"a": 1.0}], ["a", "b"], [True])
