import numpy as np
import pytest

from freqid.core.results.design import Multisine
from freqid.design.multisine import joint_phases
from freqid.design.multisine.allocation import limits_from_db
from freqid.design.multisine.joint_phases import JointPhases
from freqid.design.multisine.net_load import load_gains, net_loads
from freqid.design.multisine.phases import lowest_peaks
from freqid.design.multisine.signals import relative_peak_factor

COMBS = [np.arange(3 + j, 40, 6) for j in range(6)]
TONES = sum(comb.size for comb in COMBS)
POWERS = [np.linspace(1.0, 2.0, comb.size) for comb in COMBS]
LOADS = np.random.default_rng(0).standard_normal((2, 6))
BUDGET = 0.03


def searched(limits=None):
    waves = lowest_peaks(COMBS, POWERS, limits=limits, starts=4)
    return [Multisine(f"e{j}", "rad", w.index, w.amplitude, w.phase) for j, w in enumerate(waves)]


def gains(seed=1):
    """Two loads that follow at once, and two states that lag behind by angles of their own."""
    rng = np.random.default_rng(seed)
    turned = rng.standard_normal((2, TONES)) + 1j * rng.standard_normal((2, TONES))
    return np.concatenate([np.repeat(LOADS, [comb.size for comb in COMBS], axis=1), turned])


@pytest.fixture(scope="module", params=[0.0, 3.0], ids=["flat", "3 dB"])
def polished(request):
    limits = limits_from_db(request.param)
    problem = JointPhases(searched(limits), gains(), BUDGET, POWERS, limits)
    return problem, problem.polish(problem.state(searched(limits)), 8, 0.1), limits


def test_the_peak_is_the_largest_of_all_nets_at_any_time():
    signals = searched()
    scaled = load_gains(signals, LOADS).astype(complex)
    state = JointPhases(signals, scaled, BUDGET, POWERS, None).state(signals)
    assert state.peak == pytest.approx(np.abs(net_loads(signals, LOADS)).max(), rel=1e-12)
    theta = 2 * np.pi * np.arange(5000) / 5000
    angle = np.concatenate([np.outer(s.index, theta) + s.phase[:, None] for s in signals])
    adds = gains() * np.concatenate([s.amplitude for s in signals])
    heights = np.abs((adds @ np.exp(1j * angle)).imag)
    state = JointPhases(signals, gains(), BUDGET, POWERS, None).state(signals)
    assert state.peak == pytest.approx(heights.max(), rel=2e-3)


def extremes(waves, least):
    high = np.abs(waves)
    return (high >= least) & (high >= np.roll(high, 1, axis=1)) & (high > np.roll(high, -1, axis=1))


def test_slopes_of_all_high_peaks_are_those_of_differences():
    limits, near, h = limits_from_db(3.0), 0.5, 1e-5
    signals = searched(limits)
    problem = JointPhases(signals, gains(), BUDGET, POWERS, limits)
    state = problem.state(signals)
    rows, _ = problem._peaks(state, near)
    rng = np.random.default_rng(2)
    turn, change = rng.standard_normal((2, TONES))

    def heights(step):
        amplitude, phase = state.amplitude * np.sqrt(1 + step * change), state.phase + step * turn
        return problem._nets(amplitude, phase), problem._waves(amplitude, phase)

    (nets, waves), (up, up_own), (down, down_own) = heights(0.0), heights(h), heights(-h)
    found = rows @ np.concatenate([turn, change, [0.0, 0.0]])

    top = extremes(nets, near * state.peak)
    assert top.sum() > 20
    slope = (np.sign(nets) * (up - down))[top] / (2 * h)
    np.testing.assert_allclose(found[: slope.size], slope, rtol=1e-6, atol=1e-7)

    top = extremes(waves, near * np.minimum(waves.max(axis=1), -waves.min(axis=1))[:, None])
    slope, above = (np.sign(waves) * (up_own - down_own))[top] / (2 * h), waves[top] > 0
    room, owner = slope / found[-slope.size :], np.nonzero(top)[0]
    assert found.size == extremes(nets, near * state.peak).sum() + slope.size
    for signal, wave in enumerate(waves):
        most = [room[(owner == signal) & side] for side in (above, ~above)]
        for values in most:  # peaks are measured by what they may reach, alike on one side
            np.testing.assert_allclose(values, values[0], rtol=1e-5)
        assert 1.0 < (most[0][0] + most[1][0]) / np.ptp(wave) <= 1 + BUDGET


def test_a_small_step_brings_what_its_linear_programme_foresees():
    signals = searched()
    problem = JointPhases(signals, gains(), BUDGET, POWERS, None)
    state = problem.state(signals)
    lost = []
    for trust in (4e-3, 1e-3):
        (turn, _), foreseen = problem._step(state, trust)
        assert np.abs(turn).max() == pytest.approx(trust)
        reached = problem._judge(state.amplitude, problem._start_at_zero(state.amplitude, state.phase + turn))
        gain = state.merit - foreseen
        assert gain > 0.3 * trust * state.merit
        lost.append((reached.merit - foreseen) / gain)
    assert abs(lost[1]) < 0.05
    assert abs(lost[1]) < 0.5 * abs(lost[0])  # what is lost is of second order


def test_every_step_is_better_than_the_one_before_and_the_last_by_much(polished):
    _, path, _ = polished
    merits = [state.merit for state in path]
    assert np.all(np.diff(merits) < 0)
    assert merits[-1] < 0.9 * merits[0]


def test_budget_starts_powers_and_harmonics_are_kept(polished):
    problem, path, limits = polished
    given = problem.signals(path[0])
    allowed = [(1 + BUDGET) * relative_peak_factor(s.index, s.amplitude, s.phase) for s in given]
    for state in path[1:]:
        played = problem.signals(state)
        factors = [relative_peak_factor(s.index, s.amplitude, s.phase) for s in played]
        assert np.max(np.divide(factors, allowed)) - 1 == pytest.approx(state.excess, abs=1e-12) or (
            state.excess == 0.0 and np.all(np.less_equal(factors, allowed))
        )
        for old, new, power in zip(given, played, POWERS, strict=True):
            np.testing.assert_array_equal(new.index, old.index)
            assert abs(new.amplitude @ np.sin(new.phase)) < 1e-12
            assert new.amplitude @ new.amplitude == pytest.approx(old.amplitude @ old.amplitude, rel=1e-9)
            if limits is None:
                np.testing.assert_array_equal(new.amplitude, old.amplitude)
            else:
                ratio = new.amplitude**2 / np.sum(new.amplitude**2) * power.sum() / power
                assert limits[0] * (1 - 1e-9) <= ratio.min()
                assert ratio.max() <= limits[1] * (1 + 1e-9)


@pytest.mark.parametrize("decibels", [0.0, 3.0])
def test_where_a_range_is_dear_the_budget_is_kept(monkeypatch, decibels):
    """At the price in use a path may end over the budget by up to 2 %, by where it starts.

    At a dear price all that is left is what a linear step overshoots, for which a part of the budget is
    held back: over 20 starts of each kind 2e-4 at most, and the peak fell to 0.88 of the first or less.
    """
    monkeypatch.setattr(joint_phases, "_PENALTY", 100.0)
    limits = limits_from_db(decibels)
    problem = JointPhases(searched(limits), gains(), BUDGET, POWERS, limits)
    path = problem.polish(problem.state(searched(limits)), 24, 0.1)
    assert path[-1].excess < joint_phases._RESERVE * BUDGET
    assert min(state.peak for state in path if state.excess == 0.0) < 0.95 * path[0].peak


def test_a_larger_budget_buys_lower_nets():
    signals = searched()
    peaks = []
    for budget in (0.005, 0.05):
        problem = JointPhases(signals, gains(), budget, POWERS, None)
        peaks.append(problem.polish(problem.state(signals), 12, 0.1)[-1].merit)
    assert peaks[1] < 0.97 * peaks[0]
