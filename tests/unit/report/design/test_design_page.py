"""The page and the test card of a design: true to the design, honest where something is not known."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections import Counter
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from page_script import without_script
from test_page import HOSTILE, Page

from freqid.core.results.design import Multisine, MultisineDesign
from freqid.core.sections.identification import Identification
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.design.forecast.excursions import excursions
from freqid.design.forecast.modelled import perturbed_aircraft
from freqid.design.forecast.standard_errors import forecast
from freqid.design.multisine.merit import merit, truncated
from freqid.design.multisine.net_load import net_loads
from freqid.report.design import test_card as cards
from freqid.report.design.flight_plan import FlightPlan, intrusions
from freqid.report.design.page import build_design_page
from freqid.report.kit.effectors import effector_groups, reach, runs

NAMES = ("de1", "de2", "da", "n1")
DERIVATIVES = {
    "X": {"u": -4.0, "n1": 0.5},
    "Z": {"w": -60.0, "q": -10.0, "de1": -30.0, "de2": -30.0},
    "L": {"p": -14.0, "da": 30.0},
    "M": {"w": -4.0, "q": -12.0, "de1": -20.0, "de2": -25.0},
    "Y": {"v": -9.0},
    "N": {"v": 3.0, "r": -5.0, "da": -2.0},
}
GAINS = {"de1": {"theta": 0.4, "q": 0.2}, "de2": {"theta": 0.4, "q": 0.2}, "da": {"phi": -0.3, "p": -0.1}}
TRIM = {"n1": 500.0}


def signal(name: str, index: np.ndarray, rms: float) -> Multisine:
    rng = np.random.default_rng(index[0])
    amplitude = np.full(index.size, rms * np.sqrt(2 / index.size))
    unit = "rad/s" if name == "n1" else "rad"
    return Multisine(name, unit, index, amplitude, rng.uniform(-np.pi, np.pi, index.size))


def made(period: float) -> MultisineDesign:
    index = np.arange(np.ceil(0.1 * period), 1.5 * period + 1, dtype=np.int64)
    levels = (0.04, 0.04, 0.05, 15.0)
    signals = tuple(
        signal(n, index[i::4], level) for i, (n, level) in enumerate(zip(NAMES, levels, strict=True))
    )
    return MultisineDesign(signals, period, 2, (0.1, 1.5 + 1 / period), 0.02, 5, {"scenario": "four.toml"})


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    surface = {"kind": "surface", "limits": (-0.4, 0.5), "rate_limit": 3.0}
    return Vehicle(
        name="Four effectors",
        mass_properties=MassProperties(mass_kg=20.0, inertia=Inertia(xx=2.0, yy=3.0, zz=4.0)),
        effectors=(
            *(Effector(name=n, **surface) for n in NAMES[:3]),
            Effector(name="n1", kind="rotor", limits=(100.0, 900.0), rate_limit=2000.0),
        ),
    )


@pytest.fixture(scope="module")
def loop(vehicle):
    return perturbed_aircraft(DERIVATIVES, vehicle, u=18.0, gains=GAINS, trim=TRIM)


@pytest.fixture(scope="module")
def design() -> MultisineDesign:
    return made(20.0)


@pytest.fixture(scope="module")
def judged(design):
    return merit(design), truncated(design)


@pytest.fixture(scope="module")
def plan(vehicle, design, loop) -> FlightPlan:
    channels = ("phi", "theta", "q", "u", *NAMES)
    varied = []
    for factor in (0.8, 0.9, 1.1, 1.2):
        scaled = {r: {k: factor * v for k, v in row.items()} for r, row in DERIVATIVES.items()}
        varied.append(
            excursions(design, perturbed_aircraft(scaled, vehicle, u=18.0, gains=GAINS, trim=TRIM), channels)
        )
    return FlightPlan(
        vehicle,
        condition="18 m/s",
        trim=TRIM,
        source="four.h5",
        sha256="cd" * 32,
        forbidden_hz=((2.0, 2.5),),
        fade_s=(2.0, 3.0),
        abort={"theta": 0.5, "q": 2.0, "alt": 30.0},
        control="attitude hold",
        motion=excursions(design, loop, channels),
        varied=varied,
    )


@pytest.fixture(scope="module")
def loads(design):
    effectiveness = np.array([[-30.0, -30.0, 0.0, 0.1], [-20.0, -25.0, 0.0, 0.0]])
    played = list(design.signals)
    turned = [replace(played[0], phase=played[0].phase + np.pi), *played[1:]]
    return ("Z", "M"), net_loads(turned, effectiveness), net_loads(played, effectiveness)


@pytest.fixture(scope="module")
def text(design, judged, plan, loads, loop) -> str:
    noise = dict.fromkeys(("u", "v", "w", "ax", "ay", "az"), 0.05) | dict.fromkeys("pqr", 0.002)
    noise |= dict.fromkeys(NAMES[:3], 0.002) | {"n1": 0.5}
    settings = Identification(responses=("Z", "M"), regressors=("w", "q", "de1", "de2", "n1"))
    expected = forecast(design, loop, settings, noise)
    study = [(merit(d), truncated(d)) for d in map(made, (16.0, 20.0, 30.0))]
    return build_design_page(design, *judged, plan=plan, net=loads, study=study, forecast=expected)


@pytest.fixture(scope="module")
def page(text) -> Page:
    return Page(text)


def test_the_page_is_well_formed_and_fetches_nothing(text, page):
    assert page.faults == []
    assert page.open == []
    ids = Counter(a["id"] for _, a in page.elements if "id" in a)
    assert max(ids.values()) == 1
    links = {v for _, a in page.elements for k, v in a.items() if k in ("href", "xlink:href")}
    assert links <= {f"#{name}" for name in ids}
    assert "http" not in without_script(text)
    assert page.all("script") == [{}]
    assert page.all("link") == page.all("img") == []


def test_every_part_has_a_figure_with_label_and_caption(page):
    figures = page.all("svg")
    # spectra, signals, net loads, the figures over the length flown, peak factors over T
    assert len(figures) == len(page.all("figcaption")) == 5
    assert all(len(figure["aria-label"] or "") > 10 for figure in figures)


def test_the_table_of_effectors_holds_the_figures_of_merit(page, judged, plan):
    head, *rows = page.cells[0]
    column = {name: k for k, (name, _) in enumerate(head)}
    for row, name, rpf, peak, slew in zip(
        rows, NAMES, judged[0].rpf, judged[0].peak, judged[0].slew, strict=True
    ):
        factor = 60 / (2 * np.pi) if name == "n1" else 180 / np.pi
        assert row[0][0] == name
        assert row[column["RPF"]][1] == rpf
        assert row[column["Peak"]][1] == pytest.approx(factor * peak, rel=1e-12)
        assert row[column["Slew (per s)"]][1] == pytest.approx(factor * slew, rel=1e-12)
        room = 400.0 if name == "n1" else 0.4
        used = float(row[column["Limit"] + 1][0].removesuffix(" %"))
        assert used == pytest.approx(100 * peak / room, abs=0.6)
        moved = plan.motion.values[plan.motion.names.index(name)]
        assert row[column["Peak with feedback"]][1] == pytest.approx(factor * np.abs(moved).max())


def test_net_loads_study_and_forecast_are_told(page, loads, judged):
    nets, study, motion, accuracy = page.cells[1:5]
    for row, after, before in zip(nets[1:], loads[1], loads[2], strict=True):
        assert row[3][1] == np.abs(before).max()
        assert row[4][1] == np.abs(after).max()
        change = float(row[5][0].replace("−", "-").removesuffix(" %"))
        assert change == pytest.approx(100 * (np.abs(after).max() / np.abs(before).max() - 1), abs=0.5)
    assert [row[0][0] for row in study[1:]] == ["16", "20 (this design)", "30"]
    assert study[2][2][0] == f"{np.median(judged[0].rpf):.3f}"
    assert [row[0][0] for row in motion[1:]] == ["phi", "theta", "q", "u"]
    assert [row[0][0] for row in accuracy[1:6]] == ["w", "q", "de1", "de2", "n1"]
    assert accuracy[5][2][0] == "–"  # the model has no M of n1


def test_the_verdict_names_what_is_wrong(design, judged, plan, vehicle):
    good = build_design_page(design, *judged, plan=plan)
    assert "no signal exceeds a limit or a slew rate" in good
    assert 'class="bad"' not in good
    near = replace(plan, trim={"n1": 890.0}, forbidden_hz=((0.5, 0.52),), abort={"theta": 1e-4})
    bad = build_design_page(design, *judged, plan=near)
    assert "<code>n1</code> beyond a limit or a slew rate" in bad
    name, f = intrusions(design, (0.5, 0.52))[0]
    assert f"<code>{name}</code> at {f:.4g} Hz" in bad
    assert "<code>theta</code> are beyond their abort limits" in bad
    slow = msgspec.structs.replace(vehicle.effectors[0], rate_limit=0.01)
    slow = msgspec.structs.replace(vehicle, effectors=(slow, *vehicle.effectors[1:]))
    assert "<code>de1</code> beyond a limit" in build_design_page(
        design, *judged, plan=FlightPlan(slow, trim=TRIM)
    )


def test_shared_harmonics_and_unknown_trims_are_said(design, vehicle):
    twin = replace(design.signals[0], name="de2")
    shared = replace(design, signals=(design.signals[0], twin, *design.signals[2:]))
    text = build_design_page(shared, merit(shared), truncated(shared), plan=FlightPlan(vehicle))
    assert "<code>de1</code> and <code>de2</code> share harmonics" in text
    assert f"Lines are shared {twin.index.size} times" in text
    assert "limits of <code>n1</code> are not judged: their trim is not given" in text


def test_hostile_names_stay_text(design, judged, vehicle):
    def named(name):
        return HOSTILE.replace("/", "|") if name == "da" else name

    effectors = tuple(msgspec.structs.replace(e, name=named(e.name)) for e in vehicle.effectors)
    hostile = msgspec.structs.replace(vehicle, name=HOSTILE, effectors=effectors)
    renamed = replace(design, signals=tuple(replace(s, name=named(s.name)) for s in design.signals))
    plan = FlightPlan(hostile, condition=HOSTILE, source=HOSTILE, control=HOSTILE)
    text = build_design_page(renamed, merit(renamed), judged[1], plan=plan)
    assert Page(text).faults == []
    assert "<script" not in without_script(text)
    card = cards.build_card(renamed, merit(renamed), plan)
    assert "<script" in cards.test_card_text(card)  # plain text is not escaped
    assert all(len(line) <= 150 for line in cards.test_card_text(card).splitlines())


def test_pages_repeat_to_the_byte(design, judged, plan):
    assert build_design_page(design, *judged, plan=plan) == build_design_page(design, *judged, plan=plan)


def test_the_card_scales_inputs_and_motion_by_level(design, judged, plan):
    card = cards.build_card(design, judged[0], plan)
    rows = {row.label: row for row in card.inputs}
    assert list(rows) == ["de1, de2", "da", "n1"]
    peak = np.degrees(judged[0].peak[:2].max())
    for cell, level in zip(rows["de1, de2"].cells, (0.25, 0.5, 0.75, 1.0), strict=True):
        assert float(cell.split(" / ")[1]) == pytest.approx(level * peak, rel=0.006)
    assert rows["de1, de2"].limit == "±22.92"  # 0.4 rad is nearer than 0.5
    moving = {row.label: row for row in card.motion}
    i = plan.motion.names.index("theta")
    spread = np.degrees(np.std([v.peak[i] for v in plan.varied], ddof=1))
    value, sigma = map(float, moving["theta"].cells[3].split(" ± "))
    assert value == pytest.approx(np.degrees(plan.motion.peak[i]), rel=0.02)
    assert sigma == pytest.approx(spread, rel=0.06)
    assert moving["theta"].limit == "±28.65"
    assert moving["phi"].limit == cards.BLANK
    assert moving["alt"].cells == ("not predicted: the model does not have it",)
    assert card.bands[0][0]


def test_the_share_of_time_beyond_limits_counts_position_and_rate(design, judged, plan, vehicle):
    i = plan.motion.names.index("n1")
    row = plan.motion.values[i]
    near = replace(plan, trim={"n1": 880.0})
    expected = np.mean(row > 20.0)
    assert 0 < expected < 1
    assert near.saturated(1.0)["n1"] == pytest.approx(expected)
    assert near.saturated(0.25)["n1"] < expected
    dt = plan.motion.time[1]
    rate = (np.roll(row, -1) - np.roll(row, 1)) / (2 * dt)
    limit = float(np.quantile(np.abs(rate), 0.8))
    slow = msgspec.structs.replace(vehicle.effectors[3], rate_limit=limit)
    slow = msgspec.structs.replace(vehicle, effectors=(*vehicle.effectors[:3], slow))
    assert replace(plan, vehicle=slow).saturated(1.0)["n1"] == pytest.approx(0.2, abs=0.01)
    last = cards.build_card(design, judged[0], near).motion[-1]
    assert last.label == "beyond limits"
    assert last.cells[3].endswith("n1")
    assert last.missed[3]


def test_the_card_marks_what_is_beyond_and_leaves_blanks(design, judged, vehicle, plan):
    bare = cards.test_card_text(cards.build_card(design, judged[0], FlightPlan(vehicle)))
    assert bare.count("not predicted: no model given") == 7  # six states, and the time beyond limits
    assert "trim not given" in bare
    assert re.search(r"^phi .*_______$", bare, re.MULTILINE)
    tight = replace(plan, abort={"theta": 0.6 * plan.expected("theta")[1]}, forbidden_hz=((0.5, 0.6),))
    card = cards.build_card(design, judged[0], tight)
    missed = next(row for row in card.motion if row.label == "theta").missed
    assert missed == (False, False, True, True)
    text = cards.test_card_text(card)
    assert re.search(r"^theta( .*[^!])? +\S+ ± \S+! +\S+ ± \S+! ", text, re.MULTILINE)
    assert "0.5 to 0.6 Hz: FAIL" in text


def test_the_text_card_keeps_its_columns(design, judged, plan):
    text = cards.test_card_text(cards.build_card(design, judged[0], plan))
    lines = text.splitlines()
    assert max(map(len, lines)) <= 92
    for said in (
        "Four effectors",
        "18 m/s",
        "four.h5",
        "cd" * 32,
        "ramp in 2 s, ramp out 3 s",
        "attitude hold",
    ):
        assert said in text
    start = next(i for i, line in enumerate(lines) if line.startswith("EXPECTED")) + 1
    columns = [line.index("limit" if "limit" in line else "±", 60) for line in lines[start : start + 1]]
    assert lines[start + 2][columns[0]] == "±"  # theta's limit stands below the head
    assert lines[start + 5][columns[0]] == "±"  # alt's too, though one text fills its levels


def test_the_printed_card_is_well_formed(tmp_path, design, judged, plan):
    cards.write_test_card(tmp_path / "card.html", cards.build_card(design, judged[0], plan))
    text = (tmp_path / "card.html").read_text(encoding="utf-8")
    page = Page(text)
    assert page.faults == []
    assert page.open == []
    assert "http" not in text
    assert len(page.cells) == 3
    assert "PASS, empty" in text


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no browser to print with")
def test_the_card_prints_on_one_sheet(tmp_path, design, judged, plan):
    cards.write_test_card(tmp_path / "card.html", cards.build_card(design, judged[0], plan))
    quiet = ["--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"]
    quiet += ["--disable-background-networking", "--disable-component-update"]
    subprocess.run(
        [
            "chromium",
            "--headless",
            "--no-sandbox",
            *quiet,
            f"--user-data-dir={tmp_path / 'profile'}",
            f"--print-to-pdf={tmp_path / 'card.pdf'}",
            (tmp_path / "card.html").as_uri(),
        ],
        check=True,
        capture_output=True,
        timeout=60,
    )
    counts = re.findall(rb"/Count (\d+)", (tmp_path / "card.pdf").read_bytes())
    assert counts == [b"1"]


def test_many_effectors_are_grouped_by_kind(vehicle):
    names = [f"{stem}{i}" for stem in "abcdefgh" for i in (1, 2)] + ["x1", "x2"]
    surface = {"kind": "surface", "limits": (-0.4, 0.5)}
    effectors = [Effector(name=n, **surface) for n in names[:-2]]
    effectors += [Effector(name=n, kind="rotor", limits=(0.0, 900.0)) for n in names[-2:]]
    many = msgspec.structs.replace(vehicle, effectors=tuple(effectors))
    assert effector_groups(names, many) == {"surfaces": list(range(16)), "rotors": [16, 17]}
    assert effector_groups(["a1", "a2", "b1", "x1"], many) == {"a1, a2": [0, 1], "b1": [2], "x1": [3]}
    assert reach(many, "x1", {}) is None
    assert reach(many, "x1", {"x1": 300.0}) == (-300.0, 600.0)
    assert reach(many, "a1", {}) == (-0.4, 0.5)


def test_whole_numbers_are_written_shortly():
    assert runs([3, 21, 39, 57]) == "3 to 57 by 18"
    assert runs([3, 4, 5, 9, 11, 12]) == "3 to 5, 9, 11, 12"
    assert runs([7]) == "7"
