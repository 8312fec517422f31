"""``freqid diagnose-gap`` on flights of a linear aircraft whose elevator has lost a part of its effect."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from freqid.cli.main import run
from freqid.core.record import Channel, read_record, write_record
from freqid.core.results.gap import read_gap
from freqid.simulate import effects
from freqid.simulate.effects import library
from freqid.workflows import diagnose as diagnosing

LOSS = 0.5
FEW = ("surface_effectiveness", "mass", "time_skew")
MODELS = """
import numpy as np
from linear_simulation import wrench

def good(time, state, effector, air, parameters):
    return wrench(time, state, effector, air, parameters)

def reversed_elevator(time, state, effector, air, parameters):
    # all that is wrong is the sign: the loss is known
    return wrench(time, state, {**effector, "de": 0.02 - 0.5 * (effector["de"] - 0.02)}, air, parameters)

def not_a_number(time, state, effector, air, parameters):
    return {"M": np.where(time - time[0] > 3, np.nan, 0.0)}

def diverging(time, state, effector, air, parameters):
    return {"M": np.exp(1e3 * (time - time[0]))}

def short(time, state, effector, air, parameters):
    return {"M": state["q"][:-1]}

def constant(time, state, effector, air, parameters):
    return {"M": 0.0 * time}

def half_constant(time, state, effector, air, parameters):
    return {"M": 0.0 * time, "L": 45.0 * effector["da"]}

def raising(time, state, effector, air, parameters):
    raise RuntimeError("no licence")

def flown_away(time, state, effector, air, parameters):
    return wrench(time, state, effector, air, parameters)

def declared(time, state, effector, air, parameters):
    return wrench(time, state, effector, air, parameters)

flown_away.fly = lambda record, parameters: {"q": np.exp(record.time - record.time[0])}
declared.tolerances = {"lift_slope": (0.3, "1/rad")}
for f in (good, reversed_elevator, flown_away, declared):
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
    parameters={"share": Parameter(0.0, "1", "share that is lost", 0.3, -1.0, 1.0)},
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
    few = {n: replace(c, values=c.values[:6]) for n, c in record.channels.items()}
    write_record(there / "few.h5", replace(record, time=record.time[:6], channels=few))
    still = {n: replace(c, values=np.full_like(c.values, c.values[0])) for n, c in record.channels.items()}
    write_record(there / "still.h5", replace(record, channels=still))
    shutil.copy(there / "flight1.h5", there / "copy.h5")
    return there


@pytest.fixture
def few_effects(monkeypatch):
    """Ask about three effects alone, so that a diagnosis takes a second."""
    every = library()
    monkeypatch.setattr(diagnosing, "effects_with", lambda own: {n: every[n] for n in FEW})


@pytest.fixture
def diagnose(freqid, folder, tmp_path):
    """Diagnose with a model of the folder; return exit code, stdout, stderr and the result's path."""

    def call(model, *words, records=("flight1", "flight2"), page=False):
        names = [folder / f"{n}.h5" for n in records]
        output = tmp_path / "gap.h5"
        more = [] if page else ["--no-page"]
        sim = ["--sim", f"{folder}/models.py:{model}"]
        return *freqid("diagnose-gap", *names, *sim, "-o", output, *more, *words), output

    return call


@pytest.fixture(scope="module")
def diagnosed(fly_worn, tmp_path_factory):
    """The example of docs/gap-diagnosis.md: all effects, a held-out flight; its folder."""
    there = tmp_path_factory.mktemp("diagnosed")
    fly_worn(there, LOSS, (1, 2, 3), period=60.0)
    words = f"diagnose-gap {there}/flight1.h5 {there}/flight2.h5 --holdout {there}/flight3.h5 "
    words += f"--sim {there}/linear_simulation.py:wrench --scenario scenarios/linear.toml -o {there}/gap.h5"
    with pytest.raises(SystemExit) as left:
        run(words.split())
    assert left.value.code == 0
    return there


def test_the_file_holds_what_the_contract_names(diagnosed):
    table = read_gap(diagnosed / "gap.h5").diagnosis.to_json()
    assert set(table) >= {"gap", "where", "which", "how_far", "next_flight", "sensors", "tolerances"}
    assert set(table["gap"]) >= {"exists", "p", "smallest_detectable", "largest_undetected", "form_errors"}
    assert set(table["where"][0]) >= {"response", "band_hz", "regime", "input", "phase", "share"}
    keys = {
        "probabilities",
        "set",
        "aliases",
        "not_tested",
        "parameters",
        "calibrated",
        "withdrawn",
        "groups",
    }
    assert set(table["which"]) >= keys
    for name in ("rmse", "theil", "J"):
        assert {"before", "after"} <= set(table["how_far"][name])
    for name in ("wrench", "effect_only", "tolerances_only"):
        assert {"G", "lo", "hi"} <= set(table["how_far"][name])
        assert table["how_far"][name]["G"] <= 1
    assert set(table["how_far"]["per_effect"]) == {"surface_effectiveness"}


def test_a_worn_elevator_is_named_with_its_size_and_closed(diagnosed):
    result = read_gap(diagnosed / "gap.h5")
    d = result.diagnosis
    assert d.gap.exists
    assert d.which.named == ("surface_effectiveness",)
    assert d.which.places["surface_effectiveness"] == "de"
    assert not d.which.withdrawn
    assert d.which.calibrated  # a function is asked as all simulations are
    assert "Your simulation: surface_effectiveness of de 0.5" in d.verdict
    assert sum(d.which.probabilities.values()) == pytest.approx(1.0)
    assert d.where[0].response == "M"
    assert "de" in d.where[0].input.split()
    closure = d.how_far[0]
    assert closure.held_out == (d.records[2],)
    loss = closure.settings["surface_effectiveness"]["de"]
    assert loss.lo < LOSS < loss.hi
    assert loss.estimate == pytest.approx(LOSS, abs=0.05)
    assert 0.9 < closure.wrench.G <= 1
    # tolerances alone can take it, but only by being off by far more than anybody states
    assert max(map(abs, closure.strained.values())) > 5
    assert "derivatives.M.de" in d.verdict
    # M is where the elevator acts most: the error of the replay falls to that of noise
    assert closure.rmse["M"].after < 0.5 * closure.rmse["M"].before
    assert closure.rmse["L"].after == pytest.approx(closure.rmse["L"].before, rel=0.02)
    assert closure.rmse["M"].zero > 2 * closure.rmse["M"].after
    assert {t.name: t.source for t in d.tolerances}["derivatives"] == "default"


def test_the_derivatives_that_changed_are_the_clearest(diagnosed):
    clear = {(i.response, i.input): i for i in read_gap(diagnosed / "gap.h5").increments if i.clear}
    for moved in (("M", "de"), ("Z", "de")):
        assert clear[moved].lo < -100 * LOSS < clear[moved].hi
    assert clear["M", "de"].hi - clear["M", "de"].lo < 20


def test_what_is_drawn_lies_on_what_was_measured(diagnosed):
    result = read_gap(diagnosed / "gap.h5")
    (one,) = result.before_after
    assert one.held_out
    i = one.responses.index("M")
    left = [(one.measured[i] - x[i]).std() for x in (one.before, one.after)]
    assert left[1] < 0.5 * left[0]
    assert [s.maneuver for s in result.spectra] == list(result.diagnosis.records[:2])


def test_the_page_is_whole_and_report_draws_it_again(diagnosed, freqid, tmp_path):
    page = (diagnosed / "gap.html").read_text()
    parts = "What counts as no gap", "Where", "Which effect", "How far the gap shrinks", "Residual spectra"
    for heading in (*parts, "Derivative inc"):
        assert f"<h2>{heading}" in page
    assert page.count("<svg") == 10
    assert "http://" not in page.replace("http://www.w3.org", "")
    code, out, _ = freqid("report", diagnosed / "gap.h5", "-o", tmp_path / "again.html")
    assert (code, out.strip()) == (0, str(tmp_path / "again.html"))
    assert (tmp_path / "again.html").read_text() == page


@pytest.fixture(scope="module")
def sound(fly_worn, tmp_path_factory):
    """Flights of the aircraft as it is simulated."""
    there = tmp_path_factory.mktemp("sound")
    fly_worn(there, 0.0, (1, 2, 3), period=60.0)
    return there


def test_an_aircraft_as_it_is_simulated_has_no_gap_and_no_name(sound, freqid, tmp_path):
    records = [sound / f"flight{i}.h5" for i in (1, 2)]
    words = ("--sim", f"{sound}/linear_simulation.py:wrench", "--holdout", sound / "flight3.h5")
    words += ("--scenario", "scenarios/linear.toml", "-o", tmp_path / "gap.h5", "--no-page", "--json")
    code, out, err = freqid("diagnose-gap", *records, *words)
    assert code == 0, err
    table = json.loads(out)
    assert table["verdict"].startswith("No gap beyond noise and tolerances")
    assert "no gap larger than surface_effectiveness 0." in table["verdict"]
    assert not table["gap"]["exists"]
    assert table["which"]["named"] == []
    assert table["how_far"] == {}
    assert next(iter(table["which"]["probabilities"])) == "none"
    assert 0.05 < table["gap"]["largest_undetected"]["surface_effectiveness"] < 0.4


@pytest.mark.usefixtures("few_effects")
def test_the_terminal_gets_the_verdict_first_and_then_tables(diagnose):
    code, out, _, _ = diagnose("good", records=("flight1",))
    assert code == 0
    first, _, rest = out.partition("\n")
    assert first.startswith("A gap beyond noise and tolerances")
    for words in (
        "Tolerances that",
        "Where:",
        "Which",
        "Smallest size found",
        "effect alone",
        "tolerances alone",
    ):
        assert words in rest
    for words in ("log score", "RMSE", "noise learned from", "error of form"):
        assert words in rest
    # with one manoeuvre there is none to hold out, which is said
    assert "every other line of" in rest


@pytest.mark.usefixtures("few_effects")
def test_a_tolerance_that_is_given_counts_and_is_printed(diagnose):
    given = ("surface_effectiveness.de=0.5", "mass=0.02", "cg_offset=0.005")  # the last as by default
    words = (*(word for one in given for word in ("--tolerance", one)), "--json")
    code, out, _, _ = diagnose("good", *words)
    table = json.loads(out)
    assert code == 0
    assert not table["gap"]["exists"]  # so large a loss of the elevator is then no gap
    stated = {t["name"]: t["sigma"] for t in table["tolerances"] if t["source"] == "stated"}
    assert stated == {"surface_effectiveness.de": 0.5, "mass": 0.02, "cg_offset": 0.005}


@pytest.mark.usefixtures("few_effects")
def test_tolerances_of_the_simulation_are_printed_as_its_own(diagnose):
    code, out, _, _ = diagnose("declared", "--json", records=("flight1",))
    own = [t for t in json.loads(out)["tolerances"] if t["source"] == "simulation"]
    assert code == 0
    assert own == [{"name": "lift_slope", "sigma": 0.3, "unit": "1/rad", "source": "simulation"}]


@pytest.mark.usefixtures("few_effects")
def test_a_self_test_says_what_is_seen(diagnose):
    code, out, _, path = diagnose("good", "--self-test", "--json", records=("flight1",), page=True)
    assert code == 0
    table = json.loads(out)
    assert table["which"]["calibrated_by"] == "self-test"
    tested = table["self_test"]
    assert [s["detectability"] for s in tested["strata"]] == [15.0, 50.0, 200.0]
    sizes = [s["size"] for s in tested["smallest"] if s["effect"] == "surface_effectiveness"]
    assert 0.05 < min(sizes) < 0.5
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


@pytest.mark.usefixtures("few_effects")
def test_bookkeeping_stands_beside_a_diagnosis_that_goes_on_anyway(diagnose):
    code, out, _, path = diagnose("reversed_elevator", "--anyway", "--json", records=("flight1",))
    assert code == 0
    assert path.exists()
    assert any(remark.startswith("bookkeeping: ") for remark in json.loads(out)["remarks"])


@pytest.mark.usefixtures("few_effects")
def test_without_injected_signals_it_says_what_cannot_be_told(diagnose):
    code, out, _, _ = diagnose("good", "--json", records=("quiet",))
    table = json.loads(out)
    assert code == 0
    assert any("no injected signals" in remark for remark in table["remarks"])
    assert {place["input"] for place in table["where"]} <= {""}


def test_an_effect_of_ones_own_is_closed(diagnose, folder, monkeypatch):
    monkeypatch.setattr(effects, "_added", {})  # other tests know nothing of it
    monkeypatch.setattr(effects, "shipped", dict)
    words = ("--effects", folder / "own.py", "--effect", "worn_linkage", "--json")
    code, out, err, _ = diagnose("good", *words, page=True)
    assert code == 0, err
    lost = json.loads(out)["how_far"]["settings"]["worn_linkage"]["share"]
    assert lost["lo"] < LOSS < lost["hi"]


@pytest.mark.usefixtures("few_effects")
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
    code, out, err = freqid("diagnose-gap", *records, *words, "--no-page", "--json", "-o", tmp_path / "g.h5")
    assert code == 0, err
    table = json.loads(out)
    assert table["gap"]["exists"]
    assert table["where"][0]["response"] == "M"
    assert next(iter(table["which"]["probabilities"])) == "surface_effectiveness"


@pytest.mark.parametrize(
    ("model", "code", "sentence"),
    [
        ("not_a_number", 3, "is not finite in"),
        ("diverging", 3, "is not finite in"),
        ("short", 3, "has shape"),
        ("constant", 3, "returned the constant 0 as 'M'"),
        ("half_constant", 3, "returned the constant 0 as 'M'"),
        ("flown_away", 3, "own flight diverges"),
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
        (("--band", "2:1"), ("flight1",), 2, "--band is LOW:HIGH"),
        (("--tolerance", "mass"), ("flight1",), 2, "--tolerance is NAME=SIGMA"),
        (("--tolerance", "mas=0.1"), ("flight1",), 2, "did you mean 'mass'"),
        (("--tolerance", "mass=-1"), ("flight1",), 3, "mass is -1.0, expected one sigma"),
        (("--tolerance", "mass=nan"), ("flight1",), 3, "mass is nan, expected one sigma"),
        (("--tolerance", "mass=1e9"), ("flight1",), 3, "mass is 1000000000.0, expected one sigma"),
        (("--tolerance", "derivatives=50"), ("flight1",), 3, "derivatives is 50, a share of more than all"),
        ((), ("flight1", "other"), 3, "whose effectors are not those of 'Linear aircraft'"),
        ((), ("few",), 3, "few.h5: has 6 samples"),
        ((), ("still",), 3, "still.h5: none of its states moves"),
        ((), ("absent",), 3, "no such file"),
        ((), ("models",), 3, "no such file"),
    ],
)
def test_what_is_asked_wrongly_is_said(diagnose, folder, monkeypatch, words, records, code, sentence):
    monkeypatch.chdir(folder)
    got, _, err, path = diagnose("good", *words, records=records)
    assert (got, sentence in err) == (code, True), err
    assert err.count("\n") == 1
    assert not path.exists()


@pytest.mark.usefixtures("few_effects")
def test_an_effect_that_cannot_be_tested_here_is_refused(diagnose, monkeypatch):
    every = library()
    monkeypatch.setattr(diagnosing, "effects_with", lambda own: {n: every[n] for n in (*FEW, "wing_wake")})
    code, _, err, _ = diagnose("good", "--effect", "wing_wake", records=("flight1",))
    assert code == 2
    assert "cannot be tested here: needs wing" in err


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


def test_the_consequence_gets_the_sizes_of_the_leading_closure(monkeypatch):
    """A group moves as one, a vector by its components; what is given with a size is no departure."""
    from freqid.compare import diagnosis_consequence
    from freqid.gap.infer.evidence import Estimate
    from freqid.gap.model.candidate import Candidate, Place

    each = np.array([1.0])
    group = Candidate("weak", Place("row", ("a", "b"), (("at", 0.3),)), "scalar", each, each, [])
    offset = Candidate("offset", Place("all", ("x", "y")), "vector", np.ones(2), each, [])
    estimates = (
        Estimate(group, np.array([0.2]), np.array([0.1]), np.array([0.3]), False),
        Estimate(offset, np.array([1.0, 2.0]), np.array([0.0, 0.0]), np.array([2.0, 4.0]), False),
    )
    which = SimpleNamespace(named=("weak",), pair=())
    closed = [SimpleNamespace(explanation=SimpleNamespace(estimates=estimates))]
    findings = SimpleNamespace(diagnosis=SimpleNamespace(which=which), closed=closed)
    simulation = SimpleNamespace(effects={"weak": {"at": 0.3}})
    monkeypatch.setattr(diagnosis_consequence, "with_consequence", lambda *a, **k: (a, k))
    (_, _, settings, names, covariance), more = diagnosing._with_consequence(
        findings, simulation, SimpleNamespace(named=())
    )
    assert settings == {"weak": {"a": 0.2, "b": 0.2, "at": 0.3}, "offset": {"x": 1.0, "y": 2.0}}
    assert more["baseline"] == {"weak": {"at": 0.3}, "offset": {}}
    assert names == [("weak", "a"), ("weak", "b"), ("offset", "x"), ("offset", "y")]
    ninety = 1.6448536  # of a normal distribution, from a table
    np.testing.assert_allclose(covariance[:2, :2], (0.1 / ninety) ** 2)
    np.testing.assert_allclose(covariance[2:, 2:], np.diag([1, 4]) / ninety**2)
    assert not covariance[:2, 2:].any()
    findings.closed = []
    assert diagnosing._with_consequence(findings, simulation, which) is findings.diagnosis
