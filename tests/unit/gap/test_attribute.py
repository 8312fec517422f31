"""Explanations weighed on made-up columns, where it is known which of them made the data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import effect
from scipy.stats import kstest

from freqid.gap.attribute import (
    NONE,
    OTHER,
    existence,
    freer,
    judge,
    p_value,
    paired,
    prior,
    with_the_unexplained,
)
from freqid.gap.calibrate import Table, aliases, filled, pair_called, probabilities, which
from freqid.gap.gather import gather

ROWS, DRAWS = 400, 300
LIBRARY = {n: effect(n, "size", 1.0) for n in ("a", "b", "c", "twin", "d", "e")}
TOLERANCES = ("derivatives:M:q", "derivatives:M:de", "dynamics:de:time")


def columns(seed=0):
    rng = np.random.default_rng(seed)
    found = {f"{n}:size": rng.standard_normal(ROWS) / np.sqrt(ROWS) for n in LIBRARY}
    found["twin:size"] = found["c:size"] + 0.01 * found["twin:size"]
    for name in TOLERANCES:
        found[name] = rng.standard_normal(ROWS) / np.sqrt(ROWS)
    return found


def evidence_of(*flights, seed=1):
    """Return the evidence of flights in which columns have sizes, of length one for each of them."""
    rng, white = np.random.default_rng(seed), []
    for k, sizes in enumerate(flights):
        made = columns(k)
        data = rng.standard_normal(ROWS) + sum(size * made[name] for name, size in sizes.items())
        of = {n: 10 * x if n in ("a:size", "b:size") else x for n, x in made.items()}
        white.append(of | {"data": data, "draws": rng.standard_normal((DRAWS, ROWS))})
    names = [f"{n}:size" for n in LIBRARY]
    nothing = (np.zeros(len(names) + len(TOLERANCES)), np.zeros(0))
    count = len(flights)
    return gather(white, [np.zeros((0, ROWS))] * count, names, TOLERANCES, [nothing] * count, DRAWS, 2)


def judged(sizes, seed=1):
    return judge(evidence_of(sizes, seed=seed), LIBRARY)


@pytest.mark.parametrize("name", ["a", "b", "d", "e"])
def test_one_effect_is_found_by_itself(name):
    found = judged({f"{name}:size": 12.0})
    assert next(j for j in found if "+" not in j.name).name == name
    statistic, null = existence(found)
    assert p_value(statistic, null) < 1e-3
    scale = 10.0 if name in "ab" else 1.0
    one = next(j for j in found if j.name == name)
    if scale == 10.0:  # the prior of one is wide beside what the data say
        assert one.estimate.value[0] == pytest.approx(1.2, abs=0.4)


def test_two_effects_are_found_together():
    found = judged({"a:size": 14.0, "b:size": -12.0})
    assert set(found[0].name.split("+")) == {"a", "b"}
    chosen = which(found, evidence_of({"a:size": 14.0, "b:size": -12.0}), LIBRARY, {}, True, 0.9)
    assert set(chosen.pair) == {"a", "b"}


def test_one_effect_is_no_pair():
    sizes = {"a:size": 14.0}
    assert which(judged(sizes), evidence_of(sizes), LIBRARY, {}, True, 0.9).pair == ()


@pytest.mark.parametrize(("count", "alone"), [(25, 20.0), (5, 20.0), (25, 400.0)])
def test_a_pair_is_called_at_twenty_to_one_and_where_it_says_a_tenth_more(count, alone):
    """All pairs share exp(-3) of what all singles have, by counting."""
    singles = {f"s{i}": alone - i for i in range(count)}
    before = (np.exp(-3.0) / (count * (count - 1) / 2)) / (1 / count)
    for overlap in (1.0, 0.3):
        least = max(np.log(20 / before), 0.1 * overlap * alone)
        called = [pair_called(singles | {"s0+s1": alone + least + x}, Table(), overlap) for x in (-0.1, 0.1)]
        assert called == [(), ("s0", "s1")]


def test_a_pair_is_not_called_where_it_is_likelier_that_no_effect_explains_it():
    singles = {f"s{i}": 20.0 - i for i in range(25)}
    before = (np.exp(-3.0) / 300) / 0.25  # *other* has a quarter of what all singles have together
    for x, called in ((-0.1, ()), (0.1, ("s0", "s1"))):
        said = singles | {OTHER: 30.0, "s0+s1": 30.0 + np.log(20 / before) + x}
        assert pair_called(said, Table()) == called


def test_what_moves_derivatives_as_no_candidate_does_is_other():
    found = judged({"derivatives:M:q": 25.0, "derivatives:M:de": -30.0})
    assert found[0].name == OTHER
    assert next(iter(probabilities(found, Table(), True))) == OTHER


@pytest.mark.parametrize("sizes", [{"a:size": 120.0}, {"a:size": 90.0, "b:size": -80.0}])
def test_what_one_effect_or_two_explain_is_not_other(sizes):
    evidence = evidence_of(sizes)
    first = judge(evidence, LIBRARY)
    full = with_the_unexplained(first, evidence)
    assert [(j.name, j.evidence) for j in full] == [(j.name, j.evidence) for j in first]


def test_a_part_of_what_is_plain_is_no_name_for_it():
    evidence = evidence_of({"a:size": 40.0})
    gram = evidence.gram.copy()
    gram[0, 0, 0] += 120.0**2  # of a direction that no column has
    evidence = replace(evidence, gram=gram)
    first = judge(evidence, LIBRARY)
    assert next(j for j in first if j.name == "a").evidence > 100
    assert next(iter(probabilities(first, Table(), True))) == "a"
    full = with_the_unexplained(first, evidence)
    assert next(iter(probabilities(full, Table(), True))) == OTHER


def test_without_a_gap_no_gap_is_said():
    p = [p_value(*existence(judged({}, seed=s))) for s in range(60)]
    assert kstest(p, "uniform").pvalue > 1e-3
    assert sum(x < 0.02 for x in p) <= 5  # of 60 at 2 %: more has a probability of 1e-3


def test_tolerances_within_two_sigma_are_no_gap():
    p = p_value(*existence(judged({"derivatives:M:q": 2.0, "derivatives:M:de": -1.5})))
    assert p > 0.02


def test_p_of_draws_is_uniform():
    rng = np.random.default_rng(3)
    p = [p_value(float(rng.gumbel()), rng.gumbel(size=200)) for _ in range(1000)]
    assert kstest(p, "uniform").statistic < 1.95 / np.sqrt(1000) + 1 / 201


def test_p_falls_without_a_jump_into_the_tail_of_draws():
    null = np.sort(np.random.default_rng(4).exponential(size=300))
    at = np.linspace(0, 15, 600)
    p = np.array([p_value(float(x), null) for x in at])
    assert (np.diff(p) <= 1e-12).all()
    assert (p[1:] / p[:-1]).min() > 0.7
    far = at > 7
    assert (np.log(p[far]) / -at[far] > 0.4).all()  # exp(-x), or a heavier tail, never a lighter one by far
    assert (np.log(p[far]) / -at[far] < 1.6).all()


def test_singles_have_together_as_much_as_none_beforehand():
    count = 27
    assert count * np.exp(prior("any", count)) == pytest.approx(1.0)
    pairs = count * (count - 1) / 2
    assert pairs * np.exp(prior("a+b", count)) == pytest.approx(np.exp(-3.0))
    assert np.exp(prior(OTHER, count)) == pytest.approx(0.25)


def test_a_pair_is_as_free_as_its_effects_are_alone():
    """Two effects, each of another size in each flight: of one size they explain much less."""
    flights = {"a:size": 14.0, "c:size": 2.0}, {"a:size": 4.0, "c:size": 14.0}
    plain = evidence_of(*flights)
    apart = plain.by_maneuver([f"{n}:size" for n in LIBRARY])
    a, c = (next(j for j in judge(apart, LIBRARY) if j.name == n) for n in "ac")
    both = paired(a, c, apart)
    ways = freer(both.best, apart)
    assert [len(way.columns) for way in ways] == [2, 4, 4, 6]
    assert ways[0] == both.best
    assert ways[-1].scale == (1.0, 0.5, 0.5) * 2
    each = [float(apart.evidences(way)[0]) for way in ways]
    assert both.evidence == pytest.approx(np.logaddexp.reduce(each) - np.log(4))
    assert both.evidence > paired(a, c, plain).evidence + 10
    assert freer(both.best, plain) == (both.best,)


@pytest.mark.parametrize("exists", [True, False])
@pytest.mark.parametrize("sizes", [{}, {"a:size": 12.0}, {"c:size": 400.0}])
def test_probabilities_sum_to_one(sizes, exists):
    found = probabilities(judged(sizes), Table(), exists)
    assert sum(found.values()) == pytest.approx(1.0)
    assert list(found.values()) == sorted(found.values(), reverse=True)
    assert set(found) == {*LIBRARY, OTHER, NONE}
    if not exists:
        assert found[NONE] > 0.5
        assert next(iter(found)) == NONE


def test_a_gap_that_is_nearly_called_is_likelier_than_one_of_which_nothing_shows():
    table = Table(missed=-1.0, missed_slope=0.5)
    found = [judged({}), judged({"a:size": 3.0}), judged({"c:size": 400.0})]
    none = [probabilities(j, table, False)[NONE] for j in found]
    odds = -1.0 + 0.5 * np.array([existence(j)[0] for j in found])
    assert odds[0] < odds[1] < 0 < odds[2]
    assert none[:2] == pytest.approx(1 / (1 + np.exp(odds[:2])))
    assert none[2] == pytest.approx(0.51)  # what the verdict says stays the likeliest


def test_a_large_gap_is_not_judged_to_the_last_unit_of_evidence():
    """With a form error of 15 % evidence of thousands counts as that of tens."""
    found = judged({"a:size": 100.0, "b:size": 95.0})
    singles = {j.name: j.evidence for j in found if "+" not in j.name}
    assert singles["a"] - singles["b"] > 100
    plain, soft = (probabilities(found, Table(form_error=e), True) for e in (0.0, 0.15))
    assert plain["a"] > 1 - 1e-12
    assert soft["a"] < 1 - 1e-6
    difference = (singles["a"] - singles["b"]) / (1 + 0.15**2 * singles["a"])
    assert np.log(soft["a"] / soft["b"]) == pytest.approx(difference)


def test_a_set_is_filled_to_its_level_and_no_further():
    chances = {"a": 0.1, "b": 0.55, "c": 0.05, "d": 0.3}
    assert filled(chances, 0.5) == ("b",)
    assert filled(chances, 0.9) == ("b", "d", "a")
    assert filled(chances, 1.0) == ("b", "d", "a", "c")


def test_two_effects_that_make_the_same_are_given_as_one_group():
    sizes = {"c:size": 12.0}
    evidence = evidence_of(sizes)
    found = judge(evidence, LIBRARY)
    assert aliases(found, evidence, ["c", "twin"]) == (("c", "twin"),)
    chosen = which(found, evidence, LIBRARY, {"x": "needs y"}, True, 0.9)
    assert ("c", "twin") in chosen.aliases
    assert {"c", "twin"} <= set(chosen.set)
    assert chosen.not_tested == {"x": "needs y"}
    interval = chosen.parameters["c"]["size"]
    assert interval.lo < interval.estimate < interval.hi
