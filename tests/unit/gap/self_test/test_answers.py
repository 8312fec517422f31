"""Draws are answered as records are."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.gap.infer.evidence import NONE, estimate, weigh
from freqid.gap.self_test.answers import DrawnData, Weighed, answers


@pytest.fixture(scope="module")
def pool(findings):
    return DrawnData.of(findings.evidence, findings.evidence.system, 400, 3)


def weights_of(findings, name, size):
    system = findings.evidence.system
    index = next(k for k, c in enumerate(system.candidates) if c.name == name)
    found = np.zeros(system.columns)
    found[system.columns_of(index)] = system.candidates[index].weights(size)
    return found, index


def test_a_draw_is_weighed_as_if_it_were_the_record(findings, pool):
    weights, index = weights_of(findings, "mass", 0.15)
    weighed = Weighed.of(findings.evidence, pool.with_effect(weights, [4, 7]))
    for k in (0, 1):
        one = weighed.draw(k)
        again = weigh(one.system)
        assert again.effect == pytest.approx(one.effect)
        assert weighed.effects()[:, k] == pytest.approx(list(one.effect.values()))
        assert weighed.statistics()[k] == pytest.approx(again.statistic)
        assert estimate(one, index, 0.9).size[0] == pytest.approx(0.15, rel=0.4)
    assert estimate(findings.evidence, index, 0.9).size[0] == pytest.approx(0.0, abs=0.05)


def test_false_alarms_are_at_the_level_asked_for(findings, pool):
    called = Weighed.of(findings.evidence, pool.data).statistics() >= findings.threshold
    assert called.sum() <= 20  # 8 of 400 are expected


def test_a_strong_effect_is_called_and_named_and_a_weak_one_is_not(findings, pool):
    strong, _ = weights_of(findings, "surface_effectiveness@de", -0.5)
    weighed = Weighed.of(findings.evidence, pool.with_effect(strong, range(20)))
    found = answers(weighed, "surface_effectiveness", [0] * 20, findings.threshold)
    assert all(a.called and a.right and a.covered for a in found)
    assert {a.word for a in found} == {"surface_effectiveness"}
    assert min(a.truth_probability for a in found) > 0.9
    weak, _ = weights_of(findings, "surface_effectiveness@de", -0.001)
    weighed = Weighed.of(findings.evidence, pool.with_effect(weak, range(20)))
    found = answers(weighed, "surface_effectiveness", [0] * 20, findings.threshold)
    assert sum(a.called for a in found) <= 3
    assert NONE in {a.word for a in found}
    assert all(np.isnan(a.probability) for a in found if not a.called)


def test_without_an_effect_the_library_answers_something_else(findings, pool):
    strong, _ = weights_of(findings, "mass", 0.4)
    weighed = Weighed.of(findings.evidence, pool.with_effect(strong, range(10)))
    lacking = weighed.without("mass")
    left = [e for e in findings.evidence.weighing.effects if e != "mass"]
    assert list(lacking.evidence.weighing.effects) == left
    both = dict(zip(findings.evidence.weighing.effects, weighed.effects(), strict=True))
    alone = dict(zip(left, lacking.effects(), strict=True))
    for effect in left:
        assert alone[effect] == pytest.approx(both[effect])
    found = answers(lacking, "mass", [0] * 10, findings.threshold)
    assert not any(a.right or a.truth_probability > 0 for a in found)
