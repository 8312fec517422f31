"""A steady wind in velocities that are taken for relative to the air."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from freqid.core.channels import ATTITUDE, VELOCITY
from freqid.core.record import FlightRecord
from freqid.dynamics.frames import level_from_body
from freqid.simulate.effects.along import velocity
from freqid.simulate.effects.channel_groups import changed
from freqid.simulate.effects.effect import Effect, Parameter


def _distort(settings: Mapping[str, float], record: FlightRecord) -> FlightRecord:
    """Return the log with u v w over the ground in place of those relative to the air."""
    wind = [settings[name] for name in ("north", "east", "down")]
    if not any(wind) or not all(name in record for name in (*VELOCITY, *ATTITUDE)):
        return record
    carried = np.einsum("ijn,i->jn", level_from_body(record.matrix(ATTITUDE)), wind)
    return changed(record, dict(zip(VELOCITY, velocity(record) + carried, strict=True)))


EFFECT = Effect(
    id="steady_wind",
    stage="environment",
    meaning="Velocities that are taken for relative to the air are over the ground, or their wind is wrong.",
    parameters={
        "north": Parameter(
            0.0,
            "m/s",
            "velocity of the air to the north that was not taken out",
            1.0,
            signs=(
                "The air moves to the north, which was not taken out of the velocities",
                "The air moves to the south, which was not taken out of the velocities",
            ),
        ),
        "east": Parameter(
            0.0,
            "m/s",
            "the same to the east",
            1.0,
            signs=(
                "The air moves to the east, which was not taken out of the velocities",
                "The air moves to the west, which was not taken out of the velocities",
            ),
        ),
        "down": Parameter(
            0.0,
            "m/s",
            "the same downwards",
            0.3,
            signs=(
                "The air moves downwards, which was not taken out of the velocities",
                "The air moves upwards, which was not taken out of the velocities",
            ),
        ),
    },
    needs=(*VELOCITY, *ATTITUDE),
    distort=_distort,
)
