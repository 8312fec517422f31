"""Gusts that the air carries past the vehicle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from freqid.simulate.air.dryden import gusts, low_altitude
from freqid.simulate.effects.effect import Effect, Parameter

EFFECT = Effect(
    id="turbulence",
    stage="environment",
    meaning="Low-altitude turbulence of Dryden's form moves and turns the air around the vehicle.",
    parameters={
        "wind_20ft": Parameter(0.0, "m/s", "mean wind 20 ft above ground that the gusts go with", 4.0, 0.0)
    },
    needs=("vehicle.span_m",),
)


def series(
    settings: dict[str, float],
    *,
    height: float,
    airspeed: float,
    span: float,
    steps: int,
    dt: float,
    seed: int,
) -> NDArray[np.float64]:
    """Return velocity and rotation of the air over a flight, as `turbulence.gusts`; zero without wind.

    Parameters
    ----------
    settings : dict
        Of this effect.
    height, airspeed, span : float
        Of the reference condition above ground, m; m/s; of the vehicle, m.
    steps : int
    dt : float
        s.
    seed : int
    """
    wind = float(settings["wind_20ft"])
    if wind == 0:
        return np.zeros((6, steps))
    return gusts(low_altitude(wind, height, airspeed, span), steps, dt, seed)
