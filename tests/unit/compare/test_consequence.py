"""Figures of a vehicle under a law, before and after a change of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqid.compare.consequence import Condition, assess, compare_conditions, trim_authority
from freqid.dynamics.linear_loop import Actuation, LinearLoop

SPEED, HEAVE, STIFFNESS = 20.0, -2.0, -0.6


def pitching(damping=-1.5, delay=0.02):
    """Return a short period with pitch held by an elevator that has a servo."""
    A = np.array([[HEAVE, SPEED, 0.0], [STIFFNESS, damping, 0.0], [0.0, 1.0, 0.0]])
    servo = replace(
        Actuation.ideal(1), delay=np.array([delay]), frequency=np.array([40.0]), damping=np.array([0.7])
    )
    gain = np.array([[0.0, -0.2, -0.6]])
    loop = LinearLoop(
        states=("w", "q", "theta"),
        effectors=("de",),
        axes=("M",),
        A=A,
        B=np.array([[-0.5], [-20.0], [0.0]]),
        gain=gain,
        allocation=np.eye(1),
        actuation=servo,
    )
    return Condition(loop)


def test_a_short_period_has_the_frequency_and_damping_of_its_characteristic_equation():
    """s^2 - (Zw + Mq) s + Zw Mq - u Mw."""
    mode = next(m for m in assess(pitching()).modes if m.name == "short period")
    frequency = np.sqrt(HEAVE * -1.5 - SPEED * STIFFNESS)
    assert mode.frequency == pytest.approx(frequency)
    assert mode.damping == pytest.approx((1.5 - HEAVE) / (2 * frequency))


def test_the_same_vehicle_costs_nothing():
    same = compare_conditions(pitching(), pitching())
    assert all(value == 0 or np.isnan(value) for value in same.change.values())
    assert same.change_intervals == {}
    assert same.unstable_share == 0


def test_intervals_are_those_of_linear_propagation():
    """The short period's frequency squared is linear in the pitch damping."""
    sigma = 0.1
    rng = np.random.default_rng(0)
    before = pitching()
    pairs = [(before, pitching(-1.5 + x)) for x in sigma * rng.standard_normal(400)]
    cost = compare_conditions(before, before, pairs, level=0.683)
    path = "modes/short period/frequency"
    frequency = np.sqrt(HEAVE * -1.5 - SPEED * STIFFNESS)
    low, high = cost.after_intervals[path]
    assert (high - low) / 2 == pytest.approx(sigma * abs(HEAVE) / (2 * frequency), rel=0.15)
    low, high = cost.change_intervals[path]
    assert low < 0 < high


def test_less_pitch_damping_and_a_later_servo_differ_in_what_they_cost():
    weaker = compare_conditions(pitching(), pitching(damping=-0.75))
    assert weaker.change["modes/short period/damping"] < -0.05
    later = compare_conditions(pitching(), pitching(delay=0.06))
    assert later.change["modes/short period/damping"] == 0
    turn = np.degrees(2 * np.pi * later.before.margins["M"].crossover_hz * 0.04)
    assert later.lost_phase_deg == pytest.approx(turn, rel=0.01)
    assert later.sentence().startswith(f"as flown it costs {turn:.1f} deg")
    assert compare_conditions(pitching(delay=0.06), pitching()).sentence().startswith("as flown it adds")


def unstable_pole(gain):
    """Return a vehicle that diverges at 1 rad/s, held by a gain."""
    one = np.ones((1, 1))
    return Condition(LinearLoop(("q",), ("dr",), ("M",), one, one, gain * one, one, Actuation.ideal(1)))


def test_an_unstable_loop_says_so_in_place_of_margins():
    cost = compare_conditions(unstable_pole(3.0), unstable_pole(0.5))
    assert cost.before.margins["M"].gain_down_db == pytest.approx(20 * np.log10(3))
    assert not cost.after.stable
    assert np.isnan(cost.after.figures()["margins/M/phase_deg"])
    assert np.isnan(cost.lost_phase_deg)
    assert "unstable" in cost.sentence()


def test_unstable_draws_are_counted_and_left_out_of_the_intervals():
    start = unstable_pole(3.0)
    gains = [2.0, 2.5, 3.5, 0.5]
    cost = compare_conditions(start, start, [(start, unstable_pole(g)) for g in gains])
    assert cost.unstable_share == pytest.approx(0.25)
    low, high = cost.after_intervals["margins/M/gain_down_db"]
    assert low >= 20 * np.log10(2.0) - 1e-9
    assert high == pytest.approx(20 * np.log10(3.5))


def test_without_a_law_there_are_modes_and_no_margins():
    loop = replace(pitching().loop, axes=(), gain=np.zeros((0, 3)), allocation=np.zeros((1, 0)))
    cost = compare_conditions(Condition(loop), Condition(loop))
    assert cost.before.margins == {}
    assert "no control law" in cost.sentence()


def test_authority_is_the_way_to_the_nearer_limit():
    limits = {"de1": (-0.5, 0.5), "n1": (0.0, 800.0), "df1": (-0.2, 0.6)}
    used = trim_authority({"de1": -0.1, "n1": 600.0, "df1": 0.6, "dw1": 1.0}, limits)
    assert used == pytest.approx({"de1": 0.2, "n1": 0.5, "df1": 1.0})
