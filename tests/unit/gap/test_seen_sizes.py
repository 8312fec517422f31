"""Effects are looked for at all sizes that the records show, however large they are elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import LIBRARY, Linear, Truth, effect, fly

from freqid.gap.infer.build import build
from freqid.gap.infer.evidence import weigh
from freqid.gap.infer.seen_sizes import size_at
from freqid.gap.stack.block import stack_of

BAND = (0.05, 2.0)
LOSS = 0.03
SCALE = 1.0  # of the candidate: its sizes begin at .0625 before data are looked at


@pytest.fixture(scope="module")
def system():
    """Return the stack of two sharp flights whose first surface is weaker, and a candidate for much more."""
    flights = [fly(Truth(loss=LOSS), noise=0.3, seed=s, duration=40.0, phases=s) for s in (1, 2)]
    blocks = stack_of(Linear(), flights, ["one", "two"], BAND)
    coarse = replace(LIBRARY["worn"], parameters=effect("worn", "share", SCALE).parameters)
    return build(blocks, {"worn": coarse, "drag": LIBRARY["drag"]}, {})[0].system


def worn(system):
    (index,) = (i for i, c in enumerate(system.candidates) if c.effect == "worn")
    return system.candidates[index], system.columns_of(index)


def test_sizes_begin_where_the_change_is_one_standard_deviation_of_noise(system):
    c, at = worn(system)
    assert np.abs(c.prior).min() < LOSS < SCALE / 16
    G = system.reduced(system.form_errors[0]).G[at, at]
    for sign in (-1.0, 1.0):
        least = sign * np.abs(c.prior[np.sign(c.prior) == sign]).min()
        w = c.weights(least)
        assert 0.1 < w @ G @ w < 3.0  # errors of form were larger, and alike in all loads, when it was chosen


def test_an_effect_that_is_small_for_its_kind_is_found_where_data_are_sharp(system):
    evidence = weigh(system)
    assert evidence.effect["worn"] > 5
    assert max(evidence.effect, key=lambda e: evidence.effect[e]) == "worn"


def test_an_effect_that_is_hardly_seen_keeps_its_sizes():
    loud = [fly(noise=300.0, seed=s, duration=40.0, phases=s) for s in (1, 2)]
    blocks = stack_of(Linear(), loud, ["one", "two"], BAND)
    found = build(blocks, LIBRARY, {})[0].system
    c, _ = worn(found)
    assert np.abs(c.prior).min() == pytest.approx(LIBRARY["worn"].parameters["share"].scale / 16)


def test_the_size_of_a_detectability_is_that_at_which_it_is_reached(system):
    c, at = worn(system)
    G = system.reduced(system.form_errors[0]).G[at, at]
    for goal in (1.0, 9.0, 100.0):
        w = c.weights(size_at(c, G, goal, 1.0))
        assert w @ G @ w == pytest.approx(goal, rel=0.05)
