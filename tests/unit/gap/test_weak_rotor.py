"""A weak rotor: the simulation's own thrust and torque less a share, or another speed."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from linear_flight import fly, vehicle

from freqid.core.record import Channel, Maneuver
from freqid.core.vehicle import Effector, Rotor
from freqid.gap.connect import connect
from freqid.gap.model.changes import change, departures_of
from freqid.gap.stack.trial import Trial
from freqid.simulate.effects import shipped

LOSS = 0.25
MODEL = """
def wrench(time, state, effector, air, parameters):
    loads = {"X": 0.0 * time, "L": 0.0 * time, "N": 0.0 * time}
    for name, y in (("r1", -1.0), ("r2", 1.0)):
        turned = effector[name] * (effector[name] - 4.0 * state["u"])  # less with the advance
        thrust = 1e-4 * (1 + parameters.get(f"{name}.thrust", 0.0)) * turned
        loads["X"] = loads["X"] + thrust
        loads["N"] = loads["N"] - y * thrust
        loads["L"] = loads["L"] + 2e-6 * y * (1 + parameters.get(f"{name}.torque", 0.0)) * turned
    return loads
"""
DECLARED = """
parts = [f"{rotor}.{what}" for rotor in ("r1", "r2") for what in ("thrust", "torque")]
wrench.tolerances = dict.fromkeys(parts, (0.03, "1"))
"""


@pytest.fixture
def trial(tmp_path):
    def of(text):
        rotors = tuple(Effector(name=n, kind="rotor", limits=(0.0, 900.0)) for n in ("r1", "r2"))
        places = tuple(
            Rotor(name=n, spin=s, inertia=0.0, position_m=(0.0, y, 0.0), axis=(1.0, 0.0, 0.0))
            for n, s, y in (("r1", 1, -1.0), ("r2", -1, 1.0))
        )
        own = vehicle()
        own = msgspec.structs.replace(own, effectors=(*own.effectors, *rotors), rotors=places)
        record = fly().record
        speeds = {n: 400.0 + 20.0 * np.sin((k + 1.0) * record.time) for k, n in enumerate(("r1", "r2"))}
        record = record.with_channels(
            *(Channel(f"effector/{n}", "rad/s", x, 50.0, "made") for n, x in speeds.items())
        )
        path = tmp_path / "model.py"
        path.write_text(text)
        simulation = connect(f"{path}:wrench", record=record)
        return Trial.of(simulation, Maneuver(record, own), carries=False)

    return of


def changed(trial, **settings):
    """Return the changes of X, L and N, shape (3, sample)."""
    found = change(shipped()["weak_rotor"].of(trial.maneuver.vehicle), trial, settings)
    at = {row.name: i for i, row in enumerate(found.rows)}
    return np.array([found.direct[at[n]] for n in "XLN"])


def turned(trial, share=1.0):
    record = trial.maneuver.record
    speed = np.sqrt(share) * record["effector/r1"]
    return speed * (speed - 4.0 * record["state/u"])


def test_it_is_the_declared_thrust_and_torque_less_a_share(trial):
    there = trial(MODEL + DECLARED)
    lost = -LOSS * turned(there) * np.array([[1e-4], [-2e-6], [1e-4]])
    np.testing.assert_allclose(changed(there, r1=LOSS), lost, rtol=1e-9)
    lost[1] = 0.0  # a worn blade drags as before
    np.testing.assert_allclose(changed(there, r1=LOSS, torque_kept=1.0), lost, rtol=1e-9, atol=1e-12)


def test_it_is_another_speed_where_none_is_declared(trial):
    there = trial(MODEL)
    found, lost = changed(there, r1=LOSS), turned(there, 1 - LOSS) - turned(there)
    np.testing.assert_allclose(found, lost * np.array([[1e-4], [-2e-6], [1e-4]]), rtol=1e-9)
    assert np.abs(found[0] + LOSS * 1e-4 * turned(there)).max() > 0.05 * np.abs(found[0]).max()


def test_torque_that_stays_is_what_the_simulation_says_about_the_shaft(trial):
    there = trial(MODEL)
    with_it, kept = changed(there, r1=LOSS), changed(there, r1=LOSS, torque_kept=1.0)
    record = there.maneuver.record
    slope = -2e-6 * (2 * record["effector/r1"] - 4.0 * record["state/u"])  # of L, by the speed
    torque = 0.5 * record["effector/r1"] * slope
    np.testing.assert_allclose(kept[1] - with_it[1], LOSS * torque, rtol=1e-4)
    np.testing.assert_allclose(kept[[0, 2]], with_it[[0, 2]], rtol=1e-9)


def test_only_a_loss_of_one_declared_thrust_has_one_size_with_its_tolerance(trial):
    there = trial(MODEL + DECLARED)
    effect = shipped()["weak_rotor"].of(there.maneuver.vehicle)
    values = {**dict.fromkeys(effect.parameters, 0.0), "r1": LOSS, "torque_kept": 1.0}
    assert departures_of(effect, values, there.simulation) == {"r1.thrust": -LOSS}
    assert set(departures_of(effect, {**values, "torque_kept": 0.0}, there.simulation)) == {
        "r1.thrust",
        "r1.torque",
    }
    assert departures_of(effect, values, trial(MODEL).simulation) == {}
