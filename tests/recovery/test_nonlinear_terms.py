"""Structure on flights of known terms: products that flew are found and unbiased, others stay out."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from freqid.cli.main import run
from freqid.core.record import Maneuver, write_record
from freqid.core.scenario import read_scenario
from freqid.core.toml import overridden
from freqid.flightlog.read import read_log
from freqid.identify.point import identify_point, predict_responses

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
SCENARIO = SCENARIOS / "linear.toml"
# One sigma of a sample, research quality.
NOISE = {"u": 0.15, "v": 0.15, "w": 0.15, "p": 0.00175, "q": 0.00175, "r": 0.00175, "ax": 0.098}
NOISE |= {"ay": 0.098, "az": 0.098, "de": 0.00087, "da": 0.00087, "dr": 0.00087, "n1": 0.84}
PRODUCTS = {"X": ("n1*n1", 0.005), "M": ("w*de", -60.0)}
ALL = ("u", "w", "q", "v", "p", "r", "de", "da", "dr", "n1")


@pytest.fixture(scope="module")
def scenario():
    return read_scenario(SCENARIO)[0]


@pytest.fixture(scope="module")
def flights(linear_aircraft, scenario, tmp_path_factory):
    """Two periods at 25 Hz without noise: of the linear aircraft, and two of one that is bent."""
    linear = linear_aircraft.wrench

    def bent(state, effectors, derivatives):
        applied, change = linear(state, effectors, derivatives), effectors["n1"] - linear_aircraft.TRIM["n1"]
        applied[0] += PRODUCTS["X"][1] * change**2
        applied[4] += PRODUCTS["M"][1] * state[2] * (effectors["de"] - linear_aircraft.TRIM["de"])
        return applied

    folder, found = tmp_path_factory.mktemp("bent"), {}
    with pytest.MonkeyPatch.context() as patch:
        for name, wrench, seed in (("linear", linear, 3), ("bent", bent, 3), ("other", bent, 4)):
            patch.setattr(linear_aircraft, "wrench", wrench)
            linear_aircraft.fly(seed, noise=0.0, periods=2, dt=0.04, inner_steps=1).to_csv(
                folder / f"{name}.csv", index=False
            )
            log = read_log(
                folder / f"{name}.csv", SCENARIOS / "maps" / "linear.toml", vehicle=scenario.aircraft()
            )
            found[name] = Maneuver.of(log)
    return found


def noisy(maneuver, seed, scale=1.0):
    rng = np.random.default_rng(seed)
    channels = {}
    for name, channel in maneuver.record.channels.items():
        group, _, short = name.partition("/")
        sigma = scale * NOISE.get(short, 0.0) if group in ("state", "effector") else 0.0
        channels[name] = replace(
            channel, values=channel.values + sigma * rng.standard_normal(channel.values.size)
        )
    return replace(maneuver, record=replace(maneuver.record, channels=channels))


def identified(maneuver, scenario, estimator, **changes):
    settings = overridden(scenario.identification, residuals="noise-lines", **changes)
    return identify_point(maneuver, settings, excitation=scenario.excitation, estimator=estimator), settings


@pytest.mark.parametrize("estimator", ["least-squares", "instruments"])
def test_products_that_flew_are_found_and_no_others(flights, scenario, estimator):
    model, settings = identified(noisy(flights["bent"], 0), scenario, estimator, nonlinear="products")
    plain, _ = identified(noisy(flights["bent"], 0), scenario, estimator)
    found = {r: tuple(account["products"]) for r, account in model.provenance["structure"].items()}
    assert found == {"X": ("n1*n1",), "M": ("w*de",), "Y": (), "Z": (), "L": (), "N": ()}
    other = noisy(flights["other"], 1)
    with_products, without = (
        predict_responses(model, other, settings),
        predict_responses(plain, other, settings),
    )
    for response, (name, truth) in PRODUCTS.items():
        estimate, error = model[response][name]
        assert abs(estimate - truth) < 3.5 * error
        assert plain[response].distortion > 2.5
        assert model[response].distortion < 1.5
        assert with_products[response].rms < 0.8 * without[response].rms


def test_without_noise_products_are_what_flew(flights, scenario):
    """To the accuracy of the flight itself, which is integrated in steps of 0.04 s."""
    model, _ = identified(flights["bent"], scenario, "least-squares", nonlinear="products")
    for response, (name, truth) in PRODUCTS.items():
        assert model[response][name][0] == pytest.approx(truth, rel=3e-4)
    assert not any(model.provenance["structure"][r]["products"] for r in ("Y", "Z", "L", "N"))


@pytest.mark.parametrize("estimator", ["least-squares", "instruments"])
def test_a_linear_aircraft_gets_no_products(flights, scenario, estimator, monkeypatch):
    """All products are tried, whatever the distortion; more than 1 of 20 flights would be a fault."""
    monkeypatch.setattr("freqid.identify.model.selection.DISTORTED", 0.0)
    entered = 0
    for seed in range(20):
        model, _ = identified(noisy(flights["linear"], seed), scenario, estimator, nonlinear="products")
        entered += any(one["products"] for one in model.provenance["structure"].values())
    assert entered <= 1


@pytest.mark.parametrize("estimator", ["least-squares", "instruments"])
def test_regressors_that_do_nothing_are_left_out(flights, scenario, estimator):
    """Of ten regressors five do nothing to each response: 180 of them, and each stays by chance in 0.2 %."""
    true = {r: set(names) for r, names in _given(scenario).items()}
    strong = {"X": {"n1", "u"}, "Y": {"v", "dr"}, "Z": {"u", "w"}, "L": {"p", "da"}, "M": {"w", "de"}}
    useless = 0
    for seed in range(6):
        changes = {"structure": "stepwise", "regressors": ALL}
        model, _ = identified(noisy(flights["linear"], seed), scenario, estimator, **changes)
        kept = {name: set(response.regressors) for name, response in model.responses.items()}
        useless += sum(len(kept[r] - true[r]) for r in true)
        assert all(strong[r] <= kept[r] for r in strong)
    assert useless <= 4


def test_instruments_leave_no_bias_in_a_product_where_least_squares_does(flights, scenario):
    """Three times the noise; the mean of 30 normalised errors has a standard deviation of 0.18."""
    regressors = {r: (*n, *([PRODUCTS[r][0]] if r in PRODUCTS else [])) for r, n in _given(scenario).items()}
    errors, plain = [], []
    for seed in range(30):
        flight = noisy(flights["bent"], seed, scale=3.0)
        model, _ = identified(flight, scenario, "instruments", regressors=regressors, responses=("X", "M"))
        for errors_of, source in ((errors, None), (plain, "errors_in_variables")):
            row = []
            for response, (name, truth) in PRODUCTS.items():
                one, j = model[response], model[response].regressors.index(name)
                values = one if source is None else getattr(one, source)
                row.append((values.estimate[j] - truth) / values.std_error[j])
            errors_of.append(row)
    assert np.abs(np.mean(errors, axis=0)).max() < 0.55
    assert np.all(np.abs(np.std(errors, axis=0) - 1) < 0.35)
    assert np.mean(plain, axis=0)[1] > 1.2  # w*de shrinks with the noise in w


def _given(scenario):
    return {r: tuple(n) for r, n in scenario.identification.regressors.items()}


def test_the_command_says_what_it_chose(flights, tmp_path, capsys):
    record, point = tmp_path / "flight.h5", tmp_path / "point.h5"
    write_record(record, noisy(flights["bent"], 0).record)
    scenario = tmp_path / "scenario.toml"
    text = SCENARIO.read_text().replace("[identification]", '[identification]\nresiduals = "noise-lines"')
    scenario.write_text(text)
    options = ["--scenario", scenario, "--regressors", ",".join(ALL), "--select", "--nonlinear", "products"]
    asked = ["identify-point", record, *options, "--responses", "X,M", "-o", point]
    with pytest.raises(SystemExit) as left:
        run([str(a) for a in asked])
    table = capsys.readouterr().out
    assert left.value.code == 0
    assert "added n1*n1 (F " in table
    assert "left out, F below 10: " in table
    assert "N/(rad/s rad/s)" in table
    with pytest.raises(SystemExit):
        run([str(a) for a in (*asked, "--json")])
    said = json.loads(capsys.readouterr().out)
    assert set(said["structure"]["X"]["left_out"]) >= {"v", "p", "r", "da", "dr"}
    assert set(said["structure"]["X"]["kept"]) < set(said["responses"]["X"]["parameters"])
    assert said["structure"]["M"]["products"].keys() == {"w*de"}
