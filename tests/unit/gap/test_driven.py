"""What the injected signals alone make: the simulation's own flight, or a loop fitted to the record."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from linear_flight import Linear, fly

from freqid.core.record import FlightRecord, Maneuver
from freqid.gap.driven import driven
from freqid.gap.lines import lines_of

BAND = (0.1, 2.0)
RATE = "state/q"


@dataclass(frozen=True)
class Flying(Linear):
    """The linear simulation with a flight of its own."""

    own: FlightRecord | None = None

    def fly(self, record, effects=None):
        return {"q": self.own[RATE]} if self.own is not None else None


def gusty(share: float) -> tuple[Maneuver, FlightRecord]:
    """Return a flight with another one's motion on top that was not injected, and the flight without."""
    calm, other = fly(duration=60.0, phases=1), fly(duration=60.0, phases=2)
    moved = []
    for name, channel in calm.record.channels.items():
        if not name.startswith("state/"):
            continue
        more = other.record[name] - other.record[name].mean()
        moved.append(replace(channel, values=channel.values + share * more))
    return replace(calm, record=calm.record.with_channels(*moved)), calm.record


def missed(found: np.ndarray, truth: np.ndarray) -> float:
    """Return the share of a motion that is not found."""
    return float(np.std(found - truth) / np.std(truth))


def test_without_injected_signals_there_is_nothing():
    maneuver = fly(duration=20.0)
    bare = {n: c for n, c in maneuver.record.channels.items() if not n.startswith("excitation/")}
    still = replace(maneuver, record=FlightRecord(maneuver.record.time, bare))
    assert driven(Linear(), still, lines_of(still.record, BAND)) == {}


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_a_fitted_loop_leaves_out_what_was_not_injected(share):
    maneuver, calm = gusty(share)
    found = driven(Linear(), maneuver, lines_of(maneuver.record, BAND))
    # the laws of motion are fitted to what gusts made too: some of it stays
    assert missed(found[RATE], calm[RATE]) < 0.8 * missed(maneuver.record[RATE], calm[RATE])


def test_the_own_flight_stands_where_a_loop_comes_no_closer():
    maneuver, calm = gusty(0.3)
    lines = lines_of(maneuver.record, BAND)
    assert set(driven(Flying(own=calm), maneuver, lines)) == {RATE}
    elsewhere = calm.with_channels(replace(calm.channel(RATE), values=-calm[RATE]))
    assert "state/u" in driven(Flying(own=elsewhere), maneuver, lines)


@dataclass(frozen=True)
class FlyingAll(Linear):
    """The linear simulation with a flight of all its states."""

    own: FlightRecord | None = None

    def fly(self, record, effects=None):
        return {n: self.own[f"state/{n}"] for n in ("u", "w", "q")} if self.own is not None else None


def test_each_channel_is_that_of_the_motion_that_is_nearer():
    """A flight whose pitch rate is far off and whose speed is right keeps its speed."""
    maneuver = fly(duration=60.0, phases=1)
    off = maneuver.record.with_channels(
        replace(maneuver.record.channel(RATE), values=1.6 * maneuver.record[RATE])
    )
    found = driven(FlyingAll(own=off), maneuver, lines_of(maneuver.record, BAND))
    assert found["state/u"] is off["state/u"]
    assert missed(found[RATE], maneuver.record[RATE]) < 0.4
