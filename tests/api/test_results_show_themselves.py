"""Results in a notebook: a short text with units, a table, a figure and a summary."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

import freqid as fq
from freqid.core.results.judged.sealed_trial import SealedEffect

SHORTEST, LONGEST = 20, 400  # characters of a text; one line of a response has its parameters
UNITS = {
    "flight": "60 s at 50 Hz",
    "maneuver": "60 s at 50 Hz",
    "model": "u 20 m/s",
    "response": "0.05 to 1.8 Hz",
    "design": "0.05 to 1.8 Hz",
    "check": "standard errors",
    "aircraft": "m/s, rho",
}


@pytest.fixture(scope="module")
def results(linear):
    flight, scenario = linear["flight"], linear["scenario"]
    return {
        "flight": flight,
        "maneuver": fq.Maneuver.of(flight),
        "model": linear["model"],
        "response": fq.frequency_response(flight, "q", "de", scenario=scenario),
        "design": fq.design_inputs(scenario, seed=0),
        "check": fq.check_sensors(flight),
        "aircraft": fq.blend([linear["model"], _faster(linear["model"])]),
    }


def _faster(model):
    """Return the model as if of another speed: a corridor needs two."""
    from dataclasses import replace

    import msgspec

    return replace(model, reference=msgspec.structs.replace(model.reference, id="u30", u=30.0))


@pytest.mark.parametrize("name", UNITS)
def test_a_result_shows_itself(results, name):
    result = results[name]
    text = repr(result)
    assert SHORTEST < len(text) < LONGEST
    assert text.startswith("<")
    summary = result._repr_html_()
    assert "<table" in summary
    assert len(summary) < 50_000
    assert isinstance(result.plot(), Figure)
    assert len(result.to_frame()) > 1


def test_texts_have_units(results):
    assert {name for name, words in UNITS.items() if words not in repr(results[name])} == set()


def test_a_table_holds_what_the_model_says(results):
    model = results["model"]
    table = model.to_frame().set_index(["response", "parameter"])
    estimate, std_error = model["M"]["de"]
    row = table.loc[("M", "de")]
    assert (row["estimate"], row["std_error"], row["unit"]) == (estimate, std_error, "N m/rad")
    along = results["aircraft"].to_frame()
    assert along.query("response == 'M' and parameter == 'de'")["estimate"].tolist() == [estimate] * 2


def test_a_record_is_a_table_over_time(results):
    flight = results["flight"]
    table = flight.to_frame()
    np.testing.assert_array_equal(table.index, flight.time)
    np.testing.assert_array_equal(table["state/q (rad/s)"], flight["state/q"])


def test_pages_are_shown_and_saved(results, tmp_path):
    for name in ("model", "response", "design"):
        page = fq.page(results[name])
        assert page.html.startswith("<!DOCTYPE html>")
        assert "srcdoc" in page._repr_html_()
        assert page.save(tmp_path / f"{name}.html").read_text(encoding="utf-8") == page.html
    with pytest.raises(fq.FreqidError, match="a dict has no page"):
        fq.page({})


def test_what_is_saved_is_read_back(results, linear, tmp_path):
    for name in ("flight", "model", "response", "design", "aircraft"):
        path = fq.save(results[name], tmp_path / f"{name}.h5")
        read = fq.read(path)
        assert repr(read) == repr(getattr(results[name], "design", results[name]))
    assert fq.read(tmp_path / "flight.h5").reference == "u20"
    with pytest.raises(fq.FreqidError, match="found dict, expected a result"):
        fq.save({}, tmp_path / "x.h5")
    with pytest.raises(fq.FreqidError, match=r"no\.h5: no such file; check the path"):
        fq.read(tmp_path / "no.h5")


def test_the_model_is_asked_with_words(results):
    aircraft = results["aircraft"]
    trim = aircraft.reference(25.0, 1.225)
    inputs = {name: trim[name] for name in aircraft.inputs} | {"u": np.array([25.0])}
    expected = aircraft.wrench({**inputs, "de": np.array([0.03])}).values
    np.testing.assert_allclose(aircraft.wrench(u=25.0, de=0.03).values, expected, rtol=1e-12)
    assert "N" in repr(aircraft.wrench(u=25.0))
    with pytest.raises(fq.FreqidError, match="did you mean 'de'"):
        aircraft.wrench(u=25.0, dee=0.03)
    with pytest.raises(fq.FreqidError, match="the speed u is not given, m/s"):
        aircraft.wrench(de=0.03)


def test_what_is_no_flight_or_no_option_is_said(linear):
    with pytest.raises(fq.FreqidError, match="found int, expected a flight"):
        fq.identify_point(3, linear["scenario"])
    with pytest.raises(fq.FreqidError, match="align is 'fitt'; did you mean 'fit'"):
        fq.identify_point(linear["flight"], linear["scenario"], align="fitt")
    with pytest.raises(fq.FreqidError, match="la9"):
        fq.read_scenario("la9")
    with pytest.raises(fq.FreqidError, match="was read from a file"):
        fq.next_test(object())


def test_sensors_are_checked_corrected_and_aligned(linear):
    flight, scenario = linear["flight"], linear["scenario"]
    check = fq.check_sensors(flight, scenario)
    repaired = fq.correct_sensors(flight, check)
    assert isinstance(repaired, fq.FlightRecord)
    left = fq.check_sensors(repaired)
    name = max(check.names, key=lambda n: abs(check[n][0] / check[n][1]))
    assert abs(left[name][0]) < 0.2 * abs(check[name][0])
    maneuver, alignment = fq.align_sensors(flight, scenario)
    assert isinstance(maneuver, fq.Maneuver)
    assert len(alignment.to_frame()) == len(alignment.names)
    model = fq.identify_point(flight, scenario, align="fit")
    account = model.provenance["alignment"]["flight 1"]
    assert {n: e["estimate"] for n, e in account.items()} == pytest.approx(alignment.errors)
    assert model.provenance["scenario"]["sha256"] == scenario.sha256 != ""


def test_predictions_agree_with_the_model_that_scores_a_held_out_flight(linear):
    flight, scenario = linear["flight"], linear["scenario"]
    model = fq.identify_point(flight, scenario, cut=(0, 30), held_out=flight.cut(30, 60))
    again = fq.predict(model, flight.cut(30, 60), scenario)
    assert {n: f.r2 for n, f in again.items()} == {n: f.r2 for n, f in model.prediction.items()}
    assert model.provenance["cut"] == "0:30"


def test_a_file_without_a_page_is_named(tmp_path):
    sealed = SealedEffect("", 0, "mass", "fraction", "1", 0.0, 0.1, {"flight.h5": ""}).seal()
    path = fq.save(sealed, tmp_path / "seal.h5")
    with pytest.raises(fq.FreqidError, match=r"seal\.h5: a SealedEffect has no page; name a result") as told:
        fq.page(path)
    assert told.value.exit_code == 3
