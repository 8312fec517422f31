"""``freqid predict`` and ``freqid score`` as a user runs them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import h5py
import pytest

from freqid.core import store

PROJECT = Path(__file__).resolve().parents[2]
SCENARIO = PROJECT / "scenarios" / "linear.toml"


@pytest.fixture(scope="module")
def folder(linear_aircraft, tmp_path_factory):
    """A design, a model of another flight, and a flight of the design, all without a jax simulation."""
    import numpy as np

    import freqid as fq
    from freqid.core.results.design import Multisine, MultisineDesign

    folder = tmp_path_factory.mktemp("sealed")
    # the loads' section is left out: the law is [control.gains], and actuators follow at once
    text = SCENARIO.read_text()
    (folder / "scenario.toml").write_text(
        text[: text.index("# The same aircraft as a simulation")] + text[text.index("[noise]") :]
    )
    scenario = fq.read_scenario(folder / "scenario.toml")
    for seed, name in ((0, "first"), (1, "second")):
        table = linear_aircraft.fly(seed=seed, periods=2, period=30.0)
        table.to_csv(folder / f"{name}.csv", index=False, float_format="%.10g")
        flight = fq.read_log(
            folder / f"{name}.csv", PROJECT / "scenarios/maps/linear.toml", scenario=scenario, at="u20"
        )
        fq.save(flight, folder / f"{name}.h5")
    # what was injected, as a design: the examples' multisines start at the record's first sample
    rng = np.random.default_rng(1)
    signals = []
    harmonics = np.arange(2, 55)
    for i, (effector, amplitude) in enumerate(linear_aircraft.EFFECTORS.items()):
        own = harmonics[i::4]
        phase = rng.uniform(0, 2 * np.pi, own.size)
        unit = "rad/s" if effector == "n1" else "rad"
        signals.append(
            Multisine(effector, unit, own, np.full(own.size, amplitude * np.sqrt(2 / own.size)), phase)
        )
    design = MultisineDesign(tuple(signals), 30.0, 2, (2 / 30, 54 / 30), 0.02, 1)
    fq.save(design, folder / "design.h5")
    model = fq.identify_point(folder / "first.h5", scenario, estimator="least-squares")
    fq.save(model, folder / "point.h5")
    sealed = fq.predict_flight(folder / "point.h5", folder / "design.h5", scenario, draws=3)
    fq.save(sealed, folder / "prediction.h5")
    return folder


@pytest.fixture
def predicted(folder, tmp_path):
    return Path(shutil.copy(folder / "prediction.h5", tmp_path))


def test_a_prediction_says_what_it_is_of_and_what_it_assumes(folder, freqid, tmp_path):
    path = tmp_path / "prediction.h5"
    code, out, err = freqid(
        *("predict", folder / "point.h5", folder / "design.h5", "--scenario", folder / "scenario.toml"),
        *("--draws", 3, "-o", path, "--json"),
    )
    assert code == 0, err
    found = json.loads(out)
    assert len(found["checksum"]) == 64
    assert found["reference"]["id"] == "u20"
    assert found["model"]["file"].endswith("point.h5")
    assert len(found["model"]["sha256"]) == len(found["design"]["sha256"]) == 64
    assert {a["name"] for a in found["assumptions"]} >= {"trim", "density", "amplitude", "structure"}
    assert found["channels"]["q"]["std"]["noise"] == 0.0017
    assert "least squares" in err
    assert path.with_suffix(".html").read_text().count("<svg") >= 3


def test_a_flight_that_was_there_before_is_refused(predicted, folder, freqid):
    with h5py.File(predicted, "r") as file:
        date = file.attrs["date"]
    with store.editing(folder / "second.h5") as file:
        file.attrs["created"] = "2020-01-01T00:00:00+00:00"
    code, _, err = freqid("score", predicted, folder / "second.h5")
    assert code == 3
    assert f"before the prediction was sealed at {date}" in err
    assert err.count("\n") == 1


def test_a_flight_is_scored_and_the_gate_is_an_exit_code(predicted, folder, freqid):
    with store.editing(folder / "second.h5") as file:
        file.attrs["created"] = "2099-01-01T00:00:00+00:00"
    code, out, err = freqid("score", predicted, folder / "second.h5", "--gate", 0.2)
    assert code == 0, err
    assert "one-step M" in out
    assert "structure" in out
    assert (folder / "second-score.html").read_text().count("<svg") >= 3
    code, out, err = freqid("score", predicted, folder / "second.h5", "--gate", 1.0, "--json")
    assert code == 4
    found = json.loads(out)
    assert not found["passed"]
    assert found["channels"]["one-step/M"]["coverage"] > 0.9
    assert "the gate is 100 %" in err


def test_an_edited_prediction_and_a_foreign_record_are_refused(predicted, folder, freqid):
    for name in ("first.h5", "second.h5"):
        with store.editing(folder / name) as file:
            file.attrs["created"] = "2099-01-01T00:00:00+00:00"
    code, _, err = freqid("score", predicted, folder / "first.h5")
    assert code == 3
    assert "is no flight of the design" in err
    with store.editing(predicted) as file:
        file["channel/q/change"][3] += 1e-12
    code, _, err = freqid("score", predicted, folder / "second.h5")
    assert code == 3
    assert "was edited after it was sealed" in err


def test_bad_input_is_one_sentence(folder, freqid, tmp_path):
    scenario = ("--scenario", folder / "scenario.toml", "-o", tmp_path / "p.h5")
    code, _, err = freqid("predict", folder / "design.h5", folder / "design.h5", *scenario)
    assert code == 2
    assert "expected a point or a global model" in err
    code, _, err = freqid("predict", folder / "point.h5", folder / "first.h5", *scenario)
    assert code == 3
    assert "expected 'freqid-design'" in err
    code, _, err = freqid(
        "predict", folder / "point.h5", folder / "design.h5", *scenario, "--sensors", "best"
    )
    assert code == 2
    assert "no sensor suite 'best'" in err
