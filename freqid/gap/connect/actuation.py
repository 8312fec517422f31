"""What a scenario's servos, tilt drives, motors and battery make of a record's commands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.gap.connect.loads import Along, torques
from freqid.gap.connect.servos import STEP, follow
from freqid.gap.simulation import Settings
from freqid.simulate import airframe
from freqid.simulate.actuators import Actuators, Commands, by_kind
from freqid.simulate.battery import charge_rate, power
from freqid.simulate.effects import actuator_delay, battery_sag, rate_limit

Array = NDArray[np.float64]

_ELSEWHERE = 0.03  # of an effector's range


def positions(
    record: FlightRecord, vehicle: Vehicle, act: Actuators, settings: Settings, ratio: Array
) -> dict[str, Array]:
    """Return the positions of all effectors that have a command.

    Parameters
    ----------
    record : FlightRecord
    vehicle : Vehicle
    act : Actuators
        Before effects.
    settings : mapping of mapping of float
        Of the effects of actuators.
    ratio : ndarray, shape (sample,)
        Voltage over nominal voltage as the motors feel it.

    Returns
    -------
    dict of ndarray, shape (sample,)
        rad and rad/s, by effector.
    """
    names = [e.name for e in vehicle.effectors]
    commanded = [n for n in names if f"command/{n}" in record]
    time = record.time - record.time[0]
    steps = int(np.ceil(time[-1] / STEP - 1e-9)) + 1
    fine = STEP * np.arange(steps + 1, dtype=float)
    limits = rate_limit.limits(leaves(settings["rate_limit"]), act.surface.rate_limit)
    act = act._replace(surface=act.surface._replace(rate_limit=limits))
    sent, rest = np.zeros((len(names), steps)), np.zeros(len(names))
    ratio = CubicSpline(time, ratio)(np.minimum(fine, time[-1]))
    late = actuator_delay.delays(leaves(settings["actuator_delay"]), act.delay)
    kinds = vehicle.effector_kinds
    delays = {"surface": late.surface, "tilt": late.tilt, "rotor": late.speed}
    for row, name in enumerate(names):
        if name not in commanded:
            continue
        lag = settings["motor_lag" if kinds[name] == "rotor" else "actuator_lag"]["extra"]
        sent[row] = _arriving(record, name, fine, float(delays[kinds[name]]), lag)
        held = _split(record, name)[0][0] * (ratio[0] if kinds[name] == "rotor" else 1.0)
        rest[row] = held
        if f"effector/{name}" in record:
            # One sample is noise and its sensor's bias; only a start that is plainly elsewhere counts.
            start, low, high = record[f"effector/{name}"][0], *vehicle.effector(name).limits
            if abs(start - held) > _ELSEWHERE * (high - low):
                rest[row] = start
    found = follow(
        act,
        leaves(settings["actuator_lag"]),
        split_by_kind(vehicle, sent.T),
        ratio,
        split_by_kind(vehicle, rest),
    )
    rows = np.empty((steps, len(names)))
    for columns, values in zip(by_kind(vehicle, np.arange(len(names))), found, strict=True):
        rows[:, np.asarray(columns)] = values
    spline = CubicSpline(fine[:steps], rows)(time)
    return {n: spline[:, names.index(n)] for n in commanded}


def _split(record: FlightRecord, name: str) -> tuple[Array, Array]:
    """Return the control law's part of a command, and the injected signal."""
    injected = record[f"excitation/{name}"] if f"excitation/{name}" in record else np.zeros(record.time.size)
    return record[f"command/{name}"] - injected, injected


def _arriving(record: FlightRecord, name: str, fine: Array, delay: float, lag: float) -> Array:
    """Return a command as it reaches its actuator at every step."""
    law, injected = _split(record, name)
    time = record.time - record.time[0]
    values = CubicSpline(time, law)(np.minimum(fine, time[-1])) + np.interp(fine, time, injected)
    steps = fine.size - 1
    at = np.arange(steps) - delay / STEP
    arrived = np.interp(at, np.arange(-1, steps + 1), np.concatenate([law[:1], values]))
    share = STEP / (STEP + lag)  # as in flight: implicit Euler
    return lfilter([share], [1.0, share - 1.0], arrived, zi=[(1 - share) * law[0]])[0]


def voltage_ratio(
    loaded: airframe.Parameters, act: Actuators, sag: Mapping[str, float], along: Along, dt: float
) -> Array:
    """Return voltage over nominal voltage as the motors feel it, shape (sample,).

    Not the record's voltage, whose noise would pass for motion of the rotors, but that of the scenario's
    battery under the rotors' load.
    """
    count = len(along.positions.speed)
    torque: Any = torques(loaded, along)
    charge: Any = np.full(count, float(act.battery.charge))
    given = jax.vmap(power, in_axes=(None, 0, 0, 0))
    for _ in range(3):  # what a minute takes changes the voltage, which tells what it takes, by a percent
        found = given(act.battery, charge, torque, along.positions.speed)
        used = np.asarray(charge_rate(act.battery, found.current)) * dt
        charge = charge[0] + np.concatenate([[0.0], np.cumsum(used[:-1])])
    voltage: Any = np.asarray(found.voltage)
    ratio = battery_sag.voltage_ratio(leaves(sag), voltage, act.battery.nominal)
    return np.broadcast_to(ratio, (count,))


def split_by_kind(vehicle: Vehicle, values: Array) -> Commands:
    """Split values, shape (..., effector), by kind, as numpy arrays."""
    return Commands(*(np.asarray(part) for part in by_kind(vehicle, values)))  # type: ignore[arg-type]


def leaves(settings: Mapping[str, float]) -> dict[str, Any]:
    """Return an effect's settings as the simulation takes them."""
    return {
        name: jnp.asarray(value, dtype=float) for name, value in settings.items()
    }  # strong: no recompiling
