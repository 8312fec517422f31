"""Motion without noise from a simulation that flies: its own flight, if that has effector positions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from linear_flight import SIGMA, Linear, Truth, fly, motion

from freqid.core.record import FlightRecord, Maneuver
from freqid.gap.stack.lines import lines_of
from freqid.gap.stack.motion import OWN_FLIGHT, fed_back, noise_free

STATES = ("u", "w", "q", "theta")


@dataclass(frozen=True, eq=False)
class Flying(Linear):
    """Fly the aircraft as it is, with or without the positions of its effectors."""

    moved: bool = True
    actuators: bool = False
    can_fly: bool = True

    def fly(self, record, effects=None, departures=None):
        own = motion(Truth(), 20.0, 20.0, 0)
        found = {n: own[f"state/{n}"] for n in STATES}
        return found | ({f"effector/{n}": own[f"effector/{n}"] for n in ("d1", "d2")} if self.moved else {})


def fed_back_flight() -> Maneuver:
    """Return a noisy flight whose commands hold a law's part beside the injected signals."""
    flown = fly(noise=1.0, phases=0)
    record = flown.record
    command = record.channel("command/d1")
    changed = replace(command, values=command.values + 0.5 * record["state/q"])
    return Maneuver(record.with_channels(changed), flown.vehicle)


@pytest.mark.parametrize("moved", [True, False])
def test_its_own_flight_is_used_where_it_returns_effector_positions(moved):
    """Under feedback measured positions hold what the law made of noise: they are no substitute."""
    flight = fed_back_flight()
    assert fed_back(flight.record)
    found = noise_free(Flying(moved=moved), flight, lines_of(flight.record, 2.0))
    assert (found.source == OWN_FLIGHT, found.flown) == (moved, moved)
    if moved:
        own = motion(Truth(), 20.0, 20.0, 0)["effector/d1"]
        apart = found.maneuver.record["effector/d1"] - own
        time = flight.record.time
        apart -= np.polyval(np.polyfit(time, apart, 1), time)
        assert np.abs(apart).max() < 0.1 * SIGMA["effector/d1"]  # but for a line, and what it seems to miss


def test_without_feedback_measured_positions_stand_in():
    flown = fly(noise=1.0, phases=0)
    found = noise_free(Flying(moved=False), flown, lines_of(flown.record, 2.0))
    assert isinstance(found.maneuver.record, FlightRecord)
    assert found.flown
