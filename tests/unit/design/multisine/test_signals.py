import numpy as np
import pytest

from freqid.design.multisine.signals import (
    crest_factor,
    relative_peak_factor,
    sample,
    samples_per_period,
    start_at_zero,
    zero_crossings,
)

RNG = np.random.default_rng(5)
INDEX = np.array([4, 9, 14, 19])
AMPLITUDE = np.array([1.0, 0.4, 0.7, 1.3])
PHASE = RNG.uniform(-np.pi, np.pi, 4)


def direct(theta, index=INDEX, amplitude=AMPLITUDE, phase=PHASE):
    return sum(a * np.sin(k * theta + p) for k, a, p in zip(index, amplitude, phase, strict=True))


def test_samples_are_the_sum_of_sines():
    theta = 2 * np.pi * np.arange(100) / 100
    np.testing.assert_allclose(sample(INDEX, AMPLITUDE, PHASE, 100), direct(theta), atol=1e-13)


def test_a_batch_is_sampled_row_by_row():
    phases = RNG.uniform(-np.pi, np.pi, (3, 4))
    batch = sample(INDEX, AMPLITUDE, phases, 64)
    assert batch.shape == (3, 64)
    np.testing.assert_allclose(batch[1], sample(INDEX, AMPLITUDE, phases[1], 64), atol=1e-14)


def test_tones_on_one_harmonic_add_up_and_complex_amplitudes_turn():
    twice = sample([4, 4, 9], [1.0, 0.5, 2.0], [0.1, -0.7, 0.4], 64)
    each = sample([4, 9], [1.0, 2.0], [0.1, 0.4], 64) + sample([4], [0.5], [-0.7], 64)
    np.testing.assert_allclose(twice, each, atol=1e-13)
    turned = sample(INDEX, AMPLITUDE * np.exp(0.3j), PHASE, 100)
    np.testing.assert_allclose(turned, sample(INDEX, AMPLITUDE, PHASE + 0.3, 100), atol=1e-13)


@pytest.mark.parametrize("points", [8, 64])
def test_enough_samples_per_shortest_period(points):
    assert samples_per_period(INDEX, points) >= points * 19


def test_a_sine_has_rpf_one_and_crest_root_two():
    assert relative_peak_factor([7], [3.0], [0.4]) == pytest.approx(1.0, abs=1e-3)
    assert crest_factor([7], [3.0], [0.4]) == pytest.approx(np.sqrt(2), abs=1e-3)


def test_a_square_wave_has_rpf_of_one_over_root_two():
    # Fejer means of its Fourier series do not overshoot, so the peak factor comes from below
    odd = np.arange(1, 400, 2)
    assert relative_peak_factor(odd, (1 - odd / 401) / odd, np.zeros(odd.size)) == pytest.approx(
        0.5**0.5, 0.01
    )


def test_peak_factors_on_a_fine_grid():
    u = direct(np.linspace(0, 2 * np.pi, 200_000))
    rms = np.sqrt(0.5 * np.sum(AMPLITUDE**2))
    factor = relative_peak_factor(INDEX, AMPLITUDE, PHASE)
    assert factor == pytest.approx(np.ptp(u) / (2 * np.sqrt(2) * rms), rel=1.3e-3)
    assert crest_factor(INDEX, AMPLITUDE, PHASE) == pytest.approx(np.abs(u).max() / rms, rel=1.3e-3)


def test_crossings_are_all_zeros_and_only_zeros():
    angle, slope = zero_crossings(INDEX, AMPLITUDE, PHASE)
    assert np.all(np.abs(direct(angle)) < 1e-12)
    fine = direct(np.linspace(0, 2 * np.pi, 100_001))
    assert angle.size == np.count_nonzero(np.diff(np.sign(fine)))
    assert np.all(np.diff(angle) > 0)
    h = 1e-6
    np.testing.assert_allclose(slope, (direct(angle + h) - direct(angle - h)) / (2 * h), rtol=1e-6)


def test_start_is_at_zero_with_the_gentlest_slope_and_the_same_wave():
    phase = start_at_zero(INDEX, AMPLITUDE, PHASE)
    _, slope = zero_crossings(INDEX, AMPLITUDE, PHASE)
    assert abs(direct(0.0, phase=phase)) < 1e-12
    assert abs(direct(2 * np.pi, phase=phase)) < 1e-12
    start = np.sum(AMPLITUDE * INDEX * np.cos(phase))
    assert abs(start) == pytest.approx(np.abs(slope).min(), rel=1e-9)
    before, after = (relative_peak_factor(INDEX, AMPLITUDE, p) for p in (PHASE, phase))
    assert after == pytest.approx(before, rel=1.3e-3)
