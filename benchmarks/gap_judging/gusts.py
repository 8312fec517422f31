"""Turbulence of Dryden's intensities and lengths at 30 m above the ground (MIL-F-8785C, section 3.7.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

LENGTH = (154.0, 154.0, 30.0)  # m, along u, v and w
INTENSITY = (1.72, 1.72, 1.0)  # of the vertical one


def gusts(
    vertical: float, speed: NDArray[np.float64], samples: int, step: float, seed: int
) -> NDArray[np.float64]:
    """Return the air's own velocity in body axes, m/s, shape (sample, 3, flight).

    All three are first-order processes, uniform over the vehicle.

    Parameters
    ----------
    vertical : float
        Standard deviation of w, m/s; 0.8 is light turbulence.
    speed : ndarray, shape (flight,)
        Airspeed, m/s.
    samples : int
    step : float
        s.
    seed : int
    """
    rng = np.random.default_rng([seed, 6])
    out = np.zeros((samples, 3, speed.size))
    if not vertical:
        return out
    for i, (length, share) in enumerate(zip(LENGTH, INTENSITY, strict=True)):
        for flight, u in enumerate(speed):
            memory = np.exp(-step * u / length)
            white = rng.standard_normal(samples + 20000)  # it is under way when the flight begins
            drawn = lfilter([np.sqrt(1 - memory**2)], [1, -memory], white)[20000:]
            out[:, i, flight] = vertical * share * drawn
    return out
