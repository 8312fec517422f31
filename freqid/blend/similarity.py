"""How loads and their derivatives follow air density, without a new flight."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from freqid.core.arrays import Array
from freqid.core.units import RHO0

ALIKE = 0.02  # relative: densities within it are one, for models that cannot be carried to another

# Velocities and rates: the same load at another density needs them to go with 1/sqrt(rho).
_VELOCITIES = ("m/s", "rad/s")
# Angles, dynamic pressure and thrust are the same in similar flows, and so are the reduced rates.
_INVARIANT_UNITS = ("rad", "Pa", "N")
_INVARIANT = ("phat", "qhat", "rhat")


def equivalent(rho: ArrayLike) -> Array:
    """Return equivalent over true velocity, ``sqrt(rho / RHO0)``, for densities in kg/m3.

    Notes
    -----
    Quasi-steady loads without effects of Mach and Reynolds number are ``rho`` times a function of
    velocities, rates, rotor speeds and angles that is of second degree in the first three. So they
    depend on density only through the equivalent values ``x sqrt(rho / RHO0)`` of those three
    (docs/theory/global-model.md).
    """
    return np.sqrt(np.asarray(rho, dtype=float) / RHO0)


def goes_with_velocity(units: Mapping[str, str]) -> Array:
    """Return 1 for regressors that are velocities or rates and 0 for the others, by name and unit."""
    return np.array([float(unit in _VELOCITIES) for unit in units.values()])


def not_similar(units: Mapping[str, str]) -> list[str]:
    """Return the regressors that no similarity carries to another density: throttles, accelerations."""
    return [
        name
        for name, unit in units.items()
        if unit not in _VELOCITIES + _INVARIANT_UNITS and name not in _INVARIANT
    ]
