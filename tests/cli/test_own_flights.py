"""``freqid study --flights``: real flights in place of the simulation, judged by gates."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
import tilt_wing

import freqid as fq
from freqid.blend.global_model import GlobalModel
from freqid.core.record import write_record
from freqid.core.results.corridor import read_global
from freqid.core.results.point import read_point
from freqid.workflows.studies.own_flights import find_flights

SPEEDS = (3.0, 5.0, 7.0)


def scenario_text(gates=""):
    """Return the tilt-wing of tests/tilt_wing.py as a scenario that only identifies."""
    lines = ['[vehicle]\nname = "tilt-wing"\nmass_kg = 28.6\ninertia = { xx = 3.1, yy = 6.6, zz = 9.2 }']
    for e in tilt_wing.VEHICLE.effectors:
        low, high = e.limits
        lines.append(f'[[effector]]\nname = "{e.name}"\nkind = "{e.kind}"\nlimits = [{low}, {high}]')
    lines += [
        f'[[wing]]\nname = "{w.name}"\ntilt = "{w.tilt}"\npivot_m = {list(w.pivot_m)}'
        for w in tilt_wing.VEHICLE.wings
    ]
    for u in SPEEDS:
        at = tilt_wing.reference(tilt_wing.trim(u, 1.225), f"u{u:g}")
        where = f"u = {at.u}\nrho = {at.rho}\ndw1 = {at['dw1']}\ndw2 = {at['dw2']}"
        lines.append(f'[[reference]]\nid = "{at.id}"\n{where}')
    wanted = tilt_wing.SETTINGS
    lines.append('[identification]\nresponse_source = "record"\nresponses = ["X","Y","Z","L","M","N"]')
    lines.append(f"frequencies_hz = {np.array(wanted.frequencies_hz).tolist()}\n[identification.regressors]")
    lines += [f"{r} = {list(wanted.regressors_of(r))}" for r in tilt_wing.RESPONSES]
    return "\n".join(lines) + f"\n[gates]\n{gates}\n"


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    """Two flights at three conditions; none says which, and one lies among files that are no flights."""
    folder = tmp_path_factory.mktemp("flights")
    for u in SPEEDS:
        for seed in (1, 2):
            flown = tilt_wing.fly(tilt_wing.trim(u, 1.225), seed + 10 * int(u), amplitude=0.3)
            write_record(folder / f"flight-{u:g}-{seed}.h5", flown.record)
    (folder / "notes.h5").write_text("no flight")
    (folder / "notes.md").write_text("no flight")
    return folder


@pytest.fixture
def study(freqid, flights, tmp_path):
    def run(*options, gates="", folder=flights, page=False):
        (tmp_path / "s.toml").write_text(scenario_text(gates))
        more = [] if page else ["--no-page"]  # a page takes three times as long as all else
        words = ["study", tmp_path / "s.toml", "--flights", folder, "-o", tmp_path / "out"]
        return freqid(*words, *more, *options)

    return run


def test_flights_become_points_a_global_model_and_a_page_without_a_simulation(study, tmp_path, monkeypatch):
    monkeypatch.setattr("freqid.simulate.runner.run_units", None)  # calling it fails
    monkeypatch.setattr("freqid.workflows.studies.units.fly", None)
    code, out, _ = study("--hold-out", "u5", "--json", page=True)
    assert code == 0
    said = json.loads(out)
    assert set(said["points"]) == {"u3", "u5", "u7"}
    assert set(said["held_out"]) == {"u5"}
    assert GlobalModel(read_global(tmp_path / "out" / "model.h5")).corridor.ids == ("u3", "u7")
    bias, slope = tilt_wing.derivatives(tilt_wing.trim(7.0, 1.225))
    point = read_point(tmp_path / "out" / "points" / "u7.h5")
    assert point.provenance["record"].endswith("flight-7-1.h5")
    assert point.provenance["predicted"].endswith("flight-7-2.h5")
    for i, r in enumerate(tilt_wing.RESPONSES):
        for name in point[r].regressors:
            known = slope[i, tilt_wing.INPUTS.index(name)]
            estimate, error = point[r][name]
            assert abs(estimate - known) < 5 * error + 0.03 * abs(known), (r, name)  # 0.3 rms is not nothing
        assert point[r].bias == pytest.approx(bias[i], abs=0.02 * tilt_wing.WEIGHT)
    page = (tmp_path / "out" / "index.html").read_text()
    assert "real, none simulated" in page
    assert 'id="inputs"' not in page
    assert "flight-7-2" in page


def test_named_flights_validate_and_the_others_are_modelled(study, tmp_path):
    code, _, _ = study("--validate", "flight-3-1")
    assert code == 0
    assert read_point(tmp_path / "out" / "points" / "u3.h5").provenance["record"].endswith("flight-3-2.h5")
    assert len(read_point(tmp_path / "out" / "points" / "u7.h5").provenance["manoeuvres"]) == 2


def test_logs_are_read_by_their_map(study, flights, write_log, tmp_path):
    folder = tmp_path / "mixed"
    folder.mkdir()
    for path in flights.glob("flight-*.h5"):
        if path.stem != "flight-3-1":
            shutil.copy(path, folder)
    record = fq.read(flights / "flight-3-1.h5")
    log, column_map = write_log(record, folder / "flight-3-1.csv")
    code, _, err = study(folder=folder)
    assert code == 0, err
    assert read_point(tmp_path / "out" / "points" / "u3.h5").provenance["record"].endswith("flight-3-2.h5")
    code, _, err = study("--map", column_map, folder=folder)
    assert code == 0, err
    point = read_point(tmp_path / "out" / "points" / "u3.h5")
    assert point.provenance["record"].endswith("records/flight-3-1.h5")
    direct = fq.identify_point(record, fq.read_scenario(tmp_path / "s.toml"), at="u3")
    np.testing.assert_allclose(point["M"].estimate, direct["M"].estimate, rtol=1e-6)


def test_a_second_run_with_one_flight_more_does_only_what_changed(study, flights, tmp_path):
    folder = tmp_path / "growing"
    folder.mkdir()
    for path in flights.glob("flight-*.h5"):
        shutil.copy(path, folder)
    late = (folder / "flight-7-2.h5").rename(tmp_path / "flight-7-2.h5")
    assert study("--json", folder=folder)[0] == 0
    units = tmp_path / "out" / "units" / "identify_point"
    made = {path: path.stat().st_mtime_ns for path in units.glob("*.h5")}
    assert len(made) == 3
    first = read_point(tmp_path / "out" / "points" / "u7.h5")
    code, said, _ = study("--json", folder=folder)
    assert code == 0
    assert {path: path.stat().st_mtime_ns for path in units.glob("*.h5")} == made
    late.rename(folder / late.name)
    code, more, _ = study("--json", folder=folder)
    assert code == 0
    now = {path: path.stat().st_mtime_ns for path in units.glob("*.h5")}
    assert made.items() < now.items()
    assert len(now) == 4  # u7 has a flight that validates: its point alone is made again
    assert json.loads(said)["points"]["u3"] == json.loads(more)["points"]["u3"]
    point = read_point(tmp_path / "out" / "points" / "u7.h5")
    assert not first.prediction
    assert set(point.prediction) == set(tilt_wing.RESPONSES)
    changed = tilt_wing.fly(tilt_wing.trim(3.0, 1.225), 77, amplitude=0.3).record
    write_record(folder / "flight-3-1.h5", changed)  # another flight under the same name is another flight
    assert study(folder=folder)[0] == 0
    assert len(list(units.glob("*.h5"))) == 5


def test_missed_gates_are_sentences_and_everything_is_written(study, tmp_path):
    gates = "coherence = 0.99999\nvalidation = { Z = 1e-6 }\nconsistency = 1e-9\nr2 = { Z = 0.5 }"
    code, _, err = study(gates=gates, page=True)
    assert code == 4
    assert "coherence of L is 0." in err
    assert "validation error of Z is 0." in err
    assert "the gate is 1e-06 at u3" in err
    assert "validation error of X" not in err
    assert "R2" not in err
    assert "consistency of" not in err
    assert (tmp_path / "out" / "index.html").is_file()
    assert (tmp_path / "out" / "model.h5").is_file()


def test_regressors_that_moved_together_miss_a_gate_by_name(study, flights, freqid, tmp_path):
    assert study(gates="collinearity = 10")[0] == 0
    geared = tmp_path / "geared"
    geared.mkdir()
    for path in flights.glob("flight*.h5"):
        (geared / path.name).write_bytes(path.read_bytes())
    flown = fq.read(flights / "flight-7-1.h5")
    one, other = flown.channel("effector/df"), flown.channel("effector/dr")
    record = flown.with_channels(replace(other, values=one.values + 0.1 * other.values))
    write_record(geared / "flight-7-1.h5", record)
    code, _, err = study(gates="collinearity = 10", folder=geared)
    assert code == 4
    assert "variance inflation of M is" in err
    assert "'df' and 'dr' moved together" in err or "'dr' and 'df' moved together" in err
    assert "the gate is 10 at u7" in err
    assert "at u5" not in err
    code, out, err = freqid(
        "identify-point", geared / "flight-7-1.h5", "--scenario", tmp_path / "s.toml", "--at", "u7",
        "-o", tmp_path / "p.h5", "--responses", "M", "--regressors", "df,dr",
    )  # fmt: skip
    assert code == 4
    assert "moved together" in err
    pair = read_point(tmp_path / "p.h5")["M"].most_collinear
    # dr = df + 0.1 x, df and x of one size and nothing to do with each other: 1 / (1 - R2) is 101.
    assert pair.inflation == pytest.approx(101, rel=0.02)
    assert pair.correlation < -0.95
    assert f"inflation of M is {pair.inflation:.5g}" in err


def test_flights_that_contradict_each_other_miss_the_gate_of_consistency(study, flights, tmp_path):
    spoilt = tmp_path / "spoilt"
    spoilt.mkdir()
    for path in flights.glob("flight*.h5"):
        (spoilt / path.name).write_bytes(path.read_bytes())
    worn = tilt_wing.fly(tilt_wing.trim(7.0, 1.225), 72, amplitude=0.3).record
    channel = worn.channel("response/M")
    elevator = worn["effector/dr"] - worn["effector/dr"].mean()
    lost = replace(channel, values=channel.values + 40.0 * elevator)
    write_record(spoilt / "flight-7-2.h5", worn.with_channels(lost))
    code, _, err = study(gates="consistency = 0.01", folder=spoilt)
    assert code == 4
    assert "consistency of M of repeated flights at u7 is" in err
    assert "of L of" not in err
    assert study(gates="consistency = 0.01")[0] == 0


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        (["--validate", "flight-3-9"], 2, "no flight is called 'flight-3-9'"),
        (["--validate", "flight-3-1,flight-3-2"], 2, "none is left to model"),
        (["--at", "u3"], 2, "flights at two conditions or more, found 1"),
        (["--at", "u4"], 2, "no reference 'u4'"),
        (["--noise", "2"], 2, "real flights are given"),
    ],
)
def test_what_flights_cannot_give_is_said(study, options, code, said):
    found, _, err = study(*options)
    assert (found, said in err) == (code, True), err


def test_a_flight_at_no_condition_is_named(study, tmp_path):
    folder = tmp_path / "far"
    folder.mkdir()
    write_record(folder / "far.h5", tilt_wing.fly(tilt_wing.trim(12.0, 1.225), 1).record)
    code, _, err = study(folder=folder)
    assert code == 3
    assert err.startswith("flights ...\nfreqid: far: the flight is at no reference of the scenario")
    folder = tmp_path / "none"
    folder.mkdir()
    (folder / "log.csv").write_text("time,u\n0,1\n")
    code, _, err = study(folder=folder)
    assert code == 2
    assert "holds no flight record, and 1 logs; read the logs with --map" in err


def test_theil_and_coherence_are_what_their_definitions_say():
    from freqid.core.results.fit import Fit

    time = np.arange(400) / 100
    z, y = np.sin(2 * np.pi * time), 0.5 * np.sin(2 * np.pi * time)
    assert Fit(time, z + 3.0, y).theil == pytest.approx(0.5 / 1.5)
    rng = np.random.default_rng(0)
    line = np.arange(1, 129) / 60
    clean = np.exp(2j * np.pi * rng.uniform(size=line.size))
    noisy = np.where(line < 16 / 60, clean, clean + np.exp(2j * np.pi * rng.uniform(size=line.size)))
    assert Fit(line, clean, 2j * clean).coherence == pytest.approx(1.0)
    assert 0.2 < Fit(line, noisy, clean).coherence < 0.8


def test_predicting_a_flight_by_a_model_made_from_it_warns(freqid, flights, tmp_path, recwarn):
    (tmp_path / "s.toml").write_text(scenario_text())
    one, other = (flights / f"flight-7-{i}.h5" for i in (1, 2))
    where = ("--scenario", tmp_path / "s.toml", "--at", "u7", "-o", tmp_path / "p.h5")
    assert "made from it" not in freqid("identify-point", one, *where, "--predict", other)[2]
    assert "made from it" in freqid("identify-point", one, *where, "--predict", one)[2]
    model = fq.read(tmp_path / "p.h5")
    fq.predict(model, other, tmp_path / "s.toml")
    assert not [w for w in recwarn if "made from it" in str(w.message)]
    with pytest.warns(UserWarning, match="made from it, which validates nothing"):
        fq.predict(model, one, tmp_path / "s.toml")


def test_flights_are_in_the_order_of_their_names_not_of_their_files(flights, tmp_path):
    one = next(flights.glob("flight-3-*.h5"))
    for name in ("u3-check", "u3", "u3-again"):
        shutil.copy(one, tmp_path / f"{name}.h5")
    (tmp_path / "s.toml").write_text(scenario_text())
    scenario = fq.read_scenario(tmp_path / "s.toml")
    found = find_flights(scenario, tmp_path, None, None, tmp_path / "records")
    assert list(found) == ["u3", "u3-again", "u3-check"]
