"""Commands as the actuators got them: what the positions follow of what nobody injected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import DT, Linear, fly, motion, servo, vehicle
from linear_flight import Truth as Aircraft

from freqid.core.record import Maneuver
from freqid.gap.model.changes import change
from freqid.gap.stack.block import stack_of
from freqid.gap.stack.commands import commands_of
from freqid.gap.stack.lines import lines_of
from freqid.simulate.effects import library

SECONDS = 40.0


def told(followed: float, folded: float, late: float = 0.0):
    """Return the true command of d1 and what is told of it, where the log holds two kinds of noise.

    The actuator follows one, of so many times the command's size, and misses the other.
    """
    own = motion(Aircraft(late=late), SECONDS, SECONDS, 1)
    sent = own["command/d1"]
    rng = np.random.default_rng(7)
    real, missed = (x * sent.std() * rng.standard_normal(sent.size) for x in (followed, folded))
    time = DT * np.arange(sent.size)
    position = own["effector/d1"] + servo(np.interp(time - late, time, real))
    record = fly(Aircraft(late=late), noise=1.0, seed=3, duration=SECONDS).record
    measured = position + 1e-4 * rng.standard_normal(sent.size)
    record = record.with_channels(
        replace(record.channel("command/d1"), values=sent + real + missed),
        replace(record.channel("effector/d1"), values=measured),
    )
    clean = record.with_channels(*(replace(record.channel(n), values=own[n]) for n in own if "state" in n))
    return sent + real, sent, commands_of(Linear(), record, clean, lines_of(record, 2.0)), record


@pytest.mark.parametrize(
    ("followed", "folded", "share"), [(0.1, 0.0, 1.0), (0.0, 0.1, 0.0), (0.1, 0.1, 0.5), (0.1, 0.2, 0.2)]
)
def test_the_share_that_positions_follow_is_that_of_the_true_noise(followed, folded, share):
    commands = told(followed, folded)[2]
    assert commands.followed["command/d1"] == pytest.approx(share, abs=0.1)


@pytest.mark.parametrize("late", [0.04, 0.12])
def test_noise_that_the_actuator_follows_is_told_though_it_is_late(late):
    """Without it a delay was found a quarter too small: the movement that it delays was not all there."""
    true, without_noise, commands, record = told(0.1, 0.0, late=late)
    found = commands.of(record)["command/d1"]
    assert np.std(found - true) < 0.2 * np.std(true - without_noise)


def test_a_command_that_nothing_was_added_to_stays():
    _, sent, commands, record = told(0.0, 0.0)
    assert np.std(commands.of(record)["command/d1"] - sent) < 1e-6 * sent.std()


def test_other_channels_stay_as_they_are():
    _, _, commands, record = told(0.1, 0.1)
    after = commands.of(record)
    same = [n for n in record.channels if not n.startswith("command/")]
    assert all(after.channels[n] is record.channels[n] for n in same)


def test_a_command_that_no_position_tells_of_stays_in_a_record_and_not_in_motion_without_noise():
    record = told(0.1, 0.1)[3]
    still = Linear(actuators=False)
    commands = commands_of(still, record, record, lines_of(record, 2.0))
    assert commands.of(record) is record
    asked = commands.of(record, untold=0.0)["command/d1"]
    assert np.std(asked - record["command/d1"]) > 0.05 * np.std(asked)


def test_a_scale_of_position_sensors_scales_what_the_actuators_followed_too():
    """Without it a scale and a gain of the same size left the noise of feedback, and both were called."""
    record = told(0.3, 0.0)[3]
    (block,) = stack_of(Linear(), [Maneuver(record, vehicle())], ["one"], (0.1, 2.0))
    scale = library()["sensor_scale"].of(vehicle())
    row = [r.name for r in block.rows].index("actuator/d1")
    seen = change(scale, block.trial, {"d1": 0.01}).direct[row]
    gain = 0.01 * block.trial.positions["d1"]
    noise = 0.01 * np.std(block.trial.followed["d1"])
    assert np.std(seen - gain) < 0.4 * noise  # without: all of it
