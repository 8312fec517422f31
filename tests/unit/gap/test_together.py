"""Effects beside each other, in coefficients or by name, and records that describe no vehicle."""

import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.vehicle import Inertia, MassProperties, Vehicle
from freqid.gap.compare import compare
from freqid.gap.connect.callable import CallableSimulation
from freqid.gap.diagnose import Question, diagnose
from freqid.gap.replay import Replay
from freqid.gap.together import together
from freqid.gap.tolerance import stated
from freqid.gap.trial import Trial
from freqid.gap.undescribed import without_vehicle
from freqid.simulate.effects import shipped

RATE, DURATION = 50.0, 20.0
TIME = np.arange(round(RATE * DURATION)) / RATE
W = 2 * np.pi * 0.5


def record(channels):
    units = {"stick": "rad", "q": "rad/s", "n1": "rad/s", "alpha": "rad", "V": "m/s", "rho": "kg/m3"}
    return FlightRecord(
        TIME,
        {
            n: Channel(n, units.get(n.partition("/")[2], "1"), x * np.ones_like(TIME), RATE, "made")
            for n, x in channels.items()
        },
    )


def gain(time, state, effector, air, parameters):
    return {"q": 2.0 * effector["stick"]}


@pytest.fixture(scope="module")
def trial():
    moved = {"effector/stick": np.sin(W * TIME), "command/stick": np.sin(W * TIME)}
    one = record({**moved, "state/q": 2 * np.sin(W * TIME)})
    simulation = CallableSimulation(gain, "gain", ("q",))
    return Trial.of(simulation, Maneuver.of(one, without_vehicle("any", one)))


def test_a_delay_and_a_lag_follow_one_another(trial):
    both = [shipped()["actuator_delay"], shipped()["actuator_lag"]]
    found = together(both, trial, {"actuator_delay": {"extra": 0.1}, "actuator_lag": {"extra": 0.3}})
    answer = np.exp(-1j * W * 0.1) / (1 + 1j * W * 0.3)  # of the two in a row
    expected = 2 * np.imag((answer - 1) * np.exp(1j * W * TIME))
    settled = TIME > 4
    np.testing.assert_allclose(found.direct[0][settled], expected[settled], atol=5e-3)


def test_a_delay_may_be_one_effectors(trial):
    of = shipped()["actuator_delay"].of(trial.maneuver.vehicle)
    found = together([of], trial, {"actuator_delay": {"stick": 0.04}})
    alike = together([of], trial, {"actuator_delay": {"extra": 0.04}})
    np.testing.assert_allclose(found.direct, alike.direct)
    assert np.abs(found.direct).max() > 0.1


def test_inputs_of_a_record_without_a_vehicle_become_effectors():
    one = record({"effector/stick": np.sin(TIME), "command/n1": 400 + TIME})
    vehicle = without_vehicle("any", one)
    assert vehicle.effector_kinds == {"stick": "surface", "n1": "rotor"}
    assert without_vehicle("any").effectors == ()


def test_a_load_becomes_the_coefficient_that_the_simulation_gives():
    one = record({"air/alpha": 0.1 * np.sin(TIME), "air/V": 20.0, "air/rho": 1.2})
    simulation = CallableSimulation(lambda *_: {"Cm": 0 * TIME, "CZ": 0 * TIME}, "steady", ("Cm", "CZ"))
    inertia = Inertia(xx=1.0, yy=1.0, zz=1.0)
    vehicle = Vehicle(
        name="wing",
        mass_properties=MassProperties(mass_kg=1.0, inertia=inertia),
        area_m2=2.0,
        span_m=4.0,
        chord_m=0.5,
    )
    extra = np.zeros((6, TIME.size))
    extra[2], extra[4] = 480.0, -120.0
    rows = Replay(simulation, one, vehicle).responses(extra)
    np.testing.assert_allclose(rows[:, 0], [-0.5, 1.0])  # M / (240 Pa 2 m2 0.5 m), Z / (240 Pa 2 m2)
    named = Replay(simulation, one, None).responses({"CZ": 0.3 + 0 * TIME})
    np.testing.assert_allclose(named, [0 * TIME, 0.3 + 0 * TIME])
    with pytest.raises(DataError, match="'CX'"):
        Replay(simulation, one, None).responses({"CX": 0 * TIME})
    with pytest.raises(DataError, match="shape"):
        Replay(simulation, one, None).responses(extra[:3])
    with pytest.raises(DataError, match="area"):
        Replay(simulation, one, without_vehicle("bare")).responses(extra)


def test_a_log_without_noise_without_injected_signals_and_with_few_lines_is_compared():
    stick = np.sin(W * TIME) + 0.5 * np.sin(2.6 * W * TIME)
    one = record({"effector/stick": stick, "command/stick": stick, "state/q": 1.6 * stick})
    short = one.cut(0.0, 6.0)
    library = {i: shipped()[i] for i in ("surface_effectiveness", "actuator_delay")}
    simulation = CallableSimulation(gain, "gain", ("q",))
    sizes = stated({}, shipped())
    found = compare(simulation, Maneuver.of(short, without_vehicle("any", short)), library, sizes, (0.2, 2.0))
    assert np.isfinite(found.white(found.residual)).all()
    question = Question(library, sizes, (0.2, 2.0), named=("surface_effectiveness",), draws=30)
    said = diagnose(simulation, [found.maneuver], question).diagnosis
    loss = said.how_far[0].settings["surface_effectiveness"]
    assert max(x.estimate for x in loss.values()) == pytest.approx(0.2, abs=0.03)
    assert any("injected" in remark for remark in said.remarks)
    assert "fitted to" in said.how_far[0].note
