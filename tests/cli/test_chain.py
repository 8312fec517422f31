"""The commands as a user runs them, and what they say when the input is bad."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest

import freqid as fq
from freqid.cli.point_texts import point_table
from freqid.core import store
from freqid.core.results.point import read_point

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
SCENARIO, MAP = SCENARIOS / "linear.toml", SCENARIOS / "maps" / "linear.toml"


@pytest.fixture
def record(freqid, linear_logs, tmp_path):
    path = tmp_path / "flight.h5"
    code, _, err = freqid(
        "import-log", linear_logs["noisy"], "--map", MAP, "--scenario", SCENARIO, "--at", "u20", "-o", path
    )
    assert (code, err) == (0, "")
    return path


def test_a_flight_goes_from_log_to_page(freqid, record, tmp_path):
    point, page = tmp_path / "point.h5", tmp_path / "page.html"
    code, out, _ = freqid("identify-point", record, "--scenario", SCENARIO, "-o", point, "--json")
    assert code == 0
    said = json.loads(out)
    assert said["reference"]["id"] == "u20"
    with h5py.File(point) as file:
        for name, figures in said["responses"].items():
            assert set(figures) >= {"parameters", "r2", "pse", "rmse"}
            for parameter, values in figures["parameters"].items():
                for key in ("estimate", "std_error"):
                    assert file[f"parameter/{name}/{parameter}/{key}"][()] == values[key]
            assert file[f"covariance/{name}"].shape == (5, 5)
    code, out, _ = freqid("report", point, "--scenario", SCENARIO, "-o", page)
    assert (code, out.strip()) == (0, str(page))
    assert "<svg" in page.read_text()


def test_the_table_names_units_and_two_standard_errors(freqid, record):
    code, out, _ = freqid("identify-point", record, "--scenario", SCENARIO, "--responses", "M")
    assert code == 0
    assert "M [N m]" in out
    assert "N m/rad" in out
    assert "N m/(rad/s)" in out


def test_a_missed_gate_is_exit_code_4_and_the_model_is_written(freqid, record, tmp_path):
    strict = tmp_path / "strict.toml"
    strict.write_text(SCENARIO.read_text().replace("r2 = 0.8", "r2 = 0.99999"))
    point = tmp_path / "point.h5"
    code, _, err = freqid("identify-point", record, "--scenario", strict, "-o", point)
    assert code == 4
    assert "the gate is 0.99999" in err
    assert point.is_file()


def test_what_noise_does_not_explain_is_said_in_the_terminal(record):
    model = fq.identify_point(record, SCENARIO, responses=("M",))
    quiet, loud = (
        point_table(replace(model, responses={"M": replace(model["M"], distortion=ratio)}))
        for ratio in (1.2, 3.31)
    )
    assert "on the harmonics 3.31 times the noise is left" in loud
    assert "on the harmonics" not in quiet


def test_a_gate_that_nothing_was_given_to_judge_by_is_one_sentence(freqid, record, tmp_path):
    strict, point, page = tmp_path / "strict.toml", tmp_path / "point.h5", tmp_path / "p.html"
    strict.write_text(SCENARIO.read_text().replace("r2 = 0.8", "r2 = 0.5\nvalidation = 0.3"))
    code, _, err = freqid("identify-point", record, "--scenario", strict, "-o", point)
    assert code == 4
    assert err.count("validation") == 1
    assert "--predict" in err
    assert "nan" not in err
    freqid("report", point, "--scenario", strict, "-o", page)
    assert "is not judged: no manoeuvre" in page.read_text()


def test_instruments_are_shown_beside_least_squares(freqid, record, tmp_path):
    point = tmp_path / "point.h5"
    options = ["--scenario", SCENARIO, "--estimator", "instruments", "-o", point]
    code, out, _ = freqid("identify-point", record, *options, "--json")
    assert code == 0
    said = json.loads(out)
    assert said["estimator"] == "instruments"
    plain = json.loads(freqid("identify-point", record, "--scenario", SCENARIO, "--json")[1])
    for name, figures in said["responses"].items():
        for parameter, values in figures["parameters"].items():
            if parameter == "bias":
                continue
            beside = values["least_squares"]
            expected = plain["responses"][name]["parameters"][parameter]
            assert beside["estimate"] == pytest.approx(expected["estimate"], rel=1e-9)
            assert beside["std_error"] == pytest.approx(expected["std_error"], rel=1e-9)
    assert "w" in said["responses"]["Z"]["differing"]
    assert abs(said["responses"]["Z"]["parameters"]["w"]["normalised_difference"]) > 3
    _, table, _ = freqid("identify-point", record, *options)
    assert "least squares differs beyond noise: " in table


def test_several_records_make_one_model(freqid, record, tmp_path):
    both = tmp_path / "both.h5"
    arguments = ["identify-point", record, record, "--scenario", SCENARIO, "-o", both]
    code, out, _ = freqid(*arguments, "--cut", "0:29.98", "--cut", "30:60", "--json")
    assert code == 0
    whole = json.loads(freqid("identify-point", record, "--scenario", SCENARIO, "--json")[1])
    de, expected = (said["responses"]["M"]["parameters"]["de"] for said in (json.loads(out), whole))
    assert abs(de["estimate"] - expected["estimate"]) < 2 * expected["std_error"]
    same = [*arguments[:2], *arguments[3:], "--cut", "0:29.98", "--cut", "30:60", "--json"]
    assert freqid(*same)[1] == out
    with h5py.File(both) as file:
        assert "time 2" in file["fit/M"]
        assert file.attrs["duration"] == pytest.approx(59.98)
    code, _, err = freqid(*arguments, "--cut", "0:30")
    assert code == 2
    assert "1 --cut came with 2 records" in err


def test_records_of_different_references_are_not_mixed(freqid, record, tmp_path):
    other = tmp_path / "other.h5"
    other.write_bytes(record.read_bytes())
    with store.editing(other) as file:
        file.attrs["reference"] = "u30"
    code, _, err = freqid("identify-point", record, other, "--scenario", SCENARIO, "-o", tmp_path / "p.h5")
    assert code == 2
    assert "flown at different references, u20 and u30" in err


def test_a_reference_that_was_not_flown_is_a_warning(freqid, record, tmp_path):
    scenario = tmp_path / "s.toml"
    scenario.write_text(SCENARIO.read_text().replace("u = 20.0", "u = 23.0"))
    code, _, err = freqid("identify-point", record, "--scenario", scenario, "-o", tmp_path / "p.h5")
    assert code == 0
    assert "warning: reference 'u20' states forward speed u = 23 m/s, but the mean flown is 20" in err


def test_cut_and_split(freqid, linear_logs, tmp_path):
    path = tmp_path / "cut.h5"
    freqid("import-log", linear_logs["noisy"], "--map", MAP, "--cut", "12.5:42.5", "-o", path)
    with h5py.File(path) as file:
        np.testing.assert_allclose(file["time"][[0, -1]], [12.5, 42.5])


def test_a_record_goes_to_sidpac_columns_and_back(freqid, record, tmp_path):
    code, _, _ = freqid("export", record, "--to", "sidpac", "-o", tmp_path / "flight.mat")
    assert code == 0
    code, _, err = freqid("import-log", tmp_path / "flight.mat", "-o", tmp_path / "back.h5")
    assert (code, err) == (0, "")
    with h5py.File(record) as ours, h5py.File(tmp_path / "back.h5") as back:
        np.testing.assert_allclose(back["state/q"][()], ours["state/q"][()], rtol=1e-12, atol=1e-15)


def spoiled(change):
    def write(logs, folder):
        table = pd.read_csv(logs["noisy"])
        path = folder / "bad.csv"
        change(table).to_csv(path, index=False)
        return path

    return write


BAD_LOGS = {
    "NaN": (spoiled(lambda t: t.assign(q_dps=t.q_dps.where(t.index != 40))), "state/q"),
    "inf": (spoiled(lambda t: t.assign(q_dps=t.q_dps.where(t.index != 40, np.inf))), "state/q"),
    "dropout": (spoiled(lambda t: t.drop(index=range(100, 150))), "time"),
    "duplicate": (spoiled(lambda t: pd.concat([t[:50], t[49:]])), "repeats"),
    "backward": (spoiled(lambda t: pd.concat([t[:50], t[40:]])), "backward"),
    "misspelt": (spoiled(lambda t: t.rename(columns={"q_dps": "q_dsp"})), "did you mean"),
    "text": (spoiled(lambda t: t.astype({"q_dps": object}).assign(q_dps="fast")), "fast"),
    "empty": (spoiled(lambda t: t[:0]), "bad.csv"),
}


@pytest.mark.parametrize("fault", BAD_LOGS)
def test_a_bad_log_is_exit_code_3_with_a_sentence_and_no_file(freqid, linear_logs, tmp_path, fault):
    write, says = BAD_LOGS[fault]
    log = write(linear_logs, tmp_path)
    code, out, err = freqid("import-log", log, "--map", MAP, "-o", tmp_path / "out" / "r.h5")
    assert code == 3
    assert out == ""
    assert says in err
    assert "bad.csv" in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()


BAD_SCENARIOS = {
    "band above Nyquist": (
        "[identification]",
        "[identification]\nfrequencies_hz = [1.0, 26.0]",
        3,
        "Nyquist",
    ),
    "record too short": (
        "[identification]",
        "[identification]\nfrequencies_hz = [0.01, 1.0]",
        3,
        "period of",
    ),
    "too many regressors": (
        "[identification]",
        "[identification]\nfrequencies_hz = [0.5, 1.0]",
        3,
        "equations",
    ),
    "misspelt regressor": ('X = ["u"', 'X = ["uu"', 3, "'uu' is no channel"),
    "constant regressor": ('X = ["u"', 'X = ["rho"', 3, "'rho' is constant"),
    "collinear pair": ('X = ["u"', 'X = ["twice_w"', 3, "'twice_w'"),
    "unknown key": ("[identification]", "[identification]\nmehtod = 'time'", 2, "did you mean 'method'"),
    "no regressors": ('X = ["u", "w", "q", "de", "n1"]', "X = []", 2, "'X' has no regressors"),
    "a million lines": ("period_s = 60.0", "period_s = 1e9", 2, "period_s is 1e+09"),
    "negative area": ("area_m2 = 1.0", "area_m2 = -1.0", 2, "area_m2 is -1"),
    "gate of no response": ("r2 = 0.8", "r2 = {Q = 0.5}", 2, "gate r2 names response 'Q'"),
    "an effector called q": ('name = "da"', 'name = "q"', 2, "effector 'q' has the name of a state"),
    "unknown response": ('"X", "Y"', '"X", "V"', 2, "response 'V' is unknown"),
}


@pytest.mark.parametrize("fault", BAD_SCENARIOS)
def test_a_bad_request_says_what_and_where_and_writes_nothing(freqid, record, tmp_path, fault):
    old, new, expected, says = BAD_SCENARIOS[fault]
    scenario = tmp_path / "s.toml"
    scenario.write_text(SCENARIO.read_text().replace(old, new, 1))
    if fault == "collinear pair":
        with store.editing(record) as file:
            twin = file["state/w"]
            file.copy(twin, "effector/twice_w")
            file["effector/twice_w"][...] = 2 * twin[()]
            file["effector/twice_w"].attrs["units"] = "rad"
            order = json.loads(file.attrs["channel_order"])
            file.attrs["channel_order"] = json.dumps([*order, "effector/twice_w"])
    code, out, err = freqid("identify-point", record, "--scenario", scenario, "-o", tmp_path / "p.h5")
    assert code == expected, err
    assert says in err
    assert out == ""
    assert not (tmp_path / "p.h5").exists()
    if fault == "collinear pair":
        assert "'w'" in err


def test_a_missing_channel_of_the_wrench_is_named(freqid, record, tmp_path):
    with store.editing(record) as file:
        order = [n for n in json.loads(file.attrs["channel_order"]) if n != "state/ax"]
        file.attrs["channel_order"] = json.dumps(order)
    code, _, err = freqid("identify-point", record, "--scenario", SCENARIO, "-o", tmp_path / "p.h5")
    assert code == 3
    assert "flight.h5: channel 'state/ax' is missing" in err


@pytest.mark.parametrize("command", ["identify-point", "report", "export"])
def test_a_foreign_file_is_refused_by_every_command(freqid, tmp_path, command):
    alien = tmp_path / "alien.h5"
    alien.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(200))
    options = {"identify-point": ["--scenario", SCENARIO], "export": ["--to", "sidpac"]}.get(command, [])
    code, _, err = freqid(command, alien, *options, "-o", tmp_path / "out.h5")
    assert code == 3
    assert "alien.h5" in err
    assert not (tmp_path / "out.h5").exists()


def test_an_unwritable_folder_is_exit_code_3(freqid, record, tmp_path):
    (tmp_path / "file").write_text("")
    code, _, err = freqid("identify-point", record, "--scenario", SCENARIO, "-o", tmp_path / "file" / "p.h5")
    assert code == 3
    assert "cannot be written" in err


def test_a_result_never_replaces_its_input_or_a_device(freqid, record, tmp_path):
    before = record.read_bytes()
    code, _, err = freqid("identify-point", record, "--scenario", SCENARIO, "-o", record)
    assert (code, record.read_bytes()) == (2, before)
    assert "would replace its own input" in err
    code, _, err = freqid("identify-point", record, "--scenario", SCENARIO, "-o", tmp_path)
    assert code == 3
    assert "it is a folder" in err


def test_a_cut_goes_around_a_fault(freqid, linear_logs, tmp_path):
    log = spoiled(lambda t: t.assign(q_dps=t.q_dps.where(t.index != 40)))(linear_logs, tmp_path)
    code, _, err = freqid("import-log", log, "--map", MAP, "--cut", "10:50", "-o", tmp_path / "r.h5")
    assert (code, err) == (0, "")


def test_what_sidpac_has_no_column_for_is_said(freqid, record, tmp_path):
    _, out, _ = freqid("export", record, "--to", "sidpac", "-o", tmp_path / "flight.mat", "--json")
    assert "excitation/de" in json.loads(out)["left_out"]


RECORD_FAULTS = {
    "degrees": (lambda f: f["effector/de"].attrs.__setitem__("units", "deg"), 0, ""),
    "wrong unit": (lambda f: f["state/q"].attrs.__setitem__("units", "m"), 3, "state/q"),
    "slow channel": (lambda f: f["effector/n1"].attrs.__setitem__("native_rate_hz", 2.0), 3, "Nyquist"),
    "ramp": (
        lambda f: f["effector/da"].write_direct(0.1 + 1e-3 * f["time"][()]),
        3,
        "'da' is constant, or a",
    ),
    "complex": (lambda f: recast(f, "state/q", complex), 3, "state/q"),
    "sensor of two numbers": (
        lambda f: f["state/ax"].attrs.__setitem__("position_m", [0, 1]),
        3,
        "expected three",
    ),
}


def recast(file, name, dtype):
    values, attrs = file[name][()], dict(file[name].attrs)
    del file[name]
    file[name] = values.astype(dtype)
    for key in ("units", "native_rate_hz", "source"):
        file[name].attrs[key] = attrs[key]


@pytest.mark.parametrize("fault", RECORD_FAULTS)
def test_a_record_of_another_program_is_checked(freqid, record, tmp_path, fault):
    change, expected, says = RECORD_FAULTS[fault]
    with store.editing(record) as file:
        change(file)
    code, _, err = freqid("identify-point", record, "--scenario", SCENARIO, "-o", tmp_path / "p.h5")
    assert code in (expected, 4 if expected == 0 else expected), err
    assert says in err


def test_a_channel_in_degrees_is_converted(freqid, record, tmp_path):
    _, plain, _ = freqid("identify-point", record, "--scenario", SCENARIO, "--responses", "M", "--json")
    with store.editing(record) as file:
        file["effector/de"][...] = np.rad2deg(file["effector/de"][()])
        file["effector/de"].attrs["units"] = "deg"
    _, converted, _ = freqid("identify-point", record, "--scenario", SCENARIO, "--responses", "M", "--json")
    pick = [json.loads(t)["responses"]["M"]["parameters"]["de"]["estimate"] for t in (plain, converted)]
    assert pick[1] == pytest.approx(pick[0], rel=1e-9)


def test_usage_errors_are_exit_code_2(freqid):
    for arguments in (["identify-pont"], ["import-log"], ["report", "--nonsense", "x"]):
        code, _, err = freqid(*arguments)
        assert code == 2
        assert err


def test_a_bug_is_exit_code_70(freqid, record, monkeypatch, tmp_path):
    from freqid.identify import point

    monkeypatch.setattr(point, "identify_point", lambda *a, **k: 1 / 0)
    code, _, err = freqid("identify-point", record, "--scenario", SCENARIO, "-o", tmp_path / "p.h5")
    assert code == 70
    assert "is a bug" in err


@pytest.mark.parametrize("arguments", [["--help"], ["import-log", "LOG", "--map", "MAP", "-o", "OUT"]])
def test_what_only_reads_data_loads_neither_jax_nor_matplotlib(linear_logs, tmp_path, arguments):
    words = {"LOG": linear_logs["noisy"], "MAP": MAP, "OUT": tmp_path / "r.h5"}
    code = (
        "import sys, freqid.cli.main as m\n"
        f"code = m._exit_code({[str(words.get(a, a)) for a in arguments]!r})\n"
        "heavy = {'jax', 'matplotlib'} & set(sys.modules)\n"
        "sys.exit(f'loaded {heavy}' if heavy else code)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_kinematics_are_checked_and_corrected_before_modelling(freqid, record, tmp_path):
    point = tmp_path / "checked.h5"
    code, out, err = freqid(
        "identify-point",
        record,
        "--scenario",
        SCENARIO,
        "--kinematics",
        "correct",
        "--json",
        "-o",
        point,
    )
    assert code == 0
    assert "sensor errors by kinematics, corrected" in err
    found = read_point(point).provenance["kinematics"][str(record)]
    assert found["corrected"] is True
    # the sensors of this record are noisy but true: no error is beyond its own uncertainty by much
    far = [n for n, e in found["errors"].items() if abs(e["estimate"]) > 5 * e["std_error"]]
    assert far == []
