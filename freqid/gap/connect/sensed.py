"""A flight of the simulation's own as a record's sensors would tell it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from freqid.core.frames import cross, specific_force_at
from freqid.core.record import FlightRecord
from freqid.core.scenario import Scenario
from freqid.gap.connect.flow import RATES
from freqid.simulate.fly import Flight
from freqid.simulate.truth import truth_of

Array = NDArray[np.float64]

_VELOCITIES = ("state/u", "state/v", "state/w")
_FORCES = ("state/ax", "state/ay", "state/az")
_ACCELERATIONS = ("state/pdot", "state/qdot", "state/rdot")


def as_measured(scenario: Scenario, flight: Flight, record: FlightRecord) -> dict[str, Array]:
    """Return a flight's states as the record's sensors would tell them, effectors and commands; no error."""
    truth, _ = truth_of(scenario, flight, excited=(), reference=record.reference)
    time = np.minimum(record.time - record.time[0], truth.time[-1])
    rates, turning = truth.matrix(RATES), truth.matrix(_ACCELERATIONS)
    found = {}
    for name in truth.group("state"):
        channel, values = f"state/{name}", truth[f"state/{name}"]
        place = record.channels[channel].position_m if channel in record else None
        if place and channel in _VELOCITIES:
            arm = np.broadcast_to(np.array(place)[:, None], rates.shape)
            values = values + cross(rates, arm)[_VELOCITIES.index(channel)]
        elif place and channel in _FORCES:
            values = specific_force_at(truth.matrix(_FORCES), rates, turning, place)[_FORCES.index(channel)]
        found[name] = CubicSpline(truth.time, values)(time)
    for name in (f"{group}/{n}" for group in ("effector", "command") for n in truth.group(group)):
        found[name] = CubicSpline(truth.time, truth[name])(time)
    return found
