"""When a name is given, and the words that a verdict gives it in."""

import numpy as np
import pytest

from freqid.core.diagnosis import Closure, Existence, Share, Which
from freqid.core.gap_map import GapMap
from freqid.gap.calibrate import named
from freqid.gap.verdict import verdict

GAP = Existence(True, 1e-6, 0.02, 0.0, {}, {})


def said(chances, inside, aliases=()):
    which = Which(chances, inside, aliases, {}, {}, named=named(chances, aliases))
    text = verdict(GAP, (), GapMap((), (), (), (), np.zeros((0, 0, 0, 0)), np.zeros((0, 3))), which, ())
    return text.partition("; ")[2].removesuffix(" (uncalibrated).")


@pytest.mark.parametrize(
    ("chances", "groups", "answer"),
    [
        ({"a": 0.76, "b": 0.24}, (), ("a",)),
        ({"a": 0.74, "b": 0.26}, (), ()),
        ({"a": 0.5, "b": 0.3, "c": 0.2}, (("a", "b"),), ("a", "b")),
        ({"a": 0.3, "b": 0.2, "c": 0.2}, (("a", "b"),), ()),
        ({"other": 0.9, "a": 0.1}, (), ()),
        ({"none": 0.9, "a": 0.1}, (), ()),
    ],
)
def test_a_name_is_given_from_three_quarters_of_its_group_on(chances, groups, answer):
    assert named(chances, groups) == answer


def test_a_name_is_given_alone_or_with_what_is_not_ruled_out():
    assert said({"a": 0.97, "b": 0.03}, ("a",)) == "a (97 %)"
    assert said({"a": 0.8, "b": 0.12, "c": 0.08}, ("a", "b", "c")) == "a (80 %), b and c not ruled out"
    rest = dict.fromkeys("bcde", 0.06)
    assert said({"a": 0.76, **rest}, ("a", *rest)) == "a (76 %), 4 others not ruled out"


def test_what_is_not_likely_enough_is_no_answer():
    assert said({"a": 0.5, "b": 0.4, "none": 0.1}, ("a", "b")) == "most likely a (50 %), among a, b"
    group = (("a", "b"),)
    assert said({"a": 0.3, "b": 0.25, "c": 0.2}, ("a", "b", "c"), group).startswith("most likely one of a, b")
    assert said({"a": 0.5, "b": 0.3, "c": 0.2}, ("a", "b"), group) == (
        "one of a, b, which these data cannot separate"
    )


def whole(which, energy=(), closures=()):
    rows = tuple("LMN"[: len(energy)])
    each = np.array(energy, dtype=float).reshape(len(energy), 1, 1, 1)
    cells = GapMap(rows, ("u20",), ("",), ((0.1, 1.0),), each, np.zeros((len(energy), 3)))
    return verdict(GAP, (), cells, which, closures)


def test_a_gap_that_no_place_holds_a_tenth_of_is_said_to_be_spread():
    which = Which({"a": 1.0}, ("a",), (), {}, {}, named=("a",))
    spread = "A gap beyond noise: no place holds a tenth of what is explained, M most with 50 %; a (100 %)"
    assert whole(which, (1, 2, 1)).startswith(spread)
    assert whole(which, (0, 0, 0)).startswith("A gap beyond noise; a (100 %)")


def test_two_effects_that_are_called_are_added_both():
    which = Which({"a": 0.6, "b": 0.4}, ("a", "b"), (), {}, {}, pair=("a", "b"))
    share = Share(0.9, 0.8, 1.0)
    both, one = (Closure(e, {}, share, share, {}, {}, {}, ()) for e in (("b", "a"), ("a",)))
    assert "a and b together; adding both removes 90 %" in whole(which, closures=(both,))
    assert "a and b together; adding a removes 90 %" in whole(which, closures=(one,))
