"""Agreement of densities: levels of the test where similarity holds, power where it does not."""

from dataclasses import replace

import numpy as np
import pytest
import tilt_wing
from scipy.stats import kstest

from freqid.blend.consistency import density_agreement
from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up

SEA, HIGH = 1.225, 1.0
SPEEDS = (3.0, 7.0, 12.0, 18.0)


@pytest.fixture(scope="module")
def trims():
    sea = [tilt_wing.trim(u, SEA) for u in SPEEDS]
    high = [
        tilt_wing.trim(u * np.sqrt(SEA / HIGH), HIGH, at["dw1"]) for u, at in zip(SPEEDS, sea, strict=True)
    ]
    return sea + high


def agreement(points):
    return density_agreement(GlobalModel(line_up(points, [str(i) for i in range(len(points))])))


def test_where_similarity_holds_p_is_uniform(trims):
    p = []
    for draw in range(20):
        found = agreement([tilt_wing.exact_point(at, f"{i}", seed=[draw, i]) for i, at in enumerate(trims)])
        assert [one.response for one in found] == list(tilt_wing.RESPONSES)
        assert [one.degrees_of_freedom for one in found] == [4 * (1 + n) for n in (7, 4, 7, 4, 7, 4)]
        p += [one.p for one in found]
    assert kstest(p, "uniform").pvalue > 0.01  # one fixed seed: this is a measurement, not a lottery


def test_a_derivative_that_does_not_follow_density_is_found(trims):
    points = [tilt_wing.exact_point(at, f"{i}", seed=i) for i, at in enumerate(trims)]
    z = points[5]["Z"]
    off = replace(z, estimate=z.estimate + 12 * z.std_error * (np.arange(7) == 1))
    points[5] = replace(points[5], responses={**points[5].responses, "Z": off})
    found = {one.response: one for one in agreement(points)}
    assert found["Z"].p < 1e-3
    assert min(one.p for r, one in found.items() if r != "Z") > 1e-3
    assert found["Z"].rho == pytest.approx((HIGH, SEA))
    assert found["Z"].points == 4


def test_one_density_has_nothing_to_agree_with(trims):
    assert agreement([tilt_wing.exact_point(at, f"{i}") for i, at in enumerate(trims[:4])]) == []


def test_points_that_no_line_reaches_are_not_compared(trims):
    far = [tilt_wing.trim(u, HIGH, 0.05) for u in (29.0, 32.0)]
    assert agreement([tilt_wing.exact_point(at, f"{i}") for i, at in enumerate([*trims[:4], *far])]) == []
