"""``freqid quicklook`` and the plausibility check of ``freqid import-log`` as a user runs them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from page_script import without_script

import freqid as fq

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios" / "linear.toml"


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Design and fly the linear aircraft once."""
    folder = tmp_path_factory.mktemp("quicklook")
    scenario = fq.read_scenario(SCENARIO)
    design = fq.design_inputs(scenario, seed=0)
    record = fq.simulate(scenario, design, at="u20", noise=1.0, seed=1).record
    fq.save(design.design, folder / "design.h5")
    fq.save(record, folder / "flight.h5", scenario=scenario)
    return folder, record


def with_values(record, **values):
    by_name = {n.replace("__", "/"): x for n, x in values.items()}
    return record.with_channels(*(replace(record.channel(n), values=x) for n, x in by_name.items()))


def look(freqid, folder, record=None, *more):
    log = folder / "flight.h5"
    if record is not None:
        log = folder / "changed.h5"
        fq.save(record, log)
    return freqid("quicklook", log, folder / "design.h5", "--scenario", SCENARIO, *more)


def test_a_good_flight_is_usable(freqid, flown):
    folder, _ = flown
    code, out, err = look(freqid, folder)
    assert (code, err) == (0, "")
    assert out.startswith("Usable.")
    kept = fq.read(folder / "flight-quicklook.h5")
    again = fq.quicklook(folder / "flight.h5", folder / "design.h5", SCENARIO)
    for name in (
        "verdict",
        "reasons",
        "remarks",
        "start_s",
        "band_hz",
        "inputs",
        "rates",
        "parameters",
        "accuracy",
    ):
        assert repr(getattr(kept, name)) == repr(getattr(again, name)), name
    assert kept.plausibility == again.plausibility
    assert kept.record.fingerprint == again.record.fingerprint
    np.testing.assert_array_equal(kept.inputs_flown.values, again.inputs_flown.values)
    written = (folder / "flight-quicklook.html").read_text(encoding="utf-8")
    assert freqid("report", folder / "flight-quicklook.h5", "-o", folder / "again.html")[0] == 0
    assert (folder / "again.html").read_text(encoding="utf-8") == written
    code, _, err = look(freqid, folder, None, "-o", folder / "x.html")
    assert code == 2
    assert "write -o" in err
    page = written
    assert "Usable." in page
    assert "http" not in without_script(page)  # it fetches nothing


def test_a_log_with_a_jittering_clock_is_looked_at_once_it_is_resampled(freqid, flown, write_log, tmp_path):
    folder, record = flown
    jitter = np.random.default_rng(0).uniform(-0.004, 0.004, record.time.size)
    jitter[[0, -1]] = 0.0
    log, column_map = write_log(record, tmp_path / "log.csv", record.time + jitter)
    asked = ("quicklook", log, folder / "design.h5", "--scenario", SCENARIO, "--map", column_map)
    code, _, err = freqid(*asked)
    assert code == 3
    assert "--resample" in err
    code, out, err = freqid(*asked, "--resample", "50")
    assert (code, err) == (0, "")
    assert out.startswith("Usable.")


def test_json_tells_gain_lag_and_parameters(freqid, flown):
    folder, _ = flown
    code, out, _ = look(freqid, folder, None, "--json", "--no-page")
    found = json.loads(out)
    assert (code, found["verdict"], found["reasons"]) == (0, "usable", [])
    assert found["start_s"] == pytest.approx(0.0, abs=0.002)
    # second-order actuators of 8 Hz and damping 0.8 are late by 2 zeta / omega
    assert found["inputs"]["de"]["achieved_lag_s"] == pytest.approx(2 * 0.8 / (2 * np.pi * 8), abs=0.004)
    rolling = next(p for p in found["parameters"] if (p["response"], p["parameter"]) == ("L", "da"))
    assert rolling["estimate"] == pytest.approx(45.0, abs=4 * rolling["std_error"])
    assert rolling["met"]


def test_a_missing_injection_asks_for_a_repeat(freqid, flown):
    folder, record = flown
    code, out, err = look(freqid, folder, with_values(record, excitation__dr=np.zeros(record.time.size)))
    assert code == 4
    assert out.startswith("Repeat, because the injection on 'dr' is not in the log")
    assert "the injection on 'dr'" in err


def test_interchanged_injections_name_where_the_signal_is(freqid, flown):
    folder, record = flown
    groups = ("excitation", "command", "effector")
    there = {f"{g}__{n}": record[f"{g}/{m}"] for g in groups for n, m in (("de", "dr"), ("dr", "de"))}
    code, out, _ = look(freqid, folder, with_values(record, **there), "--json")
    assert code == 4
    found = json.loads(out)["inputs"]
    assert (found["de"]["found_on"], found["dr"]["found_on"]) == ("excitation/dr", "excitation/de")


def test_half_a_design_is_not_enough(freqid, flown):
    folder, record = flown
    code, out, _ = look(freqid, folder, record.cut(0.0, 70.0))
    assert code == 4
    assert "only 1.2 of 2 periods" in out


def test_a_log_that_contradicts_itself_is_refused(freqid, flown):
    folder, record = flown
    code, out, err = look(freqid, folder, with_values(record, state__q=-record["state/q"]))
    assert (code, out) == (3, "")
    assert "'state/q' has the opposite sign" in err


def test_import_refuses_and_names_the_setting(freqid, flown, tmp_path):
    _, record = flown
    wrong = tmp_path / "wrong.h5"
    fq.save(with_values(record, state__p=np.degrees(record["state/p"])), wrong)
    out = tmp_path / "out.h5"
    code, _, err = freqid("import-log", wrong, "-o", out)
    assert code == 3
    assert not out.exists()
    assert 'set unit = "deg/s" of [[channel]] name = "state/p"' in err
    code, _, err = freqid("import-log", wrong, "-o", out, "--plausibility", "report")
    assert code == 0
    assert err.startswith("error: 'state/p' is in deg/s where rad/s is claimed")
    (finding,) = fq.read(out).provenance["plausibility"]["findings"]
    assert (finding["check"], finding["channels"]) == ("unit", ["state/p"])
    code, _, err = freqid("import-log", wrong, "-o", out, "--plausibility", "off")
    assert (code, err) == (0, "")


def test_accuracy_must_be_positive(flown):
    folder, record = flown
    with pytest.raises(fq.FreqidError, match="accuracy is 0"):
        fq.quicklook(record, folder / "design.h5", accuracy=0.0)


def test_a_flight_at_another_speed_than_its_reference_is_named(freqid, flown):
    folder, record = flown
    code, out, _ = look(freqid, folder, with_values(record, state__u=record["state/u"] + 3.0))
    assert code == 0
    assert "reference 'u20' states forward speed u = 20 m/s, but the mean flown is 22.99" in " ".join(
        out.split()
    )
