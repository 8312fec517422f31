"""What a study's page says first follows from its numbers and turns with them."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_study_page import HELD, both_ways, results
from test_study_results import history

from freqid.blend.corridor_study import HeldOut, StudiedPoint, StudyResults
from freqid.core.results.design import MultisineDesign
from freqid.core.results.judged.review import Source
from freqid.report.study.page import build_study_page, condition_rows
from freqid.report.study.verdict import settled_by, study_verdict
from freqid.workflows.reviews.grounds import grounds_of
from freqid.workflows.reviews.read_together import ReviewedFile


def said(of: StudyResults) -> list[tuple[str, str]]:
    return [(f.kind, re.sub(r"<[^>]+>", "", str(f.text))) for f in study_verdict(of)]


def about(of: StudyResults, words: str) -> tuple[str, str]:
    (found,) = [(kind, text) for kind, text in said(of) if words in text]
    return found


def changed(point: StudiedPoint, **fields: object) -> StudyResults:
    made = results()
    points = [replace(p, **fields) if p is point else p for p in made.points]  # type: ignore[arg-type]
    return replace(made, points=tuple(points))


def test_the_headline_counts_good_fits_and_names_the_worst():
    made = results()
    scores = {f"{r} at {p.id}": p.model[r].r2 for p in made.points for r in ("Z", "N")}
    worst = min(scores, key=lambda at: scores[at])
    good = sum(score >= 0.95 for score in scores.values())
    kind, text = said(made)[0]
    assert text.startswith(
        f"6 conditions: {good} of 12 responses are modelled with R² of 0.95 or more (lowest: "
    )
    assert f", {worst}). Manoeuvres" in text
    assert kind == ("good" if good == 12 else "note")


def test_a_prediction_that_is_far_worse_than_the_fit_is_a_problem():
    point = results().points[0]
    worse = {n: replace(f, modelled=0.5 * f.modelled) for n, f in point.model.prediction.items()}
    kind, text = said(changed(point, model=replace(point.model, prediction=worse)))[0]
    assert kind == "bad"
    assert f"at {point.id}; 2 of 12 above 1.15)" in text


@pytest.mark.parametrize(("times", "kind"), [(1.1, "good"), (1.16, "note"), (1.9, "note"), (2.1, "bad")])
def test_the_headline_is_as_grave_as_the_review_of_the_same_prediction(times, kind):
    """Of a model and prediction whose errors are so many times those of the fit, in every response."""
    point = results().points[0]
    model = point.model
    prediction = {}
    for n, f in model.prediction.items():
        now = point.validation_ratio(n)
        error = (f.modelled - f.measured) * times / now
        prediction[n] = replace(f, modelled=f.measured + error)
    responses = {n: replace(r, r2=0.99) for n, r in model.responses.items()}
    alone = replace(point, model=replace(model, responses=responses, prediction=prediction))
    judged = replace(results(), points=(alone,))
    assert max(alone.validation_ratio(n) for n in model.responses) == pytest.approx(times)
    assert said(judged)[0][0] == kind
    read = ReviewedFile(Source("study", "freqid-study", ""), Path("study"), judged)
    tried = "on a flight that it was not made from, the"
    weights = {g.weight for g in grounds_of([read], None) if tried in g.text}
    assert weights == {{"good": "good", "note": "risk", "bad": "stop"}[kind]}


def test_held_out_conditions_are_good_until_one_is_too_far():
    made = results()
    kind, text = about(made, "not made from")
    assert (kind, "1.10 to 1.30 times" in text) == ("bad", True)
    assert f"N at {HELD}, 1.30" in text
    assert "1 of 2 are beyond 1.25" in text
    at = made.held_out[0].reference
    good = HeldOut(at, {"Z": 1.0, "N": 1.2}, {"Z": 1.0, "N": 1.0})
    assert about(replace(made, held_out=(good,)), "not made from")[0] == "good"
    assert not any("not made from" in text for _, text in said(replace(made, held_out=())))


def test_parameters_that_settle_late_are_a_problem():
    made = results()
    falling = np.linspace(100, 0, 66)[:, None] * np.ones(2)
    late = history(falling, np.ones_like(falling))
    assert settled_by(made) == 65.0  # 40 s into the second of three periods of 25 s
    point = made.points[0]
    kind, text = about(changed(point, history={"Z": late}), "stay within 2σ")
    assert kind == "bad"
    assert "from 74 s on" in text  # 2σ is 2, a slope of 100 in 65 s gives that for 1.3 s
    assert point.id in text
    assert "later than 65 s" in text
    one: MultisineDesign = replace(made.design, periods=1)
    short = replace(changed(point, history={"Z": late}), design=one)
    assert settled_by(short) is None
    assert about(short, "stay within 2σ")[0] == "good"  # nothing is asked of a single period


def test_estimators_that_differ_are_counted():
    made = results()
    kind, text = about(made, "biases least squares")
    assert (kind, "6 of 54 parameters" in text) == ("note", True)  # u of Z at six conditions
    agreeing = [
        replace(
            p, model=replace(p.model, responses={n: both_ways(r, 1.0) for n, r in p.model.responses.items()})
        )
        for p in made.points
    ]
    assert about(replace(made, points=tuple(agreeing)), "agree within noise")[0] == "good"


@pytest.mark.parametrize(("off", "within", "word"), [(1.5, 54, "good"), (3.0, 0, "bad")])
def test_the_linearised_simulation_is_held_against_the_errors(off, within, word):
    points = []
    for p in results().points:
        linear = {
            n: dict(zip(r.regressors, (r.estimate - off * r.std_error).tolist(), strict=True))
            for n, r in p.model.responses.items()
        }
        points.append(replace(p, linear=linear))
    kind, text = about(replace(results(), points=tuple(points)), "linearised simulation")
    assert kind == word  # nothing beside it tells why
    only = "Only " if word == "bad" else ""
    assert text.startswith(f"{only}{within} of 54 parameters ({100 * within // 54} %) lie within 2σ")
    assert f"the distance is {off:.1f}σ" in text


def test_what_the_data_confuse_is_named():
    point = results().points[0]
    model = point.model
    confused = replace(
        model, responses={**model.responses, "Z": replace(model["Z"], inseparable=(("u", "w"),))}
    )
    assert about(results(), "separate every")[0] == "good"
    kind, text = about(changed(point, model=confused), "cannot separate")
    assert (kind, text) == ("bad", f"The data cannot separate u, w at {point.id}.")


def test_a_low_r2_is_excused_where_noise_allows_no_more():
    made = results()
    points = []
    for point in made.points:
        responses = {
            name: replace(response, r2=0.99, r2_ceiling=0.995)
            for name, response in point.model.responses.items()
        }
        points.append(replace(point, model=replace(point.model, responses=responses)))
    low = {name: replace(r, r2=0.80, r2_ceiling=0.81) for name, r in points[0].model.responses.items()}
    points[0] = replace(points[0], model=replace(points[0].model, responses=low))
    excused = replace(made, points=tuple(points))
    assert about(excused, "below 0.95")[1] == (
        "R² is below 0.95 for Z (1) and N (1), the number of conditions in brackets: "
        "noise sets it a ceiling there."
    )
    assert [cell["low"] for cell in condition_rows(excused)[0]["r2"]] == [False, False]
    low["N"] = replace(low["N"], r2_ceiling=0.97)
    short = replace(
        excused, points=(replace(points[0], model=replace(points[0].model, responses=low)), *points[1:])
    )
    assert about(short, "below 0.95")[1].endswith(f"there; also below its ceiling: N at {points[0].id}.")
    assert [cell["low"] for cell in condition_rows(short)[0]["r2"]] == [False, True]
    assert "0.970" in build_study_page(short)
