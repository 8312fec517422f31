"""What a scenario's servos, tilt drives, motors and battery make of a record's commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from freqid.core.arrays import Array
from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.gap.connect.loads import Along, piece, torques
from freqid.gap.simulation import Settings
from freqid.simulate.effects import actuator_delay, actuator_lag, battery_sag, motor_lag, rate_limit
from freqid.simulate.loads import airframe
from freqid.simulate.motion.actuators import (
    Actuators,
    Commands,
    by_kind,
    motor_acceleration,
    servo_acceleration,
)
from freqid.simulate.motion.battery import charge_rate, power
from freqid.simulate.motion.integrate import rk4

STEP = 0.005  # s, of the integration; as in flight
_LEG = 1000  # steps that are compiled into one loop
_ELSEWHERE = 0.03  # of an effector's range, from which a measured start is not taken for noise and bias


def positions(
    record: FlightRecord,
    vehicle: Vehicle,
    act: Actuators,
    settings: Settings,
    ratio: Array,
    gain: Mapping[str, float],
) -> dict[str, Array]:
    """Return the positions of all effectors that have a command.

    Parameters
    ----------
    record : FlightRecord
    vehicle : Vehicle
    act : Actuators
        Before effects.
    settings : mapping of mapping of float
        Of the effects of actuators; here, other than in flight, those of single effectors count too.
    ratio : ndarray, shape (sample,)
        Voltage over nominal voltage as the motors feel it.
    gain : dict of float
        Position over command at rest, by effector.

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
    rotors = [e.name for e in vehicle.effectors if e.kind == "rotor"]
    slow = settings["rate_limit"]
    of_each = [slow["slowness"] + slow.get(e.name, 0.0) for e in vehicle.effectors if e.kind == "surface"]
    limits = rate_limit.limits({"slowness": jnp.array(of_each)}, act.surface.rate_limit)
    servo, motor = settings["actuator_lag"], settings["motor_lag"]
    lag = leaves({**motor, "extra": 0.0}) | {"extra": np.array([_lag(motor, r) for r in rotors])}
    slower, ahead = motor_lag.longer(lag), dict(zip(rotors, motor_lag.before(lag).tolist(), strict=True))
    act = act._replace(
        surface=act.surface._replace(rate_limit=limits),
        motor=act.motor._replace(rise=act.motor.rise * slower, fall=act.motor.fall * slower),
    )
    sent, rest = np.zeros((len(names), steps)), np.zeros(len(names))
    ratio = CubicSpline(time, ratio)(np.minimum(fine, time[-1]))
    late = actuator_delay.delays(leaves(settings["actuator_delay"]), act.delay)
    kinds = vehicle.effector_kinds
    delays = {"surface": float(late.surface), "tilt": float(late.tilt), "rotor": float(late.speed)}
    for name, values in zip(commanded, _on_steps(record, commanded, fine), strict=True):
        row, kind = names.index(name), kinds[name]
        first = _split(record, name)[0][0]
        delay = delays[kind] + settings["actuator_delay"].get(name, 0.0)
        before = ahead[name] if kind == "rotor" else _lag(servo, name)
        sent[row] = gain[name] * _arriving(first, values, delay, before)
        held = gain[name] * first * (ratio[0] if kind == "rotor" else 1.0)
        rest[row] = held
        if f"effector/{name}" in record:
            # One sample is noise and its sensor's bias; only a start that is plainly elsewhere counts.
            start, low, high = record[f"effector/{name}"][0], *vehicle.effector(name).limits
            if abs(start - held) > _ELSEWHERE * (high - low):
                rest[row] = start
    followed = follow(
        act,
        leaves(settings["actuator_lag"]),
        split_by_kind(vehicle, sent.T),
        ratio,
        split_by_kind(vehicle, rest),
    )
    rows = np.empty((steps, len(names)))
    for columns, values in zip(by_kind(vehicle, np.arange(len(names))), followed, strict=True):
        rows[:, np.asarray(columns)] = values
    found = _between_steps(rows, time)
    return {n: found[:, names.index(n)] for n in commanded}


def _lag(settings: Mapping[str, float], name: str) -> float:
    """Return the time constant of a lag at one actuator, s: what all have in common, and its own."""
    return settings["extra"] + settings.get(name, 0.0)


def _split(record: FlightRecord, name: str) -> tuple[Array, Array]:
    """Return the control law's part of a command, and the injected signal."""
    injected = record[f"excitation/{name}"] if f"excitation/{name}" in record else np.zeros(record.time.size)
    return record[f"command/{name}"] - injected, injected


def _on_steps(record: FlightRecord, names: Sequence[str], fine: Array) -> Array:
    """Return commands as they are sent at every step, shape (effector, step)."""
    time = record.time - record.time[0]
    law, injected = np.array([_split(record, n) for n in names]).transpose(1, 0, 2)
    straight = [np.interp(fine, time, x) for x in injected]
    return CubicSpline(time, law, axis=1)(np.minimum(fine, time[-1])) + straight


def _arriving(first: float, sent: Array, delay: float, lag: float) -> Array:
    """Return a command as it reaches its actuator at every step but the last; `first` before the start."""
    steps = sent.size - 1
    at = np.arange(steps) - delay / STEP
    arrived = np.interp(at, np.arange(-1, steps + 1), np.concatenate([[first], sent]))
    share = STEP / (STEP + lag)  # as in flight: implicit Euler
    return lfilter([share], [1.0, share - 1.0], arrived, zi=[(1 - share) * first])[0]


def _between_steps(values: Array, time: Array) -> Array:
    """Return values at every step, shape (step, ...), at some times: by the cubic through four of them."""
    at = time / STEP
    k = np.clip(at.astype(int), 1, len(values) - 3)
    s = (at - k)[:, None]
    weights = (
        -s * (s - 1) * (s - 2) / 6,
        (s + 1) * (s - 1) * (s - 2) / 2,
        -(s + 1) * s * (s - 2) / 2,
        (s + 1) * s * (s - 1) / 6,
    )
    return sum((w * values[k + j] for j, w in zip((-1, 0, 1, 2), weights, strict=True)), np.zeros(()))


def voltage_ratio(
    loaded: airframe.Airframe, act: Actuators, sag: Mapping[str, float], along: Along, dt: float
) -> Array:
    """Return voltage over nominal voltage as the motors feel it, shape (sample,).

    Not the record's voltage, whose noise would pass for motion of the rotors, but that of the scenario's
    battery under the rotors' load.
    """
    count = len(along.positions.speed)
    torque: Any = torques(loaded, along)
    charge: Any = np.full(count, float(act.battery.charge))
    for _ in range(3):  # the charge used in a minute changes the voltage, and so the current, by a percent
        supply = _supply(act.battery, charge, torque, along.positions.speed)
        used = np.asarray(charge_rate(act.battery, supply.current)) * dt
        charge = charge[0] + np.concatenate([[0.0], np.cumsum(used[:-1])])
    voltage: Any = np.asarray(supply.voltage)
    ratio = battery_sag.voltage_ratio(leaves(sag), voltage, act.battery.nominal)
    return np.broadcast_to(ratio, (count,))


_supply = jax.jit(jax.vmap(power, in_axes=(None, 0, 0, 0)))


def split_by_kind(vehicle: Vehicle, values: Array) -> Commands:
    """Split values, shape (..., effector), by kind, as numpy arrays."""
    return Commands(*(np.asarray(part) for part in by_kind(vehicle, values)))  # type: ignore[arg-type]


def leaves(settings: Mapping[str, float]) -> dict[str, Any]:
    """Return an effect's settings as the simulation takes them."""
    return {name: np.asarray(value, dtype=float) for name, value in settings.items()}  # nothing compiles anew


class Driven(NamedTuple):
    """What moves: positions and rates of servos and tilt drives, speeds of rotors; rad, rad/s."""

    surface: jax.Array
    surface_rate: jax.Array
    tilt: jax.Array
    tilt_rate: jax.Array
    speed: jax.Array


def follow(
    actuators: Actuators, lag: dict[str, Array], arriving: Commands, ratio: Array, start: Commands
) -> Commands:
    """Return the positions at every step.

    Parameters
    ----------
    actuators : Actuators
    lag : dict of Array
        Settings of effect ``actuator_lag``.
    arriving : Commands of ndarray, shape (step, ...)
        As they reach the actuators; held over each step.
    ratio : ndarray, shape (step + 1,)
        Voltage over nominal voltage; straight over each step.
    start : Commands
        Positions at the first step, at rest.

    Returns
    -------
    Commands of ndarray, shape (step, ...)
        At the start of every step.
    """
    still = [jnp.zeros_like(x) for x in (start.surface, start.tilt)]
    carry = Driven(
        jnp.asarray(start.surface), still[0], jnp.asarray(start.tilt), still[1], jnp.asarray(start.speed)
    )
    count, legs = len(ratio) - 1, []
    schedule = (arriving, ratio[:-1], ratio[1:])
    for first in range(0, count, _LEG):
        now = jax.tree.map(lambda x: piece(x, first, _LEG), schedule)  # noqa: B023  used at once
        positions, carry = _followed(actuators, lag, carry, now)
        legs.append(jax.tree.map(np.asarray, positions))
    return jax.tree.map(lambda *x: np.concatenate(x)[:count], *legs)


@jax.jit
def _followed(actuators: Actuators, lag: dict[str, jax.Array], carry: Driven, schedule):
    def step(driven: Driven, now):
        commands, before, after = now

        def rate(x: Driven, elapsed: jax.Array) -> Driven:
            ratio = before + (after - before) * elapsed / STEP
            return Driven(
                x.surface_rate,
                servo_acceleration(actuators.surface, x.surface, x.surface_rate, commands.surface),
                x.tilt_rate,
                servo_acceleration(actuators.tilt, x.tilt, x.tilt_rate, commands.tilt),
                motor_acceleration(actuators.motor, x.speed, commands.speed, ratio),
            )

        surface = actuator_lag.position(lag, driven.surface, commands.surface)
        return rk4(rate, driven, STEP), Commands(surface, driven.tilt, driven.speed)

    carry, positions = jax.lax.scan(step, carry, schedule)
    return positions, carry
