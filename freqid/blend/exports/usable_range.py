"""Which states a global model is for: in words, and as samples that its exports are tried at."""

from __future__ import annotations

import numpy as np

from freqid.blend.exports.exact import DEPARTURE
from freqid.blend.global_model import GlobalModel
from freqid.blend.similarity import equivalent, goes_with_velocity
from freqid.core.arrays import Array
from freqid.core.units import RHO0


def units_of(model: GlobalModel) -> dict[str, str]:
    """Return the SI units of the model's inputs, by name."""
    c = model.corridor
    scheduled = dict(zip(c.scheduled, c.scheduled_units, strict=True))
    own = {"u": "m/s", "rho": "kg/m3"}
    return {name: c.units.get(name) or own.get(name) or scheduled[name] for name in model.inputs}


def meaning_of(model: GlobalModel, name: str) -> str:
    """Return what an input is and which values points of the model have it at, in words."""
    c = model.corridor
    if name == "u":
        return f"velocity along x body through the air, points from {c.u.min():.6g} to {c.u.max():.6g} m/s"
    if name == "rho":
        return f"air density, points from {c.rho.min():.6g} to {c.rho.max():.6g} kg/m3"
    if name in c.scheduled:
        row = c.schedule[c.scheduled.index(name)]
        return f"{name}, set along the corridor from {row.min():.6g} to {row.max():.6g}"
    trims = [r.trim[r.regressors.index(name)] for r in c.responses.values() if name in r.regressors]
    rms = max(
        r.regressor_rms[r.regressors.index(name)].max() for r in c.responses.values() if name in r.regressors
    )
    return f"{name}, trims from {np.min(trims):.6g} to {np.max(trims):.6g}, moved by up to {rms:.3g} rms"


def range_notes(model: GlobalModel) -> tuple[str, ...]:
    """Return which states a model is for and what happens elsewhere, one sentence each."""
    c, t = model.corridor, model.tolerance
    moving = [n for n in c.scheduled if n in model.inputs]
    span = f"u from {c.u.min():.6g} to {c.u.max():.6g} m/s, "
    span += f"rho from {c.rho.min():.6g} to {c.rho.max():.6g} kg/m3"
    near = f"{t.speed:g} m/s of equivalent speed"
    for n in moving:
        row = c.scheduled.index(n)
        reach, unit = t.tilt / float(model.lines[0].turn[row]), c.scheduled_units[row]
        near += f", {np.rad2deg(reach):.3g} deg of {n}" if unit == "rad" else f", {reach:.3g} {unit} of {n}"
    return (
        f"Model of {c.vehicle} over the conditions {' '.join(c.ids)}: {span}; form '{c.form}', body axes, "
        "moments about the centre of gravity.",
        "Inputs are absolute values in SI units and radians, not deviations from the trim. Equivalent "
        f"velocities, rates and rotor speeds are the true ones times sqrt(rho / {RHO0:g}).",
        f"The model is meant for states within {near} of the corridor. Beyond, parameters are held at the "
        "nearest place of the corridor and the quantity 'outside' is 1.",
        f"Regressors are meant to be within {DEPARTURE:g} rms of the manoeuvres of identification from their "
        "trims; beyond, the model goes on linearly.",
    )


def states(model: GlobalModel, count: int, seed: int = 0) -> dict[str, Array]:
    """Return states all over the stated range, shape (count,) each: on the corridor, off it, beyond its ends.

    All inputs of the model, SI: at every density of its lines and between, up to twice the tolerance from the
    corridor, regressors up to `DEPARTURE` rms from their trims.
    """
    rng, c = np.random.default_rng(seed), model.corridor
    which = rng.integers(len(model.lines), size=count)
    rho = np.array([line.rho for line in model.lines])[which]
    if len(model.lines) > 1:
        rho = rng.uniform(0.98 * rho.min(), 1.02 * rho.max(), count)
    k = equivalent(rho)
    x, schedule, speed = np.zeros((len(c.units), count)), np.zeros((len(c.scheduled), count)), np.zeros(count)
    for i, line in enumerate(model.lines):
        on = which == i
        s = rng.uniform(line.knots[0], line.knots[-1], on.sum())
        s[::7] = rng.choice(line.knots, s[::7].size)
        x[:, on], schedule[:, on], speed[on] = line.trim(s, len(c.units)), line.schedule(s), line.speed(s)
    reach = rng.choice([0.0, 0.5, 1.0, 2.0], count, p=[0.2, 0.3, 0.4, 0.1])
    turn = model.lines[0].turn[:, None]
    schedule = schedule + reach * model.tolerance.tilt * rng.uniform(-1, 1, schedule.shape) / turn
    speed = speed + reach * model.tolerance.speed * rng.uniform(-1, 1, count)
    units = c.units
    rms = {
        n: min(
            r.regressor_rms[r.regressors.index(n)].min() for r in c.responses.values() if n in r.regressors
        )
        for n in units
    }
    moved = (
        np.array([rms[n] for n in units])[:, None]
        * DEPARTURE
        * rng.uniform(-1, 1, x.shape)
        * np.minimum(reach, 1)
    )
    values = dict(zip(units, (x + moved) / k ** goes_with_velocity(units)[:, None], strict=True))
    values |= dict(zip(c.scheduled, schedule, strict=True)) | {"u": speed / k, "rho": rho}
    return {name: values[name] for name in model.inputs}


def start_of(model: GlobalModel) -> dict[str, float]:
    """Return the inputs at the trim half way along the corridor and ``theta``, SI."""
    c, line = model.corridor, model.lines[0]
    s = line.knots[line.knots.size // 2]
    inputs = model.reference(s / equivalent(line.rho) if c.along == "u" else s, line.rho)
    at = {name: float(value[0]) for name, value in inputs.items()}
    bias = dict(zip(model.names, model.wrench(inputs, outside="hold").values[:, 0].tolist(), strict=True))
    theta = float(np.arctan2(bias.get("X", 0.0), -bias.get("Z", -1.0)))
    return {"w": at["u"] * np.tan(theta)} | at | {"theta": theta}
