import numpy as np
import pytest

from freqid.design.multisine.phases import SmoothPeak, descend
from freqid.design.multisine.signals import sample

RNG = np.random.default_rng(11)
INDEX = np.array([3, 10, 17, 24])
LIMITS = (0.5, 2.0)
MEASURES = ["range", "peak"]


def starts(count=3):
    phase = RNG.uniform(-np.pi, np.pi, (count, 4))
    ratio = 1 + 0.3 * RNG.uniform(-1, 1, (count, 4))
    return phase, ratio / ratio.mean(-1, keepdims=True)


def flat(measure, limits=LIMITS, points=8):
    return SmoothPeak(INDEX, np.full(4, 0.25), limits, measure, points)


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("sharpness", [2.0, 30.0])
def test_gradient_is_that_of_finite_differences(measure, sharpness):
    peak = flat(measure)
    phase, ratio = starts()
    _, gradient, _ = peak.derivatives(phase, ratio, sharpness)
    x = np.concatenate([phase, ratio], axis=-1)
    h = 1e-6
    for j in range(8):
        step = np.zeros(8)
        step[j] = h
        up, down = (peak.derivatives(y[:, :4], y[:, 4:], sharpness)[0] for y in (x + step, x - step))
        np.testing.assert_allclose(gradient[:, j], (up - down) / (2 * h), atol=1e-7 * sharpness)


@pytest.mark.parametrize("measure", MEASURES)
def test_matrix_is_the_softmax_covariance_of_a_dense_jacobian(measure):
    peak, s = flat(measure, limits=None), 12.0
    phase, ratio = starts(1)
    _, _, matrix = peak.derivatives(phase, ratio, s)
    theta = 2 * np.pi * np.arange(peak.samples) / peak.samples
    amplitude = np.sqrt(2 * 0.25 * ratio[0])
    u = np.sin(np.outer(theta, INDEX) + phase[0]) @ amplitude
    jacobian = np.cos(np.outer(theta, INDEX) + phase[0]) * amplitude

    def covariance(rows, exponent):
        w = np.exp(exponent - exponent.max())
        w /= w.sum()
        return (rows.T * w) @ rows - np.outer(w @ rows, w @ rows)

    if measure == "peak":
        expected = s * covariance(np.concatenate([jacobian, -jacobian]), s * np.concatenate([u, -u]))
    else:
        expected = 0.5 * s * (covariance(jacobian, s * u) + covariance(jacobian, -s * u))
    np.testing.assert_allclose(matrix[0], expected, atol=1e-12)


@pytest.mark.parametrize("measure", MEASURES)
def test_smoothed_peak_bounds_the_peak_and_tends_to_it(measure):
    peak = flat(measure)
    phase, ratio = starts()
    u = sample(INDEX, peak.amplitude(ratio), phase, peak.samples)
    true = np.abs(u).max(-1) if measure == "peak" else 0.5 * np.ptp(u, axis=-1)
    for s in (10.0, 100.0, 1000.0):
        excess = peak.value(phase, ratio, s) - true
        assert np.all(excess > -1e-12)
        assert np.all(excess < np.log(2 * peak.samples) / s)


def test_descent_lowers_every_start_and_stays_inside_the_limits():
    peak = flat("range")
    phase, ratio = starts(6)
    lower_phase, lower_ratio = descend(peak, phase, ratio, [4.0, 12.0, 40.0, 400.0], 6)
    assert np.all(peak.value(lower_phase, lower_ratio, 400.0) < peak.value(phase, ratio, 400.0))
    assert np.all((lower_ratio > LIMITS[0]) & (lower_ratio < LIMITS[1]))
    np.testing.assert_allclose(lower_ratio.mean(-1), 1.0, atol=1e-12)


def test_descent_leaves_its_arguments_and_fixed_powers_alone():
    peak = flat("peak", limits=None)
    phase, _ = starts()
    ratio = np.ones_like(phase)
    before = phase.copy()
    _, lower_ratio = descend(peak, phase, ratio, [4.0], 3)
    np.testing.assert_array_equal(phase, before)
    np.testing.assert_array_equal(lower_ratio, ratio)
