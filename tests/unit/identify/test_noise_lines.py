"""Lines between the harmonics: where they lie, what they tell of noise, and what they do not hear."""

import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.identify.noise_lines import Noise, correct_by_noise_lines, distortion, noise_lines
from freqid.identify.regression import least_squares

HARMONICS = np.arange(3, 109) / 60.0


def test_noise_lines_are_between_the_harmonics_and_around_them():
    lines = noise_lines(HARMONICS, 60.0, 120.0)
    assert lines[0] == pytest.approx(2.5 / 60)
    assert lines[-1] > HARMONICS[-1]
    nearest = np.abs(lines[:, None] - np.arange(200) / 60.0).min(axis=1)
    assert np.allclose(nearest, 0.5 / 60)
    three = noise_lines(HARMONICS, 60.0, 180.0)
    assert np.all(np.abs(three[:, None] - np.arange(200) / 60.0).min(axis=1) > 0.3 / 60)


def test_a_record_of_less_than_two_periods_has_none():
    with pytest.raises(DataError, match=r"two periods of 60 s or more, the record lasts 100 s"):
        noise_lines(HARMONICS, 60.0, 100.0)


def _spectra(rng, power_of, size):
    power = power_of(size)
    return np.sqrt(power / 2) * (rng.standard_normal(size.shape) + 1j * rng.standard_normal(size.shape))


def test_intervals_from_noise_lines_cover_and_ignore_what_repeats():
    """Noise whose power rises as f squared, and on the harmonics alone a distortion ten times as strong."""
    rng = np.random.default_rng(4)
    lines = noise_lines(HARMONICS, 60.0, 120.0)
    x = _spectra(rng, np.ones_like, np.zeros((6, HARMONICS.size)))
    true = np.array([[1.0, -2.0, 0.5, 3.0, 0.0, 1.5]])
    distorted = true @ x + 10 * _spectra(rng, lambda f: f**2, HARMONICS[None])
    kept = least_squares(x, distorted).estimate
    error, covered, naive, ratio = [], 0, 0, []
    for _ in range(300):
        z = distorted + _spectra(rng, lambda f: f**2, HARMONICS[None])
        fit = least_squares(x, z)
        noise = Noise(lines, np.abs(_spectra(rng, lambda f: f**2, lines[None])) ** 2)
        corrected = correct_by_noise_lines(fit, [HARMONICS], [noise])
        lower, upper = corrected.interval(0.95)
        covered += np.sum((lower < kept) & (kept < upper))
        lower, upper = fit.interval(0.95)
        naive += np.sum((lower < kept) & (kept < upper))
        error.append((corrected.estimate - kept) / corrected.std_error)
        ratio.append(distortion(np.abs(fit.residual) ** 2 / (1 - fit.leverage / 2), HARMONICS, noise))
    assert covered / (300 * 6) == pytest.approx(0.95, abs=0.02)
    assert naive / (300 * 6) > 0.999  # the whole residual makes intervals ten times too wide
    assert np.sqrt(np.mean(np.square(error))) == pytest.approx(1.0, abs=0.05)
    assert np.mean(ratio) == pytest.approx(101, rel=0.3)  # amplitudes of 10 and 1 add in power
