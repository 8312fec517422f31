"""Margins of a model and of a simulation side by side, and why they differ, by figures that are put in."""

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from made_up_gap import made_up

from freqid.core.results.judged.review import Source
from freqid.core.results.judged.truth import Miss
from freqid.core.results.loop_margins import Beside, LoopMargins
from freqid.report.margins.page import build_margins_page
from freqid.workflows.reviews.grounds import grounds_of
from freqid.workflows.reviews.loops import interpolation, loops_compared, why_loops_differ
from freqid.workflows.reviews.read_together import ReviewedFile
from freqid.workflows.reviews.use import _margins

FIGURES = ("margins/L/phase_deg", "margins/M/phase_deg")


def margins(ids=("u20", "u30"), simulation=((46.3, 43.0), (52.0, 58.0))) -> LoopMargins:
    estimate = np.array([[46.2, 60.9], [52.2, 76.7]])[:, : len(ids)]
    beside = {"simulation sim": Beside(np.array(simulation)[:, : len(ids)])} if simulation else {}
    size, axes = len(ids), ("L", "M")
    return LoopMargins(
        ids,
        np.full(size, 8.0),
        np.full(size, 1.2),
        FIGURES,
        estimate,
        estimate - 0.3,
        estimate + 0.3,
        np.ones(size, bool),
        np.zeros(size),
        axes,
        (),
        0.95,
        50,
        0,
        "law",
        "model",
        beside,
    )


def gap(at="u30", **figures):
    found = made_up()
    table = {
        "sentence": "as flown it costs",
        "reference": at,
        "figures": {
            f"margins/{axis}/phase_deg": {"before": b, "after": a, "change": a - b, "lo": 0.0, "hi": 0.0}
            for axis, (b, a) in (figures or {"L": (43.0, 41.6), "M": (58.0, 56.9)}).items()
        },
    }
    closure = replace(found.diagnosis.how_far[0], consequence=table)
    return replace(found, diagnosis=replace(found.diagnosis, how_far=(closure,)))


def reviewed(*results):
    return [
        ReviewedFile(Source(f"{i}.h5", "freqid-x", ""), Path(f"{i}.h5"), r) for i, r in enumerate(results)
    ]


def point(at, *misses):
    return SimpleNamespace(
        id=at, model=SimpleNamespace(responses={"M": None}), misses=lambda response: misses
    )


def test_each_condition_has_model_simulation_and_effect_on_one_axis():
    rows = loops_compared(reviewed(margins(), gap()))
    assert [(r.at, r.axis, r.model, r.simulation) for r in rows] == [
        ("u20", "L", 46.2, 46.3),
        ("u30", "L", 60.9, 43.0),
    ]
    assert math.isnan(rows[0].flown)
    assert rows[1].flown == 41.6


def test_the_difference_is_split_into_effect_interpolation_and_condition():
    files = reviewed(margins(), gap())
    text = ". ".join(why_loops_differ(loops_compared(files), files, [point("u20"), point("u45")]))
    assert "is 43.0 deg in the simulation and 41.6 deg with the effect (stall), which takes 1.4 deg" in text
    assert "60.9 deg there, 17.9 deg more than the simulation: it was not identified there" in text
    assert "least margin, 46.2 deg (axis L), is at u20" in text
    assert "(u20) it and the simulation differ by at most 0.1 deg (u20), within the model's interval" in text


def test_where_the_interval_is_left_the_computed_causes_are_counted():
    parts = {"noise": 0.1, "amplitude": 0.2, "wake delay": -9.0, "not explained": 0.0}
    late = Miss("q", 1.0, 0.1, 2.0, 1.0, "linearisation", "wake delay", parts)
    noisy = Miss("w", 1.0, 0.1, 1.0, 2.0, "noise-free estimate", "noise", parts)
    files = reviewed(margins(simulation=((44.0, 43.0), (52.0, 58.0))), gap())
    text = why_loops_differ(loops_compared(files), files, [point("u20", late, late, noisy)])[-1]
    assert "by at most 2.2 deg (u20), at u20 by more than the model's interval" in text
    assert text.endswith(
        "Of the 2 parameters of all conditions that are off the simulation's linearisation, 2 are at u20: "
        "2 by wake delay"
    )


def test_margins_of_another_condition_say_what_to_run_and_one_aircraft_alone_is_not_compared():
    files = reviewed(margins(ids=("u20",), simulation=()), gap())
    rows = loops_compared(files)
    assert [(r.at, r.simulation) for r in rows][1] == ("u30", 43.0)
    text = " ".join(why_loops_differ(rows, files, [point("u20")]))
    assert "freqid margins MODEL SCENARIO --at u30 --beside SCENARIO" in text
    alone = reviewed(margins(simulation=()))
    assert loops_compared(alone) == ()
    assert why_loops_differ((), alone, []) == ()


@pytest.mark.parametrize(("after", "weight"), [(41.6, "stop"), (47.0, "risk")])
def test_the_next_flight_is_judged_by_the_margin_with_the_effect(after, weight):
    ground = next(g for g in grounds_of(reviewed(gap(L=(48.0, after))), None) if g.subject == "next flight")
    assert ground.weight == weight
    assert f"keeps {after:.1f} deg of phase margin (axis L at u30)" in ground.text
    assert ("less than the 45 deg" in ground.text) is (weight == "stop")
    assert ground.text.endswith("the simulation without it has 48.0 deg")


def test_an_interpolated_margin_is_called_known_nowhere():
    files = reviewed(margins(), gap())
    points = [point("u20"), point("u45")]
    same = interpolation(["u20", "u45"])
    assert same.startswith("it was not identified there but interpolated between u20 and u45")
    assert any(same in s for s in why_loops_differ(loops_compared(files), files, points))
    use = _margins(files, points)
    assert use.startswith(f"known with the identified model at u20; not known at u30: {same}")
    alone = _margins(files, [])  # nothing says where the model was identified
    assert "no point model among the files says" in alone
    assert "known with" not in alone
    text = " ".join(why_loops_differ(loops_compared(files), files, []))
    assert "interpolated" not in text


def test_the_margins_section_is_not_green_beside_an_answer_that_forbids():
    files = reviewed(margins(simulation=((47.0, 48.0), (52.0, 58.0))), gap())
    against = [g for g in grounds_of(files, None) if g.subject == "next flight" and g.source == "1.h5"]
    assert [g.weight for g in against] == ["stop"]
    alone = build_margins_page(files[0].result)
    assert 'class="good"' in alone
    page = build_margins_page(files[0].result, against, ["u20"]).part("margins-0").body
    assert 'class="good"' not in page
    assert page.index("keeps 41.6 deg of phase margin (axis L at u30), less than the 45 deg") < page.index(
        "The identified model alone is stable"
    )
    assert 'href="#risks"' in page
    assert "u30 (interpolated)" in page
    assert "u20 (interpolated)" not in page


def test_a_margin_beside_that_is_too_small_is_said_in_the_section():
    page = build_margins_page(margins())
    assert 'class="good"' not in page
    assert (
        "Not so the simulation sim: its least phase margin is 43.0 deg (L at u30), less than the 45" in page
    )
