"""An effect that acts while others are asked for, beside the simulation whose settings say that it does."""

from dataclasses import replace

import numpy as np
import pytest

from freqid.core.record import Maneuver
from freqid.gap.connect.callable import CallableSimulation
from freqid.gap.connect.scenario import ScenarioSimulation
from freqid.gap.departed import Departed
from freqid.gap.stack.trial import Trial
from freqid.simulate.maneuver import with_effects

GONE = {"slipstream": {"strength": 0.1}}


@pytest.fixture(scope="module")
def nominal(la8):
    return ScenarioSimulation(la8)


@pytest.fixture(scope="module")
def without(la8):
    return ScenarioSimulation(with_effects(la8, {"slipstream": 0.1}))


@pytest.fixture(scope="module")
def trial(nominal, flown):
    flight = flown("u20")
    return Trial.of(Departed(nominal, {}, GONE), Maneuver.of(flight.record))


def test_what_it_predicts_is_what_the_changed_scenario_does(nominal, without, trial):
    record = trial.maneuver.record
    np.testing.assert_array_equal(trial.predicted, without.predict(record))
    sizes = {"aerofoil.lift_slope": 0.1}
    np.testing.assert_array_equal(
        trial.simulation.sensitivity(record, sizes), without.sensitivity(record, sizes)
    )
    assert np.abs(trial.predicted - nominal.predict(record)).max() > 1.0  # N: it is no small effect
    assert trial.simulation.effects == nominal.effects


def test_its_own_size_still_counts_from_nominal(nominal, trial):
    record = trial.maneuver.record
    found = trial.with_own_effects({"slipstream": {"strength": 0.5}}, actuators=False)
    expected = nominal.predict(record, {"slipstream": {"strength": 0.5}}) - nominal.predict(record)
    np.testing.assert_allclose(found.direct[:6], expected, atol=1e-9)


def test_an_offset_is_felt_as_the_changed_scenario_feels_it(without, trial):
    record = trial.maneuver.record
    channel = record.channel("state/u")
    moved = record.with_channels(replace(channel, values=channel.values + 0.5))
    change = trial.relogged(moved)
    alone = Trial.of(without, trial.maneuver)
    expected = alone.relogged(moved)
    np.testing.assert_allclose(change.direct, expected.direct, atol=1e-9)


def test_departures_are_taken_back_and_the_effect_is_not(nominal, flown):
    maneuver = Maneuver.of(flown("u20").record)
    both = Trial.of(Departed(nominal, {"aerofoil.lift_slope": 0.3}, GONE), maneuver)
    np.testing.assert_array_equal(
        both.undeparted.predicted, Trial.of(Departed(nominal, {}, GONE), maneuver).predicted
    )
    np.testing.assert_array_equal(both.nominal.predicted, nominal.predict(maneuver.record))
    assert both.nominal.simulation is nominal  # what is flown and shown as it was before


def test_a_function_is_asked_with_its_own_effect():
    def wrench(record, *, effects):
        return np.full((1, record.time.size), effects["sag"]["depth"])

    simulation = CallableSimulation(wrench, "made up", responses=("Z",), effects={"sag": {"depth": 0.0}})
    assert simulation.acting_with({"sag": {"depth": 2.0}}).effects == {"sag": {"depth": 2.0}}
    assert simulation.effects == {"sag": {"depth": 0.0}}
