"""Several manoeuvres of unequal length in one fit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from freqid.core.record import Maneuver
from freqid.core.scenario import read_scenario
from freqid.core.toml import overridden
from freqid.flightlog.read import read_log
from freqid.identify.point import identify_point

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


@pytest.fixture(scope="module")
def scenario():
    return read_scenario(SCENARIOS / "linear.toml")[0]


@pytest.fixture(scope="module")
def flights(linear_logs, scenario):
    """The clean and the noisy flight; their excitations differ."""

    def read(name):
        log = read_log(linear_logs[name], SCENARIOS / "maps" / "linear.toml", vehicle=scenario.aircraft())
        return Maneuver.of(log)

    return {name: read(name) for name in linear_logs}


def cut(maneuver, start, stop):
    return replace(maneuver, record=maneuver.record.cut(start, stop))


def identified(maneuvers, scenario, estimator="least-squares", **changes):
    settings = overridden(scenario.identification, **changes)
    return identify_point(maneuvers, settings, excitation=scenario.excitation, estimator=estimator)


def true(linear_aircraft, response):
    return np.array([linear_aircraft.DERIVATIVES[response.response][n] for n in response.regressors])


@pytest.mark.parametrize("estimator", ["least-squares", "instruments"])
def test_without_noise_two_parts_of_unequal_length_find_every_derivative(
    linear_aircraft, scenario, flights, estimator
):
    parts = [cut(flights["clean"], 0.0, 36.0), cut(flights["clean"], 36.02, 60.0)]
    model = identified(parts, scenario, estimator)
    assert model.duration == pytest.approx(59.98)
    for response in model.responses.values():
        np.testing.assert_allclose(response.estimate, true(linear_aircraft, response), rtol=5e-5)
        assert response.r2 > 1 - 1e-9
        assert set(response.fit) == {"frequency", "time", "frequency 2", "time 2"}
        assert [response.fit[n].axis[-1] for n in ("time", "time 2")] == pytest.approx([36.0, 23.98])
        for fit in response.fit.values():
            assert fit.rms < 1e-3 * np.sqrt(np.mean(np.abs(fit.measured) ** 2))


def test_the_bias_is_that_of_both_and_the_trim_is_between(scenario, flights):
    """A flight with a weight on board: its constant goes to its own bias, not into the derivatives."""
    clean = flights["clean"]
    heavy = clean.record.channels["state/az"]
    loaded = replace(
        clean,
        record=clean.record.with_channels(replace(heavy, values=heavy.values - 0.5)),
    )
    for method in ("frequency", "time"):
        settings = {"method": method, "responses": ("Z",)}
        one = identified(clean, scenario, **settings)["Z"]
        two = identified([clean, loaded], scenario, **settings)["Z"]
        np.testing.assert_allclose(two.estimate, one.estimate, rtol=1e-6)
        assert two.bias == pytest.approx(one.bias - 0.25 * 28.6, rel=1e-9)
        np.testing.assert_allclose(two.trim, one.trim)


def test_time_domain_parts_are_one_regression_with_two_biases(scenario, flights):
    """Against numpy on the stacked samples."""
    parts = [cut(flights["noisy"], 0.0, 20.0), cut(flights["noisy"], 25.0, 60.0)]
    settings = {"method": "time", "responses": ("Z",), "residuals": "white"}
    response = identified(parts, scenario, **settings)["Z"]
    paths = [("state/" if n in "uwq" else "effector/") + n for n in response.regressors]
    x = np.concatenate([p.record.matrix(paths) for p in parts], axis=1)
    own = np.repeat(np.eye(2), [p.record.time.size for p in parts], axis=1)
    z = np.concatenate([response.fit["time"].measured, response.fit["time 2"].measured])
    found, square = np.linalg.lstsq(np.concatenate([x, own]).T, z)[:2]
    np.testing.assert_allclose(response.estimate, found[:5], rtol=1e-6)
    both = np.concatenate([x, own])
    covariance = square.item() / (z.size - 7) * np.linalg.inv(both @ both.T)
    np.testing.assert_allclose(response.std_error, np.sqrt(np.diag(covariance))[:5], rtol=1e-5)


def test_two_flights_are_worth_more_than_one(linear_aircraft, scenario, flights):
    """The same noise on two parts of 30 s makes the standard errors that it makes on 60 s."""
    whole = identified(flights["noisy"], scenario)
    parts = identified([cut(flights["noisy"], 0.0, 30.0), cut(flights["noisy"], 30.02, 60.0)], scenario)
    one = identified(cut(flights["noisy"], 0.0, 30.0), scenario)
    ratio, gain = [], []
    for name in whole.responses:
        ratio.append(parts[name].std_error / whole[name].std_error)
        gain.append(one[name].std_error / parts[name].std_error)
    assert 0.8 < np.median(ratio) < 1.25
    assert np.median(gain) > 1.2
    error = np.concatenate(
        [(r.estimate - true(linear_aircraft, r)) / r.std_error for r in parts.responses.values()]
    )
    assert 0.6 < np.sqrt(np.mean(error**2)) < 1.7
