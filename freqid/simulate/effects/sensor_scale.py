"""Sensors that read too much in proportion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.simulate.effects.channel_groups import AIRSPEED, BIAS, KINDS, each
from freqid.simulate.effects.effect import Effect, Parameter


def _distort(settings: Mapping[str, float], record: FlightRecord) -> FlightRecord:
    """Return the log with every scale factor in it; channels that it does not have are left out."""
    return each(settings, record, lambda values, scale: (1 + scale) * values)


def _scale(name: str) -> Parameter:
    return Parameter(
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


def _for_vehicle(vehicle: Vehicle) -> dict[str, Parameter]:
    """Return a scale for each effector, where there are several of its kind.

    A fault of one of them is not looked for: it does nearly what a loss of that effector's effect and another
    gain of its servo do together.
    """
    kinds = vehicle.effector_kinds
    several = [k for k in KINDS if list(kinds.values()).count(k) > 1]
    named = [n for n, kind in kinds.items() if kind in several and n not in KINDS]
    return {n: replace(_scale(n), sought=False) for n in named}


EFFECT = Effect(
    id="sensor_scale",
    stage="sensor",
    meaning="A sensor reads too much or too little in proportion to what there is.",
    # no sensor scales a heading or a bank angle
    parameters={name: _scale(name) for name in (*BIAS, AIRSPEED) if name not in ("phi", "psi")},
    alternatives=True,
    distort=_distort,
    for_vehicle=_for_vehicle,
    inverse=lambda scale: -scale / (1 + scale),
)
