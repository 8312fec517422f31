"""Bias and trend removal."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.identify.spectra.fourier import FourierPlan, frequency_grid
from freqid.identify.spectra.trend import remove_trend, trend_columns, up_to

DT = 0.1
TIME = DT * np.arange(201)


@pytest.fixture
def rng():
    return np.random.default_rng(20240229)


@pytest.mark.parametrize("kind", ["none", "mean", "endpoints", "line"])
def test_what_was_removed_restores_the_channels(rng, kind):
    x = rng.standard_normal((3, 201)) + 2.0 - 0.3 * TIME
    d = remove_trend(x, DT, kind)
    np.testing.assert_allclose(d.x + d.bias[:, None] + d.slope[:, None] * TIME, x, atol=1e-13)


def test_each_kind_removes_what_it_says(rng):
    x = rng.standard_normal((2, 201)) + 5.0
    np.testing.assert_array_equal(remove_trend(x, DT, "none").x, x)
    np.testing.assert_allclose(remove_trend(x, DT, "mean").x.mean(axis=1), 0.0, atol=1e-13)
    ends = remove_trend(x, DT).x
    np.testing.assert_allclose(ends[:, [0, -1]], 0.0, atol=1e-13)
    line = remove_trend(x, DT, "line")
    slope, bias = np.polyfit(TIME, x.T, 1)  # an independent least-squares line
    np.testing.assert_allclose(line.slope, slope, atol=1e-12)
    np.testing.assert_allclose(line.bias, bias, atol=1e-12)


@pytest.mark.parametrize("kind", ["endpoints", "line"])
def test_a_straight_line_is_removed_whole(kind):
    x = np.stack([3.0 - 0.5 * TIME, np.full(201, -1.0)])
    d = remove_trend(x, DT, kind)
    np.testing.assert_allclose(d.x, 0.0, atol=1e-12)
    np.testing.assert_allclose(d.bias, [3.0, -1.0])
    np.testing.assert_allclose(d.slope, [-0.5, 0.0], atol=1e-13)


def test_the_input_is_left_alone(rng):
    x = rng.standard_normal((2, 50))
    before = x.copy()
    remove_trend(x, DT, "line").x[:] = 0.0
    remove_trend(x, DT, "none").x[:] = 0.0
    np.testing.assert_array_equal(x, before)


def test_requests_that_make_no_sense():
    with pytest.raises(UsageError, match="'quadratic'"):
        remove_trend(np.zeros((1, 10)), DT, "quadratic")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"\(10,\)"):
        remove_trend(np.zeros(10), DT)
    with pytest.raises(UsageError, match=r"\(2, 1\)"):
        remove_trend(np.zeros((2, 1)), DT)


@pytest.mark.parametrize(("step", "rows"), [(0.013, 2), (0.05, 1)])
def test_trend_columns_are_the_transforms_of_constant_and_line(step, rows):
    """T = 20 s: 0.05 Hz are harmonics, on which the constant vanishes."""
    f = frequency_grid(0.05, step, 2.0)
    transforms = FourierPlan(201, DT, f)(np.stack([np.ones(201), TIME / 20.0 - 0.5]))
    np.testing.assert_allclose(trend_columns(f, 20.0), transforms[-rows:], atol=1e-12)


def test_up_to_keeps_what_is_below_and_drops_what_is_above():
    dt, t = 0.02, np.arange(3001) * 0.02
    low = 3.0 + 0.2 * t + np.sin(2 * np.pi * 0.75 * t)
    both = np.array([low + 0.5 * np.sin(2 * np.pi * 4.0 * t), low])
    kept = up_to(both, dt, 2.0)
    np.testing.assert_allclose(kept, [low, low], atol=1e-12)
