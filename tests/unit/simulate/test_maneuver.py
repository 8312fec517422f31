"""From a plan to what is logged: the channels of the contract, nothing of the truth, and the seed's draws."""

from pathlib import Path

import numpy as np
import pytest

from freqid.core.channels import split
from freqid.core.errors import UsageError
from freqid.core.scenario import read_scenario
from freqid.identify.sensors.flight_path import attitude_matrix
from freqid.simulate.control.lq import close_loop
from freqid.simulate.maneuver import Conditions, fly_maneuver, with_effects
from freqid.simulate.sensors import suite, with_scaled_noise

SCENARIO = read_scenario(Path(__file__).parents[3] / "scenarios" / "la8.toml")[0]
REFERENCE = SCENARIO.reference_of("u45")
EFFECTORS = {e.name for e in SCENARIO.effector}
STATES = {"u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "ax", "ay", "az", "alt"}


@pytest.fixture(scope="module")
def loop():
    return close_loop(SCENARIO, REFERENCE)


@pytest.fixture(scope="module")
def flown(loop):
    """Short flights by condition, each flown once."""
    found = {}

    def fly(**conditions):
        key = tuple(sorted(conditions.items()))
        if key not in found:
            found[key] = fly_maneuver(
                SCENARIO, REFERENCE, None, Conditions(**conditions), loop=loop, duration=4.5
            )
        return found[key]

    return fly


def groups(record):
    names: dict[str, set[str]] = {}
    for channel in record.channels:
        group, name = split(channel)
        names.setdefault(group, set()).add(name)
    return names


def test_the_record_has_the_channels_of_the_contract_and_no_others(flown):
    found = groups(flown().record)
    assert found["state"] == STATES
    assert found["air"] <= {"rho", "V", "alpha", "beta", "qbar"}
    assert found["effector"] == found["command"] == EFFECTORS
    assert found["power"] == {"voltage", "current"}
    assert set(found) == {"state", "air", "effector", "command", "power"}  # nothing was excited
    assert all(channel.unit for channel in flown().record.channels.values())


def test_the_record_knows_nothing_of_the_truth(flown):
    flight = flown(noise=1.0, sensors="owner")
    said = str(flight.record.provenance) + str(flight.record.configuration)
    for word in ("effect", "wind", "slipstream", "turbulence", "noise"):
        assert word not in said
    assert not {"response", "truth"} & set(groups(flight.record))
    assert "pdot" not in groups(flight.record)["state"]
    how = flight.truth.provenance["simulation"]
    assert how["effects"]["slipstream"] == {"strength": 1.0}
    assert np.linalg.norm(how["wind_m_s"]) > 3.0 - 1e-9


def test_sensors_without_noise_repeat_the_truth(flown):
    flight = flown()
    every = np.searchsorted(flight.truth.time, flight.record.time - 1e-9)
    for name in (*(f"state/{s}" for s in STATES - {"ax", "ay", "az"}), "power/voltage", "effector/n3"):
        expected = flight.truth[name][every]
        assert np.allclose(flight.record[name], expected, rtol=1e-9, atol=1e-9), name
    # the accelerometer is where it is: its lever arm stays
    offset, (p, q, r) = np.array([0.15, 0.0, 0.05]), flight.truth.matrix(("state/p", "state/q", "state/r"))
    turning = flight.truth.matrix(("state/pdot", "state/qdot", "state/rdot"))
    rates = np.stack([p, q, r])
    moved = np.cross(turning, offset, axis=0) + np.cross(rates, np.cross(rates, offset, axis=0), axis=0)
    for k, name in enumerate(("state/ax", "state/ay", "state/az")):
        assert np.allclose(flight.record[name], (flight.truth[name] + moved[k])[every], atol=1e-9)


def test_noise_scales_with_its_multiple(flown):
    still, once, twice = (flown(noise=noise).record for noise in (0.0, 1.0, 2.0))
    for name, sigma in (("state/q", 0.00175), ("state/az", 0.0981), ("effector/n1", 1.0)):
        error = once[name] - still[name]
        assert np.std(np.diff(error)) / np.sqrt(2) == pytest.approx(sigma, rel=0.2)
        # the same draws, larger; biases stay
        larger = twice[name] - still[name]
        bare = (larger - error) - np.mean(larger - error)
        assert np.allclose(bare, error - np.mean(error), atol=0.01 * sigma + 2e-3 * (name == "state/az"))


def test_a_suite_scaled_to_nothing_has_no_error_and_keeps_its_places():
    found = with_scaled_noise(suite(SCENARIO, "owner"), 0.0)
    assert {
        s.noise + s.bias + s.scale + s.latency_s + s.quantum + s.blind_below + s.upwash
        for s in found.values()
    } == {0}
    assert found["accelerometer"].position_m == (0.05, 0.02, 0.03)
    assert found["velocity"].senses == "ground"
    assert with_scaled_noise(suite(SCENARIO, "owner"), 1.0) == suite(SCENARIO, "owner")


def test_the_same_seed_repeats_the_record_and_another_changes_it(flown, loop):
    again = fly_maneuver(
        SCENARIO, REFERENCE, None, Conditions(noise=1.0, sensors="owner"), loop=loop, duration=4.5
    ).record
    first = flown(noise=1.0, sensors="owner").record
    other = flown(noise=1.0, sensors="owner", seed=1).record
    for name in first.channels:
        assert np.array_equal(first[name], again[name]), name
    assert np.abs(first["state/q"] - other["state/q"]).max() > 1e-3
    assert np.abs(first["state/vn"] - other["state/vn"]).max() > 0.5  # another wind: over the ground


def test_the_owner_sees_the_ground_and_no_slow_air(flown):
    flight = flown(sensors="owner")
    wind = np.asarray(flight.truth.provenance["simulation"]["wind_m_s"])
    assert 3.0 <= np.linalg.norm(wind) <= 6.0
    every = np.searchsorted(flight.truth.time, flight.record.time - 1e-9)
    over_ground = flight.record.matrix(("state/vn", "state/ve", "state/vd"))
    attitude = np.stack([flight.truth[f"state/{n}"][every] for n in ("phi", "theta", "psi")])
    through_air = np.stack([flight.truth[f"state/{n}"][every] for n in "uvw"])
    turned = np.array([attitude_matrix(*a) @ v for a, v in zip(attitude.T, through_air.T, strict=True)]).T
    assert np.allclose(over_ground - turned, wind[:, None], atol=1e-6)
    assert not {"u", "v", "w"} & groups(flight.record)["state"]
    assert not {"alpha", "beta"} & groups(flight.record)["air"]


def test_turbulence_is_an_effect_of_the_flight(loop):
    calm, gusty = (
        fly_maneuver(SCENARIO, REFERENCE, None, Conditions(turbulence=t), duration=4.5) for t in (0.0, 7.7)
    )
    assert gusty.truth.provenance["simulation"]["effects"]["turbulence"] == {"wind_20ft": 7.7}
    assert np.std(gusty.truth["state/w"]) > 10 * np.std(calm.truth["state/w"])


def test_effects_are_set_by_size_or_by_parameter():
    changed = with_effects(SCENARIO, {"slipstream": 0.5, "turbulence": {"wind_20ft": 3.0}})
    assert changed.simulation.effects == {"slipstream": {"strength": 0.5}, "turbulence": {"wind_20ft": 3.0}}
    # a later setting replaces an earlier one, and the scenario itself stays
    twice = with_effects(changed, {"slipstream": 0.0})
    assert twice.simulation.effects["slipstream"] == {"strength": 0.0}
    assert twice.simulation.effects["turbulence"] == {"wind_20ft": 3.0}
    assert SCENARIO.simulation.effects == {}


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"slipsteam": 0.5}, "effect 'slipsteam' is unknown.*slipstream"),
        ({"slipstream": {"size": 0.5}}, "effect 'slipstream' has no parameter 'size'.*strength"),
        ({"wing_wake": "much"}, "effect 'wing_wake': strength is 'much'"),
    ],
)
def test_unknown_effects_are_refused_with_names_that_are_known(settings, said):
    with pytest.raises(UsageError, match=said):
        with_effects(SCENARIO, settings)


def test_an_unknown_suite_is_refused_before_anything_is_flown():
    with pytest.raises(UsageError, match=r"no sensor suite 'reserch'.*research"):
        fly_maneuver(SCENARIO, REFERENCE, None, Conditions(sensors="reserch"), duration=1.0)


def test_turbulence_in_a_hover_without_wind_is_refused_in_words(loop):
    with pytest.raises(UsageError, match="turbulence needs an airspeed of at least 1 m/s"):
        fly_maneuver(SCENARIO, SCENARIO.reference[0], None, Conditions(turbulence=7.7), duration=1.0)
