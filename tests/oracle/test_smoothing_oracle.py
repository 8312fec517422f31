"""Global Fourier smoothing against a dense matrix, known signals in noise, and real flight data."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.io
from scipy.signal import lsim

from freqid.identify.spectra.smoothing import local_derivative, smooth

DT = 0.02
TIME = DT * np.arange(3001)


def mode_and_trend():
    t, w = TIME, 2 * np.pi * 0.6
    x = np.exp(-0.08 * t) * np.sin(w * t) + 0.3 - 0.02 * t + 4e-4 * t**2
    return x, np.exp(-0.08 * t) * (w * np.cos(w * t) - 0.08 * np.sin(w * t)) - 0.02 + 8e-4 * t


def multisine_response():
    """A short period answering 106 harmonics of equal size from 0.05 to 1.8 Hz; steady state, by hand."""
    rng = np.random.default_rng(5)
    s = 2j * np.pi * np.arange(3, 109) / 60
    amplitude = (s + 1) / (s**2 + 2 * s + 9) * np.exp(1j * rng.uniform(0, 2 * np.pi, 106))
    wave = np.exp(np.outer(TIME, s))
    return (wave @ amplitude).imag, (wave @ (s * amplitude)).imag


def doublet_response():
    """Roll rate after steps of the aileron: corners, whose coefficients fall like k^-2 only."""
    u = 1.0 * ((TIME > 5) & (TIME <= 7)) - ((TIME > 7) & (TIME <= 8)) + ((TIME > 8) & (TIME <= 9))
    p = lsim(([5.0], [1.0, 4.0]), u, TIME, interp=False)[1]
    return p, 5.0 * u - 4.0 * p


SIGNALS = {"mode": mode_and_trend(), "multisine": multisine_response(), "doublet": doublet_response()}


def test_against_a_dense_matrix():
    """The sine and cosine matrices, the hat matrix's trace and the score, all written out."""
    n, dt = 64, 0.1
    rng = np.random.default_rng(3)
    t = dt * np.arange(n)
    T = t[-1]
    x = np.sin(1.3 * t) + 0.2 * t + 0.3 * rng.standard_normal(n)
    line = x[0] + (x[-1] - x[0]) * t / T
    k = np.arange(1, n - 1)
    sines = np.sin(np.pi * np.outer(t / T, k))[1:-1]
    b = np.linalg.solve(sines, (x - line)[1:-1])  # the series that interpolates every sample

    s = smooth(x[None], dt)
    phi = 1 / (1 + (k / (2 * T * s.cutoff_hz[0])) ** 6)
    np.testing.assert_allclose(s.x[0, 1:-1], line[1:-1] + sines @ (phi * b), atol=1e-12)
    slope = (x[-1] - x[0]) / T + np.cos(np.pi * np.outer(t / T, k)) @ (np.pi * k / T * phi * b)
    np.testing.assert_allclose(s.derivative[0], slope, atol=1e-11)

    def score(cutoff):
        hat = sines @ np.diag(1 / (1 + (k / (2 * T * cutoff)) ** 6)) @ np.linalg.inv(sines)
        left = (np.eye(n - 2) - hat) @ (x - line)[1:-1]
        return left @ left / np.trace(np.eye(n - 2) - hat) ** 2

    around = [score(s.cutoff_hz[0] * step) for step in (0.9, 0.95, 1.0, 1.05, 1.1)]
    assert np.argmin(around) in (1, 2, 3)
    everywhere = [score(c) for c in np.geomspace(0.5 / T, 0.5 / dt, 60)]
    assert around[2] <= min(everywhere) * 1.001


@pytest.mark.parametrize(
    ("name", "snr", "bias", "derivative"),
    [
        ("mode", 100, 0.01, 0.06),
        ("mode", 5, 0.01, 0.03),
        ("multisine", 20, 0.012, 0.12),
        ("multisine", 5, 0.01, 0.08),
        ("doublet", 20, 0.06, 0.5),  # corners count as noise, and the derivative that is sought jumps
        ("doublet", 5, 0.03, 0.2),
    ],
)
def test_noise_signal_and_derivative_are_recovered(name, snr, bias, derivative):
    truth, rate = SIGNALS[name]
    sigma = truth.std() / snr
    noisy = truth + sigma * np.random.default_rng(17).standard_normal((30, TIME.size))
    s = smooth(noisy, DT)
    ratio = s.noise_std / sigma
    assert abs(ratio.mean() - 1) < bias
    assert ratio.std() < 0.02  # 1/sqrt(2 n) = 1.3 % is the least that 3001 samples allow

    def error(cutoff_hz=None):
        return np.sqrt(np.mean((smooth(noisy, DT, cutoff_hz).x - truth) ** 2))

    # Below raw noise, and as small as the best cutoff gives, which only the truth could tell.
    assert error() < 0.52 * sigma
    assert error() < 1.02 * min(error(f) for f in np.geomspace(0.5, 12, 20))

    inner = slice(50, -50)  # the end samples are kept as measured

    def rate_error(estimate):
        return np.sqrt(np.mean((estimate - rate)[:, inner] ** 2))

    assert rate_error(s.derivative) < derivative * rate_error(np.gradient(noisy, DT, axis=1))
    best_local = min(rate_error(local_derivative(noisy, DT, window)) for window in (5, 9, 13, 17, 21, 31))
    assert rate_error(s.derivative) < best_local


def test_published_derivatives_of_real_flight_data(shared_data):
    """Twin Otter f1_017: columns 42-44 hold the author's smoothed derivatives of the rates in columns 5-7.

    Their sine series ends sharply at 2.8 Hz, a cutoff chosen by eye; behind it the gain is that of a
    five-point parabola. The same cutoff here rolls off as a Wiener filter does, hence the rest.
    """
    data = scipy.io.loadmat(shared_data / "sidpac" / "totter_f1_017_data.mat")["fdata"]
    rates, published = data[:, 4:7].T, data[:, 41:44].T
    spread = published.std(axis=1)

    def distance(derivative):
        return np.sqrt(np.mean((derivative - published) ** 2, axis=1)) / spread

    s = smooth(rates, DT, cutoff_hz=2.8)
    assert np.all(distance(s.derivative) < [0.09, 0.105, 0.02])
    # A five-point parabola alone is more than twice as far away.
    assert np.all(distance(local_derivative(rates, DT)) > 2 * distance(s.derivative))
    correlation = [np.corrcoef(a, b)[0, 1] for a, b in zip(s.derivative, published, strict=True)]
    assert min(correlation) > 0.994

    # These channels have no white noise to speak of: their floor is 0.001 deg/s, and the automatic cutoff
    # keeps all that stands above it, structure included.
    automatic = smooth(rates, DT)
    assert np.all(automatic.cutoff_hz > 15.0)
    np.testing.assert_allclose(automatic.noise_std, 0.001, rtol=0.1)
