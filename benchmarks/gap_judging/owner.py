"""What the owner of a judging vehicle has beside its wrench: actuator models, control law, trim and flight.

Servos are of second order and motors of first order, behind a known delay; commands are joined by straight
lines. The flight is a Runge-Kutta integration at the record's rate, in plain floats.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.optimize import fsolve
from scipy.signal import lfilter
from shafts import turned

GRAVITY = 9.80665
STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi")
RESPONSES = ("X", "Y", "Z", "L", "M", "N")
SETTLE = 14.0  # s that a flight lasts before its record begins, by the same periodic excitation


class Owner:
    """One vehicle as its owner knows it.

    Parameters
    ----------
    folder : Path
        Of the vehicle; holds ``scenario.toml``.
    loads : callable
        ``loads(m, state, effector, rho, parameters)`` with `m` the module of functions (`math` or `numpy`),
        states and effectors as tuples; returns X Y Z L M N.
    servo : tuple of 2 floats
        Damping and natural frequency of every servo, rad/s.
    motor, delay : float
        Time constant of every motor and delay of every command, s.
    sensor : tuple of 3 floats
        Position of the accelerometers, m.
    schedule : callable
        Fixed commands at a speed: a tuple for all effectors, of which the trim replaces `trimmed`.
    trimmed : tuple of 2 tuples of str
        Effectors that trim pitch and speed together.
    wake : bool
        Whether `loads` takes ``late(value, slow)`` too: a value behind two equal lags of together `slow`, s;
        several values where `slow` is an array.
    """

    def __init__(
        self,
        folder: Path,
        loads: Callable[..., tuple[Any, ...]],
        servo: tuple[float, float],
        motor: float,
        delay: float,
        sensor: tuple[float, float, float],
        schedule: Callable[[float], tuple[float, ...]],
        trimmed: tuple[tuple[str, ...], tuple[str, ...]],
        wake: bool = False,
    ) -> None:
        scenario = tomllib.loads((folder / "scenario.toml").read_text())
        self.loads, self.servo, self.motor, self.delay, self.sensor = loads, servo, motor, delay, sensor
        self.schedule, self.wake = schedule, wake
        self.names = tuple(e["name"] for e in scenario["effector"])
        self.surfaces = tuple(e["name"] for e in scenario["effector"] if e["kind"] != "rotor")
        self.trimmed = tuple([self.names.index(n) for n in group] for group in trimmed)
        self.mass = scenario["vehicle"]["mass_kg"]
        self.inertia = tuple(scenario["vehicle"]["inertia"][k] for k in ("xx", "yy", "zz", "xz"))
        tilt = {w["name"]: self.names.index(w["tilt"]) for w in scenario.get("wing", ())}
        # Effector, momentum by speed at zero tilt, and the effector that tilts it
        self.rotors = [
            (
                self.names.index(r["name"]),
                [r["spin"] * r["inertia"] * a for a in r["axis"]],
                tilt.get(r.get("wing")),
            )
            for r in scenario["rotor"]
        ]
        gains = scenario["control"]["gains"]
        self.law = [
            (self.names.index(e), [(STATES.index(x), k) for x, k in row.items()]) for e, row in gains.items()
        ]

    def wrench(self, sigmas: Mapping[str, float], *, flies: bool = True) -> Callable[..., dict[str, Any]]:
        """Return the simulation as ``--sim`` takes it, with one sigma of each of its parameters.

        One that does not fly has loads and actuators only: its motion has to be fitted to the record.
        """

        def wrench(time, state, effector, air, parameters):
            """Return forces and moments about the centre of gravity, N and N m, as the owner has them."""
            x = tuple(np.asarray(state[n]) for n in STATES[:6])
            e = tuple(np.asarray(effector[n]) for n in self.names)
            late = (_series_lag(time),) if self.wake else ()
            made = self.loads(np, x, e, np.asarray(air["rho"]), parameters, *late)
            return dict(zip(RESPONSES, made, strict=True))

        wrench.responses = RESPONSES
        wrench.tolerances = {name: (sigma, "1") for name, sigma in sigmas.items()}
        wrench.positions = self.positions
        if flies:
            wrench.fly = self.fly
        return wrench

    def trim(
        self, u: float, rho: float, parameters: Mapping[str, float] | None = None
    ) -> tuple[tuple, tuple]:
        """Return states and commands of level flight at a forward speed."""
        fixed = list(self.schedule(u))
        pitch, speed = self.trimmed

        def at(x):
            command = fixed.copy()
            for group, value in ((pitch, x[1]), (speed, 100 * x[2])):
                for i in group:
                    command[i] = value
            return (u, 0.0, u * math.tan(x[0]), 0.0, 0.0, 0.0, 0.0, x[0], 0.0), command

        def balance(x):
            state, command = at(x)
            load = self.loads(math, state, command, rho, parameters or {})
            return (
                load[0] / self.mass / GRAVITY - math.sin(x[0]),
                load[2] / self.mass / GRAVITY + math.cos(x[0]),
                load[4] / self.mass,
            )

        state, command = at(fsolve(balance, [0.05, 0.0, fixed[speed[0]] / 100], xtol=1e-12))
        return state, tuple(command)

    def discrete(self, name: str, dt: float, parameters: Mapping[str, float]) -> tuple[Any, Any, Any]:
        """Return A, B0, B1 of an actuator whose command runs straight from one sample to the next."""
        if name in self.surfaces:
            zeta = self.servo[0] * (1 + parameters.get(f"{name}.damping", 0.0))
            omega = self.servo[1] * (1 + parameters.get(f"{name}.natural_frequency", 0.0))
            gain = 1 + parameters.get(f"{name}.gain", 0.0)
            a, b = [[0.0, 1.0], [-(omega**2), -2 * zeta * omega]], [0.0, gain * omega**2]
        else:
            tau = self.motor * (1 + parameters.get(f"{name}.time_constant", 0.0))
            a, b = [[-1 / tau]], [1 / tau]
        n = len(b)
        whole = np.zeros((n + 2, n + 2))
        whole[:n, :n], whole[:n, n], whole[n, n + 1] = a, b, 1.0 / dt
        step = expm(whole * dt)
        return step[:n, :n], step[:n, n] - step[:n, n + 1], step[:n, n + 1]

    def positions(
        self, time: Any, command: Mapping[str, Any], parameters: Mapping[str, float]
    ) -> dict[str, Any]:
        """Return positions that commands lead to, from steady state at the first sample."""
        time = np.asarray(time)
        dt = (time[-1] - time[0]) / (time.size - 1)
        out = {}
        for name in self.names:
            if name not in command:
                continue
            late = np.interp(time - self.delay, time, command[name])
            away = late - late[0]
            a, b0, b1 = self.discrete(name, dt, parameters)
            if len(b0) == 1:
                out[name] = late[0] + lfilter([b1[0], b0[0]], [1.0, -a[0, 0]], away)
                continue
            numerator = [
                b1[0],
                b0[0] - a[1, 1] * b1[0] + a[0, 1] * b1[1],
                -a[1, 1] * b0[0] + a[0, 1] * b0[1],
            ]
            gain = 1 + parameters.get(f"{name}.gain", 0.0)
            moved = lfilter(numerator, [1.0, -a[0, 0] - a[1, 1], a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]], away)
            out[name] = gain * late[0] + moved
        return out

    def fly(self, record: Any, parameters: Mapping[str, float]) -> dict[str, Any]:
        """Return a closed-loop flight under a record's excitation, about the simulation's own trim.

        Excitations are taken to be periodic over the record: the flight has been under way for some time
        when the record begins.
        """
        time = np.asarray(
            getattr(record, "time", None) if not isinstance(record, Mapping) else record["time"]
        )
        dt = float(time[-1] - time[0]) / (time.size - 1)
        u0, rho = float(np.mean(record["state/u"])), float(np.mean(record["air/rho"]))
        state0, trim = self.trim(u0, rho, parameters)
        ahead = round(SETTLE / dt)
        total = ahead + time.size
        signals = []
        for name in self.names:
            try:
                own = np.asarray(record[f"excitation/{name}"], dtype=float)
            except Exception:
                own = np.zeros(time.size)
            around = np.arange(total) - ahead
            signals.append(own[around % (time.size - 1)].tolist())
        matrices = []
        for i, name in enumerate(self.names):
            a, b0, b1 = self.discrete(name, dt, parameters)
            gain = 1 + parameters.get(f"{name}.gain", 0.0) if name in self.surfaces else 1.0
            matrices.append((i, len(b0), *a.ravel().tolist(), *b0.tolist(), *b1.tolist(), gain))
        late = self.delay / dt
        whole = int(late)
        part = late - whole
        commands = [list(trim) for _ in range(whole + 3)]  # oldest first
        position = [trim[i] * m[-1] for i, m in enumerate(matrices)]
        rate = [0.0] * len(self.names)
        x = state0
        late = (_Lag(),) if self.wake else ()
        rotors = [(i, *(axis if tilt is None else turned(axis, trim[tilt]))) for i, axis, tilt in self.rotors]
        log_state, log_position, log_command, log_felt = [], [], [], []
        for k in range(total):
            command = [c + s[k] for c, s in zip(trim, signals, strict=True)]
            for e, row in self.law:
                for j, gain in row:
                    command[e] += gain * (x[j] - state0[j])
            commands.append(command)
            commands.pop(0)
            old = [self._late(commands, whole, part, i, 0) for i in range(len(command))]
            new = [self._late(commands, whole, part, i, 1) for i in range(len(command))]
            after, rate_after = position.copy(), rate.copy()
            for i, n, *m in matrices:
                if n == 1:
                    after[i] = m[0] * position[i] + m[1] * old[i] + m[2] * new[i]
                else:
                    after[i] = m[0] * position[i] + m[1] * rate[i] + m[4] * old[i] + m[6] * new[i]
                    rate_after[i] = m[2] * position[i] + m[3] * rate[i] + m[5] * old[i] + m[7] * new[i]
            middle = [
                0.5 * (a + b) + dt / 8 * (c - d)
                for a, b, c, d in zip(position, after, rate, rate_after, strict=True)
            ]
            momentum = [sum(r[j] * middle[r[0]] for r in rotors) for j in (1, 2, 3)]
            change = [sum(r[j] * (after[r[0]] - position[r[0]]) / dt for r in rotors) for j in (1, 2, 3)]
            k1, felt = self._slope(x, position, rho, parameters, momentum, change, late)
            if k >= ahead:
                log_state.append(x)
                log_position.append(position)
                log_command.append(command)
                log_felt.append(felt)
            k2, _ = self._slope(_moved(x, k1, dt / 2), middle, rho, parameters, momentum, change, late)
            k3, _ = self._slope(_moved(x, k2, dt / 2), middle, rho, parameters, momentum, change, late)
            k4, _ = self._slope(_moved(x, k3, dt), after, rho, parameters, momentum, change, late)
            x = tuple(
                a + dt / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4, strict=True)
            )
            position, rate = after, rate_after
            for lag in late:
                lag.advance(dt)
        out = dict(zip(STATES, np.array(log_state).T, strict=True))
        felt = np.array(log_felt).T
        out |= {f"a{axis}": row for axis, row in zip("xyz", self._at_sensor(felt, out), strict=True)}
        for group, log in (("effector", log_position), ("command", log_command)):
            out |= {f"{group}/{n}": row for n, row in zip(self.names, np.array(log).T, strict=True)}
        return out

    @staticmethod
    def _late(commands: list[list[float]], whole: int, part: float, i: int, ahead: int) -> float:
        """Return the delayed command of one effector now, or one step ahead."""
        last = len(commands) - 1 - whole + ahead
        return commands[last][i] + part * (commands[last - 1][i] - commands[last][i])

    def _at_sensor(self, felt: Any, out: Mapping[str, Any]) -> Any:
        """Return specific force at the accelerometers from that at the centre of gravity."""
        turn, rates = felt[3:6].T, np.array([out["p"], out["q"], out["r"]]).T
        arm = np.array(self.sensor)
        return (felt[:3].T + np.cross(turn, arm) + np.cross(rates, np.cross(rates, arm))).T

    def _slope(self, x, position, rho, parameters, momentum, change, late):
        """Return the derivative of the state, and specific force with angular acceleration."""
        u, v, w, p, q, r, phi, theta, _ = x
        X, Y, Z, L, M, N = self.loads(math, x, position, rho, parameters, *late)
        ix, iy, iz, ixz = self.inertia
        hx, hy, hz = momentum
        sp, cp, st, ct = math.sin(phi), math.cos(phi), math.sin(theta), math.cos(theta)
        roll = L + ixz * p * q - (iz - iy) * q * r - change[0] - q * hz + r * hy
        pitch = M - (ix - iz) * p * r - ixz * (p * p - r * r) - change[1] - r * hx + p * hz
        yaw = N - ixz * q * r - (iy - ix) * p * q - change[2] - p * hy + q * hx
        spread = ix * iz - ixz * ixz
        fx, fy, fz = X / self.mass, Y / self.mass, Z / self.mass
        pd, qd, rd = (iz * roll + ixz * yaw) / spread, pitch / iy, (ixz * roll + ix * yaw) / spread
        turn = (q * sp + r * cp) / ct
        slope = (
            fx - GRAVITY * st + r * v - q * w,
            fy + GRAVITY * ct * sp + p * w - r * u,
            fz + GRAVITY * ct * cp + q * u - p * v,
            pd,
            qd,
            rd,
            p + turn * st,
            q * cp - r * sp,
            turn,
        )
        return slope, (fx, fy, fz, pd, qd, rd)


class _Lag:
    """Two equal lags of one value, or of an array's, stepped through a flight; steady at first."""

    def __init__(self) -> None:
        self.first = self.second = None

    def __call__(self, value: float, slow: float) -> float:
        """Return the late value, and keep the one that it follows."""
        if self.first is None:
            self.first = self.second = value
        self.wanted, self.slow = value, slow
        return self.second

    def advance(self, dt: float) -> None:
        """Follow the value that was met last."""
        share = 1 - (np.exp if isinstance(self.slow, np.ndarray) else math.exp)(-2 * dt / self.slow)
        self.first = self.first + share * (self.wanted - self.first)
        self.second = self.second + share * (self.first - self.second)


def _series_lag(time: Any) -> Callable[[Any, float], Any]:
    """Return two equal lags of a series, steady at its first sample; 50 Hz where no time is given."""
    dt = 0.02 if time is None or np.size(time) < 2 else float(time[-1] - time[0]) / (np.size(time) - 1)

    def late(value, slow):
        if isinstance(slow, np.ndarray):
            return np.array([late(v, float(s)) for v, s in zip(value, slow, strict=True)])
        # exact for straight lines between samples
        fall = 2 * dt / slow
        decay = math.exp(-fall)
        old, new = (1 - decay) / fall - decay, 1 - (1 - decay) / fall
        value = np.asarray(value, dtype=float)
        away = value - value[..., :1]
        for _ in range(2):
            away = lfilter([new, old], [1.0, -decay], away)
        return value[..., :1] + away

    return late


def _moved(x: tuple, slope: tuple, by: float) -> tuple:
    """Return a state moved along a slope."""
    return tuple(a + by * b for a, b in zip(x, slope, strict=True))
