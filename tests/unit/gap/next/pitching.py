"""A body that pitches under two surfaces, flown by its difference equation, and a linear simulation of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import butter, lfilter, sosfiltfilt

from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.simulate.effects.effect import Effect, Parameter

DT, DURATION, LAG = 0.05, 20.0, 0.05
IYY, MQ, M1, M2 = 2.0, -6.0, -40.0, -8.0
NOISE = {"state/q": 1e-4, "response/M": 0.02, "effector/d1": 1e-4, "effector/d2": 1e-4}
SIZES = {"derivatives": 0.02, "dynamics": 0.02}
VEHICLE = Vehicle(
    name="pitching",
    mass_properties=MassProperties(mass_kg=10.0, inertia=Inertia(xx=1.5, yy=IYY, zz=3.0)),
    effectors=tuple(Effector(name=n, kind="surface", limits=(-0.3, 0.3)) for n in ("d1", "d2")),
)


def servo(command: np.ndarray) -> np.ndarray:
    decay = np.exp(-DT / LAG)
    return lfilter([1 - decay], [1, -decay], command)


def pitched(d1: np.ndarray, d2: np.ndarray) -> np.ndarray:
    decay = np.exp(MQ / IYY * DT)
    return lfilter([0.0, (decay - 1) / MQ], [1, -decay], M1 * d1 + M2 * d2)


def injected(seed: int) -> np.ndarray:
    rng, time = np.random.default_rng(seed), DT * np.arange(round(DURATION / DT) + 1)
    found = []
    for i in range(2):
        k = np.arange(2 + i, 2.0 * DURATION, 3)
        waves = np.sin(2 * np.pi * np.outer(k / DURATION, time) + rng.uniform(0, 2 * np.pi, (k.size, 1)))
        found.append(0.03 * waves.sum(axis=0) / np.sqrt(k.size / 2))
    return np.array(found)


def flight(seed: int = 1, gain: float = 0.0) -> Maneuver:
    """Return a noisy flight of a body whose surfaces move further than commanded by a share."""
    sent, rng = injected(seed), np.random.default_rng([seed, 9])
    d1, d2 = (1 + gain) * servo(sent)
    q = pitched(d1, d2)
    values = {"state/q": q, "response/M": MQ * q + M1 * d1 + M2 * d2, "effector/d1": d1, "effector/d2": d2}
    values = {n: x + NOISE[n] * rng.standard_normal(x.size) for n, x in values.items()}
    for i, name in enumerate(("d1", "d2")):
        values |= {f"command/{name}": sent[i], f"excitation/{name}": sent[i]}
    unit = {"state/q": "rad/s", "response/M": "N m"}
    channels = {n: Channel(n, unit.get(n, "rad"), x, 1 / DT, "made here") for n, x in values.items()}
    time = DT * np.arange(sent.shape[1], dtype=float)
    return Maneuver(FlightRecord(time, channels, VEHICLE, reference=f"c{seed}"), VEHICLE)


@dataclass(frozen=True, eq=False)
class Pitching:
    """The simulation; `can_fly` as asked for."""

    can_fly: bool = True
    name: str = "pitching"
    kind: str = "callable"
    responses: tuple[str, ...] = ("M",)
    vehicle: Vehicle = VEHICLE
    effects: dict = field(default_factory=dict)
    parts: tuple[str, ...] = ()
    tolerances: dict = field(default_factory=dict)
    has_actuators: bool = True
    gyroscopic: bool | None = True

    def predict(self, record, effects=None, departures=None):
        return np.array([[MQ, M1, M2]]) @ record.matrix(("state/q", "effector/d1", "effector/d2"))

    def gradient(self, record, inputs):
        slope = {"state/q": MQ, "effector/d1": M1, "effector/d2": M2}
        return np.array([[np.full(record.time.size, slope.get(n, 0.0)) for n in inputs]])

    def positions(self, record, effects=None, departures=None):
        return {n: servo(record[f"command/{n}"]) for n in record.group("command")}

    def fly(self, record, effects=None, departures=None):
        if not self.can_fly:
            return None
        still = np.zeros(record.time.size)
        given = record.group("excitation")
        sent = np.array([record[f"excitation/{n}"] if n in given else still for n in ("d1", "d2")])
        d1, d2 = servo(sent)
        return {"state/q": pitched(d1, d2), "effector/d1": d1, "effector/d2": d2}


def _gain(settings, signals, dt, kinds):
    return {n: (1 + settings["share"]) * x for n, x in signals.items()}


def _slow_gain(settings, signals, dt, kinds):
    """Return positions that are larger below 0.5 Hz only."""
    slow = butter(4, 0.5, fs=1 / dt, output="sos")
    return {n: x + settings["share"] * sosfiltfilt(slow, x) for n, x in signals.items()}


def effect(identifier: str, act=_gain) -> Effect:
    return Effect(identifier, "command", identifier, {"share": Parameter(0.0, "1", "", 0.05)}, act=act)


BANDS = {"wide": effect("wide"), "slow": effect("slow", _slow_gain)}
