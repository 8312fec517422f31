"""What is missing leaves an effect untested, and is never a reason to rule it out."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import pytest
from linear_flight import LIBRARY, OWN, Linear, fly

from freqid.core.vehicle import Rotor
from freqid.gap.model.testable import untestable
from freqid.gap.stack.trial import Trial
from freqid.simulate.effects import library

HAS_IT = Linear(effects={"damping": {"extra": 0.0}})


@pytest.mark.parametrize(
    ("needs", "missing"),
    [
        (("rotor",), "needs rotor"),
        (("power",), "needs power"),
        (("air/alpha",), "needs air/alpha"),
        (("vehicle.span_m",), "needs vehicle.span_m"),
        (("surface", "command", "state/q"), None),
        (("wing or surface",), None),
        (("wing or rotor",), "needs wing or rotor"),
    ],
)
def test_what_is_missing_leaves_an_effect_untested(needs, missing):
    reason = untestable(replace(LIBRARY["drag"], needs=needs), Trial.of(HAS_IT, fly()))
    assert reason is None if missing is None else missing in (reason or "")


def test_an_effect_without_a_hook_is_tested_where_the_simulation_has_it_alone():
    assert untestable(OWN, Trial.of(HAS_IT, fly())) is None
    assert "does not have it" in (untestable(OWN, Trial.of(Linear(), fly())) or "")


def test_a_rotor_whose_speed_was_not_logged_leaves_what_it_does_untested():
    flight = fly()
    rotor = Rotor(name="n1", spin=1, inertia=0.0, diameter_m=0.3)
    turning = replace(flight, vehicle=msgspec.structs.replace(flight.vehicle, rotors=(rotor,)))
    effect = replace(LIBRARY["drag"], needs=("rotor.diameter_m", "effector"))
    assert "needs effector/n1" in (untestable(effect, Trial.of(HAS_IT, turning)) or "")


def test_a_lag_of_motors_is_tested_on_throttles_too():
    flight = fly()
    throttles = tuple(msgspec.structs.replace(e, kind="throttle") for e in flight.vehicle.effectors)
    flown = replace(flight, vehicle=msgspec.structs.replace(flight.vehicle, effectors=throttles))
    assert untestable(library()["motor_lag"], Trial.of(HAS_IT, flown)) is None
