"""The page: self-contained, well-formed, the model's own numbers, safe against what files may hold."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from page_script import without_script

from freqid.core.errors import DataError
from freqid.core.record import FlightRecord
from freqid.core.scenario import Gates
from freqid.report.kit.rendering import write_text
from freqid.report.point.page import build_page

VOID = {"meta", "br", "hr", "img", "link", "input"}
PLAIN = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻−", "0123456789--")
HOSTILE = '<script>alert("$x$")</script>{{ 7 * 7 }}&amp;'


class Page(HTMLParser):
    """What a browser would see: elements with their attributes, texts, and tags left open."""

    def __init__(self, text: str):
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.faults: list[str] = []
        self.cells: list[list[list[tuple[str, float | None]]]] = []  # table, row, cell: text and value
        self.styles = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.elements.append((tag, attributes))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "table":
            self.cells.append([])
        elif tag == "tr":
            self.cells[-1].append([])
        elif tag in ("td", "th"):
            self.cells[-1][-1].append(("", None))
        elif tag == "data":
            self.cells[-1][-1][-1] = ("", float(attributes["value"]))

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.faults.append(f"</{tag}> at {self.getpos()}")

    def handle_data(self, data):
        if "style" in self.open:
            self.styles += data
        if "td" in self.open or "th" in self.open:
            text, value = self.cells[-1][-1][-1]
            self.cells[-1][-1][-1] = (text + data, value)

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


@pytest.fixture(scope="module")
def text(model, record) -> str:
    return build_page(model, record, gates=Gates(r2=0.9))


@pytest.fixture(scope="module")
def page(text) -> Page:
    return Page(text)


def test_the_page_is_well_formed(page):
    assert page.faults == []
    assert page.open == []
    ids = Counter(a["id"] for _, a in page.elements if "id" in a)
    assert ids
    assert [name for name, count in ids.items() if count > 1] == []


def test_every_reference_leads_to_an_id_of_the_page(page):
    ids = {a["id"] for _, a in page.elements if "id" in a}
    links = [v for _, a in page.elements for k, v in a.items() if k in ("href", "xlink:href")]
    clips = [m for _, a in page.elements for v in a.values() for m in re.findall(r"url\((.*?)\)", v or "")]
    assert len(clips) > 10
    assert {*links, *clips} <= {f"#{name}" for name in ids}


def test_the_page_fetches_nothing(text, page):
    assert "http:" not in without_script(text)
    assert "https:" not in text
    assert page.all("script") == [{}]
    assert page.all("link") == page.all("img") == page.all("image") == []
    assert not any("src" in a for _, a in page.elements)
    assert "url(" not in page.styles
    assert "@import" not in page.styles
    assert not any(name.startswith("on") for _, a in page.elements for name in a)


def test_every_figure_has_a_label_and_a_caption(page, model, record):
    figures = page.all("svg")
    assert len(page.all("figure")) == len(page.all("figcaption")) == len(figures)
    # data: air, states, responses, effectors and their amplitudes; fits; prediction; bars; correlations
    maps = len({r.correlation.round(6).tobytes() for r in model.responses.values()})
    assert len(figures) == 5 + 2 * 3 + 1 + 3 + maps
    assert all(figure["role"] == "img" and len(figure["aria-label"] or "") > 10 for figure in figures)


def test_two_renders_are_the_same_bytes(text, model, record):
    assert build_page(model, record, gates=Gates(r2=0.9)) == text


def test_the_table_of_parameters_holds_the_models_numbers(page, model):
    tables = [t for t in page.cells if t[0][0][0] == "Parameter"]
    assert len(tables) == len(model.responses)
    for table, response in zip(tables, model.responses.values(), strict=True):
        rows = {row[0][0]: row for row in table[1:]}
        assert list(rows) == [*response.regressors, "bias"]
        for j, name in enumerate(response.regressors):
            _, estimate, error, relative, t, low, high, inflation, unit = rows[name]
            exact = [estimate[1], error[1], t[1], low[1], high[1], inflation[1]]
            held = ("estimate", "std_error", "t_statistic", "lower", "upper", "variance_inflation")
            assert exact == [getattr(response, field)[j] for field in held]
            for shown, value in (estimate, error, low, high):
                mantissa, _, power = shown.translate(PLAIN).partition("×10")
                scale = 10.0 ** int(power or 0)
                place = 10.0 ** -len(mantissa.partition(".")[2]) * scale
                assert abs(float(mantissa) * scale - value) <= 0.5000001 * place
            percent = 100 * response.std_error[j] / abs(response.estimate[j])
            assert relative[0].endswith(" %")
            if percent <= 1000:
                assert float(relative[0][:-2]) == pytest.approx(percent, rel=0.06)
            assert unit[0] == ("1/(rad/s)" if name == "p" else "1/rad")
        assert rows["bias"][1][1] == response.bias
        assert rows["bias"][2][1] == response.bias_std_error


def test_the_summary_holds_the_scores(page, model):
    head, *rows = page.cells[0]
    columns = {name: k for k, (name, _) in enumerate(head)}
    for row, (name, response) in zip(rows, model.responses.items(), strict=True):
        assert row[columns["R²"]][1] == response.r2
        assert row[columns["R² in time"]][1] == response.fit["time"].r2
        assert row[columns["Condition number"]][1] == response.condition_number
        if name in model.prediction:
            assert row[columns["R² predicted"]][1] == model.prediction[name].r2
        else:
            assert row[columns["R² predicted"]] == ("–", None)


def test_provenance_and_configuration_are_told(text, record):
    for said in ("ab" * 32, "log.csv: da_cmd", "T-1", "fw 2", "c0ffee", "reports/one.h5", "reports/two.h5"):
        assert said in text


def test_it_needs_no_record_no_prediction_and_no_time_fit(model):
    responses = {
        name: replace(response, fit={"frequency": response.fit["frequency"]})
        for name, response in model.responses.items()
    }
    text = build_page(replace(model, responses=responses, prediction={}, provenance={}))
    page = Page(text)
    assert page.faults == []
    assert 'id="data"' not in text
    assert 'id="prediction"' not in text
    assert "What each parameter of" in text
    assert len(page.all("svg")) == 3 + 3 + len({r.correlation.round(6).tobytes() for r in responses.values()})


def test_a_fit_in_time_alone_is_shown(model):
    response = model["N"]
    alone = replace(response, fit={"time": response.fit["time"]})
    text = build_page(replace(model, method="time", responses={"N": alone}, prediction={}))
    assert Page(text).faults == []
    assert "time domain" in text
    assert "R² in time</th>" not in text


def test_hostile_names_stay_text(model, record):
    name = HOSTILE.replace("/", "|")
    channels = dict(record.channels)
    channels[f"effector/{name}"] = replace(channels["effector/da"], name=f"effector/{name}", unit=HOSTILE)
    response = replace(
        model["N"],
        response=HOSTILE,
        regressors=(HOSTILE, "a" * 90, "$\\frac", "日本"),
        regressor_units=(HOSTILE, "1", "rad", "rad/s"),
        inseparable=((HOSTILE, "$\\frac"),),
    )
    hostile = replace(
        model,
        vehicle=HOSTILE,
        reference=type(model.reference)(id=HOSTILE, u=float("nan"), rho=1.0),
        responses={HOSTILE: response},
        prediction={HOSTILE: model.prediction["N"]},
        provenance={HOSTILE: [HOSTILE, {"inner": HOSTILE}], "predicted": HOSTILE},
    )
    text = build_page(hostile, replace(record, channels=channels), gates=Gates(r2=0.99999))
    page = Page(text)
    assert page.faults == []
    assert page.all("script") == [{}]
    assert "<script" not in without_script(text)
    assert "49" not in [cell for table in page.cells for row in table for cell, _ in row]
    ids = Counter(a["id"] for _, a in page.elements if "id" in a)
    assert max(ids.values()) == 1


def test_numbers_that_do_not_exist_are_dashes(model):
    response = model["N"]
    unknown = np.array([np.nan, np.inf, *response.std_error[2:]])
    broken = replace(
        response,
        r2=float("nan"),
        pse=float("inf"),
        std_error=unknown,
        t_statistic=response.estimate / unknown,
        variance_inflation=np.array([np.inf, 1.0, 1.0, 1.0]),
        correlation=np.full((4, 4), np.nan),
    )
    text = build_page(replace(model, responses={"N": broken}, prediction={}), gates=Gates(r2=0.9))
    words = re.findall(
        r"[\w.]+", re.sub(r"<style>.*?</style>|<[^>]*>", " ", without_script(text), flags=re.DOTALL)
    )
    assert not {"nan", "NaN", "inf", "None"} & set(words)
    assert not re.search(r'"[^"]*\bnan\b[^"]*"', text)
    assert "R² – where 0.9 is asked" in text


def test_the_record_is_shown_as_far_as_it_was_used(model, record):
    short = replace(model, responses={"N": model["N"]}, prediction={}, duration=30.0)
    short = replace(short, provenance={"cut": "5:35"})
    assert "1501 at 50 Hz" in build_page(short, record)
    assert "1501 at 50 Hz" in build_page(short, record.cut(5, 35))  # cut before it was given
    with pytest.raises(DataError, match="lasts 20 s, but the model was made from 30 s"):
        build_page(short, record.cut(5, 25))


def test_it_is_written_whole_or_not_at_all(tmp_path, model, monkeypatch):
    small = replace(model, responses={"N": model["N"]}, prediction={})
    path = tmp_path / "new" / "page.html"
    write_text(path, build_page(small))
    assert path.read_text(encoding="utf-8") == build_page(small)
    assert [p.name for p in path.parent.iterdir()] == ["page.html"]
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(DataError, match="cannot be written"):
        write_text(blocked / "page.html", build_page(small))


def test_a_long_record_makes_a_small_page(model, record):
    """Histories are thinned: 15 times the samples, hardly more bytes."""
    small = replace(model, responses={"N": model["N"]}, prediction={})
    repeats = 15
    long = FlightRecord(
        np.arange(record.time.size * repeats) * record.dt,
        {n: replace(c, values=np.tile(c.values, repeats)) for n, c in record.channels.items()},
    )
    drawn = replace(small, duration=long.duration)
    assert len(build_page(drawn, long)) < 1.5 * len(build_page(small, record))
