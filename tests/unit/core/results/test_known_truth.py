"""Why an estimate misses the truth: its parts add up, and the largest is the cause."""

import math

import numpy as np
import pytest

from freqid.core.results.judged.truth import KnownTruth, as_many_as_by_chance


@pytest.mark.parametrize(
    ("noise", "amplitude", "wake", "rest", "of", "cause"),
    [
        (0.5, 6.0, 0.5, 0.0, "linearisation", "amplitude"),
        (-1.0, 1.0, -30.0, 0.2, "linearisation", "wake delay"),
        (3.0, 0.0, 0.1, 0.0, "both", "noise"),
        (3.0, -3.0, 0.0, 0.0, "noise-free estimate", "noise"),
        (0.1, 0.2, 0.1, 9.0, "linearisation", "not explained"),
    ],
)
def test_the_largest_part_is_the_cause(noise, amplitude, wake, rest, of, cause):
    error, linear = 0.25, -7.0
    small = linear + error * (wake + rest)
    full = small + error * amplitude
    known = KnownTruth(
        ("q",), np.array([linear]), np.array([full]), np.array([small]), np.array([error * rest]), 0.125
    )
    (miss,) = known.misses(np.array([full + error * noise]), np.array([error]))
    assert (miss.of, miss.cause) == (of, cause)
    assert list(miss.parts.values()) == pytest.approx([noise, amplitude, wake, rest])
    assert miss.sigmas == pytest.approx(noise + amplitude + wake + rest)


def test_what_is_near_both_is_no_miss():
    one = np.array([1.0])
    known = KnownTruth(("q",), one, one + 0.1, one + 0.1, 0 * one, 0.125)
    assert known.misses(one + 0.2, 0.2 * one) == ()
    assert known.misses(one + 5, 0 * one) == ()  # without a standard error nothing is called off


@pytest.mark.parametrize(
    ("noise", "amplitude", "alone"),
    [(3.0, 0.1, True), (1.8, 1.0, True), (3.0, -3.0, True), (2.5, 2.5, False), (-0.5, 6.0, False)],
)
def test_noise_alone_explains_what_would_be_on_the_truth_without_it(noise, amplitude, alone):
    known = KnownTruth(("q",), np.zeros(1), np.array([amplitude]), np.zeros(1), np.zeros(1), 0.125)
    (miss,) = known.misses(np.array([amplitude + noise]), np.ones(1))
    assert miss.by_noise_alone is alone


def test_what_chance_leaves_beyond_two_sigma_is_the_binomial_spread_of_four_and_a_half_per_cent():
    """Of 432 normal errors 19.7 are expected beyond 2σ, 28.4 with two standard deviations."""
    outside = math.erfc(2 / math.sqrt(2))
    most = 432 * outside + 2 * math.sqrt(432 * outside * (1 - outside))
    assert 28 < most < 29
    for count in (0, 27, 28, 29, 60):
        distances = np.where(np.arange(432) < count, -3.0, 1.0)
        assert as_many_as_by_chance(distances) is (count < most)
    assert as_many_as_by_chance(np.zeros(0))
