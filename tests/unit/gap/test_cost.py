"""What a gap costs, in the verdict: asked at the right condition, of the effects that a law feels."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from freqid.core.diagnosis import Closure, Existence, GapDiagnosis, Share, Which
from freqid.core.gap_map import GapMap
from freqid.core.scenario import read_scenario
from freqid.gap import scenario_consequence
from freqid.gap.closed_loop import Actuation, LinearLoop
from freqid.gap.condition import Condition
from freqid.gap.connect.scenario import ScenarioSimulation
from freqid.gap.consequence import compare
from freqid.gap.cost import with_cost
from freqid.gap.diagnose import Findings
from freqid.gap.refit import Refit
from freqid.simulate.effects import library

DELAY = 0.05


def condition(delay):
    """An integrator under a gain of 4 rad/s, which is where it crosses one."""
    act = replace(Actuation.ideal(1), delay=np.array([delay]))
    one = np.ones((1, 1))
    loop = LinearLoop(("q",), ("de",), ("M",), 0 * one, one, 4 * one, one, act)
    return Condition(loop)


@pytest.fixture
def simulation():
    return ScenarioSimulation(read_scenario("scenarios/la8.toml")[0])


def findings(*effects, names):
    table = {n: 0.5 / (1 + k) for k, n in enumerate(dict.fromkeys(e for e, _ in names))}
    which = Which(table, tuple(table), (), {}, {}, True)
    closure = Closure(tuple(e.id for e in effects), {}, Share(0.9, 0.8, 1.0), Share(0, 0, 0), {}, {}, {}, ())
    diagnosis = GapDiagnosis("", "s", ("a",), Existence(True, 0.0, 0.02, 0.0), (), which, (closure,))
    energy = np.array([1.0, 3.0]).reshape(1, 1, 2, 1)
    cells = GapMap(("M",), ("u10", "u45"), ("",), ((0.1, 1.0),), energy, np.ones((1, 3)) / 3)
    value = np.arange(1.0, 1.0 + len(names)) / 20
    fitted = Refit(effects, names, value, np.diag(value**2) / 100, (), ())
    return Findings(diagnosis, [], [], SimpleNamespace(), [], cells, {"x": fitted})


def test_the_phase_margin_that_a_delay_takes_is_in_the_verdict(simulation, monkeypatch):
    asked = {}

    def known(scenario, reference, before, after, **more):
        asked.update(reference=reference.id, before=before, after=after, **more)
        return compare(condition(0.0), condition(after["actuator_delay"]["extra"]))

    monkeypatch.setattr(scenario_consequence, "consequence", known)
    names = (("actuator_delay", "extra"), ("sensor_bias", "q"))
    found = with_cost(
        findings(library()["actuator_delay"], library()["sensor_bias"], names=names), simulation
    ).diagnosis
    # the regime with most of the gap, and only what changes the vehicle under its law
    assert (asked["reference"], asked["before"]) == ("u45", {})
    assert asked["after"] == {"actuator_delay": {"extra": DELAY}}
    assert asked["names"] == (("actuator_delay", "extra"),)
    assert asked["covariance"].shape == (1, 1)
    lost = np.degrees(4 * DELAY)  # crossover times delay
    assert f"as flown it costs {lost:.1f} deg" in found.verdict
    figure = found.how_far[0].consequence["figures"]["margins/M/phase_deg"]
    assert figure["before"] - figure["after"] == pytest.approx(lost, rel=1e-6)


def test_what_is_found_beside_a_simulation_is_flown_on_top_of_what_it_has(simulation, monkeypatch):
    """A replay that finds -0.95 of the gyroscopic moments says that they are not there in flight."""
    asked = {}

    def known(scenario, reference, before, after, **more):
        asked.update(after)
        return compare(condition(0.0), condition(0.0))

    monkeypatch.setattr(scenario_consequence, "consequence", known)
    one = findings(library()["gyroscopic"], names=(("gyroscopic", "strength"),))
    fitted = replace(one.refits["x"], value=np.array([-0.95]))
    with_cost(replace(one, refits={"x": fitted}), simulation)
    assert asked["gyroscopic"]["strength"] == pytest.approx(0.05)


def test_what_does_not_matter_is_not_in_the_verdict(simulation, monkeypatch):
    monkeypatch.setattr(
        scenario_consequence, "consequence", lambda *a, **k: compare(condition(0.0), condition(1e-3))
    )
    found = with_cost(
        findings(library()["actuator_delay"], names=(("actuator_delay", "extra"),)), simulation
    ).diagnosis
    assert "as flown" not in found.verdict
    assert "as flown it costs 0.2 deg" in found.how_far[0].consequence["sentence"]


def test_sensors_cost_no_margin_and_other_simulations_have_no_law(simulation):
    one = findings(library()["sensor_bias"], names=(("sensor_bias", "q"),))
    assert with_cost(one, simulation) is one
    assert with_cost(one, SimpleNamespace(kind="callable")) is one
