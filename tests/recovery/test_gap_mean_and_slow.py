"""What lives in the mean and in slow lines: missing drag, and a stall in a slow deceleration.

Nothing is injected into the slow flights, and no line of theirs is driven.
"""

from __future__ import annotations

import numpy as np
import pytest
from draggy_airplane import AREA, CRUISE, cruise, scatter, simulation, slowing, wrench

from freqid.gap.bookkeeping.check import check
from freqid.gap.diagnose import Question, diagnose
from freqid.gap.model.tolerance import stated
from freqid.simulate.effects import shipped

EFFECTS = (
    "extra_drag",
    "stall",
    "mass",
    "surface_effectiveness",
    "sensor_bias",
    "sensor_scale",
    "misalignment",
)
EFFECTS += ("steady_wind", "cg_offset", "time_skew")
LIBRARY = {i: shipped()[i] for i in EFFECTS}
STRUTS = 0.0184  # m2, drag area that the simulation does not have
TRIM = {"u": CRUISE, "w": 1.75, "q": 0.0}


def diagnosed(model, flights):
    used = flights[:-1]
    tolerances = stated({}, LIBRARY, model, used[0].vehicle)
    question = Question(LIBRARY, tolerances, (0.05, 1.2), draws=200)
    assert check(model, [m.record for m in used]) == []
    return diagnose(model, used, question, held_out=flights[-1:]).diagnosis


def slow_share(found):
    """Return the share of the gap in the first cell of lines, which holds the zero line."""
    return sum(p.share for p in found.where if p.band_hz[0] == 0)


def test_the_struts_are_a_fifth_of_the_drag():
    still = {"elevator": -0.016, "throttle": 0.0}
    with_, without = (-wrench(TRIM, still, {}, struts=s)["X"] for s in (STRUTS, 0.0))
    lift = 137.3 * np.sin(np.arctan2(TRIM["w"], TRIM["u"]))  # its part along the body's axis
    assert (with_ - without) / (with_ + lift) == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize(
    ("tolerances", "flies"), [(False, True), pytest.param(True, False, marks=pytest.mark.slow)]
)
def test_a_fifth_of_the_drag_that_is_missing_is_named_by_its_mean(tolerances, flies):
    """Whether the simulation states how well it knows its drag or not, and whether it flies or not."""
    off = scatter(4) if tolerances else {}
    flights = [cruise(seed, off, struts=STRUTS) for seed in (4, 5, 6)]
    found = diagnosed(simulation(tolerances=tolerances, flies=flies), flights)
    assert found.which.named == ("extra_drag",), found.verdict
    size = found.which.parameters["extra_drag"]["coefficient"]
    assert size.estimate == pytest.approx(STRUTS / AREA, rel=0.2)
    assert found.where[0].response == "X"
    assert slow_share(found) > 0.9
    assert found.how_far[0].wrench.G > 0.9
    assert found.how_far[0].log_score > 4


@pytest.mark.slow
def test_drag_as_it_is_simulated_is_left_alone():
    off = scatter(4)
    found = diagnosed(simulation(), [cruise(seed, off) for seed in (4, 5, 6)])
    assert not found.gap.exists, found.verdict
    assert found.which.named == ()


def slow_flights(seed, **truth):
    off = scatter(seed)
    return [slowing(seed + i, off, slowest=14.2 + 0.1 * i, **truth) for i in range(3)]


def test_a_stall_in_a_slow_deceleration_is_named_though_nothing_was_injected():
    flights = slow_flights(4)
    assert not any(n.startswith(("excitation/", "command/")) for n in flights[0].record.channels)
    found = diagnosed(simulation(flies=False), flights)
    assert found.which.named == ("stall",), found.verdict
    assert found.where[0].response == "Z"
    assert found.where[0].band_hz[0] == 0
    # 0.69: of what is detectable beside an offset of Z; of the energy alone it had been more than 0.8
    assert slow_share(found) > 0.5
    assert found.how_far[0].log_score > 2  # an error of form of Z may be part of it
    assert any("no injected signals" in remark for remark in found.remarks)


@pytest.mark.slow
def test_a_slow_deceleration_as_it_is_simulated_is_left_alone():
    """Motion that is all slow takes the noise of slow lines with it: they are not as quiet as they look."""
    found = diagnosed(simulation(flies=False), slow_flights(1, attached=lambda alpha: 1.0))
    assert not found.gap.exists, found.verdict
    assert found.which.named == ()
