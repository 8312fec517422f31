"""``freqid diagnose-gap`` on flights of a linear aircraft whose elevator has lost a part of its effect."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import msgspec
import pytest

from freqid.cli.main import run
from freqid.core.gap_file import read_gap
from freqid.core.record import Channel
from freqid.core.record_file import read_record, write_record
from freqid.simulate import effects

LOSS = 0.4
MODELS = """
import numpy as np
from linear_simulation import wrench

def good(time, state, effector, air, parameters):
    return wrench(time, state, effector, air, parameters)

def reversed_elevator(time, state, effector, air, parameters):
    # all that is wrong is the sign: the loss is known
    return wrench(time, state, {**effector, "de": 0.02 - 0.6 * (effector["de"] - 0.02)}, air, parameters)

def worn(time, state, effector, air, parameters):
    return wrench(time, state, {**effector, "de": 0.02 + 0.6 * (effector["de"] - 0.02)}, air, parameters)

def not_a_number(time, state, effector, air, parameters):
    return {"M": np.where(time - time[0] > 3, np.nan, 0.0)}

def diverging(time, state, effector, air, parameters):
    return {"M": np.exp(1e3 * (time - time[0]))}

def short(time, state, effector, air, parameters):
    return {"M": state["q"][:-1]}

def raising(time, state, effector, air, parameters):
    raise RuntimeError("no licence")

for f in (good, reversed_elevator, worn):
    f.responses = wrench.responses
"""
OWN = """
from freqid.simulate.effects.effect import Effect, Parameter

def feel(settings, signals, dt, kinds):
    return {n: (1 - settings["share"]) * x if n == "de" else x for n, x in signals.items()}

EFFECT = Effect(
    id="worn_linkage",
    stage="command",
    meaning="The elevator follows a part of its servo.",
    parameters={
        "share": Parameter(0.0, "1", "share that is lost", 0.3, -1.0, 1.0),
        "age": Parameter(1.0, "h", "age, which nothing shows", 0.5, 0.0, 100.0),
    },
    needs=("effector/de",),
    feel=feel,
)
"""


@pytest.fixture(scope="module")
def folder(fly_worn, tmp_path_factory):
    """Flights of the aircraft with the loss, models of it, and an effect of one's own."""
    there = tmp_path_factory.mktemp("gap")
    fly_worn(there, LOSS, (1, 2, 3))
    (there / "models.py").write_text(MODELS)
    (there / "own.py").write_text(OWN)
    record = read_record(there / "flight1.h5")
    quiet = {n: c for n, c in record.channels.items() if not n.startswith("excitation/")}
    write_record(there / "quiet.h5", replace(record, channels=quiet))
    bare = {n: c for n, c in record.channels.items() if n != "effector/dr"}
    named = msgspec.structs.replace(record.vehicle, name="another", effectors=record.vehicle.effectors[:2])
    write_record(there / "other.h5", replace(record, channels=bare, vehicle=named))
    shutil.copy(there / "flight1.h5", there / "copy.h5")
    return there


@pytest.fixture
def diagnose(freqid, folder, tmp_path):
    """Diagnose with a model of the folder; return exit code, stdout, stderr and the result's path."""

    def call(model, *words, records=("flight1", "flight2"), page=False):
        names = [folder / f"{n}.h5" for n in records]
        output = tmp_path / "gap.h5"
        more = [] if page else ["--no-page"]
        sim = ["--sim", f"{folder}/models.py:{model}"]
        return *freqid("diagnose-gap", *names, *sim, "--draws", "40", "-o", output, *more, *words), output

    return call


@pytest.fixture(scope="module")
def diagnosed(folder, tmp_path_factory):
    """One whole diagnosis with a held-out flight and a named effect: its folder."""
    there = tmp_path_factory.mktemp("diagnosed")
    words = f"diagnose-gap {folder}/flight1.h5 {folder}/flight2.h5 --holdout {folder}/flight3.h5 "
    words += f"--sim {folder}/models.py:good --effect surface_effectiveness --draws 60 -o {there}/gap.h5"
    with pytest.raises(SystemExit) as left:
        run(words.split())
    assert left.value.code == 0
    return there


def test_the_file_holds_what_the_contract_names(diagnosed):
    d = read_gap(diagnosed / "gap.h5").diagnosis
    table = d.to_json()
    assert set(table) >= {"gap", "where", "which", "how_far", "next_flight"}
    assert set(table["gap"]) >= {"exists", "p", "smallest_detectable"}
    assert set(table["where"][0]) >= {"response", "band_hz", "regime", "input", "phase", "share"}
    assert set(table["which"]) >= {
        "probabilities",
        "set",
        "aliases",
        "not_tested",
        "parameters",
        "calibrated",
    }
    for name in ("rmse", "theil", "J"):
        assert {"before", "after"} <= set(table["how_far"][name])
    for name in ("wrench", "response"):
        assert {"G", "lo", "hi"} <= set(table["how_far"][name])
    assert set(table["how_far"]["per_effect"]) == {"surface_effectiveness"}
    assert set(table["how_far"]["settings"]["surface_effectiveness"]["de"]) == {
        "estimate",
        "lo",
        "hi",
        "unit",
    }


def test_a_worn_elevator_is_found_where_it_is_and_closed(diagnosed):
    found = read_gap(diagnosed / "gap.h5")
    d = found.diagnosis
    assert d.gap.exists
    assert d.verdict.startswith("A gap beyond noise: ")
    assert sum(d.which.probabilities.values()) == pytest.approx(1.0)
    closure = d.how_far[0]
    assert closure.held_out == (d.records[2],)
    loss = closure.settings["surface_effectiveness"]["de"]
    assert loss.lo - 0.05 < LOSS < loss.hi + 0.05
    assert loss.estimate == pytest.approx(LOSS, abs=0.1)
    # M is where the elevator acts most: the error of the replay falls to that of noise, X has next to none
    assert closure.rmse["M"].after < 0.6 * closure.rmse["M"].before
    assert closure.J["M"].after < 0.5 * closure.J["M"].before
    assert closure.rmse["L"].after == pytest.approx(closure.rmse["L"].before)
    # a model that says nothing changes is off by the response's own rms
    assert closure.rmse["M"].zero > 2 * closure.rmse["M"].after


def test_the_derivative_that_changed_is_the_clearest(diagnosed):
    clear = [i for i in read_gap(diagnosed / "gap.h5").increments if i.clear]
    found = {(i.response, i.input): i for i in clear}
    assert found["M", "de"].lo < -100 * LOSS < found["M", "de"].hi
    assert found["Z", "de"].lo < -100 * LOSS < found["Z", "de"].hi
    assert found["M", "de"].hi - found["M", "de"].lo < 20


def test_the_page_is_whole_and_report_draws_it_again(diagnosed, freqid, tmp_path):
    page = (diagnosed / "gap.html").read_text()
    for heading in ("Where", "Which effect", "How far the gap shrinks", "Residual spectra", "Derivative inc"):
        assert f"<h2>{heading}" in page
    assert page.count("<svg") == 10
    assert "http://" not in page.replace("http://www.w3.org", "")
    code, out, _ = freqid("report", diagnosed / "gap.h5", "-o", tmp_path / "again.html")
    assert (code, out.strip()) == (0, str(tmp_path / "again.html"))
    assert (tmp_path / "again.html").read_text() == page


def test_the_terminal_gets_the_verdict_first_and_then_tables(diagnose):
    code, out, _, _ = diagnose("good", "--effect", "surface_effectiveness", records=("flight1",))
    assert code == 0
    first, _, rest = out.partition("\n")
    assert first.startswith("A gap beyond noise: ")
    for words in ("Where:", "Which", "not tested:", "G of the replayed residual", "RMSE", "remark:"):
        assert words in rest
    # with one manoeuvre there is none to hold out, which is said
    assert "scored on the manoeuvre that it was fitted to" in rest


def test_a_simulation_with_the_loss_has_no_gap(diagnose):
    code, out, _, _ = diagnose("worn", "--draws", "200", "--json", records=("flight2", "flight3"))
    table = json.loads(out)
    assert code == 0
    assert not table["gap"]["exists"]
    assert table["verdict"].startswith("No gap that can be resolved")
    assert table["how_far"] == {}
    likeliest, chance = next(iter(table["which"]["probabilities"].items()))
    assert likeliest == "none"
    assert chance >= 0.6


def test_a_self_test_calibrates_the_verdict_and_tells_what_is_seen(diagnose):
    code, out, _, path = diagnose("good", "--self-test", "--json", page=True)
    assert code == 0
    table = json.loads(out)
    assert "(calibrated by self-test)" in table["verdict"]
    assert table["which"]["calibrated"]
    assert table["which"]["calibrated_by"] == "self-test"
    assert next(iter(table["which"]["probabilities"])) == "surface_effectiveness"
    tested = table["self_test"]
    assert [s["detectability"] for s in tested["strata"]] == [15.0, 50.0, 200.0]
    elevator = next(r for r in tested["reach"] if r["parameter"] == "de")
    # half of it is lost, and seen at once; what is told as the smallest size is what was inserted
    assert 0.05 < elevator["size"] < 0.4
    assert table["gap"]["smallest_detectable"]["surface_effectiveness"] == elevator["size"]
    assert read_gap(path).diagnosis.self_test is not None
    assert "<h2>Self-test" in path.with_suffix(".html").read_text()


def test_bookkeeping_is_called_so_and_stops_the_diagnosis(diagnose):
    code, out, err, path = diagnose("reversed_elevator", "--json")
    table = json.loads(out)
    assert code == 4
    assert table["verdict"].startswith("Bookkeeping, not physics: ")
    assert table["bookkeeping"][0]["fault"] == "effector_sign"
    assert "no gap was diagnosed" in err
    assert not path.exists()


def test_bookkeeping_is_told_beside_a_diagnosis_that_goes_on_anyway(diagnose):
    code, out, _, path = diagnose("reversed_elevator", "--anyway", "--json", records=("flight1",))
    assert code == 0
    assert path.exists()
    assert any(remark.startswith("bookkeeping: ") for remark in json.loads(out)["remarks"])


def test_without_injected_signals_it_says_what_cannot_be_told(diagnose):
    code, out, _, path = diagnose("good", "--effect", "surface_effectiveness", "--json", records=("quiet",))
    table = json.loads(out)
    assert code == 0
    assert table["gap"]["exists"]
    assert any("no injected signals" in remark for remark in table["remarks"])
    assert {place["input"] for place in table["where"]} <= {""}
    assert table["how_far"]["J"]["before"] is None


def test_an_effect_of_ones_own_is_closed_and_what_data_do_not_tell_is_noted(diagnose, folder, monkeypatch):
    monkeypatch.setattr(effects, "_added", {})  # other tests know nothing of it
    words = ("--effects", folder / "own.py", "--effect", "worn_linkage", "--json")
    code, out, _, _ = diagnose("good", *words, page=True)
    table = json.loads(out)
    assert code == 0
    found = table["how_far"]["settings"]["worn_linkage"]
    assert found["share"]["lo"] - 0.05 < LOSS < found["share"]["hi"] + 0.05
    assert "worn_linkage age is not determined by these records" in table["how_far"]["note"]
    assert "took turns" in table["how_far"]["note"]


def test_pitch_rate_from_a_stick_is_enough_for_delay_and_lag(freqid, script, tmp_path):
    """A single response, no vehicle, no other channel: both effects together, at what they truly are."""
    example = script("examples/stick_to_pitch_rate.py")
    for seed in (1, 2):
        write_record(tmp_path / f"q{seed}.h5", example.fly(seed))
    words = [
        "--sim",
        f"{example.__file__}:pitch_rate",
        "--effect",
        "actuator_delay",
        "--effect",
        "actuator_lag",
    ]
    words += [
        "--holdout",
        tmp_path / "q2.h5",
        "--draws",
        "40",
        "--no-page",
        "--json",
        "-o",
        tmp_path / "g.h5",
    ]
    code, out, _ = freqid("diagnose-gap", tmp_path / "q1.h5", *words)
    how_far = json.loads(out)["how_far"]
    assert code == 0
    assert list(how_far["per_effect"]) == ["actuator_delay+actuator_lag", "actuator_delay", "actuator_lag"]
    delay, lag = (how_far["settings"][n]["extra"] for n in ("actuator_delay", "actuator_lag"))
    assert delay["lo"] < example.DELAY_S < delay["hi"]
    assert lag["lo"] < example.LAG_S < lag["hi"]
    assert how_far["wrench"]["G"] > 0.95
    assert how_far["wrench"]["G"] > how_far["per_effect"]["actuator_lag"]["wrench"]["G"] + 0.05
    # what is left is the noise of the gyro, in the band of the comparison
    assert how_far["rmse"]["by_response"]["q"]["after"] < example.NOISE
    assert how_far["J"]["after"] < 50


def test_recorded_predictions_do_for_a_simulation(freqid, folder, script, tmp_path):
    model = script("examples/linear_simulation.py").wrench
    words = []
    for name in ("flight2", "flight3"):
        record = read_record(folder / f"{name}.h5")
        state, effector = ({n: record[f"{g}/{n}"] for n in record.group(g)} for g in ("state", "effector"))
        loads = {f"response/{n}": x for n, x in model(record.time, state, effector, {}, {}).items()}
        known = {n: c for n, c in record.channels.items() if n.startswith("excitation/")}
        made = {n: Channel(n, "N" if n[-1] in "XYZ" else "N m", x, 50.0, "SITL") for n, x in loads.items()}
        write_record(tmp_path / f"{name}.h5", replace(record, channels={**made, **known}))
        words += ["--predictions", tmp_path / f"{name}.h5"]
    records = [folder / "flight2.h5", folder / "flight3.h5"]
    code, out, err = freqid(
        "diagnose-gap", *records, *words, "--draws", "40", "--no-page", "--json", "-o", tmp_path / "g.h5"
    )
    assert code == 0, err
    table = json.loads(out)
    assert table["gap"]["exists"]
    assert table["where"][0]["response"] == "M"
    assert "de" in table["where"][0]["input"].split()
    assert next(iter(table["which"]["probabilities"])) == "surface_effectiveness"


@pytest.mark.parametrize(
    ("model", "code", "sentence"),
    [
        ("not_a_number", 3, "is not finite in"),
        ("diverging", 3, "is not finite in"),
        ("short", 3, "has shape"),
        ("raising", 3, "RuntimeError: no licence"),
        ("godo", 2, "did you mean 'good'"),
    ],
)
def test_what_a_simulation_does_wrong_is_said(diagnose, model, code, sentence):
    got, _, err, path = diagnose(model)
    assert (got, sentence in err) == (code, True), err
    assert err.count("\n") == 1
    assert not path.exists()


@pytest.mark.parametrize(
    ("words", "records", "code", "sentence"),
    [
        ((), ("flight1", "flight1"), 2, "is given twice"),
        ((), ("flight1", "copy"), 2, "holds the same flight as"),
        (("--holdout", "flight1.h5"), ("flight1",), 2, "is both used and held out"),
        (("--holdout", "copy.h5"), ("flight1",), 2, "holds the same flight as"),
        (("--effect", "surface_effectivness"), ("flight1",), 2, "did you mean 'surface_effectiveness'"),
        (("--effect", "wing_wake"), ("flight1",), 2, "cannot be tested here: needs wing"),
        (("--band", "2:1"), ("flight1",), 2, "--band is LOW:HIGH"),
        ((), ("flight1", "other"), 3, "whose effectors are not those of 'Linear aircraft'"),
        ((), ("absent",), 3, "no such file"),
        ((), ("models",), 3, "no such file"),
    ],
)
def test_what_is_asked_wrongly_is_said(diagnose, folder, monkeypatch, words, records, code, sentence):
    monkeypatch.chdir(folder)
    got, _, err, _ = diagnose("good", *words, records=records)
    assert (got, sentence in err) == (code, True), err


def test_a_file_that_is_no_record_is_refused(diagnose, folder):
    (folder / "broken.h5").write_bytes(b"not a record")
    code, _, err, _ = diagnose("good", records=("broken",))
    assert code == 3
    assert "broken.h5: is no readable HDF5 file" in err


def test_a_simulation_of_another_vehicle_is_refused(freqid, folder, tmp_path):
    code, _, err = freqid(
        "diagnose-gap", folder / "flight1.h5", "--scenario", "scenarios/la8.toml", "-o", tmp_path / "g.h5"
    )
    assert code == 3
    assert "of vehicle" in err
    assert "give the simulation of the vehicle that flew" in err
