"""The page of a study: true to its results, honest where something is missing."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
import pytest
from page_script import without_script
from test_page import HOSTILE, Page

from freqid.blend.corridor_study import HeldOut, StudiedPoint, StudyResults
from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.results.design import Multisine, MultisineDesign
from freqid.core.results.point import ErrorsInVariables, ResponseModel
from freqid.core.scenario import Reference
from freqid.core.sections.identification import Identification
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.design.multisine.signals import sample
from freqid.identify.in_flight.parameter_history import parameter_history
from freqid.identify.point import identify_point, predict_responses
from freqid.report.kit.rendering import write_text
from freqid.report.study.page import build_study_page, condition_rows, held_out_rows

EFFECTORS = ("de1", "de2", "dr1", "n1")
REGRESSORS = {"Z": ("u", "w", "q", "de1", "de2", "n1"), "N": ("v", "r", "dr1")}
UNITS = dict.fromkeys("uvw", "m/s") | dict.fromkeys("qr", "rad/s")
UNITS |= dict.fromkeys(EFFECTORS[:3], "rad") | {"n1": "rad/s"}
SPEEDS, DENSITIES = (8.0, 14.0, 20.0), (1.225, 1.0)
HELD = "u14-1"
DT, PERIOD, PERIODS = 0.04, 25.0, 3


def truth(response: str, u: float, rho: float) -> dict[str, float]:
    """Derivatives that grow with dynamic pressure, and with speed for rates and velocities."""
    size = {"Z": (-3.0, -8.0, -4.0, -30.0, -25.0, -0.1), "N": (3.0, -5.0, 12.0)}[response]
    return {
        name: value * rho * (1 + u / 10) ** (2 if UNITS[name] == "rad" else 1)
        for name, value in zip(REGRESSORS[response], size, strict=True)
    }


@cache
def designed() -> MultisineDesign:
    index = np.arange(3, 45)
    signals = []
    for i, name in enumerate(EFFECTORS):
        own = index[i :: len(EFFECTORS)]
        size = np.full(own.size, 5.0 if name == "n1" else 0.02)
        phase = np.random.default_rng(i).uniform(-np.pi, np.pi, own.size)
        signals.append(Multisine(name, UNITS[name], own, size, phase))
    return MultisineDesign(tuple(signals), PERIOD, PERIODS, (0.1, 1.8), DT, 1, {"scenario": "case.toml"})


@cache
def aircraft() -> Vehicle:
    surface = {"kind": "surface", "limits": (-0.5, 0.5)}
    return Vehicle(
        name="Four effectors",
        mass_properties=MassProperties(mass_kg=10.0, inertia=Inertia(xx=1.0, yy=1.0, zz=1.5)),
        effectors=(
            *(Effector(name=n, **surface) for n in EFFECTORS[:3]),
            Effector(name="n1", kind="rotor", limits=(100.0, 900.0)),
        ),
    )


def flown(at: Reference, seed: int) -> Maneuver:
    """Return a manoeuvre whose states are their own sums of sines, and whose responses are linear."""
    rng = np.random.default_rng(seed)
    per_period = round(PERIOD / DT)
    time = np.arange(PERIODS * per_period + 1) * DT
    moved = {
        s.name: np.resize(sample(s.index, s.amplitude, s.phase, per_period), time.size)
        for s in designed().signals
    }
    for name in ("u", "v", "w", "q", "r"):
        lines = np.arange(3, 45) / PERIOD
        phase = rng.uniform(0, 2 * np.pi, lines.size)
        size = 0.1 if UNITS[name] == "m/s" else 0.02
        moved[name] = size * np.sin(2 * np.pi * np.outer(time, lines) + phase).sum(axis=1)
    channels = []
    for name, values in moved.items():
        group = "effector" if name in EFFECTORS else "state"
        trim = {"u": at.u, "n1": 500.0}.get(name, 0.0)
        channels.append(Channel(f"{group}/{name}", UNITS[name], values + trim, 1 / DT, "made"))
    for response, unit in (("Z", "N"), ("N", "N m")):
        clean = sum(value * moved[n] for n, value in truth(response, at.u, at.rho).items())
        noise = 0.1 * clean.std() * rng.standard_normal(time.size)
        channels.append(Channel(f"response/{response}", unit, clean + noise - 100, 1 / DT, "made"))
    return Maneuver.of(
        FlightRecord(time, {c.name: c for c in channels}, vehicle=aircraft(), provenance={"made": seed})
    )


def both_ways(response: ResponseModel, off: float) -> ResponseModel:
    """Return the response with a second estimate beside it, `off` standard deviations away in the first."""
    p = len(response.regressors)
    away = np.zeros(p)
    away[0] = off
    beside = ErrorsInVariables(
        estimate=response.estimate - away * response.std_error,
        std_error=response.std_error,
        difference_std_error=response.std_error,
        critical=np.full(p, 3.0),
        strength=np.full(p, 100.0),
    )
    return replace(response, errors_in_variables=beside)


@cache
def results() -> StudyResults:
    settings = Identification(
        responses=("Z", "N"),
        regressors=REGRESSORS,
        response_source="record",
        frequencies_hz=tuple((np.arange(3, 45) / PERIOD).tolist()),
    )
    points, held_out = [], []
    for rho in DENSITIES:
        for k, u in enumerate(SPEEDS):
            at = Reference.of(id=f"u{u:g}-{rho:g}", u=u, rho=rho, dw1=0.4 - u / 60, dw2=0.4 - u / 60)
            used, other = flown(at, k), flown(at, 50 + k)
            model = identify_point(used, settings, reference=at)
            responses = {n: both_ways(r, 5.0 if n == "Z" else 1.0) for n, r in model.responses.items()}
            model = replace(model, responses=responses, prediction=predict_responses(model, other, settings))
            history, time, errors = {}, np.zeros(0), {}
            if rho == DENSITIES[0]:
                history = parameter_history(used, settings, every_s=5.0)
                time = history["Z"].time
                errors = {n: 1 + np.exp(-h.time / 10) for n, h in history.items()}
            linear = {n: truth(n, u, rho) for n in REGRESSORS}
            points.append(StudiedPoint(model, linear, history, time, errors))
            if at.id == HELD:
                held_out.append(HeldOut(at, {"Z": 1.1, "N": 0.52}, {"Z": 1.0, "N": 0.4}))
    knots = [p.model for p in points if p.id != HELD]
    blended = GlobalModel(line_up(knots, [m.reference.id for m in knots]))
    return StudyResults(
        aircraft(), "research", 1.0, "instruments", designed(), tuple(points), blended, tuple(held_out)
    )


@pytest.fixture(scope="module")
def text() -> str:
    return build_study_page(results())


@pytest.fixture(scope="module")
def page(text) -> Page:
    return Page(text)


def table(page: Page, head: str) -> list[list[tuple[str, float | None]]]:
    return next(t for t in page.cells if any(head in cell[0] for cell in t[0]))


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
    # errors over speed; telling and other parameters of Z (N has no others); frequency, time and
    # prediction at three conditions, and the three beside each other; errors and settling over time;
    # histories at three conditions; inputs
    assert len(figures) == len(page.all("figcaption")) == 1 + 3 + 3 * 3 + 1 + 2 + 3 * 2 + 2
    assert all(len(figure["aria-label"] or "") > 10 for figure in figures)


def test_the_conditions_are_those_of_the_models(page):
    _, symbols, *rows = table(page, "Condition")
    assert [cell[0] for cell in symbols] == ["Z", "N"]
    assert [row[0][0] for row in rows] == [p.id for p in results().points]
    ends = round(2 / (44 / PERIOD) / DT)
    for row, point in zip(rows, results().points, strict=True):
        models = [point.model[r] for r in ("Z", "N")]
        assert [row[4][1], row[5][1]] == [m.r2 for m in models]
        ratios = []
        for m in models:
            fitted, predicted = m.fit["time"].residual, point.model.prediction[m.response].residual
            ratios.append(np.std(predicted[ends:-ends]) / np.std(fitted[ends:-ends]))
        assert row[6][1] == pytest.approx(max(ratios))
        assert row[6][0].endswith("ZN"[int(np.argmax(ratios))])
        assert row[7][0] == "1"  # Z by u is 5 standard deviations off, 3 are allowed
        known = [truth(m.response, point.model.reference.u, point.model.reference.rho) for m in models]
        near = [
            abs(m.estimate[j] - k[n]) <= 2 * m.std_error[j]
            for m, k in zip(models, known, strict=True)
            for j, n in enumerate(m.regressors)
        ]
        assert row[8][1] == np.mean(near)
        assert row[9][1] == max(m.condition_number for m in models)


def test_a_fit_that_explains_little_stands_out():
    made = results()
    model = made.points[0].model
    odd = {"Z": replace(model["Z"], r2=0.949), "N": replace(model["N"], r2=0.951)}
    first = replace(made.points[0], model=replace(model, responses=odd))
    row = condition_rows(replace(made, points=(first, *made.points[1:])))[0]
    assert [cell["low"] for cell in row["r2"]] == [True, False]


def test_what_was_held_out_is_compared_with_a_point_model(page, text):
    _, row = table(page, "Asked")
    assert row[0][0] == HELD
    assert (row[4][1], row[5][1], row[6][0]) == (pytest.approx(1.1), pytest.approx(1.3), "1.25")
    assert "1.30" in text.partition("At a condition that it was not made from")[2][:200]
    section = text.partition('id="held-out"')[2].partition("</section>")[0]
    assert section.count('class="strong"') == 1  # 1.3 where 1.25 is asked


def test_a_density_of_its_own_may_be_farther_off():
    made = results()
    knots = [p.model for p in made.points if p.model.reference.rho == DENSITIES[0]]
    (row,) = held_out_rows(replace(made, model=GlobalModel(line_up(knots, [m.reference.id for m in knots]))))
    assert (row["most"], [cell["far"] for cell in row["cells"]]) == ("1.5", [False, False])
    (row,) = held_out_rows(made)
    assert (row["most"], [cell["far"] for cell in row["cells"]]) == ("1.25", [False, True])


def test_the_same_results_give_the_same_bytes(text, tmp_path):
    write_text(tmp_path / "page.html", build_study_page(results()))
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == text


def test_real_flights_need_no_truth_no_global_model_and_no_history():
    bare = []
    for point in results().points[:2]:
        alone = {
            n: replace(r, errors_in_variables=None, fit={"frequency": r.fit["frequency"]})
            for n, r in point.model.responses.items()
        }
        bare.append(
            StudiedPoint(replace(point.model, responses=alone, prediction={}), {}, {}, np.zeros(0), {})
        )
    text = build_study_page(replace(results(), points=tuple(bare), model=None, held_out=()))
    page = Page(text)
    assert page.faults == []
    for part in ("held-out", "length"):
        assert f'id="{part}"' not in text
    assert "linearised" not in text.partition('id="glossary"')[0]
    assert "No manoeuvre was predicted" in text
    _, _, first, _ = table(page, "Condition")
    assert [first[6], first[7]] == [("– ", None), ("–", None)]


def test_what_a_study_was_made_from_is_told():
    made = {"scenario": "tilt.toml", "conditions": ["u8", "u14"], "held out": []}
    told = build_study_page(replace(results(), provenance=made)).partition('id="provenance">')[2]
    words = re.sub(r"<[^>]*>", " ", told.partition("</section>")[0]).split()
    assert " ".join(words) == "Provenance scenario tilt.toml conditions u8, u14 held out –"


def test_hostile_names_stay_text():
    point = results().points[0]
    model = point.model
    odd = replace(model["Z"], response=HOSTILE, regressors=(HOSTILE, "a" * 90, "$\\frac", "日本", "q", "n1"))
    odd = replace(odd, inseparable=((HOSTILE, "q"),), regressor_units=(HOSTILE, *odd.regressor_units[1:]))
    model = replace(model, responses={HOSTILE: odd}, prediction={HOSTILE: model.prediction["Z"]})
    model = replace(model, reference=Reference(id=HOSTILE, u=float("nan"), rho=float("nan")))
    vehicle = msgspec.structs.replace(aircraft(), name=HOSTILE)
    alone = StudiedPoint(model, {}, {}, np.zeros(0), {})
    text = build_study_page(StudyResults(vehicle, HOSTILE, 1.0, HOSTILE, designed(), (alone,)))
    assert Page(text).faults == []
    assert "<script" not in without_script(text)
    assert "{{ 7 * 7 }}" in text
    assert 'id="corridor"' not in text  # no speed is known to draw against
