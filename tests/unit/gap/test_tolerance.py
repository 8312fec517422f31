"""Tolerances: one sigma each, as differences of what simulation and record say."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from linear_flight import DT, IYY, LIBRARY, SLOPES, THETA0, Linear, fly

from freqid.core.errors import UsageError
from freqid.core.record import Maneuver
from freqid.core.vehicle import Effector, Vehicle
from freqid.gap.tolerance import DEFAULT, EACH_FLIGHT, stated, tolerances
from freqid.gap.trial import Trial
from freqid.simulate.effects.mass import EFFECT as MASS
from freqid.simulate.effects.sensor_bias import EFFECT as BIAS

KNOWN = {**LIBRARY, "mass": MASS, "sensor_bias": BIAS}


def test_a_scenario_states_what_it_knows_and_defaults_fill_in():
    found = stated({"derivatives": 0.1, "mass": 0.0, "sensor_bias.w": 0.7, "worn": 0.02}, KNOWN)
    assert (found["derivatives"], found["mass"], found["sensor_bias.w"], found["worn"]) == (0.1, 0, 0.7, 0.02)
    assert found["responses"] == DEFAULT["responses"]
    assert found["sensor_bias.u"] == EACH_FLIGHT["sensor_bias.u"]


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"derivative": 0.1}, "has no 'derivative'"),
        ({"drag.faktor": 0.1}, "has no 'drag.faktor'"),
        ({"mass": -0.1}, "mass is -0.1"),
        ({"mass": float("nan")}, "mass is nan"),
        ({"mass": "much"}, "mass is 'much'"),
    ],
)
def test_what_is_no_tolerance_is_refused(table, says):
    with pytest.raises(UsageError, match=says):
        stated(table, KNOWN)


@pytest.fixture(scope="module")
def trial():
    return Trial.of(Linear(), fly())


def allowed(trial, library=None, **sizes):
    none = dict.fromkeys((*DEFAULT, *EACH_FLIGHT), 0.0)
    return tolerances(trial, library or {}, {**none, **sizes})


def test_a_derivative_is_off_by_a_share_of_itself(trial):
    found = allowed(trial, derivatives=0.05).common
    record = trial.maneuver.record
    motion = record["state/w"] - record["state/w"].mean()
    row = found["derivatives:Z:w"]
    assert row.direct[1] == pytest.approx(0.05 * SLOPES[1, 1] * motion)
    assert not np.delete(row.direct, 1, axis=0).any()
    # one for each derivative that is not zero
    names = {f"derivatives:{r}:{x}" for r, row in zip("XZM", SLOPES, strict=True) for x in named(row)}
    shared = {f"{how}:{what}" for how in ("together", "turned") for what in ("motion", "surface")}
    assert set(found) == names | shared | {f"whole:{r}" for r in "XZM"}


def named(row):
    return [x for x, slope in zip(("u", "w", "q", "d1", "d2"), row, strict=True) if slope]


def test_what_acts_in_the_plane_of_symmetry_may_point_elsewhere(trial):
    """A large force that is a share too large and a little turned leaves a small axial one far off."""
    found = allowed(trial, derivatives=0.05).common
    record = trial.maneuver.record
    w, q = (record[f"state/{n}"] - record[f"state/{n}"].mean() for n in "wq")
    u = record["state/u"] - record["state/u"].mean()
    along = SLOPES[:, :3] @ np.array([u, w, q])
    turned = found["turned:motion"].direct
    assert turned[0] == pytest.approx(0.05 * along[1])
    assert turned[1] == pytest.approx(-0.05 * along[0])
    assert not turned[2:].any()


def test_a_response_is_off_by_a_share_of_its_change_in_each_manoeuvre(trial):
    found = allowed(trial, responses=0.02)
    assert not found.common
    predicted = trial.predicted
    for i, name in enumerate("XZM"):
        expected = 0.02 * (predicted[i] - predicted[i].mean())
        assert found.own[f"responses:{name}"].direct[i] == pytest.approx(expected)


def test_an_actuator_follows_a_share_of_its_time_later(trial):
    """The servo's lag of 50 ms: five per cent are 2.5 ms, later is a position less along its rate."""
    found = allowed(trial, dynamics=0.05).common
    at = {row.name: i for i, row in enumerate(trial.measured.rows)}
    change = found["dynamics:d1:time"].direct[at["actuator/d1"]]
    rate = np.gradient(trial.positions["d1"], DT)
    late = -np.dot(change, rate) / np.dot(rate, rate)
    assert late == pytest.approx(0.05 * 0.05, rel=0.05)
    assert {f"dynamics:{n}:{what}" for n in ("d1", "d2") for what in ("time", "gain")} <= set(found)
    gain = found["dynamics:d2:gain"].direct[at["actuator/d2"]]
    moved = trial.positions["d2"] - trial.positions["d2"].mean()
    assert gain == pytest.approx(0.01 * moved)


def motor(command, up, down, fine=50):
    """Return the speed that follows a command with one time while it rises and another while it falls."""
    speed, found = command[0], [command[0]]
    for before, now in itertools.pairwise(command):
        for k in range(fine):
            error = before + (now - before) * (k + 0.5) / fine - speed
            speed += DT / fine * error / (up if error > 0 else down)
        found.append(speed)
    return np.array(found)


def test_a_motor_that_brakes_slowly_follows_a_share_of_both_its_times_later(trial):
    """One time for both leaves an eighth of the change, this a fiftieth."""
    effectors = (Effector(name="d1", kind="rotor", limits=(-0.5, 0.5)),)
    record, stated = trial.maneuver.record, trial.maneuver.vehicle.mass_properties
    vehicle = Vehicle(name="one motor", mass_properties=stated, effectors=effectors)
    times = np.array([0.05, 0.08])
    flown, later = (motor(record["command/d1"], *(k * times)) for k in (1.0, 1.05))
    used = replace(trial, maneuver=Maneuver(record, vehicle), positions={"d1": flown})
    change = allowed(used, dynamics=0.05).common["dynamics:d1:time"]
    found = change.direct[[row.name for row in change.rows].index("actuator/d1")]
    missed = found - (later - flown)
    assert np.std(missed) < 0.03 * np.std(later - flown)


def test_an_effect_within_its_tolerance_is_one_sigma_of_the_measured_part(trial):
    found = allowed(trial, {"mass": MASS}, mass=0.01).common["tolerance:mass:fraction"]
    record = trial.maneuver.record
    # a vehicle that is 1 % heavier than described needs that much more force than is reconstructed
    assert found.direct[0] == pytest.approx(-0.01 * 10.0 * record["state/ax"])
    assert found.direct[1] == pytest.approx(-0.01 * 10.0 * record["state/az"])
    assert not found.direct[2:].any()


def test_a_bias_is_another_in_each_flight(trial):
    found = allowed(trial, {"sensor_bias": BIAS}, **{"sensor_bias.w": 0.1, "sensor_bias.q": 0.01})
    assert set(found.own) == {"tolerance:sensor_bias:w"}
    assert set(found.common) == {"tolerance:sensor_bias:q"}
    w = found.own["tolerance:sensor_bias:w"]
    # what the simulation then says is off by the derivative; the kinematics by q times the bias
    assert w.direct[1] == pytest.approx(-0.1 * SLOPES[1, 1])
    at = {row.name: i for i, row in enumerate(w.rows)}
    q = trial.maneuver.record["state/q"]
    assert w.direct[at["kinematic/u"]] == pytest.approx(0.1 * q)
    theta = trial.maneuver.record["state/theta"]
    gyro = found.common["tolerance:sensor_bias:q"]
    assert gyro.direct[at["kinematic/theta"]] == pytest.approx(-0.01)
    assert gyro.momentum[at["M"]] == pytest.approx(0.01 * IYY)
    assert np.abs(theta - THETA0).max() < 0.5  # it is near its trim, so none of this is by accident


def test_nothing_is_allowed_where_nothing_is_stated(trial):
    found = allowed(trial, {"mass": MASS, "sensor_bias": BIAS})
    assert not found.common
    assert not found.own
