"""How often 95 % intervals hold the truth, by Monte Carlo with noise made in the time domain.

Every trial is one realisation of real noise, transformed to the lines by a plain sum, so the lines are
correlated as in flight. A count is trials x parameters; the bars are 94.4-95.6 % on harmonics of 1/T and
94-96 % elsewhere. benchmarks/coverage.py runs more cases and more trials.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from freqid.identify.regress.covariance_corrections import (
    correct_by_autocorrelation,
    correct_coloured_lines,
    correct_coloured_samples,
    correct_line_spacing,
)
from freqid.identify.regress.regression import LeastSquares, least_squares

TRIALS = 5000


def noise(rng, n_samples: int, dt: float, colour: float) -> np.ndarray:
    """White noise, or first-order noise with a time constant of `colour` seconds, shape (TRIALS, N)."""
    if not colour:
        return rng.standard_normal((TRIALS, n_samples))
    settle = int(10 * colour / dt)
    driven = lfilter([1.0], [1.0, -np.exp(-dt / colour)], rng.standard_normal((TRIALS, n_samples + settle)))
    return driven[:, settle:]


def to_lines(signals: np.ndarray, dt: float, lines: np.ndarray) -> np.ndarray:
    time = dt * np.arange(signals.shape[1])
    return signals @ (dt * np.exp(-2j * np.pi * time[:, None] * lines))


def coverage(fit: LeastSquares, truth: np.ndarray) -> np.ndarray:
    """Share of the trials (rows of the fit) whose intervals hold the truth, for each parameter."""
    low, high = fit.interval(0.95)
    return ((low <= truth) & (truth <= high)).mean(axis=0)


def multisine_inputs(duration: float, dt: float) -> np.ndarray:
    """Eighteen interleaved multisines on harmonics 3..108 and three lagged mixtures of them."""
    rng = np.random.default_rng(5)
    time = np.arange(round(duration / dt)) * dt
    inputs = []
    for j in range(18):
        harmonics = np.arange(3 + j, 109, 18)
        phase = rng.uniform(0, 2 * np.pi, len(harmonics))
        inputs.append(np.sin(2 * np.pi * harmonics[:, None] * time / duration + phase[:, None]).sum(axis=0))
    frequency = np.fft.rfftfreq(len(time), dt)
    lag = 1.0 / (1.0 + 2j * np.pi * frequency * np.array([[0.3], [1.0], [2.0]]))
    states = np.fft.irfft(np.fft.rfft(rng.standard_normal((3, 18)) @ inputs) * lag, len(time))
    return np.vstack([inputs, states])


def transient_inputs(duration: float, dt: float, n: int = 5) -> np.ndarray:
    """Decaying broadband signals, periodic in nothing."""
    rng = np.random.default_rng(3)
    time = np.arange(round(duration / dt)) * dt
    harmonics = np.arange(1.5, 33.0)
    phase = rng.uniform(0, 2 * np.pi, (n, len(harmonics), 1))
    size = rng.standard_normal((n, len(harmonics), 1))
    waves = size * np.sin(2 * np.pi * harmonics[:, None] * time / duration + phase)
    return waves.sum(axis=1) * np.exp(-time / duration)


def test_on_harmonics():
    """5000 trials x 21 parameters: 106 harmonics of a 60 s record, 18 effectors and 3 states."""
    duration, dt = 60.0, 0.1
    lines = np.arange(3, 109) / duration
    phi = to_lines(multisine_inputs(duration, dt), dt, lines)
    rng = np.random.default_rng(101)
    truth = rng.standard_normal(21)
    fit = least_squares(phi, truth @ phi + to_lines(noise(rng, 600, dt, 0.0), dt, lines))
    assert 0.944 <= coverage(fit, truth).mean() <= 0.956
    # Nothing to correct: the spacing is 1/T.
    np.testing.assert_allclose(correct_line_spacing(fit, lines, duration).std_error, fit.std_error, rtol=1e-9)


def test_off_harmonics():
    """5000 trials x 5 parameters: lines 0.01 Hz apart of a 20 s record, T df = 0.2."""
    duration, dt = 20.0, 0.1
    lines = np.arange(0.1, 1.8, 0.2 / duration)
    phi = to_lines(transient_inputs(duration, dt), dt, lines)
    rng = np.random.default_rng(102)
    truth = rng.standard_normal(5)
    fit = least_squares(phi, truth @ phi + to_lines(noise(rng, 200, dt, 0.0), dt, lines))
    covered = coverage(correct_line_spacing(fit, lines, duration), truth)
    assert 0.94 <= covered.mean() <= 0.96
    assert covered.min() > 0.935
    assert coverage(fit, truth).mean() < 0.65  # what happens without the correction
    assert 0.94 <= coverage(correct_coloured_lines(fit, lines, duration), truth).mean() <= 0.96


@pytest.mark.parametrize("spacing", [1.0, 0.4])
def test_coloured_noise_on_lines(spacing):
    """5000 trials x 5 parameters: first-order noise of 0.5 s, corner 0.32 Hz in a band of 0.1-1.8 Hz."""
    duration, dt = 20.0, 0.1
    lines = np.arange(2 / duration, 1.8, spacing / duration)
    phi = to_lines(transient_inputs(duration, dt), dt, lines)
    rng = np.random.default_rng(103)
    truth = rng.standard_normal(5)
    fit = least_squares(phi, truth @ phi + to_lines(noise(rng, 200, dt, 0.5), dt, lines))
    covered = coverage(correct_coloured_lines(fit, lines, duration), truth)
    assert 0.94 <= covered.mean() <= 0.96
    assert covered.min() > 0.935
    # Taken as white, some parameters get too narrow intervals and others too wide ones.
    white = coverage(correct_line_spacing(fit, lines, duration), truth)
    assert white.min() < 0.91
    assert white.max() > 0.965


def test_coloured_noise_on_samples():
    """5000 trials x 6 parameters, a constant among them: the published correction falls short."""
    duration, dt = 20.0, 0.05
    samples = np.vstack([transient_inputs(duration, dt), np.ones(400)])
    rng = np.random.default_rng(104)
    truth = rng.standard_normal(6)
    fit = least_squares(samples, truth @ samples + noise(rng, 400, dt, 0.5))
    covered = coverage(correct_coloured_samples(fit), truth)
    assert 0.94 <= covered.mean() <= 0.96
    assert covered.min() > 0.93
    assert coverage(fit, truth).mean() < 0.75
    published = coverage(correct_by_autocorrelation(fit), truth)
    assert published.mean() < 0.92
