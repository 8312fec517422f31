"""Sensors that read too much by a constant."""

from __future__ import annotations

from collections.abc import Mapping

from freqid.core.record import FlightRecord
from freqid.simulate.effects.channel_groups import BIAS, each
from freqid.simulate.effects.effect import Effect, Parameter


def _distort(settings: Mapping[str, float], record: FlightRecord) -> FlightRecord:
    """Return the log with every bias in it; channels that it does not have are left out."""
    return each(settings, record, lambda values, bias: values + bias)


EFFECT = Effect(
    id="sensor_bias",
    stage="sensor",
    meaning="A sensor reads too much or too little by a constant.",
    parameters={
        name: Parameter(
            0.0,
            unit,
            f"what {name} reads too much",
            scale,
            signs=(
                f"The sensor of {name} reads too much by a constant",
                f"The sensor of {name} reads too little by a constant",
            ),
        )
        for name, (scale, unit) in BIAS.items()
    },
    alternatives=True,
    distort=_distort,
)
