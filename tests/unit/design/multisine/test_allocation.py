import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from freqid.core.errors import UsageError
from freqid.design.multisine import allocation
from freqid.design.multisine.allocation import check_sets, interleave, limits_from_db, lines_in_band, search
from freqid.design.multisine.phases import lowest_peaks

LINES = np.arange(3, 109)


def disjoint(sets):
    every = np.concatenate(sets)
    return np.unique(every).size == every.size


def test_the_band_of_the_la8_holds_106_harmonics():
    np.testing.assert_array_equal(lines_in_band(60.0, (0.05, 1.8)), LINES)


def test_a_band_between_harmonics_is_refused():
    with pytest.raises(UsageError, match="holds no harmonic"):
        lines_in_band(10.0, (0.11, 0.19))


@given(st.integers(1, 30), st.integers(0, 5), st.integers(30, 200))
def test_combs_share_nothing_and_leave_out_only_the_empty_ones(effectors, empty, count):
    lines = np.arange(7, 7 + count)
    sets = interleave(lines, effectors, empty=empty)
    assert len(sets) == effectors
    assert disjoint(sets)
    left = np.setdiff1d(lines, np.concatenate(sets))
    assert np.all((left - 7) % (effectors + empty) >= effectors)


def test_too_few_harmonics_are_refused_with_the_period_that_would_do():
    with pytest.raises(UsageError, match=r"3 harmonics are too few for 6 effectors.*2 times"):
        interleave([3, 4, 5], 6)


def test_sets_of_a_user_are_sorted_and_kept():
    sets = check_sets({"de1": [9, 3], "n1": [4]}, LINES)
    np.testing.assert_array_equal(sets[0], [3, 9])
    np.testing.assert_array_equal(sets[1], [4])


@pytest.mark.parametrize(
    ("sets", "message"),
    [
        ({"de1": [3, 9], "n1": [9]}, "de1 and n1 share harmonic 9"),
        ({"de1": [3, 3]}, "de1 and de1 share harmonic 3"),
        ({"de1": [2]}, "nearest one inside is 3"),
        ({"de1": []}, "de1 has no harmonic"),
    ],
)
def test_broken_sets_of_a_user_are_refused(sets, message):
    with pytest.raises(UsageError, match=message):
        check_sets(sets, LINES)


def test_search_keeps_the_rule():
    lines = np.arange(2, 41)
    low = [False, True, False, True, True, False]
    sets = search(lines, low, 28, limits=limits_from_db(3.0), starts=2)
    assert disjoint(sets)
    assert all(s.max() <= 28 for s, is_low in zip(sets, low, strict=True) if is_low)
    assert min(s.size for s in sets) >= 4
    assert np.isin(np.concatenate(sets), lines).all()


def test_search_without_a_rule_beats_the_comb():
    lines, limits = np.arange(3, 40), limits_from_db(3.0)
    found, comb = (
        np.mean(np.log([w.factor for w in lowest_peaks(s, limits=limits, starts=4)]))
        for s in (search(lines, [False] * 5, limits=limits, starts=4), interleave(lines, 5))
    )
    assert found < comb - 0.01


@pytest.mark.slow
def test_a_quick_search_compares_less_and_finds_a_set_of_about_the_same_worth(monkeypatch):
    lines, limits, low = np.arange(3, 60), limits_from_db(3.0), [False] * 4 + [True] * 3
    spent = []
    original = allocation.lowest_peak

    def counted(index, *, starts, sharpest=np.inf, **options):
        spent.append(starts * (1 if sharpest < np.inf else 4))  # the last two rungs are most of a descent
        return original(index, starts=starts, sharpest=sharpest, **options)

    monkeypatch.setattr(allocation, "lowest_peak", counted)
    worth, effort = {}, {}
    for quick in (False, True):
        spent.clear()
        sets = search(lines, low, 45, limits=limits, quick=quick)
        assert disjoint(sets)
        assert all(s.max() <= 45 for s, is_low in zip(sets, low, strict=True) if is_low)
        effort[quick] = sum(spent)
        worth[quick] = np.mean(np.log([w.factor for w in lowest_peaks(sets, limits=limits, starts=4)]))
    assert worth[True] < worth[False] + 0.02
    assert effort[True] < effort[False] / 6


@settings(max_examples=5, deadline=None)
@given(st.integers(1, 2), st.integers(0, 2), st.integers(12, 20), st.integers(0, 3))
def test_whatever_is_searched_is_disjoint(rests, lows, top, holes):
    lines = np.delete(np.arange(1, top + 1), np.arange(5, 5 + holes))
    sets = search(lines, [False] * rests + [True] * lows, top - 2, starts=1)
    assert len(sets) == rests + lows
    assert disjoint(sets)
    assert np.isin(np.concatenate(sets), lines).all()


def test_low_effectors_need_a_ceiling():
    with pytest.raises(UsageError, match="no ceiling"):
        search(LINES, [True, False])


def test_a_ceiling_that_is_too_low_is_refused():
    with pytest.raises(UsageError, match="raise the ceiling"):
        search(LINES, [True] * 8 + [False] * 10, 20)
