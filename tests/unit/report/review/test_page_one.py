"""Page one says what it rests on: uses, the rule for risks, figures that decide, counts that add up."""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_gap import made_up
from test_page import Page
from test_study_page import HELD, results

import freqid as fq
from freqid.core.results.diagnosis import Change, Interval, Share
from freqid.core.results.judged.review import Reversal, Source
from freqid.core.results.judged.truth import KnownTruth
from freqid.core.results.loop_margins import Beside, LoopMargins
from freqid.report.review.decision import decision_findings, decision_values
from freqid.report.review.points import build_points_sheet
from freqid.workflows.reviews.grounds import grounds_of
from freqid.workflows.reviews.read_together import ReviewedFile
from freqid.workflows.reviews.use import uses_of


def files(*found):
    return [ReviewedFile(Source(f"{i}.h5", "freqid-x", ""), Path(f"{i}.h5"), r) for i, r in enumerate(found)]


def grounds(*found):
    return list(grounds_of(files(*found), None))


def gap(scored="held out", change=(0.3, 0.5), effect="stall", parameter="strength", **closure):
    """Return the made-up diagnosis with a name, and its closure changed."""
    found = made_up()
    which = replace(
        found.which,
        withdrawn={},
        named=(effect,),
        parameters={effect: {parameter: Interval(sum(change) / 2, *change, "1")}},
    )
    closed = replace(found.how_far[0], effects=(effect,), scored=scored, **closure)
    return replace(found, diagnosis=replace(found.diagnosis, which=which, how_far=(closed,)))


def fitted(**r2s):
    """Return a point model whose responses explain what is given: R2, what noise allows, and chance."""
    model = results().points[0].model
    responses = {}
    for name, (r2, ceiling, level) in r2s.items():
        fit = model[name].fit["frequency"]
        noise = np.full(fit.axis.size, math.sqrt(level * np.mean(np.abs(fit.measured) ** 2)))
        fits = {**model[name].fit, "frequency": replace(fit, noise=noise)}
        responses[name] = replace(model[name], fit=fits, r2=r2, r2_ceiling=ceiling)
    return replace(model, responses={**model.responses, **responses})


def test_every_response_that_is_not_explained_is_a_risk_whether_noise_or_the_model_is_why():
    """Half of the first is noise, and by chance more may be; noise leaves the second 3.5 %, not 6.4 %."""
    model = fitted(Z=(0.364, 0.446, 0.55), N=(0.936, 0.965, 0.035))
    assert [model[r].reaches_ceiling for r in ("Z", "N")] == [True, False]
    found = [g for g in grounds(model) if any("R²" in f.text for f in g.figures)]
    assert [g.weight for g in found] == ["risk", "risk"]
    poor, hidden = found
    assert "explains too little of the yawing moment N (93.6 %, where noise allows 96.5 %)" in poor.text
    assert (
        "does not show whether the model is good enough in the normal force Z (36.4 %, where" in hidden.text
    )
    assert [(g.figures[0].now, g.figures[0].bound) for g in found] == [(0.936, 0.95), (0.364, 0.95)]
    assert not any("R²" in f.text for g in grounds(fitted(Z=(0.96, 0.99, 0.01))) for f in g.figures)


def test_the_margin_that_decides_stands_first_among_what_would_overturn_it(tmp_path):
    path = tmp_path / "gap.h5"
    fq.save(gap(), path)
    review = fq.review(path)
    first = review.reversals[0]
    assert (first.now, first.bound, first.unit, first.where) == (42.0, 45.0, "deg", "M")
    assert (first.weight, first.subject, first.room) == ("stop", "next flight", -3.0)
    html = fq.page([path, tmp_path / "gap.h5"], against=[path]).html
    table = next(t for t in Page(html).cells if any(cell[0] == "From the bound" for cell in t[0]))
    row = [cell[0] for cell in table[1]]
    assert row[:3] == ["Least phase margin with the effect (stall)", "next flight", "M"]
    assert row[3:] == ["42.0 deg", "at least 45.0 deg", "3.00 deg beyond", "forbids use"]


def test_what_a_ground_weighs_follows_from_its_figures():
    """For model and next flight: a good one has all within bounds, another with figures has one beyond."""
    study, found = results(), gap()
    seen = Counter()
    for g in grounds(study, found, fitted(Z=(0.364, 0.446, 0.55))):
        if g.subject != "simulation" and g.figures:
            beyond = [f for f in g.figures if f.room < 0]
            assert bool(beyond) is (g.weight != "good"), g
            assert g.weight != "stop" or any(f.weight == "stop" for f in beyond)
            seen[g.weight] += 1
    assert min(seen[weight] for weight in ("good", "risk", "stop")) > 0


def test_a_figure_knows_how_far_it_is_from_its_bound():
    most, least = Reversal("a", 30.0, 20.0), Reversal("b", 30.0, 20.0, side="at least")
    assert (most.room, least.room, most.room_share) == (-10.0, 10.0, -0.5)
    assert Reversal("c", 0.8, 0.0, side="at least").room_share == 1.0


def test_the_cost_of_the_own_flight_is_a_risk_above_what_is_acceptable():
    costs = {"u": Change(456.0, 434.0), "w": Change(148.0, 150.0), "q": Change(33.0, 30.0)}
    (far,) = [g for g in grounds(gap(J=costs, response=Share(0.04, 0.03, 0.06))) if "cost J" in g.text]
    assert (far.subject, far.weight) == ("simulation", "risk")
    assert "in u (434; without it 456) and w (150; without it 148)" in far.text
    assert "4 % of the difference of its own flight goes with the effect" in far.text
    assert (far.figures[0].now, far.figures[0].bound) == (434.0, 100.0)
    (near,) = [g for g in grounds(gap(J={"q": Change(33.0, 30.0)})) if "cost J" in g.text]
    assert (near.weight, near.figures[0].room) == ("good", 70.0)


@pytest.mark.parametrize(
    ("scored", "words", "untried"),
    [
        ("held out", "on c.h5, which was held out. Use", False),
        ("turns", "in turn, each with the size fitted to others (no manoeuvre was held out). Use", True),
        ("lines", "with the size fitted to the lines between (no manoeuvre was held out). Use", True),
    ],
)
def test_it_is_said_what_a_gap_was_closed_on(scored, words, untried):
    found = grounds(gap(scored))
    assert any(words in g.text for g in found)
    assert (
        any("not tried on a flight that was held out from the diagnosis" in g.text for g in found) is untried
    )


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ((-0.18, -0.14), "(the vehicle is lighter than it"),
        ((0.14, 0.18), "(the vehicle is heavier than it"),
        ((-0.1, 0.2), "(the vehicle is heavier or lighter than it"),
    ],
)
def test_the_answer_has_the_sign_that_the_interval_leaves(change, word):
    found = grounds(gap(change=change, effect="mass", parameter="fraction"))
    assert any(word in g.text for g in found)


def test_margins_beside_are_a_risk_only_where_more_of_them_are_outside_than_by_chance():
    size = 40
    estimate = np.full((1, size), 50.0)

    def found(outside):
        other = estimate.copy()
        other[0, :outside] += 5.0
        return LoopMargins(
            tuple(f"c{k}" for k in range(size)),
            np.full(size, 8.0),
            np.full(size, 1.2),
            ("margins/L/phase_deg",),
            estimate,
            estimate - 1,
            estimate + 1,
            np.ones(size, bool),
            np.zeros(size),
            ("L",),
            (),
            0.95,
            50,
            0,
            "law",
            "model",
            {"simulation sim": Beside(other)},
        )

    few, many = ([g for g in grounds(found(n)) if "lie outside" in g.text] for n in (2, 3))
    assert few == []
    assert (many[0].weight, many[0].figures[0].now) == ("risk", pytest.approx(0.075))


def test_what_the_model_may_be_used_for_is_computed_from_what_was_shown():
    study = results()
    model = study.points[0].model
    weak = replace(model["N"], r2=0.5)
    points = list(study.points)
    points[0] = replace(points[0], model=replace(model, responses={**model.responses, "N": weak}))
    uses = {u.label: u.text for u in uses_of(files(replace(study, points=tuple(points))), points)}
    where = uses["Model: speeds and tilts"]
    assert f"{points[0].id} (8 m/s, dw1 and dw2 15.3 deg)" in where
    assert f"by the global model, which was tried at {HELD}" in where
    good = [p.id for p in points if p.model["N"].r2 >= 0.95 and p.validation_ratio("N") <= 1.15]
    assert points[0].id not in good
    assert ("yawing moment N only at " in uses["Model: axes"]) is bool(good)
    assert all(identifier in uses["Model: axes"] for identifier in good)
    assert uses["Model: frequencies"].startswith("0.12 to 1.8 Hz")  # lines 3 to 44 of 25 s
    size = uses["Model: size of inputs"]
    rms = [float(r.regressor_rms[r.regressors.index("n1")]) for r in [p.model["Z"] for p in points]]
    assert f"rotors {min(rms) * 30 / math.pi:.3g} to {max(rms) * 30 / math.pi:.3g} rpm rms" in size
    assert f"({100 * max(rms) / 400:.2g} % of half their range" in size  # 100 to 900 rad/s
    assert "so larger inputs were not tried" in size


def test_larger_inputs_count_as_tried_where_a_larger_flight_was_predicted():
    point = results().points[0]
    larger = {
        n: replace(f, measured=2 * f.measured, modelled=2 * f.modelled)
        for n, f in point.model.prediction.items()
    }
    points = [replace(point, model=replace(point.model, prediction=larger))]
    (size,) = [u.text for u in uses_of(files(), points) if u.label == "Model: size of inputs"]
    assert "so larger inputs were tried" in size


def doubtful():
    """Return a study of which each parameter that is off has a known reason."""
    study, points = results(), []
    for k, p in enumerate(study.points):
        truths, responses = {}, {}
        for name, r in p.model.responses.items():
            noise_free, linear = r.estimate.copy(), r.estimate.copy()
            linear[0] -= 40 * r.std_error[0]  # off the linearisation alone
            noise_free[1] -= 3 * r.std_error[1]  # off the noise-free estimate alone
            for both in (linear, noise_free):
                both[2] -= 5 * r.std_error[2]
            truths[name] = KnownTruth(r.regressors, linear, noise_free, noise_free, 0 * linear, 0.125)
            if k == 0:  # of one condition, the first is also known poorly
                lower, upper = r.lower.copy(), r.upper.copy()
                lower[0], upper[0] = r.estimate[0] - abs(r.estimate[0]), r.estimate[0] + abs(r.estimate[0])
                r = replace(r, lower=lower, upper=upper)
            responses[name] = r
        points.append(replace(p, truth=truths, model=replace(p.model, responses=responses)))
    return replace(study, points=tuple(points))


def test_counts_of_parameters_add_up_where_they_stand_together(tmp_path):
    study = doubtful()
    review = fq.review(files(study))
    trust = review.trust
    rows = [d for p in study.points for r in p.model.responses for d in p.doubts(r)]
    assert sum(trust.reasons.values()) == trust.doubtful == len(rows)
    assert trust.off_linear + trust.off_noise_free - trust.off_both == trust.missing
    assert trust.off_both == sum(len(p.model.responses) for p in study.points)
    assert trust.reasons["wide interval and misses the truth"] >= 2
    said = " ".join(f.text.striptags() for f in decision_findings(review))
    numbers = [int(n) for n in re.findall(r"(\d+) (?:only )?for ", said)]
    assert sum(numbers) == trust.doubtful
    assert (
        f"are {trust.missing}: {trust.off_linear} off its linearisation, {trust.off_noise_free} "
        f"off the estimate from the same flight without noise, {trust.off_both} off both" in said
    )
    body = re.sub(r"<[^>]+>", "", build_points_sheet(study))
    assert f"and {trust.off_noise_free} are off them" in body
    causes = re.search(r"Of the (\d+) that are off it, .* comes from (.*?)\.", body)
    assert int(causes[1]) == trust.off_linear == sum(map(int, re.findall(r"for (\d+)", causes[2])))


def test_the_table_of_doubts_has_what_is_off_and_matters_first_and_says_how_well_each_is_known():
    cells = Page(build_points_sheet(doubtful())).cells
    table = next(t for t in cells if any(c[0] == "Why not" for c in t[0]))
    heads = [cell[0] for cell in table[0]]
    at = {name: heads.index(name) for name in ("Reason", "Why not", "Half interval (%)")}
    reasons = [row[at["Reason"]][0] for row in table[1:]]
    moves = [float(row[heads.index("Moves (%)")][0]) for row in table[1:]]
    off = [float(row[heads.index("Off (σ)")][0].replace("−", "-") or 0) for row in table[1:]]
    matters = [m >= 5 for m in moves]
    assert matters == sorted(matters, reverse=True)
    for size in (True, False):
        far = [abs(x) for x, m, r in zip(off, matters, reasons, strict=True) if m is size and "truth" in r]
        assert far == sorted(far, reverse=True)
        told = ["truth" in r for m, r in zip(matters, reasons, strict=True) if m is size]
        assert told == sorted(told, reverse=True)
    assert max(map(abs, off)) == abs(off[0]) == 40.0
    for row in table[1:]:
        if row[at["Reason"]][0] == "off the truth":
            assert re.search(r"outside 2σ of the .*; known to ±", row[at["Why not"]][0])


def test_the_rule_for_risks_and_the_uses_stand_on_the_page(tmp_path):
    path = tmp_path / "gap.h5"
    fq.save(gap(), path)
    page = fq.page([path], against=[path])
    values = decision_values(page.review)
    assert len(values["uses"]) == 1  # of the simulation; no model is among the files
    text = re.sub(r"<[^>]+>", "", page.html)
    for rule in values["rules"]:
        assert f"{rule[:1].upper()}{rule[1:]}." in text.replace("&#39;", "'")
    assert "cost J above 100" in text
    assert text.index("What it may be used for") < text.index(
        "Listed is every figure of the files that is beyond its bound"
    )
