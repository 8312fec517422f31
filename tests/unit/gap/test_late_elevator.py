"""An elevator that is logged late in flights without commands: the motion comes from the same late log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import DT, Linear, Truth, fly
from scipy.interpolate import CubicSpline

from freqid.core.record import FlightRecord, Maneuver
from freqid.gap.diagnose import Question, diagnose
from freqid.gap.model.tolerance import stated
from freqid.simulate.effects import shipped

BAND = (0.05, 2.0)
EFFECTS = ("time_skew", "surface_effectiveness", "mass", "sensor_scale", "sensor_bias", "inertia")
LIBRARY = {i: shipped()[i] for i in EFFECTS}
QUESTION = Question(LIBRARY, stated({"derivatives": 0.03}, LIBRARY), BAND, draws=400)


def flight(late: float, seed: int) -> Maneuver:
    """Return states and surfaces alone, as a log without commands holds them, `d1` late by so many s."""
    flown = fly(Truth(), noise=1.0, duration=30.0, seed=seed, phases=seed, reference=f"r{seed}")
    time = flown.record.time
    channels = {
        n: c for n, c in flown.record.channels.items() if n.partition("/")[0] not in ("command", "excitation")
    }
    own = channels["effector/d1"]
    # the log begins when it begins: before it the elevator stood
    then = CubicSpline(time, own.values)(np.maximum(time - late, 0.0))
    channels["effector/d1"] = replace(own, values=then)
    return Maneuver(FlightRecord(time, channels, flown.vehicle, reference=f"r{seed}"), flown.vehicle)


@pytest.mark.parametrize("late", [0.2, 0.3, 0.4])
def test_it_is_named_sized_and_closed_on_a_flight_that_was_not_used(late):
    found = diagnose(Linear(actuators=False), [flight(late, 1)], QUESTION, held_out=[flight(late, 2)])
    which, closure = found.diagnosis.which, found.diagnosis.how_far[0]
    assert which.named == ("time_skew",)
    (name, interval), *others = which.parameters["time_skew"].items()
    assert (name, others) == ("d1", [])
    assert interval.estimate == pytest.approx(late, abs=DT)
    assert closure.wrench.G > 0.9
    assert closure.rmse["M"].after < 0.5 * closure.rmse["M"].before


def test_an_elevator_that_is_in_time_is_left_alone():
    found = diagnose(Linear(actuators=False), [flight(0.0, 1)], QUESTION, held_out=[flight(0.0, 2)])
    assert not found.diagnosis.gap.exists
    assert found.diagnosis.which.named == ()
