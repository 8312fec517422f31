"""The finite Fourier integral against closed forms, extended precision and slow sums."""

from __future__ import annotations

from fractions import Fraction
from math import comb

import mpmath
import numpy as np
import pytest

from freqid.identify.spectra.fourier import FourierPlan, fourier_end_weights, frequency_grid, harmonics

DT, SAMPLES = 0.02, 3001
TIME = DT * np.arange(SAMPLES)
GRID = frequency_grid(0.05, 0.01, 2.0)


@pytest.fixture
def rng():
    return np.random.default_rng(20240229)


def signal(t):
    """The test signal: a lightly damped mode on a bias and a curved trend."""
    return np.exp(-0.08 * t) * np.sin(2 * np.pi * 0.6 * t) + 0.3 - 0.02 * t + 4e-4 * t**2


def signal_integral(f, T):
    """Its finite Fourier integral, each term integrated by hand."""
    k = 2j * np.pi * np.asarray(f)
    decay = np.exp(-k * T)
    total = 0.3 * (1 - decay) / k
    total -= 0.02 * (1 / k**2 - decay * (T / k + 1 / k**2))
    total += 4e-4 * (2 / k**3 - decay * (T**2 / k + 2 * T / k**2 + 2 / k**3))
    for sign in (1.0, -1.0):
        pole = -0.08 + sign * 2j * np.pi * 0.6 - k
        total += sign / 2j * (np.exp(pole * T) - 1) / pole
    return total


def slow_sum(x, dt, f):
    """The plain sum, sample by sample."""
    total = np.zeros((len(x), len(f)), dtype=complex)
    for k in range(x.shape[1]):
        total += x[:, k : k + 1] * np.exp(-2j * np.pi * f * k * dt)
    return dt * total


def gregory_sum(x, dt, f, order):
    """The plain sum with Gregory's end weights, the coefficients exact from their recurrence."""
    g = [Fraction(1)]
    for m in range(1, order + 2):
        g.append(-sum(g[k] * Fraction((-1) ** (m - k), m + 1 - k) for k in range(m)))
    weights = np.ones(x.shape[1])
    for i in range(order + 1):
        w = -sum(abs(g[m + 1]) * (-1) ** i * comb(m, i) for m in range(max(i, 0), order + 1))
        weights[i] += float(w)
        weights[-1 - i] += float(w)
    return slow_sum(x * weights, dt, f), weights


def test_closed_form_of_the_signal_agrees_with_extended_precision():
    def integrand(t):
        return mpmath.exp(-0.08 * t) * mpmath.sin(2 * mpmath.pi * 0.6 * t) + 0.3 - 0.02 * t + 4e-4 * t**2

    for f in (0.05, 2.0):
        with mpmath.workdps(18):
            exact = mpmath.quad(
                lambda t, f=f: integrand(t) * mpmath.exp(-2j * mpmath.pi * f * t), mpmath.linspace(0, 60, 61)
            )
        assert abs(signal_integral(f, 60.0) - complex(exact)) < 1e-13 * abs(complex(exact)) + 1e-14


@pytest.mark.parametrize("method", ["bins", "shifted", "zoom", "direct"])
def test_accuracy_and_noise_gain_on_the_reference_signal(method):
    """Bars: 5e-8 largest relative, 3e-10 rms, noise gain 1.02. Every way to sum stays 25 times below them."""
    # Off the FFT bins by 1e-6 Hz; a spacing that no FFT has; a list that is not uniform.
    f = {
        "bins": GRID,
        "shifted": GRID + 1e-6,
        "zoom": np.linspace(GRID[0], GRID[-1] + 1e-3, GRID.size),
        "direct": np.concatenate([GRID[:-1], [2.0005]]),
    }[method]
    plan = FourierPlan(SAMPLES, DT, f)
    assert plan.method == method
    exact = signal_integral(f, 60.0)
    error = plan(signal(TIME)[None])[0] - exact
    assert np.max(np.abs(error / exact)) < 2e-9
    assert np.linalg.norm(error) / np.linalg.norm(exact) < 1e-11
    assert 0.99 < plan.noise_gain < 1.001


def test_the_corrections_beat_gregory_of_high_order_at_less_noise():
    """Ten of Gregory's weights at each end were measured before: 4.1e-8 and 2.1e-10 on this signal."""
    exact = signal_integral(GRID, 60.0)
    ten, _ = gregory_sum(signal(TIME)[None], DT, GRID, 9)
    assert np.max(np.abs(ten[0] / exact - 1)) == pytest.approx(4.1e-8, rel=0.01)
    assert np.linalg.norm(ten[0] - exact) / np.linalg.norm(exact) == pytest.approx(2.1e-10, rel=0.03)
    eleven, weights = gregory_sum(signal(TIME)[None], DT, GRID, 10)
    plan = FourierPlan(SAMPLES, DT, GRID)
    ours = np.max(np.abs(plan(signal(TIME)[None])[0] / exact - 1))
    assert ours < np.max(np.abs(eleven[0] / exact - 1)) / 50
    assert plan.noise_gain < np.sqrt(weights @ weights / SAMPLES) - 0.01


def test_accuracy_lasts_up_to_nyquist():
    """At 10 Hz sampling a mode of 0.6 Hz is resolved up to 5 Hz, where Gregory's weights are useless."""
    dt, n = 0.1, 601
    f = frequency_grid(0.05, 0.01, 5.0)
    exact = signal_integral(f, 60.0)
    x = signal(dt * np.arange(n))[None]
    ours = np.abs(FourierPlan(n, dt, f)(x)[0] / exact - 1)
    gregory = np.abs(gregory_sum(x, dt, f, 6)[0][0] / exact - 1)
    assert np.max(ours) < 1e-4
    assert np.max(gregory) > 0.05


def test_end_weights_are_gregory_at_zero_frequency():
    """-1/2 + 1/12, 1/12 for order 1; the rest from the exact coefficients."""
    np.testing.assert_allclose(fourier_end_weights(0.0, 1)[:, 0], [-1 / 2 - 1 / 12, 1 / 12], atol=1e-15)
    _, weights = gregory_sum(np.zeros((1, 40)), DT, np.ones(1), 10)
    np.testing.assert_allclose(fourier_end_weights(0.0, 10)[:, 0], weights[:11] - 1.0, rtol=1e-13)


@pytest.mark.parametrize("theta", [1e-6, 0.05, 0.5, 0.7, 0.8, 2.0, np.pi])
def test_end_weights_against_extended_precision_moments(theta):
    """The weights solve Abel-summed moment equations: a polynomial is integrated over [0, infinity) exactly.

    With `exp(-s k)` as convergence factor and s -> 0, `sum_k C(k, m) z^k = z^m / (1 - z)^(m+1)` and
    `integral C(t, m) exp(-j theta t) dt` follows from integrals of powers, `r! / (j theta)^(r+1)`.
    """
    order = 6
    with mpmath.workdps(80):
        th = mpmath.mpf(theta)
        z = mpmath.exp(-1j * th)
        rows, right = mpmath.matrix(order + 1), mpmath.matrix(order + 1, 1)
        for m in range(order + 1):
            poly = [mpmath.mpf(1)]  # C(t, m) by ascending powers of t
            for k in range(m):
                shifted = [mpmath.mpf(0), *poly]
                poly = [a / (k + 1) for a in (s - k * p for s, p in zip(shifted, [*poly, 0], strict=True))]
            integral = sum(c * mpmath.factorial(r) / (1j * th) ** (r + 1) for r, c in enumerate(poly))
            right[m] = integral - z**m / (1 - z) ** (m + 1)
            for i in range(order + 1):
                rows[m, i] = mpmath.binomial(i, m)
        exact = [complex(v) for v in mpmath.lu_solve(rows, right)]
    np.testing.assert_allclose(fourier_end_weights(theta, order)[:, 0], exact, atol=1e-13)


@pytest.mark.parametrize(
    ("samples", "dt", "frequencies", "method"),
    [
        (3001, 0.02, GRID, "bins"),  # padded to 5000
        (6001, 0.01, harmonics(60.0, (0.05, 1.8)), "bins"),  # one period and a sample
        (2501, 0.02, harmonics(20.0, (0.05, 4.0)), "bins"),  # two and a half periods, folded
        (2000, 0.02, harmonics(40.0, (0.025, 2.0)), "bins"),  # one sample short of a period
        (1001, 0.02, frequency_grid(0.0731, 0.0113, 2.0), "zoom"),
        (3001, 0.02, frequency_grid(0.0503, 0.01, 2.0), "shifted"),
        (6001, 0.02, frequency_grid(0.0557, 0.01, 2.0), "shifted"),  # folded, nearest bin above
        (1001, 0.02, frequency_grid(0.1, 0.02, 1.0), "direct"),
        (1001, 0.02, np.geomspace(0.05, 25.0, 120), "direct"),
    ],
)
def test_every_method_matches_a_slow_sum(rng, samples, dt, frequencies, method):
    plan = FourierPlan(samples, dt, frequencies)
    assert plan.method == method
    x = rng.standard_normal((3, samples))
    expected = slow_sum(x, dt, plan.frequencies_hz)
    w = fourier_end_weights(2 * np.pi * plan.frequencies_hz * dt, 6)
    for i in range(7):
        expected += dt * x[:, i, None] * w[i]
        expected += (
            dt * x[:, -1 - i, None] * w[i].conj() * np.exp(-2j * np.pi * plan.frequencies_hz * plan.duration)
        )
    np.testing.assert_allclose(plan(x), expected, atol=1e-11 * np.max(np.abs(expected)))


@pytest.mark.parametrize("dt", [0.02, 0.1])
def test_noise_gain_from_the_weight_of_every_sample(dt):
    """The transform of unit impulses is the weight of each sample; white noise adds their squares."""
    samples = 801
    plan = FourierPlan(samples, dt, frequency_grid(0.0731, 0.0531, 5.0))
    weights = plan(np.eye(samples))
    gain = np.sqrt(np.max(np.sum(np.abs(weights) ** 2, axis=0)) / samples) / dt
    assert plan.noise_gain == pytest.approx(gain, rel=1e-12)
    assert plan.noise_gain < 1.004


def test_derivative_theorem_with_its_end_terms():
    """The transform of the analytic derivative, without differentiating."""
    t, decay, w = TIME, 0.08, 2 * np.pi * 0.6
    slope = np.exp(-decay * t) * (w * np.cos(w * t) - decay * np.sin(w * t)) - 0.02 + 8e-4 * t
    plan = FourierPlan(SAMPLES, DT, GRID)
    np.testing.assert_allclose(plan.derivative(signal(t)[None]), plan(slope[None]), atol=1e-9)


def test_nuisance_columns_take_up_errors_of_the_end_samples():
    """Wrong end samples disturb a derivative's transform; real multiples of the columns explain it."""
    plan = FourierPlan(SAMPLES, DT, GRID)
    wrong = signal(TIME)[None].copy()
    wrong[0, 0] += 1.3
    wrong[0, -1] -= 0.4
    error = (plan.derivative(wrong) - plan.derivative(signal(TIME)[None]))[0]
    columns = plan.nuisance().T
    stacked = np.concatenate([columns.real, columns.imag])
    both = np.concatenate([error.real, error.imag])
    solution = np.linalg.lstsq(stacked, both, rcond=None)[0]
    # What is left is the two samples' share in X itself, j omega dt times a weight of about 0.3.
    np.testing.assert_allclose(solution, [-1.3, -0.4], rtol=0.02)
    assert np.linalg.norm(both - stacked @ solution) < 0.06 * np.linalg.norm(both)
