"""The truth of a flight: what its channels say agrees with each other by physics, and it keeps to itself."""

from pathlib import Path

import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.core.record import read_record, write_record
from freqid.core.scenario import read_scenario
from freqid.simulate.control.lq import close_loop
from freqid.simulate.fly import fly, sortie
from freqid.simulate.truth import read_truth, truth_of, truth_path, write_truth

SCENARIO = read_scenario(Path(__file__).parents[3] / "scenarios" / "la8.toml")[0]
G = 9.80665


@pytest.fixture(scope="module")
def loop():
    return close_loop(SCENARIO, SCENARIO.reference_of("u20"))


@pytest.fixture(scope="module")
def flown(loop):
    """A stretch of transition in a wind: wings turn, everything moves."""
    plan = sortie(
        SCENARIO,
        loop,
        SCENARIO.reference_of("u20"),
        duration=9.9,
        to=SCENARIO.reference_of("u36"),
        wind=(2.0, -1.0, 0.0),
    )
    flight = fly(plan)
    return flight, *truth_of(SCENARIO, flight, excited=("de1",), reference="u20")


def test_specific_force_times_mass_is_the_wrench(flown, loop):
    """Newton's law about the origin, by hand; the wings' own motion is a little of it."""
    _, truth, _ = flown
    mass = 28.6
    force = truth.matrix(["response/X", "response/Y", "response/Z"])
    felt = truth.matrix(["state/ax", "state/ay", "state/az"])
    rates = truth.matrix(["state/p", "state/q", "state/r"])
    turning = truth.matrix(["state/pdot", "state/qdot", "state/rdot"])
    tilt = truth["effector/dw1"]
    centre = np.zeros((3, truth.time.size))
    for k, angle in enumerate(tilt):  # 4.5 kg wings, arms of 6 cm, from the scenario
        arm = 0.06 * np.array([np.cos(angle) - 1, 0, -np.sin(angle)])
        centre[:, k] = np.array([0.09, 0, 0.03]) + 2 * 4.5 / mass * arm
    moved = felt + np.cross(turning, centre, axis=0)
    moved += np.cross(rates, np.cross(rates, centre, axis=0), axis=0)
    assert np.abs(mass * moved - force).max() < 0.02 * mass * G


def test_rates_of_change_are_those_of_what_changes(flown):
    _, truth, wind = flown
    step = truth.time[1]

    def slope(values):
        return (values[..., 2:] - values[..., :-2]) / (2 * step)

    rates = truth.matrix(["state/p", "state/q", "state/r"])
    turning = truth.matrix(["state/pdot", "state/qdot", "state/rdot"])
    assert np.abs(slope(rates) - turning[:, 1:-1]).max() < 0.02 * np.abs(turning).max() + 1e-4
    # V' = a + gravity - w x V, all over the ground
    velocity = truth.matrix(["state/u", "state/v", "state/w"]) + wind
    phi, theta = truth["state/phi"], truth["state/theta"]
    gravity = G * np.stack([-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)])
    felt = truth.matrix(["state/ax", "state/ay", "state/az"])
    expected = felt + gravity - np.cross(rates, velocity, axis=0)
    assert np.abs(slope(velocity) - expected[:, 1:-1]).max() < 2e-3 * G


def test_airspeed_angles_and_pressure_belong_together(flown):
    _, truth, wind = flown
    u, v, w = truth.matrix(["state/u", "state/v", "state/w"])
    assert np.allclose(truth["air/V"], np.sqrt(u**2 + v**2 + w**2))
    assert np.allclose(np.tan(truth["air/alpha"]), w / u)
    assert np.allclose(np.sin(truth["air/beta"]), v / truth["air/V"])
    assert np.allclose(truth["air/qbar"], 0.5 * 1.225 * truth["air/V"] ** 2)
    assert np.allclose(np.linalg.norm(wind, axis=0), np.sqrt(5.0))


def test_effectors_keep_their_names(flown, loop):
    flight, truth, _ = flown
    at = loop.trims["u20"]
    kinds = {"surface": at.positions.surface, "tilt": at.positions.tilt, "rotor": at.positions.speed}
    for kind, positions in kinds.items():
        names = [e.name for e in SCENARIO.effector if e.kind == kind]
        for k, name in enumerate(names):
            assert truth[f"effector/{name}"][0] == pytest.approx(float(positions[k]), abs=1e-12)
            assert truth[f"command/{name}"].shape == flight.time.shape
    assert [name for name in truth.channels if name.startswith("excitation/")] == ["excitation/de1"]
    assert truth.channel("effector/n1").unit == "rad/s"
    assert truth.channel("response/M").unit == "N m"


def test_a_truth_goes_to_a_file_of_its_own_and_back(flown, tmp_path):
    truth = flown[1]
    path = truth_path(tmp_path / "flight.h5")
    assert path.name == "flight.truth.h5"
    write_truth(path, truth, "abc")
    back = read_truth(path)
    assert list(back.channels) == list(truth.channels)
    for name in truth.channels:
        assert np.array_equal(back[name], truth[name])
        assert back.channel(name).unit == truth.channel(name).unit


def test_a_truth_is_no_record_and_a_record_no_truth(flown, tmp_path):
    truth = flown[1]
    write_truth(tmp_path / "a.truth.h5", truth)
    with pytest.raises(DataError, match="freqid-truth"):
        read_record(tmp_path / "a.truth.h5")
    write_record(tmp_path / "a.h5", truth)
    with pytest.raises(DataError, match="freqid-record"):
        read_truth(tmp_path / "a.h5")
