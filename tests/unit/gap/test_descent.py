"""Descent to where parameters fit best: along curves, within bounds, around what is impossible."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import ImpossibleSettings
from freqid.gap.descent import Sought, View, descend

HOW = {"rounds": 20, "settled": 1e-6, "worse": 0.0}


def sought(start, low=-10.0, high=10.0):
    one = np.ones(1)
    return Sought((("late", "by"),), start * one, 0 * one, one, low * one, high * one)


def arctan(value):
    """The misfit of a curve whose full Gauss-Newton step overshoots from beyond 1.39 and never returns."""
    slope = 1 / (1 + value**2)
    return View(float(np.arctan(value[0]) ** 2), -np.arctan(value) / slope, np.diag(1 / slope**2))


def test_a_step_that_overshoots_is_halved():
    value, seen = descend(sought(3.0), arctan, **HOW)
    assert value[0] == pytest.approx(0.0, abs=1e-6)
    assert seen.misfit < 1e-12


def test_the_best_of_what_was_looked_at_is_returned():
    looked = []

    def view(value):
        looked.append((arctan(value).misfit, float(value[0])))
        return arctan(value)

    value, seen = descend(sought(3.0), view, rounds=4, settled=1e-6, worse=0.0)
    assert len(looked) == 4
    assert (seen.misfit, value[0]) == min(looked)


def test_a_bound_is_where_it_stops():
    value, _ = descend(sought(3.0, low=2.0), arctan, **HOW)
    assert value[0] == 2.0


def test_what_is_impossible_is_gone_around():
    def view(value):
        if value[0] > 1.6:
            raise ImpossibleSettings("too much")
        return arctan(value)

    value, _ = descend(sought(3.0), view, **HOW)
    assert value[0] == pytest.approx(0.0, abs=1e-6)


def test_what_is_never_possible_is_told():
    def view(value):
        raise ImpossibleSettings("no body has these moments")

    with pytest.raises(ImpossibleSettings, match="no body has these moments"):
        descend(sought(3.0), view, **HOW)


def test_another_error_is_not_taken_for_that():
    def view(value):
        raise ValueError("a fault of the program")

    with pytest.raises(ValueError, match="a fault of the program"):
        descend(sought(3.0), view, **HOW)
