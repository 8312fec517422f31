"""The page of a simulated flight: its own numbers, self-contained, and truth that is called truth."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from simulated_flights import film_record, scenario_of
from test_page import HOSTILE, Page

from freqid.report.flight.page import build_simulation_page
from freqid.report.flight.tables import (
    SimulatedFlight,
    effector_rows,
    excursion_rows,
    flight_facts,
    flight_findings,
)
from freqid.report.flight.trims import TrimCurve
from freqid.report.kit.rendering import write_text

EXCURSIONS = {
    "u": {"largest": 20.0, "unit": "m/s"},
    "v": {"largest": 4e-15, "unit": "m/s"},
    "q": {"largest": 0.1, "unit": "rad/s", "limit": 0.7, "inside": True},
    "theta": {"largest": 0.05, "unit": "rad", "limit": 0.35, "inside": True},
}


@pytest.fixture(scope="module")
def flight() -> SimulatedFlight:
    scenario = scenario_of(Path("scenarios/la8.toml"))
    truth, thrust = film_record(scenario, excited=("de1", "n1"))
    u = np.array([0.0, 20.0])
    positions = {e.name: np.zeros(2) for e in scenario.effector}
    trims = (TrimCurve(1.225, u, np.zeros(2), positions, np.full(2, 2e3)),)
    return SimulatedFlight(scenario, truth, thrust, EXCURSIONS, trims, "u00.h5", "inputs.h5", to="u85")


@pytest.fixture(scope="module")
def text(flight) -> str:
    return build_simulation_page(flight)


def test_page_is_well_formed_and_fetches_nothing(text):
    page = Page(text)
    assert (page.faults, page.open) == ([], [])
    assert not re.search(r'(src|href)="(?!#)', text)
    assert "url(http" not in text
    assert "@import" not in page.styles
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    targets = {a["href"][1:] for a in page.all("a")}
    assert targets <= set(ids)


def test_page_is_the_same_for_the_same_flight_and_is_written_whole(flight, text, tmp_path):
    write_text(tmp_path / "page.html", build_simulation_page(flight))
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == text


def test_every_figure_tells_what_it_shows(text):
    page = Page(text)
    labels = [a["aria-label"] for a in page.all("svg")]
    assert all(labels)
    assert len(labels) == len(page.all("figcaption")) == 9
    assert "Motion, truth" in text
    assert "Effectors, truth" in text
    assert "shows the simulation's truth" in text.replace("&#39;", "'")


def test_a_flight_that_stays_has_no_film_and_one_without_inputs_no_excitation(flight):
    channels = {n: c for n, c in flight.truth.channels.items() if not n.startswith("excitation/")}
    plain = replace(flight, to="", truth=replace(flight.truth, channels=channels), design="")
    text = build_simulation_page(plain)
    assert 'id="film"' not in text
    assert 'id="excitation"' not in text
    assert "Simulated flight at u00." in text


def test_excursions_in_engineering_units_beside_their_limits(flight):
    rows = {row["name"]: row for row in excursion_rows(flight)}
    assert 'value="5.7295' in rows["q"]["largest"]
    assert rows["q"]["unit"] == "deg/s"
    assert (rows["q"]["limit"], rows["q"]["used"]) == ("40.11", "14 %")
    assert (rows["v"]["largest"], rows["u"]["limit"], rows["u"]["used"]) == ("0", "–", "–")
    assert not any(row["beyond"] for row in rows.values())


def test_an_excursion_beyond_its_limit_and_a_divergence_are_problems(flight):
    far = {**EXCURSIONS, "q": {"largest": 0.9, "unit": "rad/s", "limit": 0.7, "inside": False}}
    said = flight_findings(replace(flight, excursions=far))
    assert [f.kind for f in said] == ["bad", "good", "note"]
    assert "<code>q</code>" in said[0].text
    assert "theta" not in said[0].text
    lost = flight_findings(replace(flight, diverged="phi left its limits at 3.2 s"))
    assert lost[0].kind == "bad"
    assert "3.2 s" in lost[0].text


def test_time_at_limits_is_counted(flight):
    truth = flight.truth
    high = flight.scenario.aircraft().effector("de1").limits[1]
    held = truth.channel("effector/de1")
    values = np.where(truth.time < 5, high, 0.0)
    ramp = np.clip(5.0 * (truth.time - 10.0), -0.5, 0.5)  # 0.2 s near the limit of 5.2 rad/s
    other = replace(truth.channel("effector/de2"), values=ramp)
    at_limit = replace(flight, truth=truth.with_channels(replace(held, values=values), other))
    rows = {row["name"]: row for row in effector_rows(at_limit)}
    assert rows["de1"]["at_limit"] == "25 %"
    assert rows["de1"]["margin"] == "0 %"
    assert rows["de2"]["at_rate"] == "0.95 %"  # 19 of 2001 samples: at its ends the slope is half
    assert (rows["de2"]["at_limit"], rows["de3"]["at_limit"], rows["de3"]["at_rate"]) == ("0", "0", "0")
    assert [row["name"] for row in rows.values() if row["saturated"]] == ["de1", "de2"]
    (stuck,) = [f for f in flight_findings(at_limit) if "some of the time" in f.text]
    assert "de1" in stuck.text
    assert "de2" in stuck.text
    assert "de3" not in stuck.text


def test_facts_say_how_it_was_flown(flight):
    told = dict(flight_facts(flight))
    assert told["Mean wind"] == "5 m/s"
    assert told["Turbulence"] == "3 m/s of wind at 20 ft"
    assert told["From"].startswith("u00: u 0 m/s, ρ 1.225 kg/m³, dw1 85.9°")
    assert told["Sensors"] == "owner, noise × 1"
    assert told["To"] == "u85"


def test_what_files_hold_is_shown_and_not_run(flight):
    vehicle = msgspec.structs.replace(flight.scenario.vehicle, name=HOSTILE)
    scenario = msgspec.structs.replace(flight.scenario, vehicle=vehicle)
    page = Page(build_simulation_page(replace(flight, scenario=scenario, record=HOSTILE, design=HOSTILE)))
    assert page.all("script") == [{}]
    assert not page.faults
