"""Instruments on flights of known derivatives: unbiased where least squares is not, and honest about it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.core.record import Channel, Maneuver
from freqid.core.scenario import read_scenario
from freqid.core.toml import overridden
from freqid.flightlog.read import read_log
from freqid.identify.point import identify_point

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
SEEDS = 60
# One sigma of a sample, three times research quality.
NOISE = {"u": 0.45, "v": 0.45, "w": 0.45, "p": 0.0052, "q": 0.0052, "r": 0.0052, "ax": 0.29, "ay": 0.29}
NOISE |= {"az": 0.29, "de": 0.0026, "da": 0.0026, "dr": 0.0026, "n1": 2.5}


@pytest.fixture(scope="module")
def scenario():
    return read_scenario(SCENARIOS / "linear.toml")[0]


@pytest.fixture(scope="module")
def clean(linear_logs, scenario):
    log = read_log(linear_logs["clean"], SCENARIOS / "maps" / "linear.toml", vehicle=scenario.aircraft())
    return Maneuver.of(log)


def noisy(maneuver, seed):
    rng = np.random.default_rng(seed)
    channels = {}
    for name, channel in maneuver.record.channels.items():
        group, _, short = name.partition("/")
        sigma = NOISE.get(short, 0.0) if group in ("state", "effector") else 0.0
        values = channel.values + sigma * rng.standard_normal(channel.values.size)
        channels[name] = replace(channel, values=values)
    return replace(maneuver, record=replace(maneuver.record, channels=channels))


def with_channels(maneuver, *channels):
    return replace(maneuver, record=maneuver.record.with_channels(*channels))


def identified(maneuver, scenario, **changes):
    estimator = changes.pop("estimator", "instruments")
    settings = overridden(scenario.identification, **changes)
    return identify_point(maneuver, settings, excitation=scenario.excitation, estimator=estimator)


def true(linear_aircraft, response):
    return np.array([linear_aircraft.DERIVATIVES[response.response][n] for n in response.regressors])


@pytest.fixture(scope="module")
def flights(clean, scenario):
    return [identified(noisy(clean, seed), scenario) for seed in range(SEEDS)]


def errors(linear_aircraft, flights, beside):
    """Return normalised errors, shape (flight, parameter of all responses)."""
    rows = []
    for model in flights:
        one = []
        for r in model.responses.values():
            found = r.errors_in_variables if beside else r
            one.append((found.estimate - true(linear_aircraft, r)) / found.std_error)
        rows.append(np.concatenate(one))
    return np.array(rows)


def test_without_noise_every_derivative_is_found(linear_aircraft, clean, scenario):
    for response in identified(clean, scenario).responses.values():
        np.testing.assert_allclose(response.estimate, true(linear_aircraft, response), rtol=2e-5)


def test_the_mean_error_is_none(linear_aircraft, flights):
    """Of 60 flights the mean of a normalised error has a standard deviation of 0.13."""
    instruments = errors(linear_aircraft, flights, beside=False).mean(axis=0)
    plain = errors(linear_aircraft, flights, beside=True).mean(axis=0)
    assert np.sqrt(np.mean(plain**2)) > 2.5
    assert np.sqrt(np.mean(instruments**2)) < 0.22
    assert np.abs(instruments).max() < 0.6


def test_errors_are_what_they_are_said_to_be(linear_aircraft, flights):
    found = errors(linear_aircraft, flights, beside=False)
    assert 0.93 < np.sqrt(np.mean(found**2)) < 1.07
    assert 0.92 < np.mean(np.abs(found) < 2.0) < 0.975


def test_the_two_estimates_are_said_to_differ_where_they_do(linear_aircraft, flights):
    """Z and M hang on w, whose noise is as large as its motion; the thrust of n1 is measured well."""
    often = {
        (r, n): np.mean([n in model[r].differing for model in flights])
        for r in ("X", "Z", "M")
        for n in ("w", "n1")
    }
    assert often["Z", "w"] > 0.95
    assert often["M", "w"] > 0.95
    assert flights[0].estimator == "instruments"


def test_the_time_domain_has_instruments_too(linear_aircraft, clean, scenario):
    """There least squares loses nearly half of Z_w; the noise of all frequencies is in its regressors."""
    z_w = linear_aircraft.DERIVATIVES["Z"]["w"]
    found = [
        identified(noisy(clean, seed), scenario, method="time", responses=("Z",))["Z"] for seed in range(6)
    ]
    j = found[0].regressors.index("w")
    plain = np.mean([r.errors_in_variables.estimate[j] for r in found])
    assert plain / z_w < 0.3
    scatter = np.mean([r.std_error[j] for r in found]) / np.sqrt(len(found))
    assert abs(np.mean([r.estimate[j] for r in found]) - z_w) < 3 * scatter
    assert scatter < 0.05 * abs(z_w)


def test_air_data_and_coefficients_have_instruments_as_well(clean, scenario):
    """In alpha and V, as coefficients, against the noise-free fit of the same flight."""
    regressors = {"Y": ("beta", "phat", "rhat", "da", "dr"), "Z": ("V", "alpha", "qhat", "de", "n1")}
    changes = {"regressors": regressors, "responses": ("Y", "Z"), "form": "coefficient"}
    reference = identified(clean, scenario, estimator="least-squares", **changes)
    found = [identified(noisy(clean, seed), scenario, **changes) for seed in range(12)]
    for name in ("Y", "Z"):
        error = [(m[name].estimate - reference[name].estimate) / m[name].std_error for m in found]
        beside = [m[name].errors_in_variables for m in found]
        plain = [(b.estimate - reference[name].estimate) / b.std_error for b in beside]
        assert np.abs(np.mean(error, axis=0)).max() < 1.2  # standard deviation 0.29
        assert np.abs(np.mean(plain, axis=0)).max() > 2.0


def test_a_longitudinal_flight_needs_no_lateral_excitation(linear_aircraft, clean, scenario):
    """The lateral channels hold noise alone, which the loop must not take for motion."""
    record = clean.record
    still = [
        replace(c, values=np.full_like(c.values, c.values.mean()))
        for n, c in record.channels.items()
        if n in ("state/v", "state/p", "state/r", "state/phi", "effector/da", "effector/dr")
        or n in ("excitation/da", "excitation/dr")
    ]
    settings = {"responses": ("Z", "M")}
    flight = noisy(with_channels(clean, *still), 3)
    model = identified(flight, scenario, **settings)
    for response in model.responses.values():
        error = (response.estimate - true(linear_aircraft, response)) / response.std_error
        assert np.abs(error).max() < 4.5
        assert "w" in response.differing


def test_an_effector_that_no_signal_moves_is_refused_by_name(clean, scenario):
    rest = clean.record["effector/n1"].mean()
    channels = clean.record.channels
    resting = with_channels(
        clean,
        replace(channels["effector/n1"], values=np.full(clean.record.time.size, rest)),
        replace(channels["excitation/n1"], values=np.zeros(clean.record.time.size)),
    )
    with pytest.raises(DataError, match=r"hardly move 'n1' \(first-stage F"):
        identified(noisy(resting, 1), scenario, responses=("X", "Z", "M"))


def test_a_regressor_that_the_loop_does_not_know_is_refused_by_name(clean, scenario):
    gusty = 1.2 + 0.01 * np.random.default_rng(0).standard_normal(clean.record.time.size)
    flight = with_channels(clean, Channel("air/rho", "kg/m3", gusty, 50.0, "test"))
    with pytest.raises(DataError, match="hardly move 'rho'"):
        identified(flight, scenario, regressors={"Z": ("u", "w", "q", "de", "n1", "rho")}, responses=("Z",))


def test_without_injected_signals_there_are_no_instruments(clean, scenario):
    channels = {n: c for n, c in clean.record.channels.items() if not n.startswith("excitation/")}
    bare = replace(clean, record=replace(clean.record, channels=channels))
    with pytest.raises(UsageError, match="the record holds none in excitation/"):
        identified(bare, scenario)


def test_few_lines_are_too_few_for_a_control_law(clean, scenario):
    with pytest.raises(DataError, match="20 lines are too few to model the control law"):
        identified(clean, scenario, frequencies_hz=tuple((np.arange(3, 23) / 60).tolist()))
