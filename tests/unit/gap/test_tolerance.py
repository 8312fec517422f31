"""Tolerances: which names there are, what no tolerance can be, and one sigma of each as a column."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import LIBRARY, SLOPES, Linear, fly, vehicle

from freqid.core.errors import DataError, UsageError
from freqid.gap.model.candidates import candidates
from freqid.gap.model.tolerance import (
    DEFAULT,
    EACH_FLIGHT,
    UNDECLARED,
    own_departures,
    record_columns,
    stated,
    tolerance_columns,
)
from freqid.gap.simulation import Tolerance
from freqid.gap.stack.block import stack_of
from freqid.simulate.effects.mass import EFFECT as MASS
from freqid.simulate.effects.sensor_bias import EFFECT as BIAS

KNOWN = {**LIBRARY, "mass": MASS, "sensor_bias": BIAS}
BAND = (0.05, 2.0)


DECLARING = Linear(tolerances={"lift_slope": Tolerance(0.03)})


def test_a_scenario_states_what_it_knows_and_defaults_fill_in():
    found = stated({"derivatives": 0.1, "mass": 0.0, "sensor_bias.w": 0.7, "worn": 0.02}, KNOWN)
    assert (found["derivatives"], found["mass"], found["sensor_bias.w"], found["worn"]) == (0.1, 0, 0.7, 0.02)
    assert found["dynamics"] == UNDECLARED["dynamics"]
    assert found["inertia"] == DEFAULT["inertia"]
    assert found["sensor_bias.u"] == EACH_FLIGHT["sensor_bias.u"]


def test_a_simulation_with_parameters_of_its_own_has_no_generic_tolerances():
    found = stated({}, KNOWN, DECLARING, vehicle())
    assert found["lift_slope"] == 0.03
    assert not set(UNDECLARED) & set(found)
    assert stated({"lift_slope": 0.1}, KNOWN, DECLARING, vehicle())["lift_slope"] == 0.1


def test_one_parameter_that_is_stated_replaces_the_default_of_the_effect():
    found = stated({"inertia.yy": 0.1}, {**KNOWN, "inertia": shipped("inertia")})
    assert "inertia" not in found
    assert found["inertia.yy"] == 0.1


def shipped(name):
    from freqid.simulate.effects import shipped as every

    return every()[name]


@pytest.mark.parametrize("name", ["d1.gain", "d2.natural_frequency", "d1.damping"])
def test_actuators_have_names_by_effector_where_a_vehicle_says_which(name):
    assert stated({name: 0.1}, KNOWN, Linear(), vehicle())[name] == 0.1
    with pytest.raises(UsageError, match="has no"):
        stated({name: 0.1}, KNOWN)


@pytest.mark.parametrize(
    ("table", "kind", "says"),
    [
        ({"derivative": 0.1}, UsageError, "has no 'derivative'"),
        ({"drag.faktor": 0.1}, UsageError, "has no 'drag.faktor'"),
        ({"d3.gain": 0.1}, UsageError, "has no 'd3.gain'"),
        ({"sensor_bias": 0.1}, UsageError, "one number for parameters in m/s2, rad/s"),
        ({"mass": -0.1}, DataError, "mass is -0.1"),
        ({"mass": float("nan")}, DataError, "mass is nan"),
        ({"mass": float("inf")}, DataError, "mass is inf"),
        ({"mass": 1e4}, DataError, "mass is 10000.0"),
        ({"mass": True}, DataError, "mass is True"),
        ({"mass": "much"}, DataError, "mass is 'much'"),
    ],
)
def test_what_is_no_tolerance_is_refused(table, kind, says):
    with pytest.raises(kind, match=says):
        stated(table, KNOWN, Linear(), vehicle())


def test_a_parameter_that_is_taken_as_known_has_no_unit_to_mix():
    delay = {"actuator_delay": shipped("actuator_delay")}  # its other one is a factor without a scale
    assert stated({"actuator_delay": 0.01}, delay, Linear(), vehicle())["actuator_delay"] == 0.01


@pytest.fixture(scope="module")
def block():
    (one,) = stack_of(Linear(), [fly(noise=1.0, duration=40.0)], ["one"], BAND)
    return one


def columns(block, **sizes):
    none = dict.fromkeys((*DEFAULT, *UNDECLARED, *EACH_FLIGHT), 0.0)
    return tolerance_columns(block, {}, {**none, **sizes})


def test_a_derivative_is_off_by_a_share_of_itself(block):
    found = columns(block, derivatives=0.05)
    record = block.trial.maneuver.record
    at = [r.name for r in block.rows].index("Z")
    moved = record["state/w"] - record["state/w"].mean()
    expected = 0.05 * SLOPES[1, 1] * block.grid.spectrum(moved)
    assert found["derivatives.Z.w"][at] == pytest.approx(expected)
    assert not np.delete(found["derivatives.Z.w"], at, axis=0).any()
    assert {n for n in found if n.startswith("derivatives.X")} == {
        "derivatives.X.u",
        "derivatives.X.w",
        "derivatives.X.d2",
    }


def test_an_actuator_follows_a_share_of_its_time_later(block):
    """A lag of 50 ms: a fifth is 10 ms, which turns the position's phase by as much."""
    z = columns(block, **{"d1.natural_frequency": 0.2})["d1.natural_frequency"]
    at = [r.name for r in block.rows].index("actuator/d1")
    position = block.grid.spectrum(block.trial.positions["d1"])
    strong = block.lines.owner == 0
    late = -(z[at, strong] / position[strong]).imag / (2 * np.pi * block.lines.hz[strong])
    assert np.median(late) == pytest.approx(0.01, rel=0.15)
    assert not np.delete(z, at, axis=0).any()


def test_what_nobody_stated_of_one_actuator_is_half_that_of_all(block):
    found = columns(block, dynamics=0.1)
    alone = columns(block, **{"d1.natural_frequency": 0.1, "d2.natural_frequency": 0.1})
    assert set(alone) == {"d1.natural_frequency", "d2.natural_frequency"}
    for name in alone:
        np.testing.assert_allclose(found[name], np.sqrt(0.5) * alone[name])
    np.testing.assert_allclose(
        found["every surface.natural_frequency"], np.sqrt(0.5) * sum(alone.values()), atol=1e-12
    )


def test_own_parameters_of_one_make_depart_together_and_alone(block):
    own = {f"{n}.lag": Tolerance(0.2, actuator=n, of_make=True) for n in ("d1", "d2")}
    trial = replace(block.trial, simulation=Linear(tolerances=own))
    half = 0.2 * np.sqrt(0.5)
    one_make = {"d1.lag": pytest.approx(half), "d2.lag": pytest.approx(half)}
    found = own_departures(trial, {})
    assert found == {n: {n: x} for n, x in one_make.items()} | {"every surface.lag": one_make}
    assert own_departures(trial, {"d1.lag": 0.1}) == {"d1.lag": {"d1.lag": 0.1}, "d2.lag": {"d2.lag": 0.2}}


def test_a_gain_moves_one_effector_by_its_share(block):
    found = columns(block, **{"d2.gain": 0.03})
    assert set(found) == {"d2.gain"}
    at = [r.name for r in block.rows].index("actuator/d2")
    position = block.trial.positions["d2"]
    assert found["d2.gain"][at] == pytest.approx(0.03 * block.grid.spectrum(position - position.mean()))


def test_offsets_and_starts_are_each_records_own(block):
    found = record_columns(
        block, {"sensor_bias": BIAS}, {"sensor_bias.q": 0.002, "sensor_bias.surface": 0.005}
    )
    assert {"offset.sensor_bias.q", "offset.d1", "offset.d2", "start.position.d1", "start.rate.d2"} <= set(
        found
    )
    at = [r.name for r in block.rows].index("actuator/d1")
    half = 0.005 * np.sqrt(0.5 * block.lines.duration)  # of the variance; the other half is that of both
    assert found["offset.d1"][at, 0] == pytest.approx(half)
    assert found["offset.every surface"][at, 0] == pytest.approx(half)
    assert np.abs(found["offset.d1"][at, 1:]).max() < 1e-9


def test_the_scale_of_position_sensors_is_half_common_and_half_each_ones_own(block):
    scale = {"sensor_scale": shipped("sensor_scale")}
    none = dict.fromkeys((*DEFAULT, *UNDECLARED, *EACH_FLIGHT), 0.0)
    found = tolerance_columns(block, scale, {**none, "sensor_scale": 0.01})
    assert {"sensor_scale.surface", "sensor_scale.d1", "sensor_scale.d2", "sensor_scale.q"} <= set(found)
    np.testing.assert_allclose(
        found["sensor_scale.d1"] + found["sensor_scale.d2"], found["sensor_scale.surface"]
    )
    moved = np.sqrt(0.5) * 0.01 * block.grid.spectrum(block.trial.maneuver.record["effector/d1"])
    row = [r.name for r in block.rows].index("actuator/d1")
    np.testing.assert_allclose(
        abs(found["sensor_scale.d1"][row]), abs(moved), rtol=1e-4, atol=1e-12
    )  # of second order
    alone = tolerance_columns(block, scale, {**none, "sensor_scale.surface": 0.01})
    assert set(alone) == {"sensor_scale.surface"}


def test_the_scale_of_one_position_sensor_is_no_candidate(block):
    found, _ = candidates({"sensor_scale": shipped("sensor_scale")}, [block])
    labels = {c.place.label for c in found}
    assert labels >= {"surface", "q"}
    assert not labels & {"d1", "d2"}
