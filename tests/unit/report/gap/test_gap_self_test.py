"""What is told of a self-test: on the page, on the terminal, and through JSON."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest
from made_up_gap import made_up

from freqid.cli.self_test_text import self_test_text
from freqid.core.results.diagnosis import GapDiagnosis
from freqid.core.results.gap_self_test import (
    Rate,
    Reliability,
    ReliabilityBin,
    SelfTest,
    SmallestSize,
    Stratum,
)
from freqid.report.gap.page import build_gap_page, confusions, gap_summary


def rate(count, of):
    return Rate.over(k < count for k in range(of))


@pytest.fixture(scope="module")
def tested():
    weak = {"mass": {"none": 97, "mass": 3}, "lag": {"none": 98, "several": 2}}
    strong = {"mass": {"mass": 90, "lag": 6, "none": 4}, "lag": {"lag": 70, "other": 20, "several": 10}}
    strata = (
        Stratum(15.0, weak, rate(5, 200), rate(3, 5), rate(3, 3), rate(5, 5), 0.61),
        Stratum(50.0, strong, rate(196, 200), rate(166, 196), rate(160, 166), rate(188, 196), 0.84),
    )
    bins = (
        ReliabilityBin(0.0, 0.75, 0.6, rate(20, 36)),
        ReliabilityBin(0.75, 0.9, math.nan, rate(0, 0)),
        ReliabilityBin(0.9, 1.0, 0.95, rate(150, 165)),
    )
    return SelfTest(
        draws=100,
        level=0.02,
        form_error=0.05,
        smallest=(
            SmallestSize("mass", "", "1", 0.13, 31.0, 0.3),
            SmallestSize("lag", "de1", "s", math.nan, math.nan, 0.04),
        ),
        strata=strata,
        false_alarm=rate(2, 100),
        false_name=rate(1, 100),
        outside={
            "named": rate(8, 100),
            "other": rate(60, 100),
            "several": rate(12, 100),
            "none": rate(20, 100),
        },
        reliability=Reliability(0.92, rate(170, 201), 0.02, 6, bins),
        not_inserted={"inertia": "no such vehicle"},
    )


def test_the_matrix_is_drawn_with_its_numbers_where_anything_is_found(tested):
    (picture,) = confusions(tested)
    assert "detectability of 50" in picture.caption
    for text in ("mass", "lag", "other", "several", "no gap", "90", "70"):
        assert text in picture.svg
    page = build_gap_page(with_test(tested))
    assert page.count("<svg") == build_gap_page(made_up()).count("<svg") + 1
    assert page.index("<h2>How far") < page.index("<h2>Self-test") < page.index("<h2>Residual spectra")
    for words in (
        "98 % (",
        "none within its range",
        "no such vehicle",
        "8 % (",
        "the probabilities are too high by 0.07",
        "<td>0.84</td>",
    ):
        assert words in page, words


def with_test(test):
    made = made_up()
    return replace(made, diagnosis=replace(made.diagnosis, self_test=test))


def test_without_a_self_test_the_page_says_nothing_of_one():
    assert gap_summary(None) is None
    assert confusions(None) == []
    assert "Self-test" not in build_gap_page(made_up())


def test_shares_of_a_row_sum_to_one_and_what_is_no_effect_comes_last(tested):
    rows, columns, shares = tested.strata[1].shares()
    assert rows == ["mass", "lag"]
    assert columns == ["mass", "lag", "other", "several", "none"]
    assert shares == [[0.9, 0.06, 0.0, 0.0, 0.04], [0.0, 0.7, 0.2, 0.1, 0.0]]


def test_a_self_test_survives_json(tested):
    d = with_test(tested).diagnosis
    again = GapDiagnosis.from_json(json.loads(json.dumps(d.to_json(), allow_nan=False)))
    assert again.self_test is not None
    assert math.isnan(again.self_test.smallest[1].size)
    assert math.isnan(again.self_test.reliability.bins[1].probability)
    plain = replace(tested.reliability, bins=())
    again_plain = replace(again.self_test.reliability, bins=())
    assert again_plain == plain
    assert replace(again.self_test, smallest=(), reliability=plain) == replace(
        tested, smallest=(), reliability=plain
    )
    assert again.self_test.smallest[0] == tested.smallest[0]
    assert "self_test" not in made_up().diagnosis.to_json()


def test_the_terminal_shows_sizes_and_what_is_answered_instead(tested):
    text = self_test_text(tested)
    mass, lag = (next(x for x in text.splitlines() if x.strip().startswith(n)) for n in ("mass", "lag"))
    assert "0.13" in mass
    assert "90 %" in mass
    assert "lag 6 %" in mass
    assert "no gap" not in mass  # 4 % is not listed
    assert "none in range" in lag
    assert "other 20 %, several names 10 %" in lag
    assert "not inserted: inertia (no such vehicle)" in text
    assert "2 % (1-7)" in text
    assert "too high by 0.07" in text


def test_probabilities_hold_within_counting_error_or_the_accuracy_that_is_meant():
    right, one = rate(170, 200), 0.01
    assert Reliability(0.86, right, one, 6).holds
    assert "within counting error" in Reliability(0.86, right, one, 6).sentence()
    slightly = Reliability(0.89, right, one, 6)
    assert slightly.holds
    assert "too high by 0.04" in slightly.sentence()
    assert not Reliability(0.92, right, one, 6).holds
    assert not Reliability(0.85, right, one, 1).holds  # one insertion says nothing
    assert "too low" in Reliability(0.7, right, one, 6).sentence()
    assert "nothing is known" in Reliability(math.nan, rate(0, 0), math.nan, 0).sentence()
