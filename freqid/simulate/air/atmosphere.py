"""The standard atmosphere up to 20 km, in closed form.

References
----------
U.S. Standard Atmosphere 1976, NOAA-S/T 76-1562, equations 18, 23, 33 and tables 1 to 4; identical to
ISO 2533:1975 at these heights.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from freqid.core.units import STANDARD_GRAVITY
from freqid.dynamics import precision as precision

GAS_CONSTANT = 8314.32 / 28.9644  # J/(kg K); R* and M0 of the standard
EARTH_RADIUS = 6_356_766.0  # m, of the standard's conversion to geopotential height
SEA_LEVEL_TEMPERATURE = 288.15  # K
SEA_LEVEL_PRESSURE = 101_325.0  # Pa
LAPSE = 0.0065  # K/m, below the tropopause
TROPOPAUSE = 11_000.0  # geopotential m
HEAT_RATIO = 1.4


class Air(NamedTuple):
    """Air at rest.

    Attributes
    ----------
    temperature : Array
        K.
    pressure : Array
        Pa.
    rho : Array
        kg/m3.
    sound : Array
        Speed of sound, m/s.
    """

    temperature: jax.Array
    pressure: jax.Array
    rho: jax.Array
    sound: jax.Array


def air(altitude: jax.Array) -> Air:
    """Return the standard air at a geometric altitude, m, from -1 km to 20 km; any shape."""
    height = EARTH_RADIUS * altitude / (EARTH_RADIUS + altitude)
    temperature = SEA_LEVEL_TEMPERATURE - LAPSE * jnp.minimum(height, TROPOPAUSE)
    exponent = STANDARD_GRAVITY / (GAS_CONSTANT * LAPSE)
    above = jnp.maximum(height - TROPOPAUSE, 0.0)  # where the temperature stays the same
    pressure = SEA_LEVEL_PRESSURE * (temperature / SEA_LEVEL_TEMPERATURE) ** exponent
    pressure = pressure * jnp.exp(-STANDARD_GRAVITY * above / (GAS_CONSTANT * temperature))
    rho = pressure / (GAS_CONSTANT * temperature)
    return Air(temperature, pressure, rho, jnp.sqrt(HEAT_RATIO * GAS_CONSTANT * temperature))


def altitude_of(rho: float) -> float:
    """Return the geometric altitude, m, that has a given density, kg/m3: the inverse of `air` below 11 km."""
    exponent = STANDARD_GRAVITY / (GAS_CONSTANT * LAPSE) - 1
    at_sea_level = SEA_LEVEL_PRESSURE / (GAS_CONSTANT * SEA_LEVEL_TEMPERATURE)
    height = SEA_LEVEL_TEMPERATURE / LAPSE * (1 - (rho / at_sea_level) ** (1 / exponent))
    return float(EARTH_RADIUS * height / (EARTH_RADIUS - height))
