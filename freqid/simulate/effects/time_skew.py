"""Sensors whose values are older than their time stamps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...core.record import FlightRecord
from .channel_groups import changed, unwrapped
from .effect import Effect, Parameter
from .signals import delayed

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
    """Return the log with every group late by its setting, s."""
    groups = {**_GROUPS, "effectors": tuple(f"effector/{name}" for name in record.group("effector"))}
    late = {}
    for group, delay in settings.items():
        if delay:
            for channel in groups[group]:
                if channel in record:
                    late[channel] = _wrapped(channel, delayed(unwrapped(record, channel), record.dt, delay))
    return changed(record, late)


def _wrapped(channel: str, values: np.ndarray) -> np.ndarray:
    if channel in ("state/phi", "state/psi", "air/alpha"):
        return np.arctan2(np.sin(values), np.cos(values))
    return values


EFFECT = Effect(
    id="time_skew",
    stage="sensor",
    meaning="A group of sensors logs values that are older than their time stamps.",
    parameters={
        group: Parameter(0.0, "s", f"age of what is logged of {group}", 0.02, -0.2, 0.2)
        for group in (*_GROUPS, "effectors")
    },
    alternatives=True,
    distort=_distort,
)
