"""Changes of a residual beside others: sensors in turn, one body, an effect that is in force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import MASS, Linear, fly, vehicle

from freqid.core.record import Maneuver
from freqid.gap.model.changes import beside, change, change_together
from freqid.gap.stack.trial import Trial
from freqid.simulate.effects import shipped

EFFECTS = {name: effect.of(vehicle()) for name, effect in shipped().items()}


@pytest.fixture(scope="module")
def trial():
    return Trial.of(Linear(), fly(), carries=False)


def rows(histories):
    return np.stack([histories.direct, histories.momentum])


def test_a_scale_and_a_bias_of_one_gyro_are_both_in_what_it_logs(trial):
    both = [(EFFECTS["sensor_bias"], {"q": 0.01}), (EFFECTS["sensor_scale"], {"q": 0.05})]
    record = trial.maneuver.record
    wrong = replace(record.channel("state/q"), values=1.05 * (record["state/q"] + 0.01))
    seen = Trial.of(Linear(), Maneuver(record.with_channels(wrong), trial.maneuver.vehicle))
    np.testing.assert_allclose(
        rows(change_together(both, trial)), rows(seen.residual - trial.residual), atol=1e-9
    )
    apart = sum(rows(change(e, trial, v)) for e, v in both)
    assert np.abs(apart - rows(change_together(both, trial))).max() > 1e-4


def test_what_two_effects_make_of_the_mass_is_one_body(trial):
    heavier = [(EFFECTS["mass"], {"fraction": 0.1}), (EFFECTS["inertia"], {"yy": 0.2})]
    found = change_together(heavier, trial)
    z = next(i for i, row in enumerate(found.rows) if row.name == "Z")
    measured = MASS * trial.maneuver.record["state/az"]
    np.testing.assert_allclose(found.direct[z], -0.1 * measured, rtol=1e-9)


def test_a_small_error_of_a_sensor_makes_a_small_change_beside_a_worn_surface(trial):
    """The airframe feels less than the log holds; that is not what the sensor does."""
    worn = beside([(EFFECTS["surface_effectiveness"], {"d1": 0.3})], trial)
    for name, at in (("sensor_bias", "q"), ("sensor_scale", "u"), ("inertia", "yy")):
        small, large = (np.abs(rows(change(EFFECTS[name], worn, {at: x}))).max() for x in (1e-6, 1e-2))
        assert small == pytest.approx(1e-4 * large, rel=0.05), name
