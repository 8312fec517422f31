"""The channels that every record names alike: group, symbol, SI unit and meaning."""

from __future__ import annotations

from functools import cache

from freqid.core.errors import DataError, nearest
from freqid.core.units import parse_unit

STATE = {
    "u": ("m/s", "velocity along x body, relative to the air"),
    "v": ("m/s", "velocity along y body, relative to the air"),
    "w": ("m/s", "velocity along z body, relative to the air"),
    "p": ("rad/s", "roll rate"),
    "q": ("rad/s", "pitch rate"),
    "r": ("rad/s", "yaw rate"),
    "phi": ("rad", "roll angle"),
    "theta": ("rad", "pitch angle"),
    "psi": ("rad", "heading angle"),
    "ax": ("m/s2", "specific force along x body"),
    "ay": ("m/s2", "specific force along y body"),
    "az": ("m/s2", "specific force along z body"),
    "pdot": ("rad/s2", "roll acceleration"),
    "qdot": ("rad/s2", "pitch acceleration"),
    "rdot": ("rad/s2", "yaw acceleration"),
    "alt": ("m", "altitude"),
    "vn": ("m/s", "velocity over the ground, north"),
    "ve": ("m/s", "velocity over the ground, east"),
    "vd": ("m/s", "velocity over the ground, down"),
}
AIR = {
    "rho": ("kg/m3", "air density"),
    "V": ("m/s", "true airspeed"),
    "alpha": ("rad", "angle of attack"),
    "beta": ("rad", "angle of sideslip"),
    "qbar": ("Pa", "dynamic pressure"),
    "mach": ("1", "Mach number"),
    "phat": ("1", "roll rate p b / 2V"),
    "qhat": ("1", "pitch rate q cbar / 2V"),
    "rhat": ("1", "yaw rate r b / 2V"),
}
POWER = {"voltage": ("V", "battery voltage"), "current": ("A", "battery current")}
RESPONSE = {
    "X": ("N", "force along x body"),
    "Y": ("N", "force along y body"),
    "Z": ("N", "force along z body"),
    "L": ("N m", "moment about x body"),
    "M": ("N m", "moment about y body"),
    "N": ("N m", "moment about z body"),
    "CX": ("1", "coefficient of X"),
    "CY": ("1", "coefficient of Y"),
    "CZ": ("1", "coefficient of Z"),
    "Cl": ("1", "coefficient of L"),
    "Cm": ("1", "coefficient of M"),
    "Cn": ("1", "coefficient of N"),
}
VELOCITY = ("state/u", "state/v", "state/w")
GROUND = ("state/vn", "state/ve", "state/vd")
ATTITUDE = ("state/phi", "state/theta", "state/psi")
RATES = ("state/p", "state/q", "state/r")
FORCES = ("state/ax", "state/ay", "state/az")
FLOW = ("air/V", "air/alpha", "air/beta")
ANGLES = {*FLOW[1:], *ATTITUDE}  # known up to whole turns
WRENCH = ("X", "Y", "Z", "L", "M", "N")
WRENCH_MEANING = {
    "X": "axial force",
    "Y": "side force",
    "Z": "normal force",
    "L": "rolling moment",
    "M": "pitching moment",
    "N": "yawing moment",
}
"""Components of the wrench, as engineers call them."""
COEFFICIENT: dict[str, str] = dict(zip(("CX", "CY", "CZ", "Cl", "Cm", "Cn"), WRENCH, strict=True))
KNOWN = {"state": STATE, "air": AIR, "power": POWER, "response": RESPONSE}
EFFECTOR_GROUPS = ("effector", "command", "excitation")
GROUPS = (*KNOWN, *EFFECTOR_GROUPS)
TAKEN = {**STATE, **AIR, "bias": ("", "")}  # regressors by themselves, so no effector may be called so

ADVANCE_RATIO = "J"
"""Name of the propellers' advance ratio, 2 pi V / (Omega d), where rotors state their diameter."""

EFFECTOR_UNITS = {"surface": "rad", "tilt": "rad", "rotor": "rad/s", "thrust": "N", "throttle": "1"}


@cache
def split(channel: str) -> tuple[str, str]:
    """Split ``group/name`` and check the group, and the name where the group fixes it.

    Raises
    ------
    DataError
        For an unknown group, or an unknown name in `state`, `air`, `power` or `response`.
    """
    group, _, name = channel.partition("/")
    if group not in GROUPS or not name or "/" in name:
        raise DataError(
            f"channel '{channel}' is not of the form group/name with a known group",
            remedy=nearest(group, GROUPS),
        )
    if group in EFFECTOR_GROUPS and name in TAKEN:
        raise DataError(
            f"channel '{channel}' has the name of a regressor that means something else",
            remedy="give the effector another name",
        )
    if group in KNOWN and name not in KNOWN[group]:
        raise DataError(f"channel '{channel}' is unknown", remedy=nearest(name, KNOWN[group]))
    return group, name


def effector_unit(unit: str) -> str:
    """Return the SI unit of an effector that is stated in some unit.

    Raises
    ------
    DataError
        Where no kind of effector is measured so.
    """
    for si in dict.fromkeys(EFFECTOR_UNITS.values()):
        if parse_unit(unit).dimension == parse_unit(si).dimension:
            return si
    known = ", ".join(sorted(set(EFFECTOR_UNITS.values())))
    raise DataError(f"found unit '{unit}', expected one that converts to {known}", remedy="correct the unit")


def si_unit(channel: str, effector_kinds: dict[str, str] | None = None) -> str | None:
    """Return the SI unit of a channel, or None for an effector whose kind is not known."""
    group, name = split(channel)
    if group in KNOWN:
        return KNOWN[group][name][0]
    kind = (effector_kinds or {}).get(name)
    return EFFECTOR_UNITS[kind] if kind else None
