"""``freqid check-simulation``: from words and files to findings, pictures of neither, and the exit code."""

from __future__ import annotations

import json

import numpy as np
import pytest

from freqid.core.record import Channel, FlightRecord, write_record
from freqid.core.vehicle import Inertia, MassProperties, Vehicle

VEHICLE = Vehicle(name="made", mass_properties=MassProperties(mass_kg=2.0, inertia=Inertia(xx=1, yy=1, zz=1)))
MODEL = """
def good(time, state, effector, air, parameters):
    return {"Z": -30.0 * state["w"] - 4.0 * state["q"] + 12.0 * effector["de"] - 19.6}

def reversed_elevator(time, state, effector, air, parameters):
    return {"Z": -30.0 * state["w"] - 4.0 * state["q"] - 12.0 * effector["de"] - 19.6}

def stick(time, state, effector, air, parameters):
    return {"q": 57.29578 * state["q"]}

def raising(time, state, effector, air, parameters):
    raise RuntimeError("no licence")
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A model file, a record of an aircraft with one response, and predictions of it."""
    there, rng, time = tmp_path_factory.mktemp("check"), np.random.default_rng(0), np.arange(1501) / 50
    values = {}
    for i, name in enumerate(("w", "q", "de")):
        lines = np.arange(2 + i, 45, 3)[:, None]
        phases = rng.uniform(0, 2 * np.pi, lines.shape)
        values[name] = 0.1 * np.sin(2 * np.pi * lines * time / 30 + phases).sum(axis=0)
    loads = -30 * values["w"] - 4 * values["q"] + 12 * values["de"] - 19.6
    signals = {
        "state/u": ("m/s", np.full(time.size, 15.0)),
        "state/v": ("m/s", np.zeros(time.size)),
        "state/w": ("m/s", values["w"]),
        "state/q": ("rad/s", values["q"]),
        "state/az": ("m/s2", loads / 2),
        "effector/de": ("rad", values["de"]),
    }
    channels = {n: Channel(n, unit, v, 50.0, "made") for n, (unit, v) in signals.items()}
    write_record(there / "flight.h5", FlightRecord(time, channels, VEHICLE))
    for name, factor in {"agrees": 1.0, "opposite": -1.0}.items():
        predicted = Channel("response/Z", "N", factor * loads, 50.0, "made")
        write_record(there / f"{name}.h5", FlightRecord(time, {"response/Z": predicted}))
    (there / "model.py").write_text(MODEL)
    return there


def test_a_simulation_without_mistakes_ends_well(freqid, folder):
    code, out, _ = freqid("check-simulation", folder / "flight.h5", "--sim", f"{folder}/model.py:good")
    assert code == 0
    assert "No mistake of bookkeeping was found." in out
    assert freqid("check-simulation", folder / "flight.h5", "--predictions", folder / "agrees.h5")[0] == 0


@pytest.mark.parametrize(
    ("sim", "fault", "subject"),
    [("reversed_elevator", "effector_sign", "de"), ("stick", "degrees", "q")],
)
def test_a_mistake_ends_with_the_code_of_a_gate_and_is_named(freqid, folder, sim, fault, subject):
    call = ("check-simulation", folder / "flight.h5", "--sim", f"{folder}/model.py:{sim}")
    code, out, err = freqid(*call, "--json")
    (finding,) = json.loads(out)["findings"]
    assert (code, finding["fault"], finding["subject"]) == (4, fault, subject)
    assert "1 mistake of bookkeeping" in err
    code, out, _ = freqid(*call)
    assert code == 4
    assert fault in out


def test_recorded_predictions_are_checked_too(freqid, folder):
    code, out, _ = freqid(
        "check-simulation", folder / "flight.h5", "--predictions", folder / "opposite.h5", "--json"
    )
    assert code == 4
    assert [f["fault"] for f in json.loads(out)["findings"]] == ["response_sign"]


def test_what_cannot_be_used_is_said_with_its_code(freqid, folder):
    flight = folder / "flight.h5"
    code, _, err = freqid("check-simulation", flight, "--sim", f"{folder}/model.py:raising")
    assert code == 3
    assert "RuntimeError: no licence (line 12 of model.py)" in err
    code, _, err = freqid("check-simulation", flight, "--sim", f"{folder}/model.py:godo")
    assert code == 2
    assert "did you mean 'good'" in err
    assert freqid("check-simulation", flight)[0] == 2
    assert freqid("check-simulation", folder / "absent.h5", "--sim", f"{folder}/model.py:good")[0] == 3
