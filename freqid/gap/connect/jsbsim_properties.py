"""JSBSim's properties in SI units: effectors and motion are put, loads and states are read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FOOT, POUND, SLUG = 0.3048, 4.4482216152605, 14.593902937206364
STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "ax", "ay", "az", "alt")
_FORCES = ("fbx", "fby", "fbz")
_MOMENTS = ("l", "m", "n")
_ALIAS = {"de": "elevator", "da": "aileron", "dr": "rudder", "df": "flap", "dt": "throttle"}


def effector_name(name: str) -> str:
    """Return what JSBSim calls an effector, ``elevator`` for ``de``."""
    return _ALIAS.get(name, name).replace("_", "-")


def place(fdm: Any, where: Sequence[tuple[str, float]], value: float) -> None:
    """Set the properties that an effector is, with their signs."""
    for name, sign in where:
        fdm[name] = sign * float(value)
        if "throttle" in name:  # throttles follow their commands where no component moves them
            fdm[name.replace("-pos-", "-cmd-")] = float(value)


def command(fdm: Any, names: Sequence[str], values: Array) -> None:
    """Set commands of effectors, from -1 to 1."""
    for name, value in zip(names, values, strict=True):
        fdm[f"fcs/{effector_name(name)}-cmd-norm"] = float(value)


def put(fdm: Any, motion: Array) -> None:
    """Set what the next `run_ic` starts from: u v w, m/s, p q r, rad/s, angles, rad, altitude, m."""
    fdm["ic/h-sl-ft"] = float(motion[9]) / FOOT
    for name, value in zip(("phi", "theta", "psi-true"), motion[6:9], strict=True):
        fdm[f"ic/{name}-rad"] = float(value)
    for name, value in zip("uvw", motion[:3], strict=True):
        fdm[f"ic/{name}-fps"] = float(value) / FOOT
    for name, value in zip("pqr", motion[3:6], strict=True):
        fdm[f"ic/{name}-rad_sec"] = float(value)


def loads(fdm: Any) -> list[float]:
    """Return aerodynamic and propulsive X Y Z L M N, N and N m."""
    forces = [POUND * (fdm[f"forces/{n}-aero-lbs"] + fdm[f"forces/{n}-prop-lbs"]) for n in _FORCES]
    size = POUND * FOOT
    return forces + [
        size * (fdm[f"moments/{n}-aero-lbsft"] + fdm[f"moments/{n}-prop-lbsft"]) for n in _MOMENTS
    ]


def states(fdm: Any) -> list[float]:
    """Return the states in the order of `STATES`, specific force of the centre of gravity among them."""
    felt = np.array(loads(fdm)[:3]) / (SLUG * fdm["inertia/mass-slugs"])
    moving = [FOOT * fdm[f"velocities/{n}-fps"] for n in "uvw"]
    turning = [fdm[f"velocities/{n}-rad_sec"] for n in "pqr"]
    angles = [fdm[f"attitude/{n}-rad"] for n in ("phi", "theta", "psi")]
    return [*moving, *turning, *angles, *felt, FOOT * fdm["position/h-sl-ft"]]
