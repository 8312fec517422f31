"""Fly an aircraft whose applied wrench is exactly linear, and log it as a CSV file in field units.

For trying the tools without flight data: every derivative that they should find is in ``DERIVATIVES``.
The motion is that of a rigid body, the sensors are noisy and the accelerometers sit off the centre of
gravity. Run as ``python examples/linear_record.py LOG.csv``; seeds and noise are arguments of `fly`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd

GRAVITY, FOOT = 9.80665, 0.3048
MASS, INERTIA = 28.6, (2.4, 3.1, 4.9, 0.15)  # kg; Ix Iy Iz Ixz, kg m2
SPEED, DENSITY = 20.0, 1.225  # trim speed, m/s; kg/m3
SENSOR = np.array([0.12, 0.0, -0.05])  # accelerometers from the centre of gravity, m

# Response to regressor, N or N m per SI unit; what identification should find.
DERIVATIVES = {
    "X": {"u": -6.0, "w": 4.0, "q": 0.5, "de": -5.0, "n1": 0.9},
    "Y": {"v": -14.0, "p": 0.6, "r": 2.5, "da": 2.0, "dr": 30.0},
    "Z": {"u": -28.0, "w": -95.0, "q": -12.0, "de": -60.0, "n1": -0.3},
    "L": {"v": -5.0, "p": -16.0, "r": 3.0, "da": 45.0, "dr": 2.5},
    "M": {"u": 0.4, "w": -9.0, "q": -18.0, "de": -42.0, "n1": 0.05},
    "N": {"v": 8.0, "p": -0.8, "r": -9.0, "da": -1.5, "dr": -22.0},
}
STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi")
EFFECTORS = {"de": 0.06, "da": 0.05, "dr": 0.06, "n1": 25.0}  # amplitude of the excitation, rad or rad/s
TRIM = {"de": 0.02, "da": 0.0, "dr": 0.0, "n1": 420.0}
NOISE = {"velocity": 0.15, "rate": np.deg2rad(0.1), "angle": np.deg2rad(0.1), "force": 0.01 * GRAVITY}
NOISE |= {"surface": np.deg2rad(0.05), "rotor": 0.002 * TRIM["n1"]}


def multisines(time, period, rng):
    """Return one random-phase multisine for each effector on its own harmonics, 0.05 to 1.8 Hz."""
    harmonics = np.arange(np.ceil(0.05 * period), np.floor(1.8 * period) + 1)
    signals = {}
    for i, (name, amplitude) in enumerate(EFFECTORS.items()):
        own = harmonics[i :: len(EFFECTORS)]
        phase = rng.uniform(0, 2 * np.pi, own.size)
        tones = np.sin(2 * np.pi * np.outer(own, time) / period + phase[:, None])
        signals[name] = amplitude * np.sqrt(2 / own.size) * tones.sum(axis=0)
    return signals


def wrench(state, effectors, derivatives=DERIVATIVES):
    """Return X Y Z L M N of a state and effector positions: the trim plus what is linear about it."""
    values = dict(zip(STATES, state, strict=True)) | effectors
    change = {n: v - (SPEED if n == "u" else TRIM.get(n, 0.0)) for n, v in values.items()}
    linear = [sum(c * change[n] for n, c in row.items()) for row in derivatives.values()]
    return np.array(linear) + np.array([0, 0, -MASS * GRAVITY, 0, 0, 0])


def motion(state, applied):
    """Return the derivative of the state of a rigid body (Klein & Morelli, 2nd ed., ch. 3)."""
    u, v, w, p, q, r, phi, theta, _ = state
    sin_phi, cos_phi, sin_theta, cos_theta = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    ix, iy, iz, ixz = INERTIA
    roll = applied[3] + ixz * p * q - (iz - iy) * q * r
    yaw = applied[5] - ixz * q * r - (iy - ix) * p * q
    spread = ix * iz - ixz**2
    return np.array(
        [
            applied[0] / MASS - GRAVITY * sin_theta + r * v - q * w,
            applied[1] / MASS + GRAVITY * cos_theta * sin_phi + p * w - r * u,
            applied[2] / MASS + GRAVITY * cos_theta * cos_phi + q * u - p * v,
            (iz * roll + ixz * yaw) / spread,
            (applied[4] - (ix - iz) * p * r - ixz * (p**2 - r**2)) / iy,
            (ixz * roll + ix * yaw) / spread,
            p + (q * sin_phi + r * cos_phi) * np.tan(theta),
            q * cos_phi - r * sin_phi,
            (q * sin_phi + r * cos_phi) / cos_theta,
        ]
    )


def fly(seed=0, noise=1.0, period=60.0, periods=2, dt=0.02, inner_steps=2, derivatives=DERIVATIVES):
    """Return the log of one manoeuvre as a table in field units.

    Parameters
    ----------
    seed : int
        Of excitation phases and noise.
    noise : float
        Multiplies the noise of every sensor.
    derivatives : dict of dict of float
        Of the aircraft that flies.
    """
    rng = np.random.default_rng(seed)
    h = dt / inner_steps
    fine = np.arange(round(period * periods / h) + 1) * h
    excited = multisines(np.arange(2 * fine.size - 1) * h / 2, period, rng)  # half steps for RK4
    position = {n: TRIM[n] + excited[n] for n in EFFECTORS}
    # A light attitude loop keeps the long manoeuvre near its trim; excitation is added after it.
    gains = {"de": {"theta": 0.35, "q": 0.05}, "da": {"phi": -0.3, "p": -0.05}}
    log = {n: np.empty(fine.size) for n in (*STATES, *EFFECTORS, "ax", "ay", "az")}
    state = np.array([SPEED, 0, 0, 0, 0, 0, 0, 0, 0], dtype=float)

    def moved(state, half_step):
        feedback = {e: sum(k * state[STATES.index(n)] for n, k in g.items()) for e, g in gains.items()}
        return {n: position[n][half_step] + feedback.get(n, 0.0) for n in EFFECTORS}

    def slope(state, half_step):
        return motion(state, wrench(state, moved(state, half_step), derivatives))

    for i in range(fine.size):
        effectors = moved(state, 2 * i)
        applied = wrench(state, effectors, derivatives)
        rates, accelerations = state[3:6], motion(state, applied)[3:6]
        felt = applied[:3] / MASS + np.cross(accelerations, SENSOR) + np.cross(rates, np.cross(rates, SENSOR))
        for name, value in zip(STATES, state, strict=True):
            log[name][i] = value
        for name, value in (effectors | dict(zip(("ax", "ay", "az"), felt, strict=True))).items():
            log[name][i] = value
        if i + 1 < fine.size:
            k1 = slope(state, 2 * i)
            k2 = slope(state + h / 2 * k1, 2 * i + 1)
            k3 = slope(state + h / 2 * k2, 2 * i + 1)
            k4 = slope(state + h * k3, 2 * i + 2)
            state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    table = pd.DataFrame({"time_s": fine[::inner_steps]})
    degrees, rpm = np.rad2deg(1.0), 60 / (2 * np.pi)
    kinds = (
        (("u", "v", "w"), "fps", 1 / FOOT, "velocity"),
        (("p", "q", "r"), "dps", degrees, "rate"),
        (("phi", "theta", "psi"), "deg", degrees, "angle"),
        (("ax", "ay", "az"), "g", 1 / GRAVITY, "force"),
        (("de", "da", "dr"), "deg", degrees, "surface"),
        (("n1",), "rpm", rpm, "rotor"),
    )
    for names, unit, factor, kind in kinds:
        for name in names:
            clean = log[name][::inner_steps]
            table[f"{name}_{unit}"] = factor * (clean + noise * NOISE[kind] * rng.standard_normal(clean.size))
    table["rho_kgm3"] = DENSITY
    for name in EFFECTORS:
        unit, factor = ("rpm", rpm) if name == "n1" else ("deg", degrees)
        table[f"{name}_excitation_{unit}"] = factor * excited[name][:: 2 * inner_steps]
    return table


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.parent.mkdir(parents=True, exist_ok=True)
    fly().to_csv(target, index=False, float_format="%.10g")
