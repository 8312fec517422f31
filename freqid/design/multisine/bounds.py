"""Nearest feasible values, written so that what a reader types from a message is feasible indeed."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, floor, isclose, log10


def at_most(value: float) -> str:
    """Write a bound with four digits, none of them rounded up: as written it is kept."""
    return f"{_rounded(value, floor):.4g}"


def at_least(value: float) -> str:
    """Write a bound with four digits, none of them rounded down."""
    return f"{_rounded(value, ceil):.4g}"


def _rounded(value: float, towards: Callable[[float], int]) -> float:
    digits = 3 - floor(log10(value))
    # A bound that has four digits already is kept, though it is a little off in binary.
    nearest = round(value, digits)
    return nearest if isclose(nearest, value, rel_tol=1e-9) else towards(value * 10.0**digits) / 10.0**digits
