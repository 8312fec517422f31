"""Sensors whose values are older than their time stamps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.simulate.effects.channel_groups import changed, unwrapped
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.effects.signals import logged_late

_GROUPS = {
    "velocity": (
        *(f"state/{n}" for n in ("u", "v", "w", "vn", "ve", "vd")),
        *(f"air/{n}" for n in ("V", "alpha", "beta", "qbar")),
    ),
    "rates": ("state/p", "state/q", "state/r", "state/pdot", "state/qdot", "state/rdot"),
    "accelerometers": ("state/ax", "state/ay", "state/az"),
    "attitude": ("state/phi", "state/theta", "state/psi"),
}


def _distort(settings: Mapping[str, float], record: FlightRecord) -> FlightRecord:
    """Return the log with every group late by its setting, s, and every effector by its own besides."""
    groups = {**_GROUPS, "effectors": tuple(f"effector/{name}" for name in record.group("effector"))}
    ages: dict[str, float] = {}
    for place, age in settings.items():
        for channel in groups.get(place, (f"effector/{place}",)):
            if age and channel in record:
                ages[channel] = ages.get(channel, 0.0) + age
    late: dict[str, np.ndarray] = {}
    for age in dict.fromkeys(ages.values()):  # one spline of many channels costs little more than of one
        some = [c for c, own in ages.items() if own == age]
        values = logged_late(np.array([unwrapped(record, c) for c in some]), record.dt, age)
        late.update({c: _wrapped(c, v) for c, v in zip(some, values, strict=True)})
    return changed(record, late)


def _wrapped(channel: str, values: np.ndarray) -> np.ndarray:
    if channel in ("state/phi", "state/psi", "air/alpha"):
        return np.arctan2(np.sin(values), np.cos(values))
    return values


def _for_vehicle(vehicle: Vehicle) -> dict[str, Parameter]:
    """Return an age for each effector, where there are several."""
    names = [e.name for e in vehicle.effectors if e.name not in _GROUPS]
    if len(names) < 2:
        return {}
    return {n: Parameter(0.0, "s", f"age of what is logged of {n} alone", 0.05, -0.5, 0.5) for n in names}


EFFECT = Effect(
    id="time_skew",
    stage="sensor",
    meaning="A group of sensors logs values that are older than their time stamps.",
    parameters={
        group: Parameter(
            0.0,
            "s",
            f"age of what is logged of {group}",
            0.05,
            -0.5,
            0.5,
            signs=(
                "A group of sensors logs values that are older than their time stamps",
                "A group of sensors logs values that are newer than their time stamps",
            ),
        )
        for group in (*_GROUPS, "effectors")
    },
    alternatives=True,
    distort=_distort,
    for_vehicle=_for_vehicle,
)
