"""Motion of a closed loop that was fitted to a record: what sensors read of it, where they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import DT, Linear, Truth, fly, motion

from freqid.core.record import Channel, Maneuver
from freqid.gap.stack.lines import lines_of
from freqid.gap.stack.motion import air_of, noise_free

SECONDS = 40.0
BOOM, VANE = 1.2, 2.5  # m, from the centre of gravity to where velocity and flow are measured


@pytest.fixture(scope="module")
def flown():
    """Return what the aircraft's own channels are, its lines, and the motion fitted to a noisy record."""
    own = motion(Truth(), SECONDS, SECONDS, 1)
    flight = fly(noise=0.3, seed=4, duration=SECONDS, phases=1, add={"state/w": -BOOM * own["state/q"]})
    ahead = [replace(flight.record.channel(f"state/{n}"), position_m=(BOOM, 0.0, 0.0)) for n in "uvw"]
    air = air_of(own["state/u"], np.zeros_like(own["state/u"]), own["state/w"] - VANE * own["state/q"])
    flow = [Channel(n, "m/s" if n == "air/V" else "rad", x, 1 / DT, "", (VANE, 0, 0)) for n, x in air.items()]
    record = flight.record.with_channels(*ahead, *flow)
    lines = lines_of(record, 2.0)
    found = noise_free(Linear(), Maneuver(record, flight.vehicle), lines)
    assert found.source == "fitted loop"
    return {**own, **air, "state/w": own["state/w"] - BOOM * own["state/q"]}, lines, found.maneuver.record


def apart(flown, name):
    """Return the spectra of a channel's error and of the channel, shape (line,)."""
    own, lines, found = flown
    return lines.spectrum((found[name] - own[name])[None])[0], lines.spectrum(own[name][None])[0]


@pytest.mark.parametrize("name", ["state/w", "air/alpha", "state/az"])
def test_it_is_what_sensors_read_where_they_are(flown, name):
    """Velocity that was taken for the boom's made the vertical force wrong by 70 %."""
    error, own = apart(flown, name)
    driven = flown[1].driven
    assert np.linalg.norm(error[driven]) < 0.1 * np.linalg.norm(own[driven])


@pytest.mark.parametrize("name", ["state/ax", "state/az"])
def test_forces_hold_little_that_the_aircraft_has_not_where_no_signal_drives(flown, name):
    """Products of rates and velocities, and attitudes that drift, would pass for a change of mass."""
    error, own = apart(flown, name)
    rest = ~flown[1].driven & (flown[1].hz > 0)
    left, moved = (np.sqrt(np.mean(np.abs(z) ** 2)) for z in (error[rest], own[flown[1].driven]))
    assert left < {"state/ax": 0.15, "state/az": 0.07}[name] * moved  # were 0.31 and 0.10


def fitted(flight):
    found = noise_free(Linear(), flight, lines_of(flight.record, 2.0))
    assert found.source == "fitted loop"
    return found


@pytest.mark.parametrize("late", [("q", 0.06), ("uw", 0.05), ("q", -0.03)])
def test_sensors_that_are_late_are_as_late_in_it(late):
    """A rigid body answers at once: its loop missed half of gyros that are 60 ms late."""
    names, by = late
    own = motion(Truth(), SECONDS, SECONDS, 1)
    time = DT * np.arange(own["state/q"].size)
    moved = {f"state/{n}": np.interp(time - by, time, own[f"state/{n}"]) - own[f"state/{n}"] for n in names}
    flight = fly(noise=0.3, seed=5, duration=SECONDS, phases=1, add=moved)
    found = fitted(flight).maneuver.record
    inside = slice(50, -50)
    for name in ("state/q", "state/w"):
        clean = own[name] + moved.get(name, 0.0)
        left = (found[name] - clean)[inside]
        left = left - np.polyval(np.polyfit(time[inside], left, 1), time[inside])
        assert left.std() < 0.12 * clean[inside].std(), name


def test_motion_that_is_under_way_when_the_record_begins_is_in_it():
    own = motion(Truth(), SECONDS, SECONDS, 1)
    first = round(6.0 / DT)
    flight = fly(noise=0.3, seed=6, duration=SECONDS, phases=1)
    record = flight.record.cut(first * DT, SECONDS)
    found = fitted(Maneuver(record, flight.vehicle)).maneuver.record
    early = slice(0, 75)  # 1.5 s
    error = (found["state/w"] - own["state/w"][first:])[early]
    assert error.std() < 0.15 * own["state/w"].std()


def test_noise_in_logged_commands_is_not_in_it():
    """A log that keeps one command in several folds noise into the band, and actuators miss it."""
    own = motion(Truth(), SECONDS, SECONDS, 1)
    rng = np.random.default_rng(7)
    noise = 0.2 * own["command/d1"].std() * rng.standard_normal(own["command/d1"].size)
    flight = fly(noise=0.3, seed=7, duration=SECONDS, phases=1, add={"command/d1": noise})
    found = fitted(flight).maneuver.record["command/d1"]
    assert np.std(found - own["command/d1"]) < 0.15 * noise.std()
