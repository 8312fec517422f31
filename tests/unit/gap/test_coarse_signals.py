"""Signals through a lag and a delay, against their closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.gap.model.following import slope_of
from freqid.simulate.effects.signals import delayed, lagged

DT, HZ = 0.04, 2.0
TIME = DT * np.arange(1500)
SETTLED = slice(700, 1450)


def wave(response: complex = 1.0) -> np.ndarray:
    """Return a sine as coarse as a diagnosis takes it, behind a frequency response."""
    return np.imag(response * np.exp(2j * np.pi * HZ * TIME))


@pytest.mark.parametrize("time_constant", [0.003, 0.016, 0.05, 0.3])
def test_a_lag_of_coarse_samples_is_that_of_the_continuous_signal(time_constant):
    expected = wave(1 / (1 + 2j * np.pi * HZ * time_constant))
    np.testing.assert_allclose(lagged(wave(), DT, time_constant)[SETTLED], expected[SETTLED], atol=1e-3)


def test_a_lag_starts_in_its_steady_state_and_takes_rows_one_by_one():
    rows = np.array([np.full(50, 3.0), np.linspace(0, 1, 50)])
    both = lagged(rows, DT, 0.1)
    np.testing.assert_allclose(both[0], 3.0, rtol=1e-12)
    np.testing.assert_allclose(both[1], lagged(rows[1], DT, 0.1), rtol=1e-12)


def test_a_delay_of_a_part_of_a_coarse_sample_takes_nothing_off():
    expected = wave(np.exp(-2j * np.pi * HZ * 0.02))
    both = delayed(np.array([wave(), 2 * wave()]), DT, 0.02)
    np.testing.assert_allclose(both[0, SETTLED], expected[SETTLED], atol=2e-3)
    np.testing.assert_allclose(both[1], 2 * both[0], rtol=1e-12)


def test_a_rate_of_coarse_samples_is_not_short():
    np.testing.assert_allclose(
        slope_of(wave(), DT)[SETTLED], wave(2j * np.pi * HZ)[SETTLED], atol=2e-3 * 2 * np.pi * HZ
    )
