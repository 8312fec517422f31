"""Many flights of the truth at once: rigid body, actuators and control law, Runge-Kutta at 100 Hz.

Every array has the flight as its last axis. The truth's actuators differ from the owner's: a servo is a
quicker second-order system behind a small first-order lag and a limit of rate, a motor's speed follows the
balance of torques, and commands are held from one step to the next.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from gusts import gusts
from numpy.typing import NDArray
from settings import Settings
from shafts import shafts

GRAVITY = 9.80665
STEP = 0.01  # s
STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "alt")
PRE_LAG = 0.003  # s, small lag in front of every servo
RATE_LIMIT = 6.0  # rad/s


@dataclass(frozen=True)
class Log:
    """Noise-free history of flights at 50 Hz.

    Attributes
    ----------
    time : ndarray, shape (sample,)
        s; zero where the period of 60 s begins, with a second more at both ends.
    state, acceleration, position, command : ndarray, shape (sample, channel, flight)
        `STATES`, with the velocity through the air; specific force at the centre of gravity and angular
        acceleration; effectors' positions as a perfect sensor would measure them, and commands after
        excitation.
    """

    time: NDArray[np.float64]
    state: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    position: NDArray[np.float64]
    command: NDArray[np.float64]


class Actuators:
    """Servos and motors of all flights, stepped together."""

    def __init__(self, aircraft: Any, start: NDArray[np.float64], s: Settings) -> None:
        names, self.surfaces = aircraft.EFFECTORS, aircraft.SURFACES
        n = len(self.surfaces)
        self.n, self.h, self.rotors = n, STEP, len(aircraft.ROTORS)
        each = lambda end, sigma=0.0: np.array([np.zeros(s.count) + s(f"{e}.{end}") for e in names])  # noqa: E731
        self.gain = 1 + each("gain")[:n]
        zeta0, omega0 = aircraft.SERVO
        omega = omega0 * (1 + each("natural_frequency")[:n])
        zeta = zeta0 * (1 + each("damping")[:n])
        omega = 2 * zeta / (2 * zeta / omega - PRE_LAG)  # the same delay of slow motion
        self.omega, self.zeta = omega, zeta
        wd = omega * np.sqrt(np.maximum(1 - zeta**2, 1e-3))
        decay, sin, cos = np.exp(-zeta * omega * STEP), np.sin(wd * STEP), np.cos(wd * STEP)
        self.a11 = decay * (cos + zeta * omega / wd * sin)
        self.a12 = decay * sin / wd
        self.a21 = -decay * omega**2 / wd * sin
        self.a22 = decay * (cos - zeta * omega / wd * sin)
        self.tau = aircraft.MOTOR_TAU * (1 + each("time_constant")[n:])
        self.extra_tau = s.of_all("motor_lag.extra", names[n:])
        self.lag = s.of_all("actuator_lag.extra", names)
        self.lag[n:] = np.where(
            np.array([s.has(f"actuator_lag.extra@{e}") for e in names[n:]])[:, None], self.lag[n:], 0
        )
        self.lag_gain = np.where(
            self.lag > 1e-5, np.minimum(1 - np.exp(-STEP / np.maximum(self.lag, 1e-6)), 1), 1.0
        )
        slow = np.maximum(s.of_all("rate_limit.slowness", names[:n]), 1 / RATE_LIMIT)
        self.limit = STEP / slow
        self.play = 0.5 * s.of_all("backlash.width", names[:n])
        self.loss = s.of_all("surface_effectiveness.loss", names[:n])
        self.sag = s("battery_sag.strength")
        self.has_sag, self.has_lag = s.has("battery_sag"), s.has("actuator_lag")
        self.delay = (aircraft.DELAY + s.of_all("actuator_delay.extra", names)) / STEP
        # a held command is half a step late; the small lag is as late as its discrete filter makes it
        self.delay[n:] -= 0.5
        self.delay[:n] -= 0.5 + 1 / np.expm1(STEP / PRE_LAG) - PRE_LAG / STEP
        self.delay = np.maximum(self.delay, 0)
        self.memory = int(np.ceil(self.delay.max())) + 3
        self.trail = np.repeat(start[None], self.memory, axis=0)
        self.rows = np.arange(len(names))[:, None], np.arange(s.count)[None]
        self.lagged, self.filtered = start.copy(), start[:n].copy()
        self.x = start.copy()
        self.x[:n] *= self.gain
        self.rate = np.zeros((n, s.count))
        self.seen = self.x[:n].copy()
        self.level = start[n:].copy()
        self.elapsed = 0.0

    def step(self, command: NDArray[np.float64], index: int) -> None:
        """Advance by one step with a command that is held."""
        n, m = self.n, self.memory
        self.trail[index % m] = command
        whole = self.delay.astype(int)
        part = self.delay - whole
        now, before = (
            self.trail[(index - whole) % m, *self.rows],
            self.trail[(index - whole - 1) % m, *self.rows],
        )
        late = now + part * (before - now)
        if self.has_lag:
            self.lagged += self.lag_gain * (late - self.lagged)
            late = self.lagged
        self.filtered += (1 - np.exp(-STEP / PRE_LAG)) * (late[:n] - self.filtered)
        away = self.x[:n] - self.gain * self.filtered
        moved = self.a11 * away + self.a12 * self.rate - away
        speed = self.a21 * away + self.a22 * self.rate
        step = np.clip(moved, -self.limit, self.limit)
        self.rate = np.clip(speed, -self.limit / STEP, self.limit / STEP)
        self.x[:n] += step
        wanted = late[n:]
        if self.has_sag:  # less voltage under load, and as the charge goes; tilts stay where they are
            load = np.sum(self.x[n:] ** 3, axis=0) / np.sum(self.level**3, axis=0)
            wanted = wanted.copy()
            wanted[: self.rotors] *= 1 - self.sag * (0.03 * load + 0.012 * self.elapsed / 60)
        speed = self.x[n:]
        slower = np.where(wanted < speed, 1.15, 0.9)
        tau = self.tau + self.extra_tau * slower
        self.x[n:] += (
            (1 - np.exp(-STEP / tau))
            * (wanted - speed)
            * (1 + 0.1 * (wanted / np.maximum(self.level, 1.0) - 1))
        )
        self.elapsed += STEP

    def felt(self) -> NDArray[np.float64]:
        """Return the positions that the air feels: inside the linkage's play, and less effective."""
        out = self.x.copy()
        self.seen = np.clip(self.seen, out[: self.n] - self.play, out[: self.n] + self.play)
        swung = 1 - self.loss * (1 + 0.5 * np.tanh((self.seen / 0.25) ** 2))
        out[: self.n] = self.seen * swung
        return out


def fly(
    aircraft: Any,
    flights: list[dict[str, Any]],
    s: Settings,
    settle: float = 16.0,
    lasting: float = 61.0,
    excitation: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
    gust: float = 0.0,
    seed: int = 0,
) -> Log:
    """Fly the truth.

    Parameters
    ----------
    aircraft : module
        A vehicle's ``truth``.
    flights : list of dict
        ``condition`` (a reference id) and ``design`` (an index of phases) of each flight.
    s : Settings
        Departures from the nominal truth, for each flight.
    settle : float
        Time flown before the recorded period, s.
    lasting : float
        Time flown from its start, s.
    excitation : callable, optional
        Of the time, instead of the vehicle's own.
    gust : float
        Standard deviation of the vertical gusts, m/s.
    seed : int
        Of the gusts.
    """
    count = len(flights)
    trims = [aircraft.TRIM[f["condition"]] for f in flights]
    at = np.array([t["state"] for t in trims]).T
    base = np.array([t["command"] for t in trims]).T
    rho = np.array([t["rho"] for t in trims])
    design = np.array([f["design"] for f in flights])
    x = at.copy()
    mass = aircraft.MASS * (1 + s("mass.fraction"))
    ixx, iyy, izz = (
        value * (1 + s(f"inertia.{end}"))
        for value, end in zip(aircraft.INERTIA[:3], ("xx", "yy", "zz"), strict=True)
    )
    ixz = aircraft.INERTIA[3] + s("inertia.xz") * np.sqrt(aircraft.INERTIA[0] * aircraft.INERTIA[2])
    spread = ixx * izz - ixz**2
    dx, dy, dz = (s(f"cg_offset.{end}") for end in "xyz")
    hub = shafts(aircraft, base)
    spun = 1 + s("gyroscopic.strength")
    actuators = Actuators(aircraft, base.copy(), s)
    memory = aircraft.Memory(x, actuators.x, s)
    gains = aircraft.GAINS
    steps = round((settle + lasting) / STEP)
    time = -settle + STEP * np.arange(steps + 1)
    signals = (excitation or aircraft.excitation)(time)  # (design, effector, step)
    air = gusts(gust, at[0], time.size, STEP, seed)
    first = round((settle - 1) / STEP)
    kept = (steps - first) // 2 + 1
    log = Log(
        0.02 * np.arange(kept) - 1.0,
        *(np.empty((kept, rows, count)) for rows in (10, 6, len(base), len(base))),
    )

    def through(x, moving):
        return np.concatenate([x[:3] - moving, x[3:]]) if gust else x

    def slope(x, felt, turned, pulled, moving):
        load = aircraft.loads(through(x, moving), felt, rho, s, memory)
        u, v, w, p, q, r, phi, theta, psi, _ = x
        sp, cp, st, ct = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
        hx, hy, hz = turned
        fx, fy, fz = load[0] / mass, load[1] / mass, load[2] / mass
        ml = load[3] - (dy * load[2] - dz * load[1]) - pulled[0] - q * hz + r * hy
        mm = load[4] - (dz * load[0] - dx * load[2]) - pulled[1] - r * hx + p * hz
        mn = load[5] - (dx * load[1] - dy * load[0]) - pulled[2] - p * hy + q * hx
        ml = ml + ixz * p * q - (izz - iyy) * q * r
        mm = mm - (ixx - izz) * p * r - ixz * (p * p - r * r)
        mn = mn - ixz * q * r - (iyy - ixx) * p * q
        pd, qd, rd = (izz * ml + ixz * mn) / spread, mm / iyy, (ixz * ml + ixx * mn) / spread
        turn = (q * sp + r * cp) / ct
        out = np.array(
            [
                fx - GRAVITY * st + r * v - q * w,
                fy + GRAVITY * ct * sp + p * w - r * u,
                fz + GRAVITY * ct * cp + q * u - p * v,
                pd,
                qd,
                rd,
                p + turn * st,
                q * cp - r * sp,
                turn,
                u * st - (v * sp + w * cp) * ct,
            ]
        )
        return out, (fx, fy, fz, pd, qd, rd)

    h = STEP
    rotors = slice(len(aircraft.SURFACES), len(aircraft.SURFACES) + len(aircraft.ROTORS))
    in_body = (lambda spin: hub @ spin) if hub.ndim == 2 else (lambda spin: (hub * spin).sum(axis=1))
    felt = actuators.felt()
    for i in range(steps + 1):
        command = base + gains @ (x[:9] - at[:9]) + signals[design, :, i].T
        position = actuators.x.copy()
        actuators.step(command, i)
        after = actuators.felt()
        middle = 0.5 * (felt + after)
        pulled = in_body(spun * (actuators.x[rotors] - position[rotors]) / h)
        turned = in_body(spun * position[rotors])
        k1, felt_now = slope(x, felt, turned, pulled, air[i])
        if i >= first and (i - first) % 2 == 0:
            j = (i - first) // 2
            log.state[j], log.acceleration[j] = through(x, air[i]), felt_now
            log.position[j], log.command[j] = position, command
        k2, _ = slope(x + h / 2 * k1, middle, turned, pulled, air[i])
        k3, _ = slope(x + h / 2 * k2, middle, turned, pulled, air[i])
        k4, _ = slope(x + h * k3, after, turned, pulled, air[i])
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        memory.step(through(x, air[i]), after, rho, s, h)
        felt = after
    return log
