"""The whole self-test: what it counts, and that it is the one to say whether probabilities hold."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from freqid.core.results.diagnosis import GapDiagnosis
from freqid.gap.self_test.answers import Answer
from freqid.gap.self_test.self_test import DETECTABILITIES, reliability, self_test, with_self_test


@pytest.fixture(scope="module")
def tested(findings, library):
    lines = []
    test = self_test(findings, library, draws=20, tell=lines.append)
    assert lines[0] == "inserting effects"
    return test


def test_every_effect_is_answered_in_every_stratum(tested, library):
    assert [s.detectability for s in tested.strata] == list(DETECTABILITIES)
    for stratum in tested.strata:
        assert set(stratum.answers) == set(library)
        assert all(sum(row.values()) == 20 for row in stratum.answers.values())
        assert stratum.detected.of == 20 * len(library)
        assert stratum.named.of == stratum.detected.count
        assert stratum.right.of == stratum.named.count
    rates = [s.detected.share for s in tested.strata]
    assert rates == sorted(rates)
    assert rates[-1] == 1.0
    assert tested.strata[-1].right.share > 0.95
    assert tested.strata[-1].truth_probability > 0.85
    assert tested.false_alarm.lo < 0.02  # the level is the most, as the odds have to speak for a gap too
    assert tested.false_name.count <= tested.false_alarm.count
    assert sum(r.count for r in tested.outside.values()) == tested.outside["named"].of


@pytest.mark.slow
def test_of_a_gap_that_was_called_the_columns_are_still_those_of_the_evidence(diagnosed, library):
    """Once it is named, an effect is computed near its size: that is another stack."""
    found = diagnosed(late=("p_dps", "q_dps", "r_dps"), samples=3)
    assert found.diagnosis.which.named == ("time_skew",)
    assert all(len(c.effects) == found.evidence.system.columns for c in found.columns)
    assert found.system is not found.evidence.system
    assert self_test(found, library, draws=5).strata[-1].detected.share == 1.0


def test_the_diagnosis_is_calibrated_only_where_the_self_test_says_so(findings, tested):
    assert tested.calibrated == tested.reliability.holds
    said = with_self_test(findings.diagnosis, tested)
    assert said.which.calibrated == tested.calibrated
    assert said.which.calibrated_by == "self-test"
    off = replace(tested, reliability=replace(tested.reliability, probability=0.5, error=0.01))
    assert not with_self_test(findings.diagnosis, off).which.calibrated
    first = next(s for s in tested.smallest if s.effect == "mass")
    assert said.gap.smallest_detectable["mass"] == first.size
    again = GapDiagnosis.from_json(json.loads(json.dumps(said.to_json(), allow_nan=False)))
    assert again.self_test is not None
    assert again.self_test.strata == tested.strata
    assert again.self_test.calibrated == tested.calibrated


def case(insertion, probability, right):
    return Answer("mass", insertion, True, ("mass",), probability, right, probability, True)


def test_reliability_is_the_mean_probability_beside_the_share_that_was_right():
    group = [case(k % 10, 0.8, k % 5 > 0) for k in range(200)]
    found = reliability([*group, Answer("mass", 3)])  # one that is not called does not count
    assert found.probability == pytest.approx(0.8)
    assert (found.right.count, found.right.of) == (160, 200)
    assert found.insertions == 10
    assert found.off == pytest.approx(0.0)
    (only,) = [b for b in found.bins if b.right.of]
    assert (only.low, only.high) == (0.75, 0.9)


def test_draws_of_one_insertion_are_counted_as_one_where_they_agree():
    """Ten insertions, all of whose draws are right or all wrong, are ten numbers and not two hundred."""
    together = reliability([case(k // 20, 0.6, k // 20 < 5) for k in range(200)])
    apart = reliability([case(k, 0.6, k < 100) for k in range(200)])
    assert together.error == pytest.approx(0.5 / 10**0.5, rel=1e-6)
    assert apart.error == pytest.approx(0.5 / 200**0.5, rel=1e-6)
    assert not together.beyond_counting
    assert apart.beyond_counting
