"""From a log in field units to the derivatives that flew it, through every step in between."""

from pathlib import Path

import numpy as np
import pytest

from freqid.core.record import Maneuver
from freqid.core.scenario import read_scenario
from freqid.core.toml import overridden
from freqid.flightlog.read import read_log
from freqid.identify.point import identify_point, predict_responses

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


@pytest.fixture(scope="module")
def scenario():
    return read_scenario(SCENARIOS / "linear.toml")[0]


@pytest.fixture(scope="module")
def flown(linear_logs, scenario):
    def read(name):
        record = read_log(linear_logs[name], SCENARIOS / "maps" / "linear.toml", vehicle=scenario.aircraft())
        return Maneuver.of(record)

    return {name: read(name) for name in linear_logs}


def true(linear_aircraft, response):
    return np.array([linear_aircraft.DERIVATIVES[response.response][n] for n in response.regressors])


def test_without_noise_every_derivative_is_found(linear_aircraft, scenario, flown):
    model = identify_point(flown["clean"], scenario.identification, excitation=scenario.excitation)
    for response in model.responses.values():
        np.testing.assert_allclose(response.estimate, true(linear_aircraft, response), rtol=2e-5)
        assert response.r2 > 1 - 1e-10


def test_with_noise_errors_are_what_the_model_says_they_are(linear_aircraft, scenario, flown):
    model = identify_point(flown["noisy"], scenario.identification, excitation=scenario.excitation)
    normalised = np.concatenate(
        [(r.estimate - true(linear_aircraft, r)) / r.std_error for r in model.responses.values()]
    )
    # 30 errors of unit variance have an rms of 0.74 to 1.27 (95 %); regressor noise adds some bias.
    assert 0.6 < np.sqrt(np.mean(normalised**2)) < 1.6


def test_the_bias_is_the_response_at_the_trim(scenario, flown):
    model = identify_point(flown["noisy"], scenario.identification, excitation=scenario.excitation)
    weight = 28.6 * 9.80665
    bias, error = model["Z"]["bias"]
    assert abs(bias + weight) < 0.01 * weight
    assert 0 < error < 0.01 * weight


def test_estimates_do_not_depend_on_trends_in_the_record(scenario, flown):
    """A drift in every channel, as of temperature, must not move them: the trend columns take it up."""
    from dataclasses import replace

    maneuver = flown["noisy"]
    time = maneuver.record.time
    drifted = {
        name: replace(c, values=c.values + np.std(c.values) * (3 + 5 * time / time[-1]))
        for name, c in maneuver.record.channels.items()
        if name.startswith(("effector/", "state/u", "state/v", "state/w"))
    }
    drifting = replace(
        maneuver, record=replace(maneuver.record, channels={**maneuver.record.channels, **drifted})
    )
    settings = overridden(scenario.identification, responses=("X", "Y", "Z"))
    plain = identify_point(maneuver, settings, excitation=scenario.excitation)
    bent = identify_point(drifting, settings, excitation=scenario.excitation)
    for name in settings.responses:
        np.testing.assert_allclose(bent[name].estimate, plain[name].estimate, rtol=1e-6, atol=1e-9)


def test_the_time_domain_agrees_where_there_is_no_noise(linear_aircraft, scenario, flown):
    settings = overridden(scenario.identification, method="time", responses=("X", "Y", "Z"))
    model = identify_point(flown["clean"], settings)
    for response in model.responses.values():
        expected = true(linear_aircraft, response)
        scale = np.abs(expected * np.std([flown["clean"].record[n] for n in paths(response)], axis=1))
        error = (response.estimate - expected) / expected * scale / scale.max()
        assert np.abs(error).max() < 0.01


def paths(response):
    states = set("uvwpqr")
    return [f"{'state' if n in states else 'effector'}/{n}" for n in response.regressors]


def test_a_flight_that_was_not_used_is_predicted(scenario, flown):
    model = identify_point(flown["noisy"], scenario.identification, excitation=scenario.excitation)
    for name, fit in predict_responses(model, flown["clean"], scenario.identification).items():
        assert fit.r2 > 0.98, name


def test_coefficients_are_forces_over_dynamic_pressure_and_size(scenario, flown):
    force = identify_point(flown["clean"], scenario.identification, excitation=scenario.excitation)
    settings = overridden(scenario.identification, form="coefficient", responses=("Y", "M"))
    coefficient = identify_point(flown["clean"], settings, excitation=scenario.excitation)
    qbar = 0.5 * 1.225 * np.mean(np.sum([flown["clean"].record[f"state/{n}"] ** 2 for n in "uvw"], axis=0))
    size = {"Y": 1.0, "M": 0.3}
    for name, row in (("Y", "dr"), ("M", "de")):
        expected = force[name][row][0] / (qbar * size[name])
        assert coefficient[name][row][0] == pytest.approx(expected, rel=0.05)
    with pytest.raises(Exception, match="area_m2"):
        identify_point(
            Maneuver.of(flown["clean"].record, overridden_area(flown["clean"].vehicle)),
            settings,
            excitation=scenario.excitation,
        )


def overridden_area(vehicle):
    import msgspec

    return msgspec.structs.replace(vehicle, area_m2=None)


def test_noise_outside_the_band_pulls_the_time_domain_towards_zero(linear_aircraft, scenario, flown):
    z_w = linear_aircraft.DERIVATIVES["Z"]["w"]
    settings = overridden(scenario.identification, responses=("Z",))
    in_frequency = identify_point(flown["noisy"], settings, excitation=scenario.excitation)["Z"]["w"][0]
    in_time = identify_point(flown["noisy"], overridden(settings, method="time"))["Z"]["w"][0]
    assert -0.08 < in_frequency / z_w - 1 < -0.02
    assert -0.45 < in_time / z_w - 1 < -0.35
