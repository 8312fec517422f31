"""How simulated actuators follow their commands, and what a share of that time makes of their positions."""

from __future__ import annotations

import numpy as np

from freqid.core.arrays import Array
from freqid.gap.stack.trial import Trial

_IDEAL = 0.02  # s: an actuator that is taken as ideal still takes its time
_SHARE = 0.05  # of a time constant of its own, by which a simulation is asked to be slower


def late(trial: Trial, name: str) -> float:
    """Return the time by which a simulated position follows its command on the whole, s."""
    record, position = trial.maneuver.record, trial.positions[name]
    sent = f"command/{name}"
    if sent not in record:
        return _IDEAL
    rate = slope_of(position, record.dt)
    found = float(np.dot(record[sent] - position, rate) / max(np.dot(rate, rate), 1e-300))
    return max(found, _IDEAL)


def time_constant(trial: Trial, name: str) -> float:
    """Return the time constant of a simulated actuator, s.

    Where the simulation declares one as a parameter of its own, it is asked for a share s more of it. A
    first-order lag, ``T x' = command - x``, then moves by d, of which ``T (d' + s (x + d)') = -d``, however
    late its command is beside. What declares none has all of its delay taken for a lag.
    """
    own = trial.simulation.tolerances.get(f"{name}.time_constant")
    if own is None or own.unit != "1":
        return late(trial, name)
    position, dt = trial.positions[name], trial.maneuver.record.dt
    moved = trial.positions_with(departures={f"{name}.time_constant": _SHARE})[name] - position
    aim = slope_of(moved + _SHARE * (position + moved), dt)
    return max(float(-np.dot(moved, aim) / max(np.dot(aim, aim), 1e-300)), 0.0) or late(trial, name)


def slower(trial: Trial, name: str, size: float) -> Array:
    """Return what a position changes by, shape (sample,), where its actuator takes a share longer to follow.

    Rotors follow as a first-order lag does, ``T x' = command - x``, with another T while they brake: what
    a share s of T adds to x follows ``T d' = -d - s T x'``.
    """
    dt = trial.maneuver.record.dt
    rate = slope_of(trial.positions[name], dt)
    if trial.maneuver.vehicle.effector_kinds.get(name) != "rotor":
        return -size * late(trial, name) * rate
    up, down = _late_up_and_down(trial, name)
    time = np.where(rate > 0, up, down)
    between = slice(1, None), slice(None, -1)
    kept = np.exp(-dt / np.mean([time[k] for k in between], axis=0))
    aim = -size * np.mean([(time * rate)[k] for k in between], axis=0)
    change = np.zeros_like(rate)
    for k in range(1, rate.size):
        change[k] = kept[k - 1] * change[k - 1] + (1 - kept[k - 1]) * aim[k - 1]
    return change


def _late_up_and_down(trial: Trial, name: str) -> tuple[float, float]:
    """Return the times by which a simulated speed follows its command while it rises and while it falls, s.

    A supply that sags scales commands, which is no time.
    """
    record, position = trial.maneuver.record, trial.positions[name]
    sent = f"command/{name}"
    rate = slope_of(position, record.dt)
    if sent not in record or not (rate.max() > 0 > rate.min()):
        both = late(trial, name)
        return both, both
    moved = record[sent] - record[sent].mean()
    columns = np.array([np.maximum(rate, 0), np.minimum(rate, 0), moved, np.ones_like(rate)])
    found = np.linalg.lstsq(columns.T, record[sent] - position, rcond=None)[0]
    return max(float(found[0]), _IDEAL), max(float(found[1]), _IDEAL)


def slope_of(values: Array, dt: float) -> Array:
    """Return a signal's rate of change, shape (sample,), by a cubic spline.

    Differences of samples 0.04 s apart would be 4 % short at 2 Hz.
    """
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(dt * np.arange(values.size), values)(dt * np.arange(values.size), 1))
