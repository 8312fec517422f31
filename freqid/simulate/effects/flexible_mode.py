"""The first bending mode of the structure, as accelerometers and gyros feel it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from freqid.core.record import FlightRecord
from freqid.simulate.effects.channel_groups import changed
from freqid.simulate.effects.effect import Effect, Parameter

_STEPS = 8  # between two samples, over which the force is straight
_PER_METRE = 0.5  # rad of pitch that a metre of the mode's deflection turns the sensors by


def _distort(settings: Mapping[str, float], record: FlightRecord) -> FlightRecord:
    """Return the log of sensors on a mode that the normal force drives.

    ``y'' + 2 z w y' + w^2 y = az``, from its steady state on; the accelerometer adds ``-strength y''`` and
    the gyro ``strength 0.5/m y'``. The mode does not act back on the flight.
    """
    strength = settings["strength"]
    if not strength or "state/az" not in record:
        return record
    force = record["state/az"] - record["state/az"][0]  # a constant part moves nothing
    rate, acceleration = _mode(force, record.dt, settings["frequency"], settings["damping"])
    felt = {"state/az": record["state/az"] - strength * acceleration}
    if "state/q" in record:
        felt["state/q"] = record["state/q"] + strength * _PER_METRE * rate
    return changed(record, felt)


def _mode(
    force: NDArray[np.float64], dt: float, frequency: float, damping: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return rate and acceleration of a mode of unit mass under a force that is a cubic spline.

    Straight lines between samples 0.04 s apart would take 2 % off a force at 2 Hz.
    """
    from scipy.interpolate import CubicSpline
    from scipy.signal import TransferFunction, lfilter

    w, time = 2 * np.pi * frequency, dt * np.arange(force.size)
    fine = dt / _STEPS * np.arange((force.size - 1) * _STEPS + 1)
    pushed = CubicSpline(time, force)(np.minimum(fine, time[-1]))
    found = []
    for numerator in ([1.0, 0.0], [1.0, 0.0, 0.0]):
        # scipy returns one of a subclass
        continuous = TransferFunction(  # pyrefly: ignore[direct-abstract-base-instantiation]
            numerator, [1.0, 2 * damping * w, w**2]
        )
        mode = continuous.to_discrete(dt / _STEPS, method="foh")
        found.append(lfilter(mode.num, mode.den, pushed)[::_STEPS])
    return found[0], found[1]


EFFECT = Effect(
    id="flexible_mode",
    stage="sensor",
    meaning="The structure's first bending mode moves the accelerometer and the gyro.",
    parameters={
        "strength": Parameter(
            0.0,
            "1",
            "share of the normal force that drives the mode at the sensors",
            0.1,
            signs=(
                "The first bending mode moves the sensors against the normal force that drives it",
                "The first bending mode moves the sensors along with the normal force that drives it",
            ),
        ),
        "frequency": Parameter(5.0, "Hz", "of the mode", 1.0, 0.1, 100.0),
        "damping": Parameter(0.02, "1", "ratio", 0.01, 0.001, 1.0),
    },
    needs=("state/az",),
    distort=_distort,
)
