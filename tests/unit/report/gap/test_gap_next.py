"""What to do next, on the page, in the terminal and in the file of a diagnosis."""

from __future__ import annotations

from dataclasses import replace

import pytest
from made_up_gap import made_up

from freqid.cli.gap_texts import diagnosis_text
from freqid.core.results.diagnosis import GapDiagnosis
from freqid.report.gap.page import build_gap_page


@pytest.fixture
def planned():
    """Return a diagnosis that leaves two explanations, with the ground tests that split them."""
    weighing = {
        "kind": "ground",
        "name": "weighing",
        "how": "weigh the aircraft as flown",
        "instrument": "scales",
        "pairs": [{"rivals": ["mass", "sensor_scale"], "now": 0.5, "after": 1250.5}],
    }
    group = {"rivals": ["mass", "sensor_scale"], "split_by": ["weighing"], "splits": True}
    table = {
        "separates": [],
        "gain": None,
        "design": "gap-next.h5",
        "groups": [{**group, "sentence": "mass and sensor_scale: on the ground: weighing."}],
        "tests": [weighing],
    }
    result = made_up()
    return replace(result, diagnosis=replace(result.diagnosis, next_flight=table))


def test_page_and_text_say_what_to_do_next(planned):
    html, text = build_gap_page(planned), diagnosis_text(planned.diagnosis)
    for said in (html, text):
        assert "weigh the aircraft as flown" in said
        assert "on the ground: weighing." in said
        assert "gap-next.h5" in said
    assert 'id="next"' in html
    assert "1250" in html


def test_nothing_is_said_where_nothing_is_left():
    html, text = build_gap_page(made_up()), diagnosis_text(made_up().diagnosis)
    assert 'id="next"' not in html
    assert "Next:" not in text


def test_a_table_that_went_through_its_file_says_the_same(planned):
    again = GapDiagnosis.from_json(planned.diagnosis.to_json())
    assert (
        diagnosis_text(again).partition("Next:")[2] == diagnosis_text(planned.diagnosis).partition("Next:")[2]
    )
