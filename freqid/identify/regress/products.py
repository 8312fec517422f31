"""Products of two regressors: which of them physics allows in the loads of an aircraft."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations_with_replacement

FLOW = frozenset(("u", "v", "w", "V", "alpha", "beta"))
RATES = frozenset(("p", "q", "r", "phat", "qhat", "rhat"))


def candidate_products(units: Mapping[str, str]) -> tuple[str, ...]:
    """Return the products of second degree that the loads may depend on.

    Parameters
    ----------
    units : mapping of str to str
        Unit of each regressor by name; of effectors it tells surfaces and tilts (rad) from propulsors.

    Returns
    -------
    tuple of str
        As ``w*de1``, factors in the order of `units`; a square is ``w*w``.

    Notes
    -----
    To second degree a load is dynamic pressure times angles, plus thrusts. So velocities and flow angles go
    with everything, a propulsor with the surfaces in its slipstream and, as blades meet the air that a rate
    brings, with rates; and each effector with itself, as drag and thrust do. Two surfaces, two propulsors,
    two rates, or a surface and a rate meet only through wakes, and are left out.
    """
    return tuple(f"{a}*{b}" for a, b in combinations_with_replacement(units, 2) if _act_together(a, b, units))


def _act_together(a: str, b: str, units: Mapping[str, str]) -> bool:
    kinds = {_kind(a, units[a]), _kind(b, units[b])}
    if "flow" in kinds:
        return True
    if a == b:
        return kinds != {"rate"}
    return kinds in ({"propulsor", "surface"}, {"propulsor", "rate"})


def _kind(name: str, unit: str) -> str:
    if name in FLOW:
        return "flow"
    if name in RATES:
        return "rate"
    return "surface" if unit == "rad" else "propulsor"
