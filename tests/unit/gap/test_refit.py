"""Refits on flights of an aircraft that has the effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import LIBRARY, SIZES, TOLERANT, Flying, Truth, fly, upright

from freqid.gap import driven
from freqid.gap.close import misfit
from freqid.gap.compare import compare
from freqid.gap.refit import refit, stepped


def test_a_refit_finds_the_size_within_its_standard_error(worn):
    found = refit(worn[0], [LIBRARY["worn"]], {"worn": {"share": 0.05}})
    sigma = float(np.sqrt(found.covariance[0, 0]))
    assert abs(found.value[0] - 0.15) < 3.3 * sigma
    assert sigma < 0.03
    assert found.settings == {"worn": {"share": float(found.value[0])}}
    assert found.at_bound == ()
    assert found.undetermined == ()


@pytest.mark.parametrize(("effect", "start"), [("worn", {"share": 0.05}), ("late", {"by": 0.02})])
def test_one_step_from_what_all_ask_for_is_what_some_ask_for(worn, effect, start):
    seen = {}
    every = refit(worn[0], [LIBRARY[effect]], {effect: start}, seen)
    name = next(iter(start))
    for c in worn[0]:
        alone = refit([c], [LIBRARY[effect]], {effect: start})
        sigma = float(np.sqrt(alone.covariance[0, 0]))
        found = stepped([c], [LIBRARY[effect]], every, seen)[effect][name]
        assert found == pytest.approx(alone.value[0], abs=0.05 * sigma)
        assert found != every.value[0]


def test_what_an_effect_may_be_off_by_is_part_of_its_refit(worn, compared):
    """A tolerance of the very parameter would widen its interval by as much; that of a derivative stays."""
    tolerant = compared(Truth(loss=0.15), (1, 2), {**TOLERANT, "worn": 0.05})
    assert "tolerance:worn:share" in tolerant[0].common
    start = {"worn": {"share": 0.1}}
    with_it, without = (refit(used, [LIBRARY["worn"]], start) for used in (tolerant, worn[0]))
    assert with_it.value[0] == pytest.approx(without.value[0], rel=1e-6)
    assert with_it.covariance == pytest.approx(without.covariance, rel=1e-6)


def test_a_large_effect_is_told_by_the_flight_that_it_moved(monkeypatch):
    """Where no loop is fitted, signatures are of the simulation's own flight, without the gap's motion."""
    monkeypatch.setattr(driven, "_by_fitted_loop", lambda maneuver, lines: {})
    used = []
    for s in (1, 2):
        flight = upright(fly(Truth(drag=4.0), noise=1.0, seed=s, phases=s))
        used.append(compare(Flying(phases=s), flight, LIBRARY, SIZES, (0.1, 2.0), count=60, seed=s))
    drag = LIBRARY["drag"]
    moved = [np.std(c.smoothed.record["state/u"] - c.trial.maneuver.record["state/u"]) for c in used]
    assert min(moved) > 0.2 * np.std(used[0].maneuver.record["state/u"])
    found = refit(used, [drag], {"drag": {"factor": 1.0}})
    assert found.value[0] == pytest.approx(4.0, abs=3.3 * float(np.sqrt(found.covariance[0, 0])))
    assert misfit(used, [drag], found.settings).share(0.9).G > 0.95


def test_a_delay_is_found_though_it_is_no_straight_line(compared):
    used = compared(Truth(late=0.04), (1, 2))
    found = refit(used, [LIBRARY["late"]], {"late": {"by": 0.0}})
    assert found.value[0] == pytest.approx(0.04, abs=max(3.3 * float(np.sqrt(found.covariance[0, 0])), 1e-4))


def test_a_refit_that_stops_at_a_bound_says_so(worn):
    effect = LIBRARY["worn"]
    narrow = replace(effect, parameters={"share": replace(effect.parameters["share"], high=0.08)})
    found = refit(worn[0], [narrow], {"worn": {"share": 0.0}})
    assert found.value[0] == 0.08
    assert found.at_bound == (("worn", "share"),)


def test_a_parameter_that_does_nothing_here_is_not_determined(worn):
    idle = replace(LIBRARY["drag"], id="idle", replay=lambda settings, replay: np.zeros((6, 1001)))
    found = refit(worn[0], [LIBRARY["worn"], idle], {"worn": {"share": 0.1}, "idle": {"factor": 0.2}})
    assert found.undetermined == (("idle", "factor"),)
    assert found.value[0] == pytest.approx(0.15, abs=0.03)
