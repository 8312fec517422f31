"""Pilot's inputs and turbulence of the judging set against what is stated of them."""

import tomllib
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from judging_owner import module_of

FOLDER = Path(__file__).resolve().parents[3] / "benchmarks" / "gap_judging"
RATE_LIMIT = 6.0  # rad/s, of every true servo

loaded = partial(module_of, FOLDER)
VEHICLES = sorted(path.parent.name for path in FOLDER.glob("*/scenario.toml"))


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_no_input_of_a_pilot_drives_a_servo_to_its_limit(vehicle):
    scenario = tomllib.loads((FOLDER / vehicle / "scenario.toml").read_text())
    time = 0.01 * np.arange(-1600, 6101)
    made = loaded("pilot").pilot_inputs(scenario, time)
    surfaces = [i for i, e in enumerate(scenario["effector"]) if e["kind"] == "surface"]
    quickest = np.abs(np.diff(made[:, surfaces], axis=-1)).max() / 0.01
    assert quickest < 0.6 * RATE_LIMIT  # the control law needs some of it too
    assert np.allclose(made[..., 1600:1700], made[..., 7600:7700])  # periodic: an owner's flight wraps it
    driven = scenario["excitation"]["amplitude"]
    still = [e["name"] not in driven for e in scenario["effector"]]
    assert np.array_equal(made.any(axis=(0, 2)), np.logical_not(still))


def test_three_two_one_one_is_one():
    since = np.linspace(-1, 4, 5001)
    shape = loaded("pilot").three_two_one_one(since, 5.0)
    for seconds, level in ((-0.1, 0), (0.5, 1), (1.3, -1), (1.96, 1), (2.3, -1), (2.7, 0)):
        assert np.interp(seconds, since, shape) == pytest.approx(level)


def test_gusts_have_drydens_intensity_and_memory():
    speed, step = np.array([15.0, 30.0]), 0.01
    air = loaded("gusts").gusts(0.5, speed, 400_000, step, seed=3)
    for axis, (length, share) in enumerate(((154.0, 1.72), (154.0, 1.72), (30.0, 1.0))):
        for flight, u in enumerate(speed):
            drawn = air[:, axis, flight]
            assert drawn.std() == pytest.approx(0.5 * share, rel=0.1)
            later = round(0.5 * length / u / step)
            shared = np.mean(drawn[:-later] * drawn[later:]) / drawn.var()
            assert shared == pytest.approx(np.exp(-0.5), abs=0.1)
    assert not loaded("gusts").gusts(0.0, speed, 10, step, seed=3).any()
