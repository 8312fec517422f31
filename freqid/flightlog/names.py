"""Channels by the names that loggers give them, with the unit that stands in a name.

``pitch rate (deg/s)``, ``bodyAngularRateWrtEi_deg_s_Pitch`` (NESC check cases), ``velocities/q-rad_sec`` and
``Q (deg/s)`` (JSBSim) are all ``state/q``.
"""

from __future__ import annotations

import re
from collections.abc import Collection

from freqid.core.errors import DataError
from freqid.core.units import parse_unit

_BRACKETS = re.compile(r"^(.*?)\s*[(\[]\s*([^()\[\]]*?)\s*[)\]]\s*$")
# Units as they end names; what follows another unit divides it: deg_s, ft_s2, slug_ft3.
_UNITS = {
    **{
        u: u for u in ("deg", "rad", "ft", "m", "s", "ms", "us", "kt", "rpm", "g", "psf", "lbf", "slug", "kg")
    },
    **{"sec": "s", "fps": "fps", "mps": "m/s", "dps": "dps", "degps": "deg/s", "radps": "rad/s", "kts": "kt"},
    **{
        "s2": "s2",
        "sec2": "s2",
        "ft3": "ft3",
        "m3": "m3",
        "nmi": "nmi",
        "h": "h",
        "pa": "Pa",
        "in": "in",
        "kgm3": "kg/m3",
    },
    **{"knots": "kt", "volt": "V", "amp": "A", "n": "N", "norm": "1", "rps": "rad/s", "fps2": "ft/s2"},
}
_WORDS = {
    "state/p": "p rollrate gyrx gyrox bodyangularratewrteiroll wx omegax prate",
    "state/q": "q pitchrate gyry gyroy bodyangularratewrteipitch wy omegay qrate",
    "state/r": "r yawrate gyrz gyroz bodyangularratewrteiyaw wz omegaz rrate",
    "state/phi": "phi roll rollangle eulerangleroll bank bankangle",
    "state/theta": "theta pitch pitchangle euleranglepitch",
    "state/psi": "psi yaw yawangle hdg heading eulerangleyaw psitrue headingtrue",
    "state/u": "u ubody uaero",
    "state/v": "v vbody vaero",
    "state/w": "w wbody waero wdown",
    "state/ax": "ax accx accelx nx axm accfwd accforward",
    "state/ay": "ay accy accely ny aym accright",
    "state/az": "az accz accelz azm accdown",
    "state/pdot": "pdot rollacceleration",
    "state/qdot": "qdot pitchacceleration",
    "state/rdot": "rdot yawacceleration",
    "state/alt": "alt altitude altitudemsl h hsl altitudeasl",
    "state/vn": "vn vnorth velnorth vnorthfps",
    "state/ve": "ve veast veleast",
    "state/vd": "vd vdown veldown",
    "air/V": "vtotal vt tas airspeed trueairspeed vtrue",
    "air/alpha": "alpha aoa angleofattack",
    "air/beta": "beta aos sideslip angleofsideslip sideslipangle",
    "air/rho": "rho airdensity density",
    "air/qbar": "qbar dynamicpressure",
    "air/mach": "mach machnumber",
    "power/voltage": "vbat voltage battvolt batteryvoltage",
    "power/current": "current battcurr batterycurrent",
}
_BY_WORD = {word: channel for channel, words in _WORDS.items() for word in words.split()}
_SURFACE = re.compile(
    r"^(?:fcs)?(elevator|aileron|rudder|elevon|flap|throttle|de|da|dr|df)(left|right|l|r|\d*)(?:pos)?$"
)
# What names of effectors usually mean, by kind; the first that fits decides.
_KINDS = (
    ("thrust", r"thrust|^T\d+$"),
    ("throttle", r"thr(ottle)?|thtl|power_?lever"),
    ("rotor", r"^(n|rpm|om|omega|w|m)_?\d+|rotor|motor|(^|_)prop|rpm|(^|_)esc|(^|_)fan"),
    ("tilt", r"tilt|^nac|nacelle|^dw\d*$|^sigma|conversion"),
    (
        "surface",
        r"^d?(e|a|r|f|s)\d*$|^d[aefrs](_|[lr]?\d*$)|^d[lr]a?\d*$|ail|el(e)?v|rud|flap|flp|spoil|^rv|^tail|canard|"
        r"^stab|slat|^tef|^lef|(^|_)fin|vane",
    ),
)
# What stands before or after an effector's name where a column is not its position.
_GROUPS = {"excitation": "inj|injected|injection|exc|excitation", "command": "cmd|command|sp|setpoint"}
_GROUP = {
    group: re.compile(rf"^(?:{words})[_ ](.+)$|^(.+)[_ ](?:{words})$", re.IGNORECASE)
    for group, words in _GROUPS.items()
}
_NO_POSITION = re.compile(
    r"inj|excit|cmd|command|setpoint|_sp$|target|stick|pilot|elevation|alpha|beta", re.IGNORECASE
)
_ROTOR = re.compile(r"^(?:n|rpm|motor|esc|rotor|engine|m)(\d+)(?:rpm|speed|erpm)?$")


def guess_kind(name: str) -> str:
    """Return the kind of effector that a name suggests; empty where it suggests none."""
    return next((kind for kind, words in _KINDS if re.search(words, name, re.IGNORECASE)), "")


def recognise(name: str, unit: str = "", effectors: Collection[str] = ()) -> tuple[str, str]:
    """Return the channel that a logger's name means, empty where it is not understood, and its unit.

    Parameters
    ----------
    name : str
        Of a column; what stands before the last slash or dot is its folder.
    unit : str
        That the log states elsewhere; else it is looked for in the name.
    effectors : collection of str
        Of the aircraft: a column with the name of one, in capitals or not, is that one, and so are its
        commands and injected signals.

    Examples
    --------
    >>> recognise("bodyAngularRateWrtEi_deg_s_Pitch")
    ('state/q', 'deg/s')
    >>> recognise("V_{Total} (ft/s)")
    ('air/V', 'ft/s')
    >>> recognise("/fdm/jsbsim/velocities/p-rad_sec")
    ('state/p', 'rad/s')
    >>> recognise("INJ_RVT_L_deg", effectors=["rvt_l"])
    ('excitation/rvt_l', 'deg')
    """
    base, found = _split(name)
    unit = unit or found
    leaf = re.split(r"[/.]", base)[-1] or base
    by_name = {_plain(effector): effector for effector in effectors}
    if _plain(leaf) in by_name:
        return f"effector/{by_name[_plain(leaf)]}", unit
    for group, pattern in _GROUP.items():
        if match := pattern.match(leaf):
            rest = match[1] or match[2]
            position = by_name.get(_plain(rest)) or recognise(rest)[0].removeprefix("effector/")
            known = position and "/" not in position
            return (f"{group}/{position}" if known else ""), unit or ("rpm" if "rpm" in rest.lower() else "")
    if leaf == "V":
        return "air/V", unit
    word = re.sub(r"[^a-z0-9]", "", leaf.lower())
    if word in _BY_WORD:
        return _BY_WORD[word], unit
    surface, rotor = _SURFACE.match(word), _ROTOR.match(word)
    if surface:
        side = {"l": "_left", "r": "_right", "left": "_left", "right": "_right"}.get(surface[2], surface[2])
        return f"effector/{surface[1]}{side}", unit
    if rotor:
        return f"effector/n{rotor[1]}", unit or ("rpm" if "rpm" in word else "")
    if re.fullmatch(r"[A-Za-z]\w*", leaf) and guess_kind(leaf) and not _NO_POSITION.search(base):
        return f"effector/{leaf}", unit
    return "", unit


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _split(name: str) -> tuple[str, str]:
    """Return a name without its unit, and the unit; empty where it has none."""
    bracketed = _BRACKETS.match(name)
    if bracketed and _understood(bracketed[2]):
        return bracketed[1], bracketed[2]
    tokens = re.split(r"[_\- ]", name)
    at = next((i for i in range(1, len(tokens)) if tokens[i].lower() in _UNITS), None)
    if at is None:
        return name, ""
    end = at
    while end < len(tokens) and tokens[end].lower() in _UNITS:
        end += 1
    unit = "/".join(_UNITS[token.lower()] for token in tokens[at:end])
    if not _understood(unit):
        return name, ""
    return "_".join(tokens[:at] + tokens[end:]), unit


def _understood(unit: str) -> bool:
    try:
        parse_unit(unit)
    except DataError:
        return False
    return True
