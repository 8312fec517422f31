"""Flow angles that the vehicle bends before they are measured."""

from __future__ import annotations

from collections.abc import Mapping

from freqid.core.channels import VELOCITY
from freqid.core.record import FlightRecord
from freqid.dynamics.frames import body_velocity, flow_angles
from freqid.simulate.effects.along import velocity
from freqid.simulate.effects.channel_groups import changed
from freqid.simulate.effects.effect import Effect, Parameter


def _distort(settings: Mapping[str, float], record: FlightRecord) -> FlightRecord:
    """Return the log with alpha and beta magnified, and u v w as they follow from them."""
    by = {"alpha": 1 + settings["alpha"], "beta": 1 + settings["beta"]}
    bent = {f"air/{n}": by[n] * record[f"air/{n}"] for n in by if f"air/{n}" in record}
    if all(name in record for name in VELOCITY):
        speed, alpha, beta = flow_angles(velocity(record))
        bent |= zip(VELOCITY, body_velocity(speed, by["alpha"] * alpha, by["beta"] * beta), strict=True)
    return changed(record, bent)


EFFECT = Effect(
    id="flow_upwash",
    stage="sensor",
    meaning="The vehicle bends the flow at the sensors of flow angles and of velocity relative to the air.",
    parameters={
        "alpha": Parameter(
            0.0,
            "1",
            "share by which the angle of attack reads too much",
            0.05,
            -0.9,
            9.0,
            signs=(
                "The angle of attack reads too much in proportion",
                "The angle of attack reads too little in proportion",
            ),
        ),
        "beta": Parameter(
            0.0,
            "1",
            "the same of sideslip",
            0.05,
            -0.9,
            9.0,
            signs=(
                "The angle of sideslip reads too much in proportion",
                "The angle of sideslip reads too little in proportion",
            ),
        ),
    },
    distort=_distort,
    inverse=lambda share: -share / (1 + share),
)
