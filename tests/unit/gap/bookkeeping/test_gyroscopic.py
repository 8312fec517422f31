"""Rotor inertia in the vehicle is used where the simulation leaves gyroscopic moments to the rigid body."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.vehicle import Effector, Inertia, MassProperties, Rotor, Vehicle
from freqid.gap.bookkeeping.check import check
from freqid.gap.bookkeeping.gyroscopic import rotor_account, without_rotor_inertia
from freqid.identify.loads.wrench import applied_wrench

RATE, DURATION = 50.0, 30.0
TIME = np.arange(round(RATE * DURATION) + 1) / RATE
VEHICLE = Vehicle(
    name="made",
    mass_properties=MassProperties(mass_kg=30.0, inertia=Inertia(xx=3.0, yy=6.0, zz=8.0)),
    effectors=(Effector(name="n1", kind="rotor", limits=(0.0, 900.0)),),
    rotors=(Rotor(name="n1", spin=1, inertia=0.02),),
)
RESPONSES = ("L", "M", "N")


def flight(noise, vehicle=VEHICLE):
    """Return a flight that turns about all axes with a rotor whose speed changes, and its noise-free twin."""
    rng = np.random.default_rng(1)
    clean = {}
    for i, name in enumerate(("state/p", "state/q", "state/r", "effector/n1")):
        lines = np.arange(3 + i, 45, 4)[:, None] / DURATION
        phases = rng.uniform(0, 2 * np.pi, lines.shape)
        signal = np.sin(2 * np.pi * lines * TIME + phases).sum(axis=0) / np.sqrt(lines.size / 2)
        clean[name] = 500 + 10 * signal if name == "effector/n1" else 0.1 * signal
    sigma = {"effector/n1": 300 * noise}
    noisy = {n: x + sigma.get(n, noise) * rng.standard_normal(x.size) for n, x in clean.items()}

    def record(signals):
        units = dict.fromkeys(signals, "rad/s")
        return FlightRecord(
            TIME, {n: Channel(n, units[n], x, RATE, "made") for n, x in signals.items()}, vehicle
        )

    return record(noisy), record(clean)


@dataclass(frozen=True)
class Truth:
    """Predict the moments of the flight itself, with or without the rotors' part, a share of them off."""

    clean: FlightRecord
    vehicle: Vehicle
    off: float = 0.0
    gyroscopic: bool | None = None
    name: str = "truth"
    kind: str = "callable"
    responses: tuple[str, ...] = RESPONSES
    tolerances: dict = field(default_factory=dict)

    def predict(self, record, effects=None, departures=None):
        history = applied_wrench(Maneuver.of(self.clean, self.vehicle), RESPONSES).history(record.dt)
        return (1 + self.off) * history


@pytest.mark.parametrize("off", [0.0, 0.1])
def test_the_records_decide_where_the_simulation_does_not_say(off):
    record, clean = flight(1e-3)
    counted = rotor_account(Truth(clean, VEHICLE, off), [record])
    assert counted.share == pytest.approx(1.0, abs=0.15)
    assert counted.vehicle == VEHICLE
    assert "are subtracted" in counted.sentence
    never = rotor_account(Truth(clean, without_rotor_inertia(VEHICLE), off), [record])
    assert never.share == pytest.approx(0.0, abs=0.15)
    assert not any(r.inertia for r in never.vehicle.rotors)
    assert "are not subtracted" in never.sentence
    assert "\n" not in never.sentence


def test_what_the_simulation_states_is_not_asked_of_the_records():
    record, clean = flight(1e-3)
    bare = without_rotor_inertia(VEHICLE)
    assert rotor_account(Truth(clean, bare, gyroscopic=True), [record]).vehicle == VEHICLE
    stated = rotor_account(Truth(clean, VEHICLE, gyroscopic=False), [record])
    assert stated.vehicle == bare
    assert "states" in stated.sentence


def test_noise_that_hides_them_leaves_the_vehicle_as_it_is_described():
    weak = Vehicle(
        name="made",
        mass_properties=VEHICLE.mass_properties,
        effectors=VEHICLE.effectors,
        rotors=(Rotor(name="n1", spin=1, inertia=2e-5),),
    )
    record, clean = flight(1e-2, weak)
    account = rotor_account(Truth(clean, weak), [record])
    assert account.vehicle == weak
    assert "do not tell" in account.sentence


def test_there_is_nothing_to_decide_without_rotor_inertia_or_without_moments():
    record, clean = flight(1e-3)
    bare = without_rotor_inertia(VEHICLE)
    assert rotor_account(Truth(clean, bare), [record], bare).sentence == ""
    forces = replace(Truth(clean, VEHICLE), responses=("X", "Z"))
    assert rotor_account(forces, [record]).sentence == ""


def test_a_simulation_that_never_had_them_has_no_mistake_of_bookkeeping():
    record, clean = flight(1e-3)

    @dataclass(frozen=True)
    class Never(Truth):
        def gradient(self, record, inputs):
            return np.zeros((3, len(inputs), record.time.size))

    assert check(Never(clean, without_rotor_inertia(VEHICLE)), [record]) == []
