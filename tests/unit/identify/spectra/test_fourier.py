"""What a Fourier plan promises beside its numbers: shapes, choices, errors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from freqid.core.errors import DataError, UsageError
from freqid.identify.spectra.fourier import FourierPlan, fourier, frequency_grid, harmonics


@pytest.fixture
def rng():
    return np.random.default_rng(20240229)


def test_shapes_are_kept_and_nothing_is_squeezed():
    plan = FourierPlan(501, 0.02, [0.5])
    assert plan(np.ones((1, 501))).shape == (1, 1)
    assert plan.derivative(np.ones((4, 501))).shape == (4, 1)
    assert plan(np.empty((0, 501))).shape == (0, 1)
    assert plan.end_terms().shape == (2, 1)


def test_properties_of_a_plan():
    plan = FourierPlan(3001, 0.02, harmonics(60.0, (0.05, 1.8)))
    assert plan.duration == pytest.approx(60.0)
    assert plan.resolution == pytest.approx(1 / 60)
    assert plan.frequencies_hz.size == 106
    with pytest.raises(ValueError, match="read-only"):
        plan.frequencies_hz[0] = 1.0
    assert FourierPlan(3001, 0.02, [0.1, 0.2, 0.4]).resolution is None
    assert FourierPlan(3001, 0.02, [0.1]).resolution is None


@pytest.mark.parametrize("n", [2, 3, 5, 8, 13, 14])
def test_few_samples_lower_the_order(n):
    """Where the two corrected ends would meet the degree shrinks; up to it polynomials stay exact."""
    plan = FourierPlan(n, 1.0, [0.5])
    assert plan.order == min(6, n // 2 - 1)
    t = np.arange(n) - (n - 1) / 2
    node, weight = np.polynomial.legendre.leggauss(40)
    s = node * (n - 1) / 2
    for power in range(plan.order + 1):
        expected = np.sum(weight * s**power * np.exp(-1j * np.pi * (s + (n - 1) / 2))) * (n - 1) / 2
        assert plan(t[None] ** power)[0, 0] == pytest.approx(expected, abs=1e-12 * n ** (power + 1))


def test_nuisance_columns_where_the_ends_cannot_be_told_apart():
    on = FourierPlan(3001, 0.02, harmonics(60.0, (0.05, 1.8)))
    between = FourierPlan(3001, 0.02, harmonics(60.0, (0.05, 1.8)) + 0.5 / 60)
    off = FourierPlan(3001, 0.02, frequency_grid(0.05, 0.01, 1.8))
    np.testing.assert_allclose(on.end_terms()[0], on.end_terms()[1], atol=1e-10)
    assert on.nuisance().shape == (1, 106)
    np.testing.assert_allclose(between.end_terms()[0], -between.end_terms()[1], atol=1e-10)
    assert between.nuisance().shape == (1, 106)
    assert off.nuisance().shape == (2, 176)


@pytest.mark.parametrize(
    ("samples", "dt", "frequencies", "words"),
    [
        (101, 0.1, [0.2, 5.1], "5.1 Hz, is above Nyquist, 5 Hz"),
        (101, 0.1, [0.09, 1.0], "10 s, less than the 11.1111 s period of its lowest frequency, 0.09 Hz"),
    ],
)
def test_data_that_cannot_carry_the_band(samples, dt, frequencies, words):
    with pytest.raises(DataError, match=words):
        FourierPlan(samples, dt, frequencies)


def test_a_period_cut_one_sample_short_is_accepted():
    assert FourierPlan(1000, 0.02, [0.05, 0.1]).duration == pytest.approx(19.98)
    with pytest.raises(DataError, match="less than"):
        FourierPlan(999, 0.02, [0.05, 0.1])


@pytest.mark.parametrize("bad", [[], [0.0, 1.0], [-1.0], [1.0, 0.5], [1.0, 1.0], [[1.0]], [0.5, np.nan]])
def test_frequencies_must_be_positive_and_increasing(bad):
    with pytest.raises(UsageError, match="positive, increasing"):
        FourierPlan(1001, 0.02, bad)


@pytest.mark.parametrize(("samples", "dt"), [(1, 0.1), (100, 0.0), (100, -0.1), (100, np.nan)])
def test_impossible_sampling(samples, dt):
    with pytest.raises(UsageError, match="two samples and a positive interval"):
        FourierPlan(samples, dt, [1.0])


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("count", [10, 120])
def test_a_sample_that_is_not_finite_is_named(value, count):
    x = np.zeros((3, 1001))
    x[1, 500] = value
    with pytest.raises(DataError, match=rf"channel 1 is {value} at sample 500"):
        FourierPlan(1001, 0.02, np.linspace(0.1, 2, count))(x)


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        ((1001,), "expected an array"),
        ((2, 1000), "planned for 1001 samples, not for 1000"),
        ((1, 2, 1001), "found shape"),
    ],
)
def test_shape_must_be_as_planned(shape, words):
    with pytest.raises(UsageError, match=words):
        FourierPlan(1001, 0.02, [1.0])(np.zeros(shape))


def test_lists_of_frequencies():
    np.testing.assert_allclose(harmonics(60.0, (0.05, 1.8)) * 60, np.arange(3, 109))
    np.testing.assert_allclose(harmonics(10.0, (0.0, 0.35)), [0.1, 0.2, 0.3])
    np.testing.assert_allclose(frequency_grid(0.1, 0.02, 1.5)[[0, -1]], [0.1, 1.5])
    assert frequency_grid(0.1, 0.02, 1.5).size == 71
    assert frequency_grid(0.1, 0.2, 0.45).tolist() == pytest.approx([0.1, 0.3])
    with pytest.raises(UsageError, match="no harmonic"):
        harmonics(1.0, (0.2, 0.8))
    with pytest.raises(UsageError, match="low:step:high"):
        frequency_grid(0.5, 0.1, 0.4)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(51, 900),
    st.integers(1, 80),
    st.floats(0.002, 0.4),
    st.floats(0.01, 1.0),
    st.integers(0, 2**32 - 1),
)
def test_linear_and_shift_and_reversal(samples, lines, dt, band, seed):
    """Properties of the integral that no wrong weight or phase survives, at any size and by any method."""
    low = 1.0 / ((samples - 1) * dt)
    high = low + band * (0.5 / dt - low)
    plan = FourierPlan(samples, dt, np.linspace(low, high, lines) if lines > 1 else [low])
    x, y = np.random.default_rng(seed).standard_normal((2, 2, samples))
    X, Y = plan(x), plan(y)
    size = dt * np.sqrt(samples)
    np.testing.assert_allclose(plan(2.0 * x - 3.0 * y), 2.0 * X - 3.0 * Y, atol=1e-10 * size)
    # x(T - t) has the conjugate transform, turned by exp(-j 2 pi f T).
    np.testing.assert_allclose(plan(x[:, ::-1]), X.conj() * plan.end_terms()[1], atol=1e-9 * size)
    # Polynomials up to the order are exact: the derivative theorem holds without remainder.
    tau = np.linspace(-1.0, 1.0, samples)
    rate = 2.0 / plan.duration
    powers = np.stack([tau**k for k in range(7)])
    slopes = np.stack([k * rate * tau ** max(k - 1, 0) for k in range(7)])
    np.testing.assert_allclose(plan.derivative(powers), plan(slopes), atol=1e-8)


@settings(max_examples=30, deadline=None)
@given(st.integers(8, 200), st.integers(0, 2**32 - 1))
def test_parseval_on_a_whole_period(half, seed):
    """A trigonometric polynomial of period T: line k carries T/2 of its complex amplitude, energy is kept."""
    rng = np.random.default_rng(seed)
    count = max(half // 8, 1)  # well resolved, so that quadrature is not what is tested
    a, b = rng.standard_normal((2, count))
    samples, dt = 2 * half + 1, 0.1
    T = 2 * half * dt
    t = dt * np.arange(samples)
    k = np.arange(1, count + 1)
    angle = 2 * np.pi * np.outer(t / T, k)
    x = np.cos(angle) @ a + np.sin(angle) @ b
    X = FourierPlan(samples, dt, k / T)(x[None])[0]
    energy = dt * np.sum(x[:-1] ** 2)  # exact for a trigonometric polynomial over its period
    np.testing.assert_allclose(2 / T * np.sum(np.abs(X) ** 2), energy, rtol=2e-3)
    np.testing.assert_allclose(X, T / 2 * (a - 1j * b), atol=2e-3 * T)


def test_one_line_convenience(rng):
    x = rng.standard_normal((2, 400))
    np.testing.assert_array_equal(fourier(x, 0.05, [0.5, 1.0]), FourierPlan(400, 0.05, [0.5, 1.0])(x))
