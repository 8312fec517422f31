"""An aircraft with linear loads in its plane of symmetry, its flights, and simulations of it to be compared.

The flight is integrated with equations written here; nothing of `freqid.gap` makes the truth.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.gap.connect.callable import CallableSimulation

G, DT, U0, W0, MASS, IYY, LAG = 9.80665, 0.02, 20.0, 1.0, 10.0, 2.0, 0.05
RESPONSES = ("X", "Z", "M")
SLOPES = np.array(  # N and N m by u, w (m/s), q (rad/s), two surfaces (rad)
    [[-1.0, 1.0, 0.0, 0.0, -5.0], [-6.0, -20.0, -3.0, -20.0, -80.0], [0.0, -1.6, -8.0, -40.0, -8.0]]
)
ELEVATOR = 3
THETA0 = np.arctan2(W0, U0)
TRIM = np.array([MASS * G * np.sin(THETA0), -MASS * G * np.cos(THETA0), 0.0])
SIGMA = {  # channels that stand still have no noise
    **dict.fromkeys(("state/u", "state/w", "state/ax", "state/az", "air/V"), 0.02),
    **dict.fromkeys(("state/q", "state/theta"), 0.001),
    **dict.fromkeys(("effector/d1", "effector/d2"), 1e-4),
    "air/alpha": 3 * 0.02 / U0,  # a vane three times as noisy as w
}
UNITS = {"u": "m/s", "v": "m/s", "w": "m/s", "V": "m/s", "ax": "m/s2", "ay": "m/s2", "az": "m/s2"}


def vehicle():
    surfaces = tuple(Effector(name=n, kind="surface", limits=(-0.5, 0.5)) for n in ("d1", "d2"))
    stated = MassProperties(mass_kg=MASS, inertia=Inertia(xx=1.5, yy=IYY, zz=3.0))
    return Vehicle(name="linear", mass_properties=stated, effectors=surfaces)


def servo(command):
    """Return a first-order servo's position, its command straight between samples."""
    decay = np.exp(-DT / LAG)
    rise = 1 - (1 - decay) * LAG / DT
    position = command.copy()
    for n in range(1, command.shape[-1]):
        before, now = command[..., n - 1], command[..., n]
        position[..., n] = decay * position[..., n - 1] + (1 - decay - rise) * before + rise * now
    return position


def multisines(duration, phases):
    """Return two injected signals from 0.1 to 2 Hz on lines of their own, every third line left to nobody."""
    rng, time = np.random.default_rng(phases), np.arange(round(duration / DT) + 1) * DT
    sent = []
    for i in range(2):
        k = np.arange(2 + i, 2.0 * duration, 3)
        waves = np.sin(2 * np.pi * np.outer(k / duration, time) + rng.uniform(0, 2 * np.pi, (k.size, 1)))
        sent.append(0.03 * waves.sum(axis=0) / np.sqrt(k.size / 2))
    return np.array(sent)


def motion(slopes, sent):
    """Return noise-free channels of an open-loop flight under commands, shape (2, sample)."""
    position, table, time = servo(sent), np.array(slopes), DT * np.arange(sent.shape[1])

    def loads(x, d):
        return TRIM + table @ np.array([x[0] - U0, x[1] - W0, x[2], *d])

    def rate(x, d):
        (u, w, q, theta), (fx, fz, moment) = x, loads(x, d)
        forward = fx / MASS - G * np.sin(theta) - q * w
        return np.array([forward, fz / MASS + G * np.cos(theta) + q * u, moment / IYY, q])

    x = np.empty((4, time.size))
    x[:, 0] = U0, W0, 0.0, THETA0
    for n in range(time.size - 1):
        a, c = position[:, n], position[:, n + 1]
        b = (a + c) / 2
        k1 = rate(x[:, n], a)
        k2 = rate(x[:, n] + DT / 2 * k1, b)
        k3 = rate(x[:, n] + DT / 2 * k2, b)
        k4 = rate(x[:, n] + DT * k3, c)
        x[:, n + 1] = x[:, n] + DT / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    felt = np.array([loads(x[:, n], position[:, n]) for n in range(time.size)]).T / MASS
    found = {f"state/{n}": np.zeros(time.size) for n in ("v", "p", "r", "phi", "psi", "ay")}
    found |= dict(zip(("state/u", "state/w", "state/q", "state/theta"), x, strict=True))
    found |= {"state/ax": felt[0], "state/az": felt[1]}
    found |= {"air/V": np.hypot(x[0], x[1]), "air/alpha": np.arctan2(x[1], x[0])}
    for i, name in enumerate(("d1", "d2")):
        found |= {f"effector/{name}": position[i], f"command/{name}": sent[i], f"excitation/{name}": sent[i]}
    return found


@lru_cache(maxsize=64)
def _flown(slopes, duration, phases):
    return motion(slopes, multisines(duration, phases))


def fly(loss=0.0, *, noise=1.0, seed=0, duration=40.0, phases=1, reference="u20", factors=None):
    """Return a flight as it is logged: an elevator that lost a share of its effect, `noise` times SIGMA."""
    slopes = SLOPES * (np.ones_like(SLOPES) if factors is None else factors)
    slopes[:, ELEVATOR] *= 1 - loss
    flown = _flown(tuple(map(tuple, slopes)), duration, phases)
    rng, channels = np.random.default_rng(seed), {}
    for name, values in flown.items():
        unit = UNITS.get(name.partition("/")[2], "rad")
        values = values + noise * SIGMA.get(name, 0.0) * rng.standard_normal(values.size)
        channels[name] = Channel(name, unit, values, 1 / DT, "made here")
    time = np.arange(flown["state/u"].size, dtype=np.float64) * DT
    return Maneuver(FlightRecord(time, channels, vehicle(), reference=reference), vehicle())


def simulation(name="plain", *, loss=0.0, factors=None, responses=RESPONSES, vane=False, flies=False):
    """Return a simulation: derivatives off by factors, a loss of the elevator, w from the vane."""
    slopes = SLOPES * (np.ones_like(SLOPES) if factors is None else factors)
    slopes[:, ELEVATOR] *= 1 - loss

    def loads(time, state, effector, air, parameters):
        w = state["u"] * np.tan(air["alpha"]) if vane else state["w"]
        moved = np.array([state["u"] - U0, w - W0, state["q"], effector["d1"], effector["d2"]])
        every = dict(zip(RESPONSES, TRIM[:, None] + slopes @ moved, strict=True))
        return {n: every[n] for n in responses}

    def flight(record, parameters):
        made = motion(slopes, np.array([record["command/d1"], record["command/d2"]]))
        return {n.removeprefix("state/"): x for n, x in made.items() if n.startswith(("state/", "effector/"))}

    loads.positions = lambda time, command, parameters: {n: servo(x) for n, x in command.items()}
    if flies:
        loads.fly = flight
    return CallableSimulation(loads, name, responses, vehicle())
