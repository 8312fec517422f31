"""Why an estimate misses the truth: its parts add up, and the largest is the cause."""

import numpy as np
import pytest

from freqid.core.results.judged.truth import KnownTruth


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
