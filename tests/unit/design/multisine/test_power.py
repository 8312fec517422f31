import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.design.multisine.allocation import fractions, limits_from_db


def test_three_db_is_a_factor_of_two():
    low, high = limits_from_db(3.0)
    assert low == pytest.approx(0.5012, abs=1e-4)
    assert high == pytest.approx(1.9953, abs=1e-4)


def test_zero_db_fixes_the_powers():
    assert limits_from_db(0.0) is None


@pytest.mark.parametrize("band", [-1.0, np.inf, np.nan])
def test_a_band_without_meaning_is_refused(band):
    with pytest.raises(UsageError, match="0 dB or more"):
        limits_from_db(band)


def test_fractions_follow_the_spectrum_and_sum_to_one():
    power = fractions([3, 30, 60, 120], 60.0, [0.1, 1.0], [4.0, 1.0])
    np.testing.assert_allclose(power / power[-1], [4.0, 1 + 3 * 0.5 / 0.9, 1.0, 1.0])
    assert power.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("frequency", "density", "message"),
    [
        ([0.1, 1.0], [1.0], "one power for each frequency"),
        ([1.0, 0.1], [1.0, 2.0], "do not rise"),
        ([0.1, 1.0], [1.0, 0.0], "without a signal"),
    ],
)
def test_a_broken_spectrum_is_refused(frequency, density, message):
    with pytest.raises(UsageError, match=message):
        fractions([3, 4], 60.0, frequency, density)
