"""Several manoeuvres as one regression: weights, nuisance columns, and the uncertainty that follows."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from freqid.core.errors import UsageError
from freqid.identify.loads.wrench import AppliedWrench
from freqid.identify.model.line_equations import on_lines
from freqid.identify.regress.covariance_corrections import (
    correct_coloured_lines,
    correct_coloured_samples,
    correct_line_spacing,
)
from freqid.identify.regress.regression import least_squares
from freqid.identify.spectra.fourier import fourier

LINES = np.arange(0.15, 1.6, 0.02)


def wrench_of(direct):
    return AppliedWrench(("Z",), ("N",), direct, np.zeros_like(direct))


def test_each_manoeuvre_has_its_lines_its_weight_and_its_own_nuisance_columns():
    rng = np.random.default_rng(0)
    x = [rng.standard_normal((2, n)) for n in (401, 801)]
    z = [rng.standard_normal((1, n)) for n in (401, 801)]
    dt = (0.05, 0.05)
    both = on_lines(x, [wrench_of(v) for v in z], dt, LINES)
    alone = [on_lines([x[i]], [wrench_of(z[i])], dt[:1], LINES) for i in (0, 1)]
    assert both.durations == (20.0, 40.0)
    for i in (0, 1):
        np.testing.assert_allclose(both.each(both.x)[i], alone[i].x, rtol=1e-12)
        np.testing.assert_allclose(both.each(both.z)[i], alone[i].z, rtol=1e-12)
    # k = 0.02 T: both manoeuvres have the same independent lines per T, so their weights are equal here.
    np.testing.assert_allclose(both.weight, 1.0)
    longer = on_lines(x, [wrench_of(v) for v in z], dt, LINES[::10])  # 0.2 Hz apart: all independent
    np.testing.assert_allclose(longer.each(longer.weight)[1] * longer.weight[-1], np.sqrt(0.5))
    first, second = np.split(both.nuisance, 2, axis=1)
    assert not first[2:].any()
    assert not second[:2].any()


def test_two_manoeuvres_are_the_weighted_least_squares_of_numpy():
    rng = np.random.default_rng(1)
    x = [rng.standard_normal((3, n)) for n in (401, 1201)]
    z = [np.array([[1.0, -2.0, 0.5]]) @ v + rng.standard_normal((1, v.shape[1])) for v in x]
    equations = on_lines(x, [wrench_of(v) for v in z], (0.05, 0.05), LINES, nuisance="none")
    fit = least_squares(equations.x, equations.z)
    rows, right = [], []
    for phi, response, duration, k in zip(x, z, (20.0, 60.0), (0.4, 1.0), strict=True):
        t = 0.05 * np.arange(phi.shape[1])
        for channels, into in ((phi, rows), (response, right)):
            slope, level = np.polyfit(t, channels.T, 1)
            flat = channels - slope[:, None] * t - level[:, None]
            into.append(np.sqrt(k / duration) * fourier(flat, 0.05, LINES))
    stack, response = (np.concatenate(part, axis=1) for part in (rows, right))
    expected = np.linalg.lstsq(
        np.hstack([stack.real, stack.imag]).T, np.hstack([response.real, response.imag]).T
    )[0]
    np.testing.assert_allclose(fit.estimate[0], expected[:, 0], rtol=1e-9)


def flights(rng, count, durations, colour):
    """Transforms of two manoeuvres: fixed regressors, noise of many realisations as responses."""
    signals, noises = [], []
    for duration in durations:
        t = np.arange(0.0, duration, 0.1)
        phases = rng.uniform(0, 2 * np.pi, (4, 24, 1))
        tones = np.sin(2 * np.pi * np.arange(2, 26)[:, None] / 17.0 * t + phases) * rng.standard_normal(
            (4, 24, 1)
        )
        kernel = 0.1 * np.exp(-2j * np.pi * np.outer(t, LINES))
        noise = rng.standard_normal((count, t.size + 100))
        if colour:  # of first order, 0.5 s
            noise = lfilter([1.0], [1.0, -np.exp(-0.2)], noise)
        weight = np.sqrt(min(1.0, 0.02 * duration) / duration)
        signals.append(weight * tones.sum(axis=1) @ kernel)
        noises.append(weight * noise[:, 100:] @ kernel)
    return np.concatenate(signals, axis=1), np.concatenate(noises, axis=1)


@pytest.mark.parametrize("colour", [False, True])
def test_intervals_of_two_manoeuvres_cover_what_they_say(colour):
    durations, held = (18.0, 40.0), []
    rng = np.random.default_rng(7)
    for _ in range(6):
        phi, noise = flights(rng, 400, durations, colour)
        fit = least_squares(phi, noise)
        corrected = (correct_coloured_lines if colour else correct_line_spacing)(
            fit, [LINES, LINES], durations
        )
        low, high = corrected.interval(0.95)
        held.append((low <= 0) & (high >= 0))
        naive = fit.interval(0.95)
        assert ((naive[0] <= 0) & (naive[1] >= 0)).mean() < 0.88
    assert 0.935 < np.mean(held) < 0.97


def test_one_manoeuvre_in_a_list_is_one_manoeuvre():
    rng = np.random.default_rng(3)
    rows = rng.standard_normal((5, LINES.size)) + 1j * rng.standard_normal((5, LINES.size))
    fit = least_squares(rows[:3], rows[3:])
    for correct in (correct_line_spacing, correct_coloured_lines):
        one, listed = correct(fit, LINES, 20.0), correct(fit, [LINES], [20.0])
        np.testing.assert_array_equal(one.covariance, listed.covariance)
        np.testing.assert_array_equal(one.degrees_of_freedom, listed.degrees_of_freedom)
    samples = least_squares(rows[:3].real, rows[3:].real)
    np.testing.assert_array_equal(
        correct_coloured_samples(samples).covariance,
        correct_coloured_samples(samples, samples=[LINES.size]).covariance,
    )


def test_each_manoeuvre_s_samples_have_a_spectrum_of_their_own():
    """A quiet and a noisy flight, each with its own regressor: each parameter gets its own flight's noise."""
    rng = np.random.default_rng(4)
    quiet, noisy = rng.standard_normal((2, 1, 300))
    x = np.zeros((2, 600))
    x[0, :300], x[1, 300:] = quiet, noisy
    noise = rng.standard_normal((50, 600)) * np.repeat([0.1, 1.0], 300)
    together = correct_coloured_samples(least_squares(x, noise), samples=[300, 300])
    for j, (own, part) in enumerate(((quiet, noise[:, :300]), (noisy, noise[:, 300:]))):
        alone = correct_coloured_samples(least_squares(own, part))
        np.testing.assert_allclose(together.std_error[:, j], alone.std_error[:, 0], rtol=1e-6)
    with pytest.raises(UsageError, match="manoeuvres of 500 samples do not make up a fit on 600"):
        correct_coloured_samples(least_squares(x, noise), samples=[200, 300])
