"""The owner's simulation of one aircraft: linear coefficients.

A copy of it lies in the folder of every case, with its numbers in ``simulation.json``. Forces
are N in body axes, moments N m about the centre of gravity. It needs numpy and scipy only.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from scipy.linalg import expm

GRAVITY = 9.80665
MODEL = json.loads((Path(__file__).parent / "simulation.json").read_text())
LENGTHS = {"Cl": "span_m", "Cm": "chord_m", "Cn": "span_m"}
LOADS = {"CX": "X", "CY": "Y", "CZ": "Z", "Cl": "L", "Cm": "M", "Cn": "N"}
SLOW = 3  # degree of the polynomials that stand for motion which the simulation does not fly


def derivative(coefficient, regressor, parameters):
    """Return one derivative: its nominal value and the departure asked for."""
    return MODEL["derivatives"][coefficient][regressor] + parameters.get(f"{coefficient}_{regressor}", 0.0)


def size(coefficient):
    """Return what a coefficient and the dynamic pressure are multiplied by, m2 or m3."""
    return MODEL["area_m2"] * (MODEL[LENGTHS[coefficient]] if coefficient in LENGTHS else 1.0)


def lagged(time, x, time_constant):
    """Return `x` after a first-order lag that is at rest in the beginning."""
    y = np.empty_like(x)
    y[0] = x[0]
    share = np.exp(-np.diff(time) / time_constant)
    for i, a in enumerate(share):
        y[i + 1] = a * y[i] + (1 - a) * 0.5 * (x[i] + x[i + 1])
    return y


def regressors(time, state, effector, air):
    """Return every variable that the derivatives may refer to."""
    twice = 2 * air["V"]
    known = {"0": np.ones_like(air["V"]), "alpha": air["alpha"], "beta": air["beta"], **effector}
    known["V"] = air["V"] / MODEL["speed_mps"] - 1.0
    for rate, length in (("p", "span_m"), ("q", "chord_m"), ("r", "span_m")):
        if rate in state:
            known[rate + "hat"] = state[rate] * MODEL[length] / twice
    if MODEL.get("lag_s"):
        known["lagged"] = lagged(np.asarray(time), air["alpha"], MODEL["lag_s"])
    return known


def wrench(time, state, effector, air, parameters):
    """Return the loads of the aircraft on the states and positions that were flown."""
    known = regressors(time, state, effector, air)
    return {
        LOADS[c]: air["qbar"] * size(c) * sum(derivative(c, x, parameters) * known[x] for x in row)
        for c, row in MODEL["derivatives"].items()
        if c in MODEL["responses"]
    }


def _slope(coefficient, regressor, parameters):
    row = MODEL["derivatives"].get(coefficient, {})
    return derivative(coefficient, regressor, parameters) if regressor in row else 0.0


def _lateral(at, names, parameters):
    """Return the linear system of v p r phi, inputs last."""
    qbar, speed, u0, w0, theta = at["qbar"], at["V"], at["u"], at["w"], at["theta"]
    mass, (xx, _, zz, xz) = MODEL["mass_kg"], MODEL["inertia"]
    rate = MODEL["span_m"] / (2 * speed)
    loads = np.zeros((3, 4 + len(names)))
    for i, c in enumerate(("CY", "Cl", "Cn")):
        scale = qbar * size(c)
        loads[i, 0] = scale * _slope(c, "beta", parameters) / speed
        loads[i, 1] = scale * rate * _slope(c, "phat", parameters)
        loads[i, 2] = scale * rate * _slope(c, "rhat", parameters)
        loads[i, 4:] = [scale * _slope(c, n, parameters) for n in names]
    system = np.zeros((4, 4 + len(names)))
    system[0] = loads[0] / mass
    system[[1, 2]] = np.linalg.solve([[xx, -xz], [-xz, zz]], loads[1:])
    system[0, :4] += [0, w0, -u0, GRAVITY * np.cos(theta)]
    system[3, :4] = [0, 1, np.tan(theta), 0]
    return system, ("v", "p", "r", "phi")


def _longitudinal(at, names, parameters):
    """Return the linear system of u w q theta, inputs last."""
    qbar, speed, u0, w0, theta = at["qbar"], at["V"], at["u"], at["w"], at["theta"]
    mass, yy = MODEL["mass_kg"], MODEL["inertia"][1]
    loads = np.zeros((3, 4 + len(names)))
    for i, c in enumerate(("CX", "CZ", "Cm")):
        scale, row = qbar * size(c), MODEL["derivatives"].get(c, {})
        trim = {**at, "0": 1.0, "V": speed / MODEL["speed_mps"] - 1.0}
        level = sum(derivative(c, x, parameters) * trim.get(x, 0.0) for x in row)
        loads[i, 0] = scale * (2 * level / speed + _slope(c, "V", parameters) / MODEL["speed_mps"])
        loads[i, 1] = scale * _slope(c, "alpha", parameters) / speed
        loads[i, 2] = scale * MODEL["chord_m"] / (2 * speed) * _slope(c, "qhat", parameters)
        loads[i, 4:] = [scale * _slope(c, n, parameters) for n in names]
    system = np.zeros((4, 4 + len(names)))
    system[:3] = loads / np.array([mass, mass, yy])[:, None]
    system[0, :4] += [0, 0, -w0, -GRAVITY * np.cos(theta)]
    system[1, :4] += [0, 0, u0, -GRAVITY * np.sin(theta)]
    system[3, 2] = 1
    return system, ("u", "w", "q", "theta")


def _march(system, inputs, dt, start):
    """Return the states of a linear system by steps that are exact for inputs linear between samples."""
    n, m = system.shape[0], system.shape[1] - system.shape[0]
    block = np.zeros((n + 2 * m, n + 2 * m))
    block[:n, : n + m] = system * dt
    block[n : n + m, n + m :] = np.eye(m)
    step = expm(block)
    a, b1 = step[:n, :n], step[:n, n + m :]
    b0 = step[:n, n : n + m] - b1
    states = np.empty((n, inputs.shape[1]))
    states[:, 0] = start
    for i in range(inputs.shape[1] - 1):
        states[:, i + 1] = a @ states[:, i] + b0 @ inputs[:, i] + b1 @ inputs[:, i + 1]
    return states


def _slow(time, x):
    return np.polynomial.Polynomial.fit(time, x, SLOW)(time)


def fly(record, parameters):
    """Return the simulation's own motion under the surfaces that were measured.

    The rigid body is linear about the record's mean levels. Its initial state and one constant
    acceleration of each state are those by which it fits the recorded motion best: they are not known
    otherwise. States of the other plane of symmetry follow cubic polynomials through the record.
    """
    time = np.asarray(record.time)
    at = {n: float(np.mean(record[f"state/{n}"])) for n in ("u", "w", "theta")}
    at |= {n: float(np.mean(record[f"air/{n}"])) for n in ("V", "alpha", "qbar")}
    names = [n for n in MODEL["effectors"] if f"effector/{n}" in record]
    at |= {n: float(np.mean(record[f"effector/{n}"])) for n in names}
    plane = _lateral if MODEL["fly"] == "lateral" else _longitudinal
    system, states = plane(at, names, parameters)
    n, dt = len(states), float(time[-1] - time[0]) / (time.size - 1)
    levels = np.array([np.mean(record[f"state/{s}"]) for s in states])
    moved = np.array([record[f"effector/{e}"] - at[e] for e in names])
    forced = _march(system, moved, dt, np.zeros(n))
    steady = np.hstack([system[:, :n], np.eye(n)])
    ones = np.ones((1, time.size))
    free = [_march(steady, np.zeros((n, time.size)), dt, start) for start in np.eye(n)]
    free += [_march(steady, np.outer(constant, ones), dt, np.zeros(n)) for constant in np.eye(n)]
    measured = np.array([record[f"state/{s}"] for s in states]) - levels[:, None]
    weight = 1 / measured.std(axis=1, keepdims=True)
    columns = np.array([(weight * f).ravel() for f in free]).T
    found = np.linalg.lstsq(columns, (weight * (measured - forced)).ravel(), rcond=1e-10)[0]
    flown = levels[:, None] + forced + np.tensordot(found, np.array(free), 1)
    own = dict(zip(states, flown, strict=True))
    rest = [s for s in ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi") if s not in own]
    return {**own, **{s: _slow(time, record[f"state/{s}"]) for s in rest if f"state/{s}" in record}}


wrench.responses = tuple(LOADS[c] for c in MODEL["responses"])
wrench.tolerances = {name: (sigma, "1") for name, sigma in MODEL["tolerances"].items()}
if MODEL.get("fly"):
    wrench.fly = fly
