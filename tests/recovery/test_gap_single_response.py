"""Pitch rate from a stick: a delay and a lag that a simulation lacks are found and refitted."""

import pytest

from freqid.core.record import Maneuver
from freqid.gap.connect.callable import CallableSimulation
from freqid.gap.diagnose import Question, diagnose
from freqid.gap.model.tolerance import stated
from freqid.gap.undescribed import without_vehicle
from freqid.simulate.effects import shipped

EFFECTS = ("actuator_delay", "actuator_lag")


@pytest.fixture(scope="module")
def answer(script):
    """Diagnose two flights of the example with some delay and lag, a third held out."""
    example = script("examples/stick_to_pitch_rate.py")
    simulation = CallableSimulation(example.pitch_rate, "pitch_rate", ("q",))

    def of(delay, lag, library=None, named=EFFECTS, seeds=(1, 2, 3)):
        flights = [example.fly(seed, delay=delay, lag=lag) for seed in seeds]
        maneuvers = [Maneuver.of(f, without_vehicle("any", f)) for f in flights]
        library = library or {i: shipped()[i] for i in (*EFFECTS, "surface_effectiveness")}
        question = Question(
            library, stated({}, shipped()), (0.1, 3.0), named=named, draws=60, close=bool(named)
        )
        return diagnose(simulation, maneuvers[:-1], question, held_out=maneuvers[-1:]).diagnosis

    return of


@pytest.fixture(scope="module")
def found(answer):
    """A stick that is 70 ms late and has a lag of 100 ms."""
    return answer(0.07, 0.10)


def test_a_late_and_slow_stick_is_a_gap_that_mostly_goes_on_a_flight_that_was_not_used(found):
    assert found.gap.exists
    assert {place.response for place in found.where} == {"q"}
    assert {place.input for place in found.where} == {"stick"}
    first = found.how_far[0]
    assert first.effects[0] in EFFECTS  # of the second: the test of the pair, below
    assert first.log_score > 90
    assert first.rmse["q"].after < 0.3 * first.rmse["q"].before


def test_a_delay_and_a_lag_together_are_closed_and_recovered(found):
    both, *alone = found.how_far
    assert set(both.effects) == set(EFFECTS)
    assert both.wrench.G > 0.97
    # neither does it by itself; with a lag, delays and clocks at four sigmas each make up for the delay
    assert all(c.rmse["q"].after > 2 * both.rmse["q"].after for c in alone)
    (delay,) = [c for c in alone if c.effects == ("actuator_delay",)]
    assert delay.log_score < both.log_score - 10
    for effect, truth in zip(EFFECTS, (0.07, 0.10), strict=True):
        interval = next(x for x in both.settings[effect].values() if x.estimate)
        assert interval.lo < truth < interval.hi, effect
    assert both.rmse["q"].after < 0.15 * both.rmse["q"].before


@pytest.mark.parametrize("seeds", [(4, 5, 6), pytest.param((7, 8, 9), marks=pytest.mark.slow)])
def test_sizes_of_a_delay_before_a_lag_hold_what_tolerances_of_both_could_be(answer, seeds):
    """The delay is seen through the lag: else its own tolerance was taken for an eighth of it."""
    found = answer(0.07, 0.10, seeds=seeds).how_far[0].settings
    for effect, truth in zip(EFFECTS, (0.07, 0.10), strict=True):
        interval = next(x for x in found[effect].values() if x.estimate)
        assert interval.lo < truth < interval.hi, effect
        assert interval.estimate == pytest.approx(truth, rel=0.05)


@pytest.mark.slow
def test_the_pair_is_called_though_a_third_effect_explains_more_than_either(answer):
    """Of all effects, a gyro of another scale comes nearest to a delay with a lag."""
    which = answer(0.07, 0.10, shipped(), (), (1, 2, 3, 4)).which
    # the rate logged late is the same as the stick acting late: nothing else is measured
    assert set(which.pair) in ({"actuator_lag", "actuator_delay"}, {"actuator_lag", "time_skew"})
    # and no third one beside them, whose size is nothing once it is computed
    assert set(which.parameters) == set(which.pair)
    found = {e: next(x for x in which.parameters[e].values() if x.estimate) for e in which.pair}
    assert found["actuator_lag"].estimate == pytest.approx(0.10, rel=0.1)
    # clocks of commands, sticks and gyros are each known to 6 ms, and of all three the sum alone is seen
    (late,) = (found[e] for e in which.pair if e != "actuator_lag")
    assert late.lo < 0.07 < late.hi
    assert late.hi - late.lo < 0.04


def test_without_them_there_is_no_gap(answer):
    found = answer(0.0, 0.0)
    assert not found.gap.exists
    assert not found.how_far
