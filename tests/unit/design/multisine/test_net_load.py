import itertools
from pathlib import Path

import numpy as np
import pytest
from linear_design import AMPLITUDE, GAINS, VEHICLE
from msgspec.structs import replace
from scipy.signal import lsim

from freqid.core.results.design import Multisine
from freqid.core.scenario import read_scenario
from freqid.core.sections.excitation import Excitation
from freqid.design.forecast.excursions import excursions
from freqid.design.forecast.modelled import perturbed_aircraft
from freqid.design.multisine.allocation import limits_from_db
from freqid.design.multisine.net_load import load_gains, lowest_nets, net_loads, nets, peaks_by_chance, ways
from freqid.design.multisine.orthogonal_set import (
    design_multisines,
    effectiveness,
    excited,
    with_low_net_loads,
)
from freqid.design.multisine.phases import lowest_peaks
from freqid.design.multisine.signals import relative_peak_factor, sample


def signals(count=4, tones=4, seed=3):
    rng = np.random.default_rng(seed)
    return [
        Multisine(f"e{j}", "rad", np.arange(2 + j, 2 + j + count * tones, count), np.ones(tones), p)
        for j, p in enumerate(rng.uniform(0, 2 * np.pi, (count, tones)))
    ]


def searched(sets, powers=None, limits=None):
    waves = lowest_peaks(sets, powers, limits=limits, starts=8)
    return [Multisine(f"e{j}", "rad", w.index, w.amplitude, w.phase) for j, w in enumerate(waves)]


def lowest(played, loads, weights, **options):
    return lowest_nets(played, load_gains(played, loads), weights, **options)


def by_chance(played, loads):
    return peaks_by_chance(played, load_gains(played, loads), seed=9)


def factors(played):
    return np.array([relative_peak_factor(s.index, s.amplitude, s.phase) for s in played])


def peaks(played, loads):
    return np.abs(net_loads(played, loads)).max(axis=1)


LA8 = Path(__file__).parents[4] / "scenarios" / "la8.toml"
COMBS = [np.arange(3 + j, 40, 6) for j in range(6)]
LOADS = np.random.default_rng(0).standard_normal((3, 6))


@pytest.fixture(scope="module", params=[0.0, 3.0], ids=["flat", "3 dB"])
def before_after(request):
    limits = limits_from_db(request.param)
    before = searched(COMBS, limits=limits)
    return before, lowest(before, LOADS, np.ones(3), limits=limits), limits


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
    assert 4 <= len(ways(signal, most=9)) <= 9


def test_net_loads_are_the_sum_of_what_each_effector_does():
    two, loads = signals(2), np.array([[1.0, -2.0], [0.5, 3.0]])
    net = nets(two, load_gains(two, loads), points=16)
    each = np.array([sample(s.index, s.amplitude, s.phase, net.shape[1]) for s in two])
    np.testing.assert_allclose(net[1], 0.5 * each[0] + 3 * each[1], atol=1e-12)


def test_nets_of_frequency_responses_are_what_a_simulation_settles_to():
    """Two inputs through a damped mode, integrated until only the periodic motion is left."""
    two, period = signals(2), 10.0
    A, B, C = np.array([[0.0, 1.0], [-4.0, -1.6]]), np.array([[0.3, 0.0], [1.0, -0.5]]), np.array([1.0, 0.2])
    s = np.concatenate([2j * np.pi * signal.index / period for signal in two])
    excited = np.repeat(B, [signal.index.size for signal in two], axis=1)
    gains = np.array([C @ np.linalg.solve(x * np.eye(2) - A, b) for x, b in zip(s, excited.T, strict=True)])
    found = nets(two, gains[None], points=256)
    time = period * np.arange(2 * found.shape[1]) / found.shape[1]
    inputs = [np.sin(np.outer(time / period, 2 * np.pi * w.index) + w.phase) @ w.amplitude for w in two]
    _, settled, _ = lsim((A, B, C[None], np.zeros((1, 2))), np.transpose(inputs), time)
    settled = settled[-found.shape[1] :]
    np.testing.assert_allclose(found[0], settled, atol=1e-3 * np.abs(settled).max())


def test_every_axis_comes_down_from_where_it_was_and_from_chance(before_after):
    before, after, limits = before_after
    bar = 0.8 if limits is None else 0.85  # 0.75 and 0.80 measured
    assert np.all(peaks(after, LOADS) < bar * peaks(before, LOADS))
    assert np.all(peaks(after, LOADS) < bar * by_chance(before, LOADS))


@pytest.mark.slow
def test_all_net_peaks_of_the_la8_come_down_by_a_fifth():
    scenario = read_scenario(LA8)[0]
    excitation = replace(scenario.excitation, allocation="interleaved", power_db=0.0, starts=8)
    design = design_multisines(excitation, scenario.effector)
    quiet = with_low_net_loads(design, excitation, scenario.effector)
    before, after = design.signals, quiet.signals
    loads = effectiveness(excited(excitation, scenario.effector))
    assert np.all(factors(after) <= 1.03 * factors(before))
    assert np.all(peaks(after, loads) < 0.8 * peaks(before, loads))
    assert np.all(peaks(after, loads) < 0.8 * by_chance(before, loads))


def test_peak_factors_stay_in_their_budget_and_starts_and_rms_where_they_were(before_after):
    before, after, limits = before_after
    assert np.all(factors(after) <= 1.03 * factors(before))
    for old, new in zip(before, after, strict=True):
        np.testing.assert_array_equal(new.index, old.index)
        assert abs(new.amplitude @ np.sin(new.phase)) < 1e-12
        assert new.amplitude @ new.amplitude == pytest.approx(old.amplitude @ old.amplitude, rel=1e-12)
        if limits is None:
            np.testing.assert_array_equal(new.amplitude, old.amplitude)
        else:
            ratio = new.amplitude**2 / np.mean(new.amplitude**2)
            assert limits[0] * (1 - 1e-9) <= ratio.min()
            assert ratio.max() <= limits[1] * (1 + 1e-9)


def test_powers_stay_near_the_spectrum_they_refer_to():
    powers, limits = [np.linspace(1.0, 4.0, s.size) for s in COMBS], limits_from_db(1.0)
    before = searched(COMBS, powers, limits)
    after = lowest(before, LOADS, np.ones(3), powers=powers, limits=limits, starts=2)
    moved = 0.0
    for old, new, power in zip(before, after, powers, strict=True):
        ratio = new.amplitude**2 / np.sum(new.amplitude**2) / (power / power.sum())
        assert limits[0] * (1 - 1e-9) <= ratio.min()
        assert ratio.max() <= limits[1] * (1 + 1e-9)
        moved = max(moved, np.abs(new.amplitude - old.amplitude).max())
    assert moved > 1e-3


def test_without_a_budget_only_start_sense_and_reversal_change():
    before = searched(COMBS)
    after = lowest(before, LOADS, np.ones(3), rpf_budget=0.0)
    for old, new in zip(before, after, strict=True):
        turns = [np.exp(1j * way.phase) for way in ways(old)]
        assert np.min([np.abs(turn - np.exp(1j * new.phase)).max() for turn in turns]) < 1e-9
    ratio = peaks(after, LOADS) / np.minimum(peaks(before, LOADS), by_chance(before, LOADS))
    assert ratio.max() < 0.95
    polished = lowest(before, LOADS, np.ones(3))
    assert peaks(polished, LOADS).max() < peaks(after, LOADS).max()


def test_what_exhaustion_finds_among_all_phases_is_found():
    """Two tones that start at zero have one free phase and two branches: few enough to try all pairs."""
    two = searched([np.array([2, 5]), np.array([3, 4])])
    budget, count = 0.1, 400
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    phases = np.concatenate([np.array([angle, -angle]).T, np.array([angle, angle + np.pi]).T])
    waves = []
    for signal in two:
        allowed = (1 + budget) * relative_peak_factor(signal.index, signal.amplitude, signal.phase)
        amplitudes = np.broadcast_to(signal.amplitude, phases.shape)
        good = relative_peak_factor(signal.index, amplitudes, phases) <= allowed
        waves.append(sample(signal.index, amplitudes[good], phases[good], 120))
    exhausted = min(np.abs(first + waves[1]).max(axis=1).min() for first in waves[0])
    found = lowest(two, np.ones((1, 2)), np.ones(1), rpf_budget=budget)
    assert np.all(factors(found) <= (1 + budget) * factors(two))
    # 24 samples per shortest period hide up to 0.9 % of a peak from the exhaustive search
    assert peaks(found, np.ones((1, 2)))[0] <= 1.01 * exhausted


def test_the_choice_is_no_worse_than_trying_every_combination():
    two, loads = signals(2, tones=3), np.array([[1.0, 1.0]])
    chosen = lowest(two, loads, np.ones(1), starts=8)
    best = min(np.abs(net_loads(pair, loads)).max() for pair in itertools.product(*map(ways, two)))
    assert peaks(chosen, loads)[0] <= best


def test_axes_and_signals_that_do_not_count_are_left_alone():
    four, loads = signals(), np.random.default_rng(0).standard_normal((3, 4))
    loads[0, 2] = 0.0
    chosen = lowest(four, loads, np.array([1.0, 0.0, 0.0]))
    assert chosen[2] is four[2]
    assert peaks(chosen, loads)[0] < 0.8 * peaks(four, loads)[0]
    assert lowest(four, loads, np.zeros(3)) == four
    assert lowest(four, np.zeros((3, 4)), np.ones(3)) == four


def test_weight_moves_the_gain_to_the_axis_that_matters():
    before = searched(COMBS)
    first, last = (
        peaks(lowest(before, LOADS, np.array(w), starts=4), LOADS) for w in ([1.5, 1.0, 1.0], [1.0, 1.0, 1.5])
    )
    assert first[0] < last[0]
    assert last[2] < first[2]


def test_the_same_seed_gives_the_same_signals():
    before = searched(COMBS)
    once, again = (lowest(before, LOADS, np.ones(3), starts=2, seed=4) for _ in range(2))
    for one, other in zip(once, again, strict=True):
        np.testing.assert_array_equal(one.phase, other.phase)


def test_signals_that_cannot_be_improved_come_back_no_worse():
    once = lowest(searched(COMBS), LOADS, np.ones(3))
    twice = lowest(once, LOADS, np.ones(3), starts=1, rpf_budget=0.0)
    assert np.all(peaks(twice, LOADS) <= (1 + 1e-9) * peaks(once, LOADS))


def test_states_near_their_abort_limits_come_down_with_the_axes(linear_aircraft):
    excitation = Excitation(
        band_hz=(0.1, 1.5),
        period_s=20.0,
        amplitude=AMPLITUDE,
        net_load={"Z": 1.0, "M": 1.0},
        abort={"theta": 0.5, "q": 0.1, "p": 3.0, "alt": 5.0},
    )
    rows = linear_aircraft.DERIVATIVES.items()
    effectors = [
        replace(e, effectiveness={w: row[e.name] for w, row in rows if e.name in row})
        for e in VEHICLE.effectors
    ]
    loop = perturbed_aircraft(linear_aircraft.DERIVATIVES, VEHICLE, u=20.0, gains=GAINS)
    design = design_multisines(excitation, effectors)
    blind = with_low_net_loads(design, excitation, effectors)
    seeing = with_low_net_loads(design, excitation, effectors, loop)
    alone = with_low_net_loads(design, replace(excitation, net_load={}), effectors, loop)

    share = excursions(design, loop, ["theta", "q", "p"]).peak / [0.5, 0.1, 3.0]
    assert share.argmax() == 1  # the pitch rate comes nearest to its limit
    q = [excursions(played, loop, ["q"]).peak[0] for played in (design, blind, seeing, alone)]
    assert q[3] < 0.8 * q[0]
    assert q[3] < q[2] < q[1] < q[0]
    assert q[2] < 0.9 * q[0]
    axes = effectiveness(effectors)[[2, 4]]
    assert np.all(peaks(seeing.signals, axes) < 0.95 * peaks(design.signals, axes))
    assert np.all(factors(seeing.signals) <= 1.03 * factors(design.signals))
    assert with_low_net_loads(design, replace(excitation, net_load={}), effectors).signals == design.signals
