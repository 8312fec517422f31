"""The cubics are scipy's; their weights are derivatives with respect to the knot values."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from freqid.blend.pchip import Pchip

KNOTS = np.array([0.0, 1.0, 2.5, 3.0, 5.0, 9.0])
S = np.linspace(0, 9, 181)


def channels(n, seed=0):
    """Rising, falling, turning and flat data, and noise about nothing."""
    x = np.linspace(0, 1, n)
    noise = np.random.default_rng(seed).standard_normal((6, n))
    steep_end = np.concatenate([[0.0, 0.1], -np.arange(n - 2.0) * 5])[:n]
    return np.vstack([np.exp(3 * x), -x, np.sin(7 * x), steep_end, noise])


@pytest.mark.parametrize("n", [2, 3, 4, 6])
def test_weights_are_central_differences_of_scipy(n):
    knots, values = KNOTS[:n], channels(n)
    s = np.linspace(knots[0], knots[-1], 41)
    weights = Pchip(knots, values).weights(s)
    step = 1e-6
    for k in range(n):
        up, down = (
            PchipInterpolator(knots, values + sign * step * np.eye(n)[k], axis=1)(s) for sign in (1, -1)
        )
        np.testing.assert_allclose(weights[:, k], (up - down) / (2 * step), atol=2e-8)


def test_weights_add_up_to_one_and_reproduce_the_data():
    """Cubics through values plus a constant are the cubics plus it, and through multiples the multiples."""
    values = channels(6)
    curve = Pchip(KNOTS, values)
    weights = curve.weights(S)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(np.einsum("cki,ck->ci", weights, values), curve(S), atol=1e-10)


def test_a_flat_channel_has_weights_that_are_finite():
    assert np.isfinite(Pchip(KNOTS, np.zeros((1, 6))).weights(S)).all()


def test_nothing_is_extrapolated():
    curve = Pchip(KNOTS, channels(6))
    assert np.isnan(curve([-0.1, 9.1])).all()
    assert np.isnan(curve([-0.1, 9.1], 1)).all()
    assert np.isnan(curve.weights([-0.1, 9.1])).all()


def test_derivatives_are_of_the_curve():
    curve, s = Pchip(KNOTS, channels(6)), np.array([0.3, 1.7, 4.1, 8.9])
    np.testing.assert_allclose(curve(s, 1), (curve(s + 1e-6) - curve(s - 1e-6)) / 2e-6, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(
        curve(s, 2), (curve(s + 1e-6, 1) - curve(s - 1e-6, 1)) / 2e-6, rtol=1e-6, atol=1e-7
    )


@pytest.mark.parametrize(("truth", "spread"), [(np.zeros(12), 1.0), (5 * np.tanh(np.arange(12.0) - 5), 0.3)])
def test_with_a_spread_one_draw_tells_the_scatter_of_all(truth, spread):
    """Noise about nothing and beside a step: there the plain derivative is off by -14 % to +26 %."""
    knots = np.array([0, 3, 6, 9, 11, 12, 13.5, 15, 17, 19, 21, 26.0])
    s = np.linspace(0, 26, 105)
    values = truth + spread * np.random.default_rng(1).standard_normal((3000, 12))
    scatter = Pchip(knots, values)(s).std(axis=0)
    ratios = []
    for given in (np.full((200, 12), spread), None):
        weights = Pchip(knots, values[:200], given).weights(s)
        stated = spread * np.sqrt((weights**2).sum(axis=1)) / scatter
        ratios.append(np.percentile(stated, [2.5, 97.5]))
    assert ratios[0][0] > 0.90
    assert ratios[0][1] < 1.10
    assert ratios[1][0] < 0.88
    assert ratios[1][1] > 1.15


def test_a_chord_that_is_all_but_level_is_taken_for_level():
    """Weights over such slopes overflow; the suite takes warnings for errors."""
    values = np.array([[0.0, 1e-310, 1.0, 2.0]])
    level = np.array([[0.0, 0.0, 1.0, 2.0]])
    s = np.linspace(0.0, 3.0, 31)
    np.testing.assert_allclose(Pchip(KNOTS[:4], values)(s), Pchip(KNOTS[:4], level)(s), atol=1e-15)
