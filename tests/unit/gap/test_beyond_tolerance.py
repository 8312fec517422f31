"""A declared parameter that is further off than it is stated to be is a gap, and it is named."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np
import pytest
from linear_flight import INPUTS, LIBRARY, RESPONSES, SLOPES, TRIM, U0, W0, Linear, Truth, fly

from freqid.gap.diagnose import Question, diagnose
from freqid.gap.model.candidates import beyond_tolerance
from freqid.gap.model.tolerance import stated, tolerance_columns
from freqid.gap.simulation import Tolerance
from freqid.gap.stack.block import stack_of

OWN = {"pitch.stiffness": ("M", "state/w"), "elevator.power": ("M", "effector/d1")}


@dataclass(frozen=True, eq=False)
class Declared(Linear):
    """It says how well its pitch stiffness and its elevator's power are known."""

    tolerances: dict = field(default_factory=lambda: dict.fromkeys(OWN, Tolerance(0.02, loads_only=True)))

    def predict(self, record, effects=None, departures=None):
        slopes = self.slopes(effects)
        for name, share in (departures or {}).items():
            response, moved = OWN[name]
            slopes[RESPONSES.index(response), INPUTS.index(moved)] *= 1 + share
        moved = record.matrix(INPUTS) - np.array([U0, W0, 0.0, 0.0, 0.0])[:, None]
        return TRIM[:, None] + slopes @ moved

    def sensitivity(self, record, sizes, departures=None):
        about = dict(departures or {})
        ends = [
            [self.predict(record, None, about | {n: about.get(n, 0.0) + sign * size}) for sign in (1, -1)]
            for n, size in sizes.items()
        ]
        return np.array([(up - down) / 2 for up, down in ends])


def diagnosed(truth):
    question = Question(LIBRARY, stated({"dynamics": 0.02}, LIBRARY, Declared()), (0.05, 2.0), draws=400)
    flights = [fly(truth, noise=1.0, duration=40.0, seed=s, phases=s, reference=f"r{s}") for s in (1, 2, 3)]
    return diagnose(Declared(), flights[:2], question, held_out=flights[2:]).diagnosis


def stiffer(share):
    slopes = SLOPES.copy()
    slopes[2, 1] *= 1 + share
    return Truth(slopes=tuple(map(tuple, slopes.tolist())))


def test_a_stiffness_at_ten_stated_sigmas_is_a_gap_that_is_said():
    found = diagnosed(stiffer(0.2))
    assert found.gap.exists
    assert found.which.named == ()
    interval = found.which.parameters["other"]["pitch.stiffness"]
    assert interval.lo < 0.2 < interval.hi
    said = re.search(r"its own parameter pitch\.stiffness does, off by ([\d.]+) \(", found.verdict)
    assert float(said[1]) == pytest.approx(interval.estimate, rel=5e-3)


def test_no_share_falls_by_more_than_all():
    """A servo's natural frequency below zero makes positions of 1e187."""
    simulation = Declared(tolerances=dict.fromkeys(OWN, Tolerance(0.1, loads_only=True)))
    block = stack_of(simulation, [fly(noise=1.0, seed=1)], ["one"], (0.05, 2.0))[0]
    sizes = dict.fromkeys(OWN, 0.1)
    made = beyond_tolerance([block], [tolerance_columns(block, LIBRARY, sizes)], sizes)
    assert {c.place.label for c in made} == set(OWN)
    for c in made:
        assert -1 < c.prior[0] < 0
        assert c.prior[-1] > 1


@pytest.mark.parametrize("share", [0.0, 0.03])
def test_within_its_tolerance_it_is_none(share):
    assert not diagnosed(stiffer(share)).gap.exists


def test_a_parameter_that_does_what_an_effect_does_leaves_the_name_to_it():
    found = diagnosed(Truth(loss=0.2))
    assert found.which.named == ("worn",)
    assert found.which.probabilities["other"] < 0.05
