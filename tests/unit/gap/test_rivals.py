"""Which of two simulations is nearer: weighing beside matrices written out, verdicts on linear flights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from linear_flight import LIBRARY, SIZES, SLOPES, Linear, Truth, fly
from scipy.stats import false_discovery_control, norm

from freqid.core.errors import UsageError
from freqid.core.rivals import Rivals
from freqid.gap.rivals import compare_two
from freqid.gap.weighed import UNSTATED, holm, weigh

TOLERANT = {**SIZES, "derivatives": 0.05, "responses": 0.02, "dynamics": 0.05}
QUIET = np.zeros((1, 12))


@dataclass(frozen=True, eq=False)
class Worn(Linear):
    """A simulation that knows of a loss of the first surface, or says that it is another."""

    loss: float = 0.0

    def slopes(self, effects=None):
        return SLOPES * np.array([1.0, 1.0, 1.0, 1 - self.loss, 1.0])


def _compare(a, b, truth, seeds=(1, 2), **more):
    flights = [fly(truth, noise=1.0, seed=s, duration=14.0, phases=s, reference=f"u{s}") for s in seeds]
    return compare_two((a, b), flights, LIBRARY, TOLERANT, (0.1, 2.0), count=25, **more)


@pytest.fixture(scope="module")
def worn():
    return _compare(Linear(name="plain"), Worn(name="worn", loss=0.4), Truth(loss=0.4))


def test_squares_and_their_difference_are_those_of_the_whole_matrix():
    rng = np.random.default_rng(0)
    a, b = rng.standard_normal((2, 12))
    allowed = 2 * rng.standard_normal((3, 12))
    inverse = np.linalg.inv(np.eye(12) + allowed.T @ allowed)
    w = weigh(a, b, allowed, QUIET, QUIET, QUIET)
    assert w.squares == pytest.approx((a @ inverse @ a, b @ inverse @ b))
    assert w.difference == pytest.approx(a @ inverse @ a - b @ inverse @ b)
    # half of it is the logarithm of the likelihood ratio
    density = [-0.5 * x @ inverse @ x for x in (a, b)]
    assert w.difference / 2 == pytest.approx(density[1] - density[0])


@pytest.mark.parametrize("tolerances", [0, 3, 20])
def test_the_deviation_is_that_of_the_difference_when_both_share_what_tolerances_allow(tolerances):
    rng = np.random.default_rng(1)
    allowed = rng.standard_normal((tolerances, 12))
    d = 0.5 * rng.standard_normal(12)
    inverse = np.linalg.inv(np.eye(12) + allowed.T @ allowed)
    middle = rng.standard_normal((4000, 12)) + rng.standard_normal((4000, tolerances)) @ allowed
    made = [weigh(m + d / 2, m - d / 2, allowed, QUIET, QUIET, QUIET) for m in middle]
    least = 2 * np.sqrt(d @ inverse @ d)
    assert np.std([w.difference for w in made]) == pytest.approx(least, rel=0.05)
    # where the nearer one lacks nothing beyond what tolerances allow, only what they do not state is added
    assert np.median([w.deviation for w in made]) == pytest.approx(UNSTATED * least, rel=0.05)
    z = np.array([w.difference / w.deviation * UNSTATED for w in made])
    assert np.mean(np.abs(z) > norm.ppf(0.975)) < 0.06


def test_a_gap_in_both_makes_no_verdict_of_scatter_between_them():
    rng = np.random.default_rng(2)
    allowed = 3 * rng.standard_normal((6, 40))
    gap = 20 * np.ones(6) @ allowed  # tolerances' own directions, twenty sigma
    none = np.zeros((1, 40))
    z = []
    for _ in range(400):
        noise, one, other = rng.standard_normal(40), *(rng.standard_normal((2, 6)) @ allowed)
        w = weigh(gap + one + noise, gap + other + noise, allowed, none, none, none)
        z.append(w.difference / w.deviation)
    assert np.mean(np.abs(z) > norm.ppf(0.975)) < 0.07


def test_noise_of_the_flown_states_is_taken_out_of_the_difference():
    """Both perfect: all that differs is that one hands on twice the noise of a state."""
    rng = np.random.default_rng(3)
    state, rest = rng.standard_normal((2, 3000, 60))
    quiet = np.zeros((0, 60))
    draws = weigh(2 * state[0], state[0], quiet, 2 * state[1:] + rest[1:], state[1:] + rest[1:], rest[:5])
    # E|2e + n|^2 - E|e + n|^2 = 3 each
    raw = draws.squares[0] - draws.squares[1]
    assert raw - draws.difference == pytest.approx(3 * 60, rel=0.05)


def test_holm_is_the_step_down_procedure():
    p = [0.01, 0.04, 0.03, 0.005]
    assert holm(p).tolist() == pytest.approx([0.03, 0.06, 0.06, 0.02])  # Holm 1979
    assert holm([]).size == 0
    many = np.random.default_rng(4).uniform(size=30)
    assert (holm(many) >= false_discovery_control(many) - 1e-12).all()


def test_the_one_that_knows_what_flew_is_nearer(worn):
    assert worn.nearer == "B"
    assert worn.verdict.startswith("B (worn) is nearer beyond noise: ")
    assert "A (plain) is nearer nowhere" in worn.verdict
    assert {c.response for c in worn.contests if c.nearer} <= {"Z", "M"}  # the surface makes no X
    assert worn.overall.p_adjusted < worn.level
    assert worn.overall.difference.lo > 0
    assert worn.overall.maneuvers == 2


def test_to_swap_them_swaps_the_verdict(worn):
    other = _compare(Worn(name="worn", loss=0.4), Linear(name="plain"), Truth(loss=0.4))
    assert other.nearer == "A"
    assert other.overall.difference.value == pytest.approx(-worn.overall.difference.value, rel=1e-6)
    assert [c.p for c in other.contests] == pytest.approx([c.p for c in worn.contests], rel=1e-6)


def test_what_is_the_same_is_equal_exactly():
    found = _compare(Linear(), Linear(name="twin"), Truth(loss=0.4), seeds=(1,))
    assert found.identical
    assert found.nearer == ""
    assert found.contests == ()
    assert found.overall.difference.value == 0.0
    assert found.overall.p == 1.0


def test_what_tolerances_make_is_equal():
    found = _compare(Worn(loss=-0.05), Worn(loss=0.05), Truth())
    assert found.nearer == ""
    assert not found.identical
    assert "cannot tell" in found.verdict


def test_responses_in_common_are_compared_and_the_rest_is_said():
    found = _compare(Linear(), Linear(responses=("M",), name="pitch"), Truth(), seeds=(1,))
    assert found.identical
    assert found.remarks == ("A alone predicts X, Z: not compared, B does not",)


def test_nothing_in_common_is_refused():
    with pytest.raises(UsageError, match="no response in common"):
        _compare(Linear(responses=("X",)), Linear(responses=("M",)), Truth(), seeds=(1,))


def test_the_table_comes_back(worn):
    assert Rivals.from_json(worn.to_json()) == worn
    with pytest.raises(ValueError, match="level"):
        Rivals.from_json({**worn.to_json(), "level": "low"})
