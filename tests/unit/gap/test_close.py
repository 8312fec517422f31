"""Closure on the linear aircraft: what goes on flights that were not used, and which names do not hold."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from linear_flight import LIBRARY, Linear, Truth, fly, motion

from freqid.gap.close.closing import closing_of
from freqid.gap.close.closure import close
from freqid.gap.close.score import shares_of
from freqid.gap.diagnose import Question, diagnose
from freqid.gap.infer.explain import explain
from freqid.gap.infer.linearise import Linearised
from freqid.gap.model.tolerance import stated
from freqid.gap.stack.block import stack_of

BAND = (0.05, 2.0)
WORN = Truth(loss=0.1)
TOLERANCES = {"derivatives": 0.02, "dynamics": 0.02}
QUESTION = Question(LIBRARY, stated(TOLERANCES, LIBRARY), BAND, draws=400)


def flight(truth, seed):
    return fly(truth, noise=1.0, duration=40.0, seed=seed, phases=seed, reference=f"r{seed}")


def diagnosed(truth, held_out=(), question=QUESTION):
    return diagnose(Linear(), [flight(truth, s) for s in (1, 2)], question, held_out=held_out)


@pytest.fixture(scope="module")
def worn():
    return diagnosed(WORN, [flight(WORN, 3)])


def test_a_gap_in_few_numbers_has_an_interval_of_what_goes_where_there_is_one():
    """Draws that hold none of its numbers have no gap, and no share of it."""
    rng = np.random.default_rng(0)
    before = rng.standard_normal(3000) ** 2
    before[:2] = 4000.0
    closed = before.copy()
    closed[:2] = 1.0
    found = shares_of(before, {"closed": closed, "half": np.where(before > 100, 2000.0, before)}, rng, 0.9)
    assert found["closed"].lo > 0.9
    assert 0.4 < found["half"].lo <= found["half"].G <= found["half"].hi < 0.6


def test_a_lost_surface_is_named_sized_and_closed_to_the_noise(worn):
    assert worn.diagnosis.which.named == ("worn",)
    closure = worn.diagnosis.how_far[0]
    interval = closure.settings["worn"]["share"]
    assert interval.lo < 0.1 < interval.hi
    assert closure.wrench.G > 0.95
    assert (closure.held_out, closure.scored) == (("manoeuvre 3",), "held out")
    assert "is closed on manoeuvre 3, which was held out" in worn.diagnosis.verdict
    assert closure.rmse["M"].after < closure.rmse["M"].before


@pytest.mark.parametrize("share", ["wrench", "effect_only", "tolerances_only"])
def test_nothing_is_closed_by_more_than_all(worn, share):
    found = getattr(worn.diagnosis.how_far[0], share)
    assert found.lo <= found.G <= 1.0
    assert found.hi <= 1.0


def test_tolerances_alone_close_it_only_where_they_are_strained(worn):
    """A tenth of a surface is five sigma of each of its derivatives."""
    closure = worn.diagnosis.how_far[0]
    assert closure.strained["derivatives.M.d1"] == pytest.approx(-5, abs=1.0)
    assert np.abs(worn.closed[0].fit.tolerances).max() < 3
    assert closure.log_score > 0


def test_a_name_is_withdrawn_where_the_held_out_score_falls():
    """Flights that were used have the loss, the one that is scored has the opposite."""
    found = diagnosed(WORN, [flight(Truth(loss=-0.1), 3)])
    closure = found.closed[0].closure
    assert closure.log_score < 0
    assert "worse than tolerances" in found.closed[0].withdrawn
    assert found.diagnosis.which.named == ()
    assert "worn" in found.diagnosis.which.withdrawn
    assert closure.note


@pytest.mark.parametrize(
    ("flights", "scored", "words"),
    [
        (2, "turns", "on manoeuvre 1 and manoeuvre 2 in turn, each with the size fitted to the other (no"),
        (1, "lines", "on every other line of manoeuvre 1, with the size fitted to the lines between (no"),
    ],
)
def test_without_a_flight_held_out_the_verdict_says_what_took_turns(flights, scored, words):
    found = diagnose(Linear(), [flight(WORN, s) for s in range(1, flights + 1)], QUESTION).diagnosis
    assert found.how_far[0].scored == scored
    assert f"{words} manoeuvre was held out)" in found.verdict
    assert "not used" not in found.verdict


@pytest.mark.slow
def test_a_second_effect_stays_only_where_it_predicts_what_was_not_used(worn):
    """The held-out flight lacks the drag that both flights used have beside the loss."""
    both = replace(WORN, drag=1.0)
    used = diagnosed(both, question=replace(QUESTION, close=False))
    at = Linearised(used.evidence.system, used.columns, used.blocks, LIBRARY, QUESTION.tolerances)
    explanation, _ = explain(at, ("worn",))
    assert set(explanation.effects) == {"worn", "drag"}
    scored = {}
    for name, truth in (("with it", both), ("without it", WORN)):
        others = stack_of(Linear(), [flight(truth, 3)], ["third"], BAND, seed=9)
        form_error = used.evidence.form_error(explanation.places[0])
        closing = closing_of(replace(at, system=used.system), others, explanation, form_error)
        scored[name] = set(close(closing, explanation, 0, LIBRARY, QUESTION.tolerances)[0].closure.effects)
    assert scored["with it"] == {"worn", "drag"}
    assert scored["without it"] == {"worn"}


def test_without_a_gap_nothing_is_named_or_closed():
    found = diagnosed(Truth())
    assert not found.diagnosis.gap.exists
    assert found.diagnosis.how_far == ()
    assert found.diagnosis.which.named == ()


@pytest.mark.slow
def test_nulls_of_a_simulation_within_its_tolerances_are_called_as_rarely_as_is_said():
    """Every derivative off by its own sigma: of 20 flights 3 would be beyond four standard errors."""
    from linear_flight import SLOPES

    called, p = 0, []
    for seed in range(20):
        rng = np.random.default_rng([seed, 1])
        slopes = SLOPES * (1 + 0.02 * rng.standard_normal(SLOPES.shape))
        truth = Truth(slopes=tuple(map(tuple, slopes.tolist())))
        flown = fly(truth, noise=1.0, duration=20.0, seed=seed, phases=1 + seed)
        found = diagnose(Linear(), [flown], replace(QUESTION, close=False, seed=seed)).diagnosis
        called += found.gap.exists
        p.append(found.gap.p)
    assert called < 3
    assert np.mean(np.array(p) < 0.2) < 0.45


@dataclass(frozen=True, eq=False)
class Flying(Linear):
    """The simulation with a flight of its own, integrated apart from all that closes a gap."""

    can_fly: bool = True

    def fly(self, record, effects=None, departures=None):
        flown = motion(Truth(), 40.0, 40.0, int(record.reference[1:]))
        return {n.removeprefix("state/"): x for n, x in flown.items() if not n.startswith("excitation/")}


def flown_closures(truth, named=()):
    question = replace(QUESTION, named=named)
    found = diagnose(Flying(), [flight(truth, s) for s in (1, 2)], question, held_out=[flight(truth, 3)])
    return {c.effects: c for c in found.diagnosis.how_far}


@pytest.mark.parametrize(
    ("truth", "effect"), [(WORN, "worn"), (Truth(late=0.03), "late"), (Truth(drag=1.5), "drag")]
)
def test_the_simulations_own_flight_closes_with_the_right_effect(truth, effect):
    closure = flown_closures(truth)[(effect,)]
    assert closure.response.G > 0.97
    assert closure.response.lo <= closure.response.G <= closure.response.hi <= 1.0
    assert set(closure.J) == {"u", "w", "q", "theta"}
    assert closure.J["q"].after < 0.1 * closure.J["q"].before


def test_a_wrong_effect_leaves_the_own_flight_where_it_was():
    closures = flown_closures(Truth(drag=1.5), ("late",))
    assert pytest.approx(0.0, abs=0.1) == closures[("late",)].response_effect_only.G
    # what is closed all the same tolerances do, strained: beside them the delay foretells nothing
    assert closures[("late",)].log_score < 1.0 < closures[("drag",)].log_score
    assert closures[("late",)].strained["derivatives.X.u"] > 5
    assert closures[("drag",)].response_effect_only.G > 0.9


def test_a_simulation_that_cannot_fly_says_so(worn):
    closure = worn.diagnosis.how_far[0]
    assert np.isnan(closure.response.G)
    assert "does not fly" in closure.response.why_undefined
    assert closure.J == {}


def test_effects_that_were_asked_for_are_closed_with_and_found_only_where_they_are_there():
    """The surface is worn; drag and a gyro are asked for, and their sizes are no clearer than zero."""
    question = replace(QUESTION, named=("drag", "gyro"))
    found = diagnosed(WORN, [flight(WORN, 3)], question).diagnosis
    assert found.how_far[0].effects == ("drag", "gyro", "worn")
    assert found.which.named == ("worn",)
    assert (found.which.pair, found.which.withdrawn) == ((), {})
    assert found.where[0].response == "M"
    assert "Your simulation: worn 0.1" in found.verdict
