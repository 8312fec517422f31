"""Sensors that are mounted askew."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from freqid.core.record import FlightRecord
from freqid.simulate.effects.channel_groups import changed
from freqid.simulate.effects.effect import Effect, Parameter

_SENSORS = {
    "imu": (("state/p", "state/q", "state/r"), ("state/ax", "state/ay", "state/az")),
    "velocity": (("state/u", "state/v", "state/w"),),
}


def _distort(settings: Mapping[str, float], record: FlightRecord) -> FlightRecord:
    """Return the log of sensors that are turned about body axes by the settings."""
    turned = {}
    for sensor, triads in _SENSORS.items():
        angles = np.array([settings[f"{sensor}_{axis}"] for axis in "xyz"])
        if angles.any():
            for triad in triads:
                if all(name in record for name in triad):
                    turned |= zip(triad, _turn(angles).T @ record.matrix(triad), strict=True)
    return changed(record, turned)


def _turn(angles: np.ndarray) -> np.ndarray:
    """Return the matrix of a turn by a vector of angles, shape (3, 3), by Rodrigues' formula."""
    size = np.linalg.norm(angles)
    x, y, z = angles / size
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(size) * across + (1 - np.cos(size)) * across @ across


EFFECT = Effect(
    id="misalignment",
    stage="sensor",
    meaning="A triad of sensors is mounted askew.",
    parameters={
        f"{sensor}_{axis}": Parameter(
            0.0,
            "rad",
            f"turn of the {label} about {axis}",
            0.02,
            -0.5,
            0.5,
            signs=(
                f"The mounting of the {label} is turned clockwise about {axis}, seen along it",
                f"The mounting of the {label} is turned anticlockwise about {axis}, seen along it",
            ),
        )
        for sensor, label in (("imu", "gyros and accelerometers"), ("velocity", "velocity sensor"))
        for axis in "xyz"
    },
    distort=_distort,
)
