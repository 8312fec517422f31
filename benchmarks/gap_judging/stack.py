"""Everything that a record says against the owner's simulation, on lines: loads, actuators, kinematics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shafts import shafts

LINES = np.arange(121)  # multiples of 1/60 Hz, up to 2 Hz
PERIOD, GRAVITY = 60.0, 9.80665
LOADS = ("X", "Y", "Z", "L", "M", "N")
KINEMATIC = ("u", "v", "w", "phi", "theta", "psi")


def rows_of(aircraft: Any) -> list[str]:
    """Return the names of the stack's rows."""
    return [*LOADS, *(f"actuator/{e}" for e in aircraft.EFFECTORS), *(f"kinematic/{k}" for k in KINEMATIC)]


def lines(values: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return Fourier coefficients of channels over one period, shape (..., line)."""
    body = values[..., :-1].copy()
    body[..., 0] = 0.5 * (values[..., 0] + values[..., -1])
    return np.fft.rfft(body, axis=-1)[..., LINES] / body.shape[-1]


def rates_of(values: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return Fourier coefficients of derivatives, with ends from parabolas over 0.4 s."""
    s = np.arange(21) - 20.0
    weight = np.linalg.pinv(np.vander(s, 3))[2]  # value at the last of 21 samples
    jump = values[..., -21:] @ weight - values[..., 20::-1] @ weight
    return 2j * np.pi * LINES / PERIOD * lines(values) + jump[..., None] / PERIOD


def stack(aircraft: Any, simulation: Any, channels: Mapping[str, NDArray[np.float64]], rho: float) -> Any:
    """Return the residual of one record, complex, shape (row, line).

    Parameters
    ----------
    aircraft, simulation : module
    channels : mapping
        Of the record, ``group/name``.
    rho : float
        Air density, kg/m3.
    """
    names = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi")
    x = np.array([channels[f"state/{n}"] for n in names])
    u, v, w, p, q, r, phi, theta, psi = x
    force = np.array([channels[f"state/a{end}"] for end in "xyz"])
    effector = {e: channels[f"effector/{e}"] for e in aircraft.EFFECTORS}
    arm = aircraft.SENSOR
    rates, slope = x[3:6], rates_of(x)
    turn = slope[3:6]
    steady = force - np.cross(rates.T, np.cross(rates.T, arm)).T
    specific = lines(steady) - np.cross(turn.T, arm).T
    ixx, iyy, izz, ixz = aircraft.INERTIA
    spin = np.array([effector[e] for e in aircraft.ROTORS])
    hub = shafts(aircraft, np.array([np.mean(effector[e]) for e in aircraft.EFFECTORS]))
    h = hub @ spin
    change = hub @ rates_of(spin)
    products = np.array(
        [
            (izz - iyy) * q * r - ixz * p * q + q * h[2] - r * h[1],
            (ixx - izz) * p * r + ixz * (p * p - r * r) + r * h[0] - p * h[2],
            (iyy - ixx) * p * q + ixz * q * r + p * h[1] - q * h[0],
        ]
    )
    moment = lines(products) + change
    moment += np.array([ixx * turn[0] - ixz * turn[2], iyy * turn[1], izz * turn[2] - ixz * turn[0]])
    state = dict(zip(names, x, strict=True))
    said = simulation.wrench(None, state, effector, {"rho": np.full(u.size, rho)}, {})
    said = lines(np.array([said[k] for k in LOADS]))
    loads = np.vstack([aircraft.MASS * specific, moment]) - said
    before = 150  # samples of the period's end, so that actuators are under way at its start
    command = {
        e: np.concatenate([channels[f"command/{e}"][-1 - before : -1], channels[f"command/{e}"]])
        for e in aircraft.EFFECTORS
    }
    moved = simulation.wrench.positions(0.02 * np.arange(u.size + before), command, {})
    actuators = lines(np.array([effector[e] - moved[e][before:] for e in aircraft.EFFECTORS]))
    sp, cp, st, ct = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    carried = np.array(
        [
            -GRAVITY * st + r * v - q * w,
            GRAVITY * ct * sp + p * w - r * u,
            GRAVITY * ct * cp + q * u - p * v,
            p + (q * sp + r * cp) * st / ct,
            q * cp - r * sp,
            (q * sp + r * cp) / ct,
        ]
    )
    kinematic = np.vstack([slope[0:3], slope[6:9]]) - lines(carried)
    kinematic[:3] -= specific
    return np.vstack([loads, actuators, kinematic])
