"""Units at the doors: any field unit in, SI and radians inside.

Angle is a dimension of its own here, unlike in the SI, so that degrees cannot pass for a
pure number nor revolutions per second for hertz: the two commonest slips in flight logs.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import pi

from freqid.core.errors import DataError, nearest

RHO0 = 1.225  # kg/m3, sea level of the standard atmosphere: where equivalent quantities equal true ones
STANDARD_GRAVITY = 9.80665  # m/s2, ISO 80000-3
FOOT = 0.3048  # m, exact
POUND = 0.45359237  # kg, exact
POUND_FORCE = POUND * STANDARD_GRAVITY  # N

_BASE = ("m", "kg", "s", "rad", "K", "A")


@dataclass(frozen=True)
class Unit:
    """A unit as ``si = factor * value + offset``.

    Attributes
    ----------
    factor, offset : float
        Conversion to SI.
    dimension : tuple of int
        Exponents of m, kg, s, rad, K, A.
    """

    factor: float
    dimension: tuple[int, ...]
    offset: float = 0.0

    def times(self, other: Unit, power: int) -> Unit:
        """Return this unit multiplied by a power of another."""
        dimension = tuple(a + power * b for a, b in zip(self.dimension, other.dimension, strict=True))
        return Unit(self.factor * other.factor**power, dimension)


def _unit(factor: float, offset: float = 0.0, **powers: int) -> Unit:
    return Unit(factor, tuple(powers.get(b, 0) for b in _BASE), offset)


_SYMBOLS = {
    "1": _unit(1.0),
    "%": _unit(0.01),
    # length
    "m": _unit(1.0, m=1),
    "mm": _unit(1e-3, m=1),
    "cm": _unit(1e-2, m=1),
    "km": _unit(1e3, m=1),
    "in": _unit(FOOT / 12, m=1),
    "ft": _unit(FOOT, m=1),
    "nmi": _unit(1852.0, m=1),
    # mass
    "kg": _unit(1.0, kg=1),
    "gram": _unit(1e-3, kg=1),
    "lb": _unit(POUND, kg=1),
    "slug": _unit(POUND_FORCE / FOOT, kg=1),
    # time and frequency
    "s": _unit(1.0, s=1),
    "sec": _unit(1.0, s=1),
    "ms": _unit(1e-3, s=1),
    "us": _unit(1e-6, s=1),
    "ns": _unit(1e-9, s=1),
    "min": _unit(60.0, s=1),
    "h": _unit(3600.0, s=1),
    "Hz": _unit(1.0, s=-1),
    # angle and rotation
    "rad": _unit(1.0, rad=1),
    "deg": _unit(pi / 180, rad=1),
    "rev": _unit(2 * pi, rad=1),
    "rpm": _unit(2 * pi / 60, rad=1, s=-1),
    "dps": _unit(pi / 180, rad=1, s=-1),
    # speed
    "kt": _unit(1852.0 / 3600, m=1, s=-1),
    "fps": _unit(FOOT, m=1, s=-1),
    "mph": _unit(5280 * FOOT / 3600, m=1, s=-1),
    # acceleration, force, pressure
    "g": _unit(STANDARD_GRAVITY, m=1, s=-2),
    "N": _unit(1.0, kg=1, m=1, s=-2),
    "kN": _unit(1e3, kg=1, m=1, s=-2),
    "lbf": _unit(POUND_FORCE, kg=1, m=1, s=-2),
    "Pa": _unit(1.0, kg=1, m=-1, s=-2),
    "hPa": _unit(1e2, kg=1, m=-1, s=-2),
    "kPa": _unit(1e3, kg=1, m=-1, s=-2),
    "psf": _unit(POUND_FORCE / FOOT**2, kg=1, m=-1, s=-2),
    "psi": _unit(POUND_FORCE / (FOOT / 12) ** 2, kg=1, m=-1, s=-2),
    # temperature and electricity
    "K": _unit(1.0, K=1),
    "degC": _unit(1.0, 273.15, K=1),
    "degF": _unit(5 / 9, 459.67 * 5 / 9, K=1),
    "A": _unit(1.0, A=1),
    "V": _unit(1.0, kg=1, m=2, s=-3, A=-1),
    "W": _unit(1.0, kg=1, m=2, s=-3),
}
_FACTOR = re.compile(r"\s*([*/·. -]?)\s*([A-Za-z%]+|1)(?:\^|\*\*)?(-?\d+)?")


def parse_unit(text: str) -> Unit:
    """Read a unit such as ``deg/s``, ``slug/ft3``, ``slug*ft^2`` or ``lbf ft``.

    Parameters
    ----------
    text : str
        Symbols joined by ``*``, a space, ``-`` or ``/``; an integer exponent follows its symbol.
        Each ``/`` divides by the one symbol after it.

    Raises
    ------
    DataError
        Where a symbol is not known.
    """
    source = text.strip()
    result, position = Unit(1.0, (0,) * len(_BASE)), 0
    while position < len(source):
        match = _FACTOR.match(source, position)
        if match is None or match[2] not in _SYMBOLS:
            found = match[2] if match else source[position:]
            raise DataError(f"unit '{text}' is not understood at '{found}'", remedy=nearest(found, _SYMBOLS))
        symbol = _SYMBOLS[match[2]]
        if symbol.offset and match[0].strip() == source:
            return symbol
        result = result.times(symbol, int(match[3] or 1) * (-1 if match[1] == "/" else 1))
        position = match.end()
    if not source:
        raise DataError("a unit is missing", remedy="write '1' for a pure number")
    return result


def to_si(text: str, si: str, what: str) -> Unit:
    """Return the unit `text`, checked to measure the same thing as the SI unit `si`.

    Parameters
    ----------
    text : str
        Unit of the values as found.
    si : str
        SI unit that the values are wanted in.
    what : str
        Channel or key, named in the error.

    Raises
    ------
    DataError
        Where the dimensions differ, or `text` is not understood.
    """
    try:
        found = parse_unit(text)
    except DataError as error:
        raise DataError(f"{what}: {error.message}", remedy=error.remedy) from None
    if found.dimension != parse_unit(si).dimension:
        hint = "write rev/s or rpm for a rotation" if text == "Hz" and "rad" in si else "correct the unit"
        raise DataError(f"{what}: found unit '{text}', expected a unit that converts to '{si}'", remedy=hint)
    return found
