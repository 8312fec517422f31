"""What smoothing promises beside its numbers: shapes, limits, errors."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.identify.spectra.smoothing import local_derivative, smooth

DT = 0.02
TIME = DT * np.arange(501)


def test_shapes_and_the_ends_stay(rng):
    x = rng.standard_normal((3, 501))
    s = smooth(x, DT)
    assert s.x.shape == s.derivative.shape == (3, 501)
    assert s.noise_std.shape == s.cutoff_hz.shape == (3,)
    np.testing.assert_allclose(s.x[:, [0, -1]], x[:, [0, -1]], atol=1e-12)


def test_channels_do_not_disturb_each_other_and_scale(rng):
    x = np.sin(TIME) + 0.1 * rng.standard_normal((2, 501))
    both, alone = smooth(x, DT), smooth(1e3 * x[1:], DT)
    np.testing.assert_allclose(alone.x[0], 1e3 * both.x[1], rtol=1e-9)
    np.testing.assert_allclose(alone.noise_std[0], 1e3 * both.noise_std[1], rtol=1e-9)
    assert alone.cutoff_hz[0] == both.cutoff_hz[1]


def test_a_line_and_a_constant_pass_unchanged():
    x = np.stack([2.0 - 0.3 * TIME, np.full(501, 4.0)])
    s = smooth(x, DT)
    np.testing.assert_allclose(s.x, x, atol=1e-12)
    np.testing.assert_allclose(s.derivative, [[-0.3] * 501, [0.0] * 501], atol=1e-12)
    np.testing.assert_allclose(s.noise_std, 0.0, atol=1e-12)


def test_the_filter_passes_half_at_the_cutoff_and_nothing_far_above():
    """A sine that fits the record is one coefficient, so each comes through multiplied by Phi alone."""
    duration = TIME[-1]
    x = np.sin(2 * np.pi * np.array([[0.5], [2.0], [16.0]]) * TIME)
    assert duration == pytest.approx(10.0)
    s = smooth(x, DT, cutoff_hz=2.0)
    ratio = np.array([1 / (1 + 0.25**6), 0.5, 1 / (1 + 8.0**6)])[:, None]
    np.testing.assert_allclose(s.x, ratio * x, atol=1e-12)


def test_the_derivative_belongs_to_the_smooth_signal(rng):
    """Independent of the series: a fine central difference of the smooth signal."""
    s = smooth(rng.standard_normal((2, 2001)), 0.001, cutoff_hz=5.0)
    slope = (s.x[:, 2:] - s.x[:, :-2]) / 0.002
    np.testing.assert_allclose(s.derivative[:, 1:-1], slope, atol=5e-3 * np.max(np.abs(slope)))


@pytest.mark.parametrize("cutoff", [0.0, 0.049, 25.1, -1.0, np.nan])
def test_cutoff_out_of_range(cutoff):
    with pytest.raises(UsageError, match=r"between 0.05 and 25 Hz"):
        smooth(np.zeros((1, 501)), DT, cutoff)


def test_bad_channels():
    with pytest.raises(UsageError, match="8 samples"):
        smooth(np.zeros((1, 7)), DT)
    x = np.zeros((1, 50))
    x[0, 3] = np.nan
    for call in (smooth, local_derivative):
        with pytest.raises(DataError, match="channel 0 is nan at sample 3"):
            call(x, DT)


@pytest.mark.parametrize(("window", "degree"), [(3, 1), (5, 2), (9, 4)])
def test_local_derivative_is_exact_on_its_polynomial_up_to_the_ends(window, degree):
    t = TIME[:51]
    x = np.stack([t**k for k in range(degree + 1)])
    slope = np.stack([k * t ** max(k - 1, 0) for k in range(degree + 1)])
    np.testing.assert_allclose(local_derivative(x, DT, window, degree), slope, atol=1e-9)


def test_local_derivative_noise_and_attenuation_are_as_documented(rng):
    w = 9
    noise = local_derivative(rng.standard_normal((1, 200_000)), DT, w)
    assert noise.std() == pytest.approx(np.sqrt(12 / (w**3 - w)) / DT, rel=0.02)
    f = 0.5
    peak = np.max(local_derivative(np.sin(2 * np.pi * f * TIME)[None], DT, w)[:, w:-w])
    assert 1 - peak / (2 * np.pi * f) == pytest.approx((np.pi * f * DT * w) ** 2 / 10, rel=0.1)


@pytest.mark.parametrize(("window", "degree"), [(4, 2), (5, 5), (5, 0), (53, 2)])
def test_local_derivative_refuses_windows_it_cannot_fit(window, degree):
    with pytest.raises(UsageError, match="odd window"):
        local_derivative(np.zeros((1, 51)), DT, window, degree)


@pytest.fixture
def rng():
    return np.random.default_rng(11)
