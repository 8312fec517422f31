"""Averages over errors being there or not, beside an integral over the same prior done on a grid."""

import numpy as np
import pytest

from freqid.identify.sensors.inclusion import MOST, average_over_inclusion


def test_the_average_is_the_posterior_of_a_grid():
    """Spike and slab in two dimensions: the slab on a grid, the spikes on its axes, weights by hand."""
    estimate, size = np.array([0.03, -0.02]), np.array([0.2, 0.3])
    covariance = np.array([[4e-4, 1.5e-4], [1.5e-4, 2.5e-4]])
    x = np.linspace(-0.4, 0.4, 1601)
    step = x[1] - x[0]
    precision = np.linalg.inv(covariance)

    def likelihood(a, b):
        d = np.stack(np.broadcast_arrays(a - estimate[0], b - estimate[1]))
        return np.exp(-0.5 * np.einsum("i...,ij,j...->...", d, precision, d))

    def prior(t, s):
        return np.exp(-0.5 * (t / s) ** 2) / (s * np.sqrt(2 * np.pi))

    parts = []  # weight, mean and second moment of each combination
    one, two = x[:, None], x[None, :]
    both = likelihood(one, two) * prior(one, size[0]) * prior(two, size[1]) * step**2
    first = likelihood(x, 0.0) * prior(x, size[0]) * step
    second = likelihood(0.0, x) * prior(x, size[1]) * step
    parts.append((float(likelihood(0.0, 0.0)), np.zeros(2), np.zeros(2)))
    parts.append((first.sum(), np.array([first @ x, 0]), np.array([first @ x**2, 0])))
    parts.append((second.sum(), np.array([0, second @ x]), np.array([0, second @ x**2])))
    moments = [np.array([(both * t**k).sum() for t in (one, two)]) for k in (1, 2)]
    parts.append((both.sum(), *moments))
    total = sum(p[0] for p in parts)
    mean = sum(p[1] for p in parts) / total
    square = sum(p[2] for p in parts) / total

    found = average_over_inclusion(estimate, covariance, size, np.array([True, True]))
    np.testing.assert_allclose(found.estimate, mean, rtol=1e-4)
    np.testing.assert_allclose(np.diag(found.covariance), square - mean**2, rtol=1e-4)
    there = np.array([parts[1][0] + parts[3][0], parts[2][0] + parts[3][0]]) / total
    np.testing.assert_allclose(found.probability, there, rtol=1e-4)


def test_what_is_not_there_is_hardly_taken_out_and_what_is_there_wholly():
    covariance = np.diag([0.002**2, 0.002**2, 0.01])
    found = average_over_inclusion(
        np.array([0.001, 0.14, 0.5]), covariance, np.array([0.3, 0.3, 3.0]), np.array([True, True, False])
    )
    assert abs(found.estimate[0]) < 2e-5
    assert found.probability[0] < 0.02
    assert found.estimate[1] == pytest.approx(0.14, rel=1e-3)
    assert found.probability[1] == pytest.approx(1.0)
    assert (found.estimate[2], found.covariance[2, 2]) == pytest.approx((0.5, 0.01))


def test_what_is_not_on_trial_follows_what_is():
    """A bias that goes with a scale moves back as the scale does: regression of the one on the other."""
    covariance = np.array([[1e-4, 8e-4], [8e-4, 1e-2]])
    found = average_over_inclusion(
        np.array([0.005, 0.3]), covariance, np.array([0.3, 1.0]), np.array([True, False])
    )
    moved = found.estimate[0] - 0.005
    assert found.estimate[1] == pytest.approx(0.3 + 8.0 * moved)
    assert found.covariance[1, 1] < 1e-2


def test_of_very_many_only_the_doubtful_are_tried():
    n = MOST + 3
    estimate = np.append(np.full(MOST, 0.001), np.full(3, 1.0))
    found = average_over_inclusion(estimate, 1e-4 * np.eye(n), np.full(n, 0.3), np.ones(n, dtype=bool))
    np.testing.assert_array_equal(found.probability[MOST:], 1.0)
    np.testing.assert_array_equal(found.estimate[MOST:], 1.0)
    nothing = average_over_inclusion(estimate, 1e-4 * np.eye(n), np.full(n, 0.3), np.zeros(n, dtype=bool))
    np.testing.assert_array_equal(nothing.estimate, estimate)
