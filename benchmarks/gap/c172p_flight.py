"""Flights of an edited c172p by JSBSim, from trim."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from c172p_craft import RATE_HZ, STEPS, Craft
from gap_c172p import AMPLITUDE, CONTROLS, FOOT, SLUG, in_trim

ALTITUDE = 3000.0  # ft
_HEADING = 90.0  # deg
_TERRAIN = 2200.0  # ft
_RISE = 30.0  # s, that a wind has to come up before the record
_LAID_OUT = {n: 2.0 * a for n, a in AMPLITUDE.items()}  # of full travel, peak

Array = np.ndarray


@lru_cache(maxsize=8)
def excitation(samples: int, seed: int) -> Array:
    """Return multisines of full travel over the whole record, shape (control, sample)."""
    time = np.arange(samples) / RATE_HZ
    rng = np.random.default_rng(seed)
    span = time[-1] + time[1]
    found = []
    for i, name in enumerate(CONTROLS):
        k = np.arange(3 + i, round(1.9 * span) + 1, len(CONTROLS))
        turns = 2 * np.pi * np.outer(time / span, k)
        tries = (np.sin(turns + rng.uniform(0, 2 * np.pi, k.size)).sum(axis=1) for _ in range(30))
        best = min(tries, key=np.ptp)
        found.append(_LAID_OUT[name] * best / np.abs(best).max())
    return np.array(found)


def fly(craft: Craft, speed: float, signals: Array, *, gusts: float, seed: int) -> dict[str, Array]:
    """Return channels of a flight from trim, SI, logged at the nominal centre of gravity.

    Parameters
    ----------
    craft : Craft
    speed : float
        m/s.
    signals : ndarray, shape (control, sample)
        Of full travel; a light attitude hold is added.
    gusts : float
        More than zero for JSBSim's turbulence. At this altitude above the sea its severity alone sets how
        strong that is, about 1.8 m/s of each component; no other value changes it.
    seed : int
        Of the gusts.

    Raises
    ------
    ArithmeticError
        Where the flight diverges or there is no trim.
    """
    import jsbsim

    fdm = craft.loaded()
    given = {
        "h-sl-ft": ALTITUDE,
        "terrain-elevation-ft": _TERRAIN,
        "vt-fps": speed / FOOT,
        "psi-true-deg": _HEADING,
        "gamma-deg": 0.0,
    }
    try:
        trim = in_trim(fdm, given)
    except jsbsim.TrimFailureError:
        raise ArithmeticError(f"no trim at {speed:g} m/s") from None
    level, bank, before, rows = fdm["attitude/theta-rad"], fdm["attitude/phi-rad"], trim, []

    def held(command: Array) -> Array:
        """Return commands with a light hold of the attitude."""
        pitch = 0.6 * (fdm["attitude/theta-rad"] - level) + 0.2 * fdm["velocities/q-rad_sec"]
        roll = -0.5 * (fdm["attitude/phi-rad"] - bank) - 0.1 * fdm["velocities/p-rad_sec"]
        return command + np.array([pitch, roll, 0.0, 0.0])

    def step(now: Array) -> None:
        for share in np.arange(1, STEPS + 1) / STEPS:
            for name, value in zip(CONTROLS, before + share * (now - before), strict=True):
                fdm[f"fcs/{name}-cmd-norm"] = float(value)
            fdm.run()

    for k in range(round(_RISE * RATE_HZ) if craft.rising else 0):
        for name, value in craft.rising.items():
            fdm[name] = value * min(1.0, 2 * k / (_RISE * RATE_HZ))
        now = held(trim)
        step(now)
        before = now
    if gusts:
        _let_blow(fdm, seed)
    for k in range(signals.shape[1]):
        now = held(trim + signals[:, k]) if k else before
        if k:
            step(now)
        rows.append(_seen(fdm, craft, now, signals[:, k]))
        before = now
    found = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    if not all(np.isfinite(x).all() for x in found.values()) or np.abs(found["state/phi"]).max() > 1.0:
        raise ArithmeticError(f"the flight at {speed:g} m/s diverges")
    return found


def _let_blow(fdm: Any, seed: int) -> None:
    """Turn JSBSim's turbulence on, the same for the same seed whatever flies.

    It is turned to where the wind blows. After a trim that is the direction of a wind of rounding errors,
    another one for every edit of the aircraft: a wind too weak to matter holds it along the flight.
    """
    fdm["simulation/randomseed"] = seed
    fdm["atmosphere/randomseed"] = seed
    fdm["atmosphere/turb-type"] = 3
    fdm["atmosphere/turbulence/milspec/severity"] = 3
    for axis, wind in (("north", 1e-9), ("east", 0.0), ("down", 0.0)):
        fdm[f"atmosphere/wind-{axis}-fps"] = wind
    fdm["atmosphere/psiw-rad"] = np.radians(_HEADING)


def _blowing(fdm: Any) -> Array:
    """Return the turbulence in body axes, ft/s."""
    north, east, down = (fdm[f"atmosphere/turb-{n}-fps"] for n in ("north", "east", "down"))
    phi, theta, psi = (fdm[f"attitude/{n}-rad"] for n in ("phi", "theta", "psi"))
    along, right = north * np.cos(psi) + east * np.sin(psi), east * np.cos(psi) - north * np.sin(psi)
    u, below = along * np.cos(theta) - down * np.sin(theta), along * np.sin(theta) + down * np.cos(theta)
    return np.array([u, right * np.cos(phi) + below * np.sin(phi), below * np.cos(phi) - right * np.sin(phi)])


def _seen(fdm: Any, craft: Craft, command: Array, injected: Array) -> dict[str, float]:
    """Return one row of the log."""
    rates = np.array([fdm[f"velocities/{n}-rad_sec"] for n in "pqr"])
    turning = np.array([fdm[f"accelerations/{n}dot-rad_sec2"] for n in "pqr"])
    place = np.array([fdm[f"inertia/cg-{n}-in"] for n in "xyz"])
    arm = 0.0254 * (np.array(craft.weighed().place) - place) * (-1, 1, -1)  # from the true centre of gravity
    felt = np.array([fdm[f"forces/fb{n}-aero-lbs"] + fdm[f"forces/fb{n}-prop-lbs"] for n in "xyz"])
    felt = FOOT * felt / fdm["inertia/mass-slugs"]
    out = arm + craft.accelerometer
    felt = felt + np.cross(turning, out) + np.cross(rates, np.cross(rates, out))
    kind = "" if craft.ground else "-aero"
    moving = FOOT * np.array([fdm[f"velocities/{n}{kind}-fps"] for n in "uvw"]) + np.cross(rates, arm)
    if craft.ground:  # the wind is what such sensors do not see, gusts they feel like all others
        moving = moving - FOOT * _blowing(fdm)
    row = dict(zip(("state/u", "state/v", "state/w"), moving.tolist(), strict=True))
    row |= dict(zip(("state/p", "state/q", "state/r"), rates.tolist(), strict=True))
    row |= {f"state/{n}": fdm[f"attitude/{n}-rad"] for n in ("phi", "theta", "psi")}
    row |= dict(zip(("state/ax", "state/ay", "state/az"), felt.tolist(), strict=True))
    row["state/alt"] = FOOT * fdm["position/h-sl-ft"]
    row["air/rho"] = SLUG / FOOT**3 * fdm["atmosphere/rho-slugs_ft3"]
    for name, sent, added in zip(CONTROLS, command, injected, strict=True):
        row[f"effector/{name}"] = fdm[craft.logged[name]]
        row[f"command/{name}"], row[f"excitation/{name}"] = float(sent), float(added)
    return row
