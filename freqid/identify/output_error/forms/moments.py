"""Angular accelerations from applied moments, with what rates and spinning rotors take of them."""

from __future__ import annotations

from typing import Any

from freqid.identify.output_error.model import Named

MOMENTUM = ("hx", "hy", "hz", "hx_rate", "hy_rate", "hz_rate")  # inputs: that of all rotors, body axes
PITCH = ("Ixx", "Iyy", "Izz", "Ixz", *MOMENTUM)
ROLL_AND_YAW = ("Ixx", "Iyy", "Izz", "Ixz", *MOMENTUM)


def pitch_acceleration(moment: Any, p: Any, r: Any, u: Named) -> Any:
    """Return q' from M, rad/s2.

    Parameters
    ----------
    moment : scalar
        M, N m.
    p, r : scalar
        Measured roll and yaw rate, rad/s.
    u : mapping of str to scalar
        With the names of PITCH, kg m2 and N m s.

    Notes
    -----
    ``M = Iyy q' + (Ixx - Izz) p r + Ixz (p^2 - r^2) + hy' + r hx - p hz`` (Klein & Morelli, 2nd ed., ch. 3).
    """
    taken = (u["Ixx"] - u["Izz"]) * p * r + u["Ixz"] * (p**2 - r**2)
    taken = taken + u["hy_rate"] + r * u["hx"] - p * u["hz"]
    return (moment - taken) / u["Iyy"]


def roll_and_yaw_acceleration(applied: Named, p: Any, q: Any, r: Any, u: Named) -> tuple[Any, Any]:
    """Return p' and r' from L and N, rad/s2.

    Parameters
    ----------
    applied : mapping of str to scalar
        With L and N, N m.
    p, q, r : scalar
        Rates, rad/s.
    u : mapping of str to scalar
        With the names of ROLL_AND_YAW, kg m2 and N m s.

    Notes
    -----
    ``L = Ixx p' - Ixz r' + (Izz - Iyy) q r - Ixz p q + hx' + q hz - r hy`` and
    ``N = Izz r' - Ixz p' + (Iyy - Ixx) p q + Ixz q r + hz' + p hy - q hx`` (Klein & Morelli, 2nd ed., ch. 3).
    """
    roll = applied["L"] - (u["Izz"] - u["Iyy"]) * q * r + u["Ixz"] * p * q
    roll = roll - u["hx_rate"] - q * u["hz"] + r * u["hy"]
    yaw = applied["N"] - (u["Iyy"] - u["Ixx"]) * p * q - u["Ixz"] * q * r
    yaw = yaw - u["hz_rate"] - p * u["hy"] + q * u["hx"]
    determinant = u["Ixx"] * u["Izz"] - u["Ixz"] ** 2
    return (u["Izz"] * roll + u["Ixz"] * yaw) / determinant, (u["Ixz"] * roll + u["Ixx"] * yaw) / determinant
