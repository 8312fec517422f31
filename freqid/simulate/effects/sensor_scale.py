"""Sensors that read too much in proportion."""

from __future__ import annotations

from collections.abc import Mapping

from freqid.core.record import FlightRecord
from freqid.simulate.effects.channel_groups import BIAS, each
from freqid.simulate.effects.effect import Effect, Parameter


def _distort(settings: Mapping[str, float], record: FlightRecord) -> FlightRecord:
    """Return the log with every scale factor in it; channels that it does not have are left out."""
    return each(settings, record, lambda values, scale: (1 + scale) * values)


EFFECT = Effect(
    id="sensor_scale",
    stage="sensor",
    meaning="A sensor reads too much or too little in proportion to what there is.",
    parameters={
        name: Parameter(
            0.0,
            "1",
            f"share by which {name} reads too much",
            0.03,
            -0.9,
            9.0,
            signs=(
                f"The sensor of {name} reads too much in proportion",
                f"The sensor of {name} reads too little in proportion",
            ),
        )
        for name in BIAS
        if name not in ("phi", "psi")  # no sensor scales a heading or a bank angle
    },
    alternatives=True,
    distort=_distort,
    inverse=lambda scale: -scale / (1 + scale),
)
