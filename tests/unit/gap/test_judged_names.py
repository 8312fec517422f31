"""The judging set's rule for names: a load and its parts, benchmarks/gap_judging/aliases.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

JUDGING = Path(__file__).parents[3] / "benchmarks" / "gap_judging"


@pytest.fixture(scope="module")
def judged():
    """Return whether names, with what `mass_properties` says is off, are right for a truth."""
    sys.path.insert(0, str(JUDGING))
    try:
        import aliases
    finally:
        sys.path.remove(str(JUDGING))

    def call(truth, names, moved=()):
        same = aliases.equivalent(truth, moved={"mass_properties": moved})
        return aliases.right(same, aliases.merged(names, same=same))

    return call


@pytest.mark.parametrize(
    ("effect", "parameter", "other"),
    [("mass", "fraction", "yy"), ("cg_offset", "x", "fraction"), ("inertia", "yy", "x")],
)
def test_a_part_named_as_a_load_is_right_only_where_the_load_says_that_part(judged, effect, parameter, other):
    truth = {effect: [parameter]}
    assert judged(truth, ["mass_properties"], [parameter])
    assert judged(truth, ["mass_properties"], [parameter, other])
    assert not judged(truth, ["mass_properties"], [other])
    assert not judged(truth, ["mass_properties"])


def test_a_load_named_as_a_part_is_right_only_where_it_moved_that_part_alone(judged):
    assert judged({"mass_properties": ["fraction"]}, ["mass"])
    assert not judged({"mass_properties": ["fraction", "x"]}, ["mass"])
    assert not judged({"mass_properties": ["fraction"]}, ["inertia"])
    assert judged({"mass_properties": ["fraction", "x"]}, ["mass_properties"])


def test_a_part_beside_the_load_is_one_answer_where_the_load_is_right(judged):
    assert judged({"mass_properties": ["fraction", "x"]}, ["cg_offset", "mass_properties"])
    assert judged({"cg_offset": ["x"]}, ["cg_offset", "mass_properties"], ["x"])
    assert not judged({"cg_offset": ["x"]}, ["cg_offset", "mass_properties"], ["fraction"])
    assert not judged({"cg_offset": ["x"], "slipstream": []}, ["cg_offset", "mass_properties"], ["x"])


def test_a_load_says_two_true_parts_only_with_the_parameters_of_both(judged):
    truth = {"mass": ["fraction"], "cg_offset": ["x"]}
    assert judged(truth, ["mass_properties"], ["fraction", "x"])
    assert not judged(truth, ["mass_properties"], ["fraction"])
    assert judged(truth, ["mass", "cg_offset"])
    assert not judged(truth, ["mass"])
