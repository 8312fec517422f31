"""Costs and bounds against numbers worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.gap.fidelity import frequency_cost, muad, muad_bounds, rmse, theil

F = np.geomspace(0.05, 5.0, 60)


def test_one_decibel_everywhere_costs_twenty_times_the_weight():
    flight = np.full(F.size, 10 ** (1 / 20)) * np.exp(0.7j)
    simulation = np.full(F.size, 1.0 + 0j) * np.exp(0.7j)
    trust = (1.58 * (1 - np.exp(-1.0))) ** 2
    assert trust == pytest.approx(0.9975, abs=1e-4)  # the constant makes full coherence count one
    assert frequency_cost(F, flight, simulation) == pytest.approx(20 * trust)
    less = (1.58 * (1 - np.exp(-0.6))) ** 2
    assert frequency_cost(F, flight, simulation, np.full(F.size, 0.6)) == pytest.approx(20 * less)


def test_a_delay_costs_by_phase_alone_summed_by_hand():
    flight = np.exp(-2j * np.pi * F * 0.05)
    at = np.geomspace(F[0], F[-1], 20)
    expected = 20 / 20 * sum(0.01745 * (360 * 0.05 * f) ** 2 for f in at) * (1.58 * (1 - np.exp(-1))) ** 2
    # degrees are straight between given frequencies on a logarithmic axis
    assert frequency_cost(F, flight, np.ones(F.size)) == pytest.approx(expected, rel=5e-3)
    exact = np.mean(0.01745 * (360 * 0.05 * F) ** 2) * 20 * (1.58 * (1 - np.exp(-1))) ** 2
    assert frequency_cost(F, flight, np.ones(F.size), points=None) == pytest.approx(exact)


def test_seven_and_a_half_degrees_are_worth_one_decibel():
    turned = frequency_cost(F, np.full(F.size, np.exp(1j * np.radians(7.57))), np.ones(F.size))
    louder = frequency_cost(F, np.full(F.size, 10 ** (1 / 20)), np.ones(F.size))
    assert turned == pytest.approx(louder, rel=1e-3)


def test_frequencies_that_are_not_known_are_left_out():
    flight = np.full(F.size, 2.0 + 0j)
    flight[::3] = np.nan
    assert frequency_cost(F, flight, np.full(F.size, 2.0)) == 0.0
    assert np.isnan(frequency_cost(F[:2], flight[:2], np.ones(2)))


def test_muad_is_narrowest_where_pilots_fly_and_holds_no_added_dynamics():
    w = np.geomspace(0.1, 30, 200)
    gain, phase = muad_bounds(w)
    for lower, upper in (gain, phase):
        assert np.all(lower < 0)
        assert np.all(upper > 0)
        assert 0.5 < w[np.argmin(upper - lower)] < 6
    assert muad(F, np.ones(F.size), np.ones(F.size)).unnoticed


def test_muad_bounds_by_hand_at_one_radian_per_second():
    gain, phase = muad_bounds(np.array([1.0]))
    # (3.16 s^2 + 31.61 s + 22.79) / (s^2 + 27.14 s + 1.84) at s = j: |19.63 + 31.61j| / |0.84 + 27.14j|
    assert gain[1, 0] == pytest.approx(20 * np.log10(37.2096 / 27.1530), abs=1e-3)
    assert gain[0, 0] == pytest.approx(20 * np.log10(np.hypot(2.0545, 9.92) / np.hypot(3.95, 11.6)))
    upper = np.arctan2(1100.12, -275.22 - 68.89) - np.arctan2(39.94, 8.99) + 0.0059
    assert phase[1, 0] == pytest.approx(np.degrees(upper))


def test_a_delay_of_a_tenth_of_a_second_is_noticed_and_a_hundredth_is_not():
    f = np.geomspace(0.05, 2.0, 80)

    def late(time):
        return muad(f, np.exp(-2j * np.pi * f * time), np.ones(f.size))

    assert late(0.01).unnoticed
    found = late(0.15)
    assert not found.unnoticed
    assert found.inside[0]  # a delay shows at high frequencies


def test_theil_of_a_bias_of_a_size_and_of_a_shape():
    t = np.arange(1000) / 1000
    z = np.sin(2 * np.pi * 5 * t)
    biased, larger, turned = theil(z, z + 0.3), theil(z, 1.5 * z), theil(z, np.cos(2 * np.pi * 5 * t))
    assert (biased.bias, biased.variance, biased.covariance) == pytest.approx((1, 0, 0), abs=1e-9)
    assert (larger.bias, larger.variance, larger.covariance) == pytest.approx((0, 1, 0), abs=1e-9)
    assert (turned.bias, turned.variance, turned.covariance) == pytest.approx((0, 0, 1), abs=1e-9)
    assert larger.coefficient == pytest.approx(0.5 / 2.5)
    assert turned.coefficient == pytest.approx(1 / np.sqrt(2))
    assert theil(z, -z).coefficient == pytest.approx(1.0)
    assert theil(z, z).coefficient == 0
    rng = np.random.default_rng(0)
    mixed = theil(z, 0.8 * z + 0.2 + 0.3 * rng.standard_normal(1000))
    assert mixed.bias + mixed.variance + mixed.covariance == pytest.approx(1.0)
    assert rmse(z, z + 0.3) == pytest.approx(0.3)


def test_shapes_that_differ_are_refused():
    with pytest.raises(UsageError, match="shapes"):
        theil(np.ones(3), np.ones(4))
    with pytest.raises(UsageError, match="shapes"):
        frequency_cost(F, np.ones(3), np.ones(F.size))
