from __future__ import annotations

from dataclasses import replace

import numpy as np

from freqid.core.results.fit import Fit
from freqid.core.scenario import Gates
from freqid.report.point.verdict import crosses_zero, missed_by_response, point_verdict


def said(model, gates=None) -> list[tuple[str, str]]:
    return [(finding.kind, finding.text.striptags()) for finding in point_verdict(model, gates)]


def changed(model, name, **fields):
    return replace(model, responses={**model.responses, name: replace(model[name], **fields)})


def test_the_headline_names_the_best_and_the_worst(model):
    model = changed(changed(changed(model, "Y", r2=0.97), "L", r2=0.91), "N", r2=0.9912)
    kind, text = said(model)[0]
    assert (kind, text) == (
        "note",
        "R² is from 0.910 (Cl) to 0.9912 (Cn). No gate was given to hold it against.",
    )


def test_the_headline_says_whether_the_gates_are_reached(model):
    model = changed(changed(changed(model, "Y", r2=0.97), "L", r2=0.91), "N", r2=0.9912)
    kind, text = said(model, Gates(r2=0.9))[0]
    assert (kind, text) == ("good", "Every response reaches its gate: R² is from 0.910 (Cl) to 0.9912 (Cn).")
    kind, text = said(model, Gates(r2={"L": 0.95}))[0]
    assert kind == "bad"
    assert text.startswith("1 of 3 responses misses a gate: Cl (R² 0.910 where 0.95 is asked).")
    condition = model["N"].condition_number
    kind, text = said(model, Gates(condition_number=0.5 * condition))[0]
    assert kind == "bad"
    assert text.startswith("3 of 3 responses miss a gate: CY (condition number ")


def test_a_score_that_does_not_exist_misses_its_gate(model):
    assert list(missed_by_response(changed(model, "N", r2=float("nan")), Gates(r2=0.0))) == ["N"]
    assert missed_by_response(model, Gates()) == {}


def test_parameters_whose_bar_includes_zero_are_named(model):
    response = model["N"]
    error = np.abs(response.estimate) * np.array([0.49, 0.51, np.nan, 0.1])
    assert crosses_zero(replace(response, std_error=error)).tolist() == [False, True, True, False]
    only = replace(changed(model, "N", std_error=error), prediction={})
    only = replace(only, responses={"N": only["N"]})
    assert (
        "note",
        "2 of 4 parameters cannot be told from zero: the 2σ bar includes it (Cn: p and da).",
    ) in said(only)


def test_what_the_data_cannot_separate_is_a_problem_and_comes_first(model):
    bad = changed(
        model, "L", inseparable=(("da", "dr"),), variance_inflation=np.array([1.0, 2.0, 90.0, 80.0])
    )
    findings = said(bad, Gates(r2=0.1))
    assert findings[0][0] == "good"
    assert findings[1] == (
        "bad",
        "The data cannot separate da and dr in Cl: only a combination of their parameters is known.",
    )
    assert ("note", "Variance inflation is above 10 for da (90.0) and dr (80.0).") in findings
    assert not any(text.startswith("The data separate every") for _, text in findings)


def test_good_data_are_said_to_be_good(model):
    kinds = {text.partition(":")[0]: kind for kind, text in said(model)}
    assert kinds["The data separate every parameter"] == "good"


def test_a_prediction_worse_than_a_constant_is_a_problem(model):
    time = model["N"].fit["time"]
    wrong = replace(model, prediction={"N": Fit(time.axis, time.measured, -time.measured)})
    kind, text = said(wrong)[1]
    assert kind == "bad"
    assert text.startswith("A manoeuvre that was not used is predicted worse than by a constant in Cn")
    assert any(t.startswith("A manoeuvre that was not used is predicted with R²") for _, t in said(model))
