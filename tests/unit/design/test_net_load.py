import itertools

import numpy as np
import pytest

from freqid.core.design import Multisine
from freqid.design.net_load import lowest_net_loads, net_loads, ways
from freqid.design.signals import relative_peak_factor, sample


def signals(count=4, tones=4, seed=3):
    rng = np.random.default_rng(seed)
    return [
        Multisine(f"e{j}", "rad", np.arange(2 + j, 2 + j + count * tones, count), np.ones(tones), p)
        for j, p in enumerate(rng.uniform(0, 2 * np.pi, (count, tones)))
    ]


def test_every_way_keeps_spectrum_and_peaks_and_starts_at_zero():
    signal = signals()[0]
    before = relative_peak_factor(signal.index, signal.amplitude, signal.phase)
    found = ways(signal)
    assert len(found) >= 8
    for way in found:
        np.testing.assert_array_equal(way.index, signal.index)
        np.testing.assert_array_equal(way.amplitude, signal.amplitude)
        assert abs(way.amplitude @ np.sin(way.phase)) < 1e-9
        # sampled elsewhere, so equal to what 64 points per shortest period leave open
        assert relative_peak_factor(way.index, way.amplitude, way.phase) == pytest.approx(before, rel=2e-3)


def test_net_loads_are_the_sum_of_what_each_effector_does():
    two, loads = signals(2), np.array([[1.0, -2.0], [0.5, 3.0]])
    net = net_loads(two, loads, points=16)
    each = np.array([sample(s.index, s.amplitude, s.phase, net.shape[1]) for s in two])
    np.testing.assert_allclose(net[1], 0.5 * each[0] + 3 * each[1], atol=1e-12)


def test_the_choice_is_as_good_as_trying_every_combination():
    two, loads = signals(2, tones=3), np.array([[1.0, 1.0]])
    chosen = lowest_net_loads(two, loads, np.ones(1), starts=8)
    best = min(np.abs(net_loads(pair, loads, points=32)).max() for pair in itertools.product(*map(ways, two)))
    assert np.abs(net_loads(chosen, loads, points=32)).max() <= 1.01 * best


def test_axes_that_do_not_count_are_left_alone_and_those_that_do_come_down():
    rng = np.random.default_rng(0)
    four, loads = signals(), rng.standard_normal((3, 4))
    before = np.abs(net_loads(four, loads)).max(axis=1)
    after = np.abs(net_loads(lowest_net_loads(four, loads, np.array([1.0, 0, 0])), loads)).max(axis=1)
    assert after[0] < 0.9 * before[0]
