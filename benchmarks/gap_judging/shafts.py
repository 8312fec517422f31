"""Rotors' shafts in body axes, where wings may tilt them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray


def turned(vector: Any, tilt: Any) -> tuple[Any, Any, Any]:
    """Return a vector of a wing in body axes; a tilt is positive leading edge up, rad, number or array."""
    c, s = (np.cos(tilt), np.sin(tilt)) if isinstance(tilt, np.ndarray) else (math.cos(tilt), math.sin(tilt))
    return vector[0] * c + vector[2] * s, vector[1], vector[2] * c - vector[0] * s


def shafts(aircraft: Any, position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return angular momentum of each rotor by its speed, shape (3, rotor) or (3, rotor, flight).

    Parameters
    ----------
    aircraft : module
        With ``TILTS`` and ``TILTED``, effectors that tilt wings and the tilt's index for each rotor, where
        wings tilt; these stay where they are during a flight.
    position : ndarray, shape (effector,) or (effector, flight)
    """
    hub = aircraft.ROTOR_AXIS.T * aircraft.ROTOR_MOMENTUM
    if not hasattr(aircraft, "TILTS"):
        return hub
    tilt = position[[aircraft.EFFECTORS.index(aircraft.TILTS[i]) for i in aircraft.TILTED]]
    return np.array(turned(hub.reshape(*hub.shape, *[1] * (tilt.ndim - 1)) + 0 * tilt, tilt))
