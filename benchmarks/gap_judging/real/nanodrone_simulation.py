"""The owner's simulation of a nano quadcopter: thrust of each rotor, less by inflow, and rotor drag.

Numbers are read from ``simulation.json`` beside this file. Forces only: the moments of so small a
vehicle are not modelled. The published simulator has the thrust alone.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

GRAVITY = 9.80665
MODEL = json.loads((Path(__file__).parent / "simulation.json").read_text())
SMOOTHING_S = 0.1  # time constant of what the attitude of the own flight is smoothed by


def value(name, parameters):
    """Return one number of the model: nominal, and the departure asked for as a fraction or in N."""
    if name.endswith("_0"):
        return MODEL["parameters"][name] + parameters.get(name, 0.0)
    return MODEL["parameters"][name] * (1 + parameters.get(name, 0.0))


def wrench(time, state, effector, air, parameters):
    """Return the forces on the velocities and rotor speeds that were flown, N in body axes."""
    speeds = [effector[n] for n in MODEL["rotors"]]
    total, squares = sum(speeds), sum(s**2 for s in speeds)
    return {
        "X": value("drag_x", parameters) * total * state["u"] + value("X_0", parameters),
        "Y": value("drag_y", parameters) * total * state["v"] + value("Y_0", parameters),
        "Z": -value("thrust", parameters) * squares
        + value("inflow", parameters) * total * state["w"]
        + value("Z_0", parameters),
    }


def _smooth(time, x):
    """Return a history by a centred kernel, which delays nothing."""
    half = max(1, round(2 * SMOOTHING_S / (time[1] - time[0])))
    kernel = np.hanning(2 * half + 1)
    padded = np.pad(x, half, mode="reflect", reflect_type="odd")
    return np.convolve(padded, kernel / kernel.sum(), mode="valid")


def _to_earth(phi, theta, psi):
    """Return matrices that turn body axes into earth axes, shape (sample, 3, 3)."""
    (sf, cf), (st, ct), (sp, cp) = ((np.sin(a), np.cos(a)) for a in (phi, theta, psi))
    rows = [
        [ct * cp, sf * st * cp - cf * sp, cf * st * cp + sf * sp],
        [ct * sp, sf * st * sp + cf * cp, cf * st * sp - sf * cp],
        [-st, sf * ct, cf * ct],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def fly(record, parameters):
    """Return the motion under the measured rotor speeds, at the attitude that was flown, smoothed.

    A quadcopter falls over without its control law, so only the velocity is flown. Its initial value and
    one constant force along each axis are those by which it fits the recorded velocity best.
    """
    time = np.asarray(record.time)
    held = {n: _smooth(time, record[f"state/{n}"]) for n in ("p", "q", "r", "phi", "theta", "psi")}
    turn = _to_earth(held["phi"], held["theta"], held["psi"])
    speeds = np.array([record[f"effector/{n}"] for n in MODEL["rotors"]])
    total, squares = speeds.sum(axis=0), (speeds**2).sum(axis=0)
    mass, dt = MODEL["mass_kg"], float(time[-1] - time[0]) / (time.size - 1)
    drag = np.array([value(n, parameters) for n in ("drag_x", "drag_y", "inflow")]) / mass
    thrust = np.zeros((time.size, 3))
    thrust[:, 2] = -value("thrust", parameters) * squares
    thrust += [value(n, parameters) for n in ("X_0", "Y_0", "Z_0")]
    # columns: the flight from rest, three initial velocities, three constant forces per mass
    velocity = np.zeros((time.size, 3, 7))
    velocity[0, :, 1:4] = np.eye(3)
    for i in range(time.size - 1):
        body = turn[i].T @ velocity[i]
        push = drag[:, None] * total[i] * body
        push[:, 0] += thrust[i] / mass
        push[:, 4:] += np.eye(3)
        slope = turn[i] @ push
        slope[2, 0] += GRAVITY
        velocity[i + 1] = velocity[i] + dt * slope
    own = np.einsum("tij,tik->tjk", turn, velocity)
    measured = np.array([record[f"state/{n}"] for n in ("u", "v", "w")]).T
    columns = own[..., 1:].reshape(-1, 6)
    found = np.linalg.lstsq(columns, (measured - own[..., 0]).ravel(), rcond=None)[0]
    flown = own[..., 0] + own[..., 1:] @ found
    return {**dict(zip(("u", "v", "w"), flown.T, strict=True)), **held}


wrench.responses = ("X", "Y", "Z")
wrench.tolerances = {name: tuple(entry) for name, entry in MODEL["tolerances"].items()}
wrench.fly = fly
