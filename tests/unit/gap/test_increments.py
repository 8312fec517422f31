"""Derivative increments beside the dense posterior that they stand for."""

import numpy as np
import pytest

from freqid.gap.gather import gather
from freqid.gap.increments import WIDE, increments

SIGMA = 0.05
NAMES = ("derivatives:M:q", "derivatives:M:de", "derivatives:Z:de", "tolerance:mass:fraction")


@pytest.fixture(scope="module")
def columns():
    rng = np.random.default_rng(1)
    made = rng.standard_normal((4, 60))
    made[1] += 0.8 * made[0]  # not orthogonal
    made[2] *= 0.02  # hardly excited
    truth = np.array([0.0, -5.0, 1.0, 0.7])  # in sigma
    return made, truth @ made + rng.standard_normal(60)


def evidence_of(made, data):
    white = {**dict(zip(NAMES, made, strict=True)), "data": data, "draws": np.zeros((25, data.size))}
    nothing = np.zeros((0, data.size))
    return gather([white], [nothing], [], NAMES, [(np.zeros(4), np.zeros(0))], 25, 0)


def test_they_are_the_posterior_with_a_wide_prior_on_derivatives_alone(columns):
    made, data = columns
    wide = 1 + (WIDE / SIGMA) ** 2
    precision = made @ made.T + np.diag([1 / wide, 1 / wide, 1 / wide, 1.0])
    mean = np.linalg.solve(precision, made @ data)
    sigma = np.sqrt(np.diag(np.linalg.inv(precision)))
    found = {(i.response, i.input): i for i in increments(evidence_of(made, data), SIGMA)}
    assert set(found) == {("M", "q"), ("M", "de"), ("Z", "de")}
    for k, key in enumerate([("M", "q"), ("M", "de"), ("Z", "de")]):
        got = found[key]
        assert got.percent == pytest.approx(100 * SIGMA * mean[k], rel=1e-8)
        assert (got.hi - got.lo) / 2 == pytest.approx(100 * SIGMA * 1.959964 * sigma[k], rel=1e-6)


def test_clear_ones_come_first_and_what_is_not_excited_is_not_clear(columns):
    found = increments(evidence_of(*columns), SIGMA)
    assert (found[0].response, found[0].input, found[0].clear) == ("M", "de", True)
    assert found[0].lo < -25 < found[0].hi
    assert not next(i for i in found if i.response == "Z").clear


def test_what_derivatives_are_off_by_together_is_part_of_them(columns):
    """The whole change of a derivative is asked for: a common factor may not hide in its own tolerance."""
    made, data = columns
    rng = np.random.default_rng(2)
    shared = [made[1] + made[2], 0.9 * made[1] + 0.1 * rng.standard_normal(60)]
    names = (*NAMES, "together:surface", "tolerance:surface_effectiveness:loss")
    white = {**dict(zip(names, (*made, *shared), strict=True)), "data": data, "draws": np.zeros((25, 60))}
    evidence = gather([white], [np.zeros((0, 60))], [], names, [(np.zeros(6), np.zeros(0))], 25, 0)
    assert increments(evidence, SIGMA) == pytest.approx(increments(evidence_of(made, data), SIGMA))


def test_without_tolerances_there_is_nothing_to_estimate_with(columns):
    assert increments(evidence_of(*columns), 0.0) == ()
