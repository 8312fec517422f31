"""Angular accelerations from applied moments, rotors at rest or of negligible momentum."""

from __future__ import annotations

from typing import Any

from freqid.identify.output_error.model import Named


def roll_and_yaw(applied: Named, u: Named) -> tuple[Any, Any]:
    """Return p' and r' from L and N, rad/s2: ``Ixx p' - Ixz r' = L``, ``Izz r' - Ixz p' = N``.

    Parameters
    ----------
    applied : mapping of str to scalar
        Moments, N m.
    u : mapping of str to scalar
        With Ixx, Izz, Ixz, kg m2.

    Notes
    -----
    Products of rates are left out: they vanish where the pitch rate does.
    """
    determinant = u["Ixx"] * u["Izz"] - u["Ixz"] ** 2
    roll = (u["Izz"] * applied["L"] + u["Ixz"] * applied["N"]) / determinant
    yaw = (u["Ixz"] * applied["L"] + u["Ixx"] * applied["N"]) / determinant
    return roll, yaw
