"""What the sensors log of a noise-free flight: errors of each sensor, then noise, jitter and quantisation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from motion import Log
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

TIME = 0.02 * np.arange(3001)  # one period of 60 s, both ends included
JITTER = 5e-4  # s, one sigma of a sample's time
STEP = {
    "velocity": 0.02,
    "rates": 0.001,
    "accelerometers": 0.02,
    "attitude": 0.0005,
    "surface": 0.0005,
    "rotor": 0.5,
    "tilt": 0.0005,
}


def measure(
    aircraft: Any, log: Log, flight: int, departures: Mapping[str, float], rng: np.random.Generator | None
) -> dict[str, NDArray[np.float64]]:
    """Return the channels of one record, ``group/name``; without `rng` there is no noise.

    Parameters
    ----------
    aircraft : module
    log : Log
    flight : int
        Which flight of the log.
    departures : mapping
        That flight's departures from the nominal truth, of which the sensors' count here.
    rng : Generator or None
    """
    get = lambda name: departures.get(name, 0.0)  # noqa: E731
    noise = aircraft.SCENARIO["noise"]

    def at(history, group):
        when = TIME - get(f"time_skew.{group}")
        if rng is not None:
            when = when + JITTER * rng.standard_normal(TIME.size)
        return CubicSpline(log.time, history)(np.clip(when, log.time[0], log.time[-1])).T

    state, felt = log.state[:, :, flight], log.acceleration[:, :, flight]
    out = {}
    shift = np.array([get(f"cg_offset.{end}") for end in "xyz"])
    # velocity, at the described centre of gravity
    speed = at(state, "velocity")
    velocity = speed[:3] - np.cross(speed[3:6].T, shift).T
    if any(get(f"steady_wind.{end}") for end in ("north", "east", "down")):
        velocity = velocity + _into_body(
            speed[6:9], [get(f"steady_wind.{end}") for end in ("north", "east", "down")]
        )
    if get("flow_upwash.alpha") or get("flow_upwash.beta"):
        total = np.sqrt((velocity**2).sum(axis=0))
        alpha = np.arctan2(velocity[2], velocity[0]) * (1 + get("flow_upwash.alpha"))
        beta = np.arcsin(velocity[1] / total) * (1 + get("flow_upwash.beta"))
        velocity = total * np.array(
            [np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)]
        )
    velocity = _askew(velocity, [get(f"misalignment.velocity_{end}") for end in "xyz"])
    # gyros
    rates = at(state[:, 3:6], "rates")
    # accelerometers
    here = at(np.hstack([felt, state[:, 3:6]]), "accelerometers")
    arm = aircraft.SENSOR + np.array([get(f"lever_arm.{end}") for end in "xyz"]) - shift
    force = here[:3] + np.cross(here[3:6].T, arm).T
    force = force + np.cross(here[6:9].T, np.cross(here[6:9].T, arm)).T
    if get("flexible_mode.strength"):
        bent = _bending(force[2], get("flexible_mode.strength"))
        force[2] += bent[0]
        rates[1] += bent[1]
    mount = [get(f"misalignment.imu_{end}") for end in "xyz"]
    rates, force = _askew(rates, mount), _askew(force, mount)
    attitude = at(state[:, 6:10], "attitude")
    positions = at(log.position[:, :, flight], "effectors")
    rows = [
        ("velocity", ("u", "v", "w"), velocity),
        ("rates", ("p", "q", "r"), rates),
        ("accelerometers", ("ax", "ay", "az"), force),
        ("attitude", ("phi", "theta", "psi"), attitude[:3]),
    ]
    shaking = None if rng is None else rng.standard_normal(TIME.size)
    for group, names, values in rows:
        for name, row in zip(names, values, strict=True):
            read = row * (1 + get(f"sensor_scale.{name}")) + get(f"sensor_bias.{name}")
            if rng is not None:
                white = rng.standard_normal(TIME.size)
                if group == "attitude":  # the filter behind it remembers
                    white = _coloured(white, 0.4)
                elif group in ("rates", "accelerometers"):  # vibration is felt by all of them
                    white = np.sqrt(0.92) * white + np.sqrt(0.08) * shaking
                read = _rounded(read + noise[name] * white, STEP[group])
            out[f"state/{name}"] = read
    out["state/alt"] = attitude[3] if rng is None else attitude[3] + 0.3 * rng.standard_normal(TIME.size)
    for name, row in zip(aircraft.EFFECTORS, positions, strict=True):
        kind = kind_of(aircraft, name)
        read = (
            row * (1 + get(f"sensor_scale.{kind}"))
            + get(f"sensor_bias.{kind}")
            + get(f"sensor_bias.{kind}@{name}")
        )
        if rng is not None:
            read = _rounded(read + noise[kind] * rng.standard_normal(TIME.size), STEP[kind])
        out[f"effector/{name}"] = read
    first = round((TIME[0] - log.time[0]) / 0.02)
    for i, name in enumerate(aircraft.EFFECTORS):
        out[f"command/{name}"] = log.command[first : first + TIME.size, i, flight].copy()
    return out


def kind_of(aircraft: Any, effector: str) -> str:
    """Return whether an effector is a surface, a rotor or a wing's tilt."""
    if effector in getattr(aircraft, "TILTS", ()):
        return "tilt"
    return "surface" if effector in aircraft.SURFACES else "rotor"


def with_air(channels: dict[str, NDArray[np.float64]], rho: float) -> dict[str, NDArray[np.float64]]:
    """Return the channels with air data computed from the measured velocity."""
    u, v, w = (channels[f"state/{n}"] for n in "uvw")
    total = np.sqrt(u * u + v * v + w * w)
    air = {
        "rho": np.full(TIME.size, rho),
        "V": total,
        "alpha": np.arctan2(w, u),
        "beta": np.arcsin(v / total),
    }
    air["qbar"] = 0.5 * rho * total**2
    return channels | {f"air/{name}": values for name, values in air.items()}


def _into_body(attitude, wind):
    """Return a wind, north east down, in body axes."""
    (sp, st, ss), (cp, ct, cs) = np.sin(attitude), np.cos(attitude)
    n, e, d = wind
    return np.array(
        [
            ct * cs * n + ct * ss * e - st * d,
            (sp * st * cs - cp * ss) * n + (sp * st * ss + cp * cs) * e + sp * ct * d,
            (cp * st * cs + sp * ss) * n + (cp * st * ss - sp * cs) * e + cp * ct * d,
        ]
    )


def _askew(vector, turn):
    """Return a vector as a triad reads it that is turned by small angles, to second order."""
    turn = np.asarray(turn)
    once = np.cross(vector.T, turn)
    return vector + (once + 0.5 * np.cross(once, turn)).T


def _bending(force, strength, hz=5.0, damping=0.02):
    """Return what a bending mode adds to the normal accelerometer and to the pitch gyro."""
    n = force.size - 1
    f = np.fft.rfftfreq(n, 0.02)
    drive = np.fft.rfft(force[:n] - force[:n].mean())
    mode = f**2 / (hz**2 - f**2 + 2j * damping * f * hz) * drive
    with np.errstate(divide="ignore", invalid="ignore"):
        turned = np.where(f > 0, mode / (2j * np.pi * np.maximum(f, 1e-9)), 0)
    ring = lambda lines: np.resize(np.fft.irfft(lines, n), n + 1)  # noqa: E731
    return strength * ring(mode), -0.25 * strength * ring(turned)


def _coloured(white, memory):
    """Return first-order noise of the same sigma."""
    return lfilter([np.sqrt(1 - memory**2)], [1, -memory], white)


def _rounded(values, step):
    """Return values as a converter of that step reads them."""
    return step * np.round(values / step)
