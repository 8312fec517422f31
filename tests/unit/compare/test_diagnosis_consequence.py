"""What a diagnosed gap costs: computed at the right condition, for the effects that a law feels."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from freqid.compare import scenario_consequence
from freqid.compare.consequence import Condition, compare_conditions
from freqid.compare.diagnosis_consequence import with_consequence
from freqid.core.results.diagnosis import Closure, Existence, GapDiagnosis, Place, Share, Which
from freqid.core.scenario import read_scenario
from freqid.dynamics.linear_loop import Actuation, LinearLoop
from freqid.simulate import effects

DELAY = 0.05
LATE = {"actuator_delay": {"extra": DELAY}}
NAMES = (("actuator_delay", "extra"),)


def condition(delay):
    """An integrator under a gain of 4 rad/s, which is where it crosses one."""
    act = replace(Actuation.ideal(1), delay=np.array([delay]))
    one = np.ones((1, 1))
    loop = LinearLoop(("q",), ("de",), ("M",), 0 * one, one, 4 * one, one, act)
    return Condition(loop)


@pytest.fixture(scope="module")
def simulation():
    scenario = read_scenario("scenarios/la8.toml")[0]
    return SimpleNamespace(scenario=scenario, effects=effects.settings({}, scenario.aircraft()))


@pytest.fixture
def asked(monkeypatch):
    """Return what the scenario is asked for; its answer is that of the integrator with the delay found."""
    seen = {}

    def answer(scenario, reference, before, after, **more):
        seen.update(reference=reference.id, before=before, after=after, **more)
        return compare_conditions(
            condition(0.0), condition(after.get("actuator_delay", {}).get("extra", 0.0))
        )

    monkeypatch.setattr(scenario_consequence, "consequence_of_effects", answer)
    return seen


def place(regime, share):
    return Place("M", (0.1, 1.0), regime, "", "all", share)


WHERE = (place("u10", 0.25), place("u45", 0.75))


def diagnosis(*named, where=WHERE):
    which = Which(dict.fromkeys(named, 1.0), named, (), {}, {}, True)
    closure = Closure(named, {}, Share(0.9, 0.8, 1.0), Share(0, 0, 0), {}, {}, {}, ())
    return GapDiagnosis("A gap.", "s", ("a",), Existence(True, 0.0, 0.02, 0.0), where, which, (closure,))


def test_the_phase_margin_that_a_delay_takes_is_in_the_verdict(simulation, asked):
    names = (*NAMES, ("sensor_bias", "q"))
    settings = {**LATE, "sensor_bias": {"q": 0.1}}
    named = diagnosis("actuator_delay", "sensor_bias")
    found = with_consequence(named, simulation, settings, names, np.diag([1e-4, 1e-2]))
    # the condition with most of the gap, and only what changes the vehicle under its law
    assert (asked["reference"], asked["before"]) == ("u45", {})
    assert asked["after"] == LATE
    assert asked["names"] == NAMES
    assert asked["covariance"].tolist() == [[1e-4]]
    lost = np.degrees(4 * DELAY)  # crossover times delay
    assert found.verdict.startswith(
        f"A gap. With actuator_delay and sensor_bias: as flown it costs {lost:.1f} deg"
    )
    figure = found.how_far[0].consequence["figures"]["margins/M/phase_deg"]
    assert figure["before"] - figure["after"] == pytest.approx(lost, rel=1e-6)


def test_what_is_found_beside_a_simulation_is_flown_on_top_of_what_it_has(simulation, asked):
    """A replay that finds -0.95 of the gyroscopic moments says that they are not there in flight."""
    with_consequence(
        diagnosis("gyroscopic"),
        simulation,
        {"gyroscopic": {"strength": -0.95}},
        (("gyroscopic", "strength"),),
        [[1e-4]],
        baseline={"gyroscopic": {"strength": 0.0}},
    )
    assert asked["after"]["gyroscopic"]["strength"] == pytest.approx(0.05)


def test_a_stated_reference_comes_before_the_places_of_the_gap(simulation, asked):
    with_consequence(diagnosis("actuator_delay"), simulation, LATE, NAMES, [[1e-4]], reference="u20")
    assert asked["reference"] == "u20"


def test_a_place_of_several_conditions_counts_for_each_in_part(simulation, asked):
    where = (place("u10 u20", 0.5), place("u45", 0.3))
    with_consequence(diagnosis("actuator_delay", where=where), simulation, LATE, NAMES, [[1e-4]])
    assert asked["reference"] == "u45"


def test_what_does_not_matter_is_not_in_the_verdict(simulation, asked):
    small = {"actuator_delay": {"extra": 1e-3}}
    found = with_consequence(diagnosis("actuator_delay"), simulation, small, NAMES, [[1e-4]])
    assert found.verdict == "A gap."
    assert "as flown it costs 0.2 deg" in found.how_far[0].consequence["sentence"]


@pytest.mark.usefixtures("asked")
def test_nothing_is_said_where_nothing_can_be(simulation):
    bias = diagnosis("sensor_bias")
    assert (
        with_consequence(bias, simulation, {"sensor_bias": {"q": 0.1}}, (("sensor_bias", "q"),), [[1]])
        is bias
    )
    late = diagnosis("actuator_delay")
    assert with_consequence(late, SimpleNamespace(kind="callable"), LATE, NAMES, [[1e-4]]) is late
    nowhere = diagnosis("actuator_delay", where=())
    assert with_consequence(nowhere, simulation, LATE, NAMES, [[1e-4]]) is nowhere
    unclosed = replace(late, how_far=())
    assert with_consequence(unclosed, simulation, LATE, NAMES, [[1e-4]]) is unclosed
