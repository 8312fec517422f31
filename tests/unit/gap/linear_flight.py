"""An aircraft with linear loads and two surfaces, flown in its plane of symmetry, and a simulation of it.

The flight is integrated with load and servo equations written here; nothing of `freqid.gap` makes the truth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.gap.simulation import Tolerance
from freqid.simulate.effects.effect import Effect, Parameter

G = 9.80665
DT, U0, W0, MASS, IYY, LAG = 0.02, 20.0, 1.0, 10.0, 2.0, 0.05
RESPONSES = ("X", "Z", "M")
INPUTS = ("state/u", "state/w", "state/q", "effector/d1", "effector/d2")
SLOPES = np.array(  # by INPUTS
    [
        [-1.0, 1.0, 0.0, 0.0, -5.0],
        [-6.0, -20.0, -3.0, -20.0, -80.0],
        [0.0, -1.6, -8.0, -40.0, -8.0],
    ]
)
THETA0 = np.arctan2(W0, U0)
TRIM = np.array([MASS * G * np.sin(THETA0), -MASS * G * np.cos(THETA0), 0.0])
SIGMA = {
    **dict.fromkeys(("state/u", "state/v", "state/w"), 0.02),
    **dict.fromkeys(("state/p", "state/q", "state/r"), 0.001),
    **dict.fromkeys(("state/phi", "state/theta", "state/psi"), 0.001),
    **dict.fromkeys(("state/ax", "state/ay", "state/az"), 0.02),
    **dict.fromkeys(("effector/d1", "effector/d2"), 1e-4),
}
UNITS = {"u": "m/s", "v": "m/s", "w": "m/s", "ax": "m/s2", "ay": "m/s2", "az": "m/s2"}
UNITS |= dict.fromkeys("pqr", "rad/s") | dict.fromkeys(("phi", "theta", "psi"), "rad")


def vehicle(mass: float = MASS) -> Vehicle:
    surfaces = tuple(Effector(name=n, kind="surface", limits=(-0.5, 0.5)) for n in ("d1", "d2"))
    stated = MassProperties(mass_kg=mass, inertia=Inertia(xx=1.5, yy=IYY, zz=3.0))
    return Vehicle(name="linear", mass_properties=stated, effectors=surfaces)


def commands(duration: float, period: float, seed: int, late: float = 0.0) -> np.ndarray:
    """Return multisines from 0.1 to 2 Hz on lines of their own, every third one left to nobody."""
    rng, time = np.random.default_rng(seed), np.arange(round(duration / DT) + 1) * DT
    time = np.maximum(time - late, 0.0)
    found = []
    for i in range(2):
        k = np.arange(2 + i, 2.0 * period, 3)
        waves = np.sin(2 * np.pi * np.outer(k / period, time) + rng.uniform(0, 2 * np.pi, (k.size, 1)))
        found.append(0.03 * waves.sum(axis=0) / np.sqrt(k.size / 2))
    return np.array(found)


def servo(command: np.ndarray, lag: float = LAG) -> np.ndarray:
    """Return a first-order servo's position by its difference equation, command straight between samples."""
    decay = np.exp(-DT / lag)
    rise = 1 - (1 - decay) * lag / DT
    position = command.copy()
    for n in range(1, command.shape[-1]):
        before, now = command[..., n - 1], command[..., n]
        position[..., n] = decay * position[..., n - 1] + (1 - decay - rise) * before + rise * now
    return position


@dataclass(frozen=True)
class Truth:
    """What the aircraft is, beyond what the simulation takes it for."""

    loss: float = 0.0  # share of d1 that the air does not feel
    mass: float = MASS
    late: float = 0.0  # s, of commands
    slow: float = 0.0  # s, time constant of a lag behind the servo
    drag: float = 0.0  # N s/m
    slopes: tuple[tuple[float, ...], ...] = tuple(map(tuple, SLOPES.tolist()))


@lru_cache(maxsize=64)
def motion(truth: Truth, duration: float, period: float, seed: int) -> dict[str, np.ndarray]:
    """Return noise-free channels of a flight: Runge-Kutta steps of the body-axis equations."""
    sent = commands(duration, period, seed)
    time = np.arange(sent.shape[1]) * DT
    position = servo(commands(duration, period, seed, truth.late))
    position = servo(position, truth.slow) if truth.slow else position
    slopes, drag = np.array(truth.slopes), truth.drag

    def loads(x, d):
        moved = np.array([x[0] - U0, x[1] - W0, x[2], (1 - truth.loss) * d[0], d[1]])
        found = TRIM * [truth.mass / MASS, truth.mass / MASS, 1.0] + slopes @ moved
        found[0] -= drag * (x[0] - U0)
        return found

    def rate(x, d):
        u, w, q, theta = x
        fx, fz, moment = loads(x, d)
        return np.array(
            [
                fx / truth.mass - G * np.sin(theta) - q * w,
                fz / truth.mass + G * np.cos(theta) + q * u,
                moment / IYY,
                q,
            ]
        )

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
    felt = np.array([loads(x[:, n], position[:, n]) for n in range(time.size)]).T
    still = np.zeros(time.size)
    found = {f"state/{n}": still for n in ("v", "p", "r", "phi", "psi", "ay")}
    found |= dict(zip(("state/u", "state/w", "state/q", "state/theta"), x, strict=True))
    found |= {"state/ax": felt[0] / truth.mass, "state/az": felt[1] / truth.mass}
    for i, name in enumerate(("d1", "d2")):
        found |= {f"effector/{name}": position[i], f"command/{name}": sent[i]}
        found[f"excitation/{name}"] = sent[i]
    return found


def fly(
    truth: Truth = Truth(),
    *,
    noise: float = 0.0,
    seed: int = 0,
    duration: float = 20.0,
    period: float | None = None,
    phases: int = 1,
    reference: str = "",
    add: Mapping[str, np.ndarray] | None = None,
) -> Maneuver:
    """Return a flight as it is logged: `noise` times SIGMA, and what is added to channels."""
    flown = motion(truth, duration, period or duration, phases)
    rng = np.random.default_rng(seed)
    channels = {}
    for name, values in flown.items():
        unit = UNITS.get(name.partition("/")[2], "rad")
        values = values + noise * SIGMA.get(name, 0.0) * rng.standard_normal(values.size)
        channels[name] = Channel(name, unit, values + (add or {}).get(name, 0.0), 1 / DT, "made here")
    time = np.arange(flown["state/u"].size, dtype=np.float64) * DT
    return Maneuver(FlightRecord(time, channels, vehicle(), reference=reference), vehicle())


@dataclass(frozen=True, eq=False)
class Linear:
    """The simulation: loads at one instant, servos with a lag, exact gradient."""

    responses: tuple[str, ...] = RESPONSES
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    actuators: bool = True
    name: str = "linear"
    kind: str = "callable"
    parts: tuple[str, ...] = ()
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict)
    gyroscopic: bool | None = True
    can_fly: bool = False

    @property
    def has_actuators(self) -> bool:
        return self.actuators

    @property
    def vehicle(self) -> Vehicle:
        return vehicle()

    def slopes(self, effects=None) -> np.ndarray:
        found = SLOPES.copy()
        for identifier, values in {**self.effects, **(effects or {})}.items():
            if identifier == "damping":
                found[2, 2] *= 1 + values["extra"]
        return found

    def predict(self, record, effects=None, departures=None):
        moved = record.matrix(INPUTS) - np.array([U0, W0, 0.0, 0.0, 0.0])[:, None]
        return (TRIM[:, None] + self.slopes(effects) @ moved)[[RESPONSES.index(r) for r in self.responses]]

    def gradient(self, record, inputs):
        found = np.zeros((len(self.responses), len(inputs), record.time.size))
        for j, name in enumerate(inputs):
            if name in INPUTS:
                for i, response in enumerate(self.responses):
                    found[i, j] = self.slopes()[RESPONSES.index(response), INPUTS.index(name)]
        return found

    def positions(self, record, effects=None, departures=None):
        if not self.actuators:
            return {}
        return {n: servo(record[f"command/{n}"]) for n in record.group("command")}

    def fly(self, record, effects=None, departures=None):
        return None


def _feel(settings, signals, dt, kinds):
    return {**signals, "d1": (1 - settings["share"]) * signals["d1"]}


def _act(settings, signals, dt, kinds):
    time = dt * np.arange(len(next(iter(signals.values()))))
    then = np.clip(time - settings["by"], 0.0, time[-1])
    return {n: CubicSpline(time, x)(then) for n, x in signals.items()}


def _load(settings, described):
    from msgspec.structs import replace as changed

    stated = described.mass_properties
    heavier = changed(stated, mass_kg=(1 + settings["fraction"]) * stated.mass_kg)
    return changed(described, mass_properties=heavier)


def distorted(settings, record):
    channel = record.channel("state/q")
    return record.with_channels(replace(channel, values=(1 + settings["scale"]) * channel.values))


def _replay(settings, replay):
    found = np.zeros((6, replay.record.time.size))
    found[0] = -settings["factor"] * (replay.record["state/u"] - U0)
    return found


def effect(identifier: str, parameter: str, scale: float, unit: str = "1", **hooks) -> Effect:
    return Effect(identifier, "airframe", identifier, {parameter: Parameter(0.0, unit, "", scale)}, **hooks)


LIBRARY = {
    e.id: e
    for e in (
        effect("worn", "share", 0.1, feel=_feel),
        effect("late", "by", 0.02, "s", act=_act),
        effect("heavy", "fraction", 0.05, load=_load),
        effect("gyro", "scale", 0.03, distort=distorted),
        effect("drag", "factor", 0.5, "N s/m", replay=_replay),
    )
}
OWN = effect("damping", "extra", 0.1)
