"""A function of the session as a simulation: checked, diagnosed, compared, and the next test asked for."""

from __future__ import annotations

import msgspec
import pytest

import freqid as fq
from freqid.workflows import diagnose

FEW = ("surface_effectiveness", "mass")


@pytest.fixture(scope="module")
def sides(linear, linear_aircraft):
    """A sound simulation, one whose elevator does too little, one with a sign wrong; two flights."""

    def made(factor):
        def wrench(time, state, effector, air, parameters):
            values = {**state, **effector, "de": effector["de"] * factor}
            return {
                name: r.bias
                + sum(c * (values[x] - t) for x, c, t in zip(r.regressors, r.estimate, r.trim, strict=True))
                for name, r in linear["model"].responses.items()
                if name in wrench.responses
            }

        wrench.responses = ("Z", "M")
        return wrench

    flight = linear["flight"]
    return {
        "sound": made(1.0),
        "weak": made(0.7),
        "reversed": made(-1.0),
        "flights": [flight.cut(0, 30), flight.cut(30, 60)],
    }


@pytest.fixture
def few(monkeypatch):
    every = diagnose.effects_with(None)
    monkeypatch.setattr(diagnose, "effects_with", lambda own: {name: every[name] for name in FEW})


def test_a_function_is_connected_with_its_scenario(linear, sides):
    sim = fq.connect(sides["weak"], scenario=linear["scenario"])
    assert sim.responses == ("Z", "M")
    assert "made.<locals>.wrench" in repr(sim)
    assert sim.scenario is linear["scenario"]
    assert sim.vehicle == linear["scenario"].aircraft()


def test_a_wrong_sign_is_bookkeeping_and_stops_a_diagnosis(linear, sides):
    sim = fq.connect(sides["reversed"], scenario=linear["scenario"])
    flight = sides["flights"][0]
    found = fq.check_simulation(sim, flight)
    assert not found
    assert "effector_sign" in str(found)
    with pytest.raises(fq.FreqidError, match="1 mistake of bookkeeping") as told:
        found.refuse()
    assert told.value.exit_code == 4
    with pytest.raises(diagnose.BookkeepingMistakes, match="no gap was diagnosed") as stopped:
        fq.diagnose_gap(sim, flight)
    assert stopped.value.findings == found.findings
    assert fq.check_simulation(sides["sound"], flight, scenario=linear["scenario"])


@pytest.mark.usefixtures("few")
def test_a_gap_is_diagnosed_and_the_next_test_asked_for(linear, sides, tmp_path):
    sim = fq.connect(sides["weak"], scenario=linear["scenario"])
    flight, other = sides["flights"]
    gap = fq.diagnose_gap(sim, flight, held_out=other, draws=100, plan=False)
    assert gap.gap.exists
    assert gap.which.probabilities["surface_effectiveness"] > 0.9
    assert gap.to_frame()["effect"][0] == "surface_effectiveness"
    assert gap.next_flight == {}
    assert isinstance(fq.next_test(gap), dict)
    assert gap._repr_html_().count("<tr") > 2
    fq.save(gap, tmp_path / "gap.h5")
    read = fq.read(tmp_path / "gap.h5")
    assert (read.verdict, read.which.probabilities) == (gap.verdict, gap.which.probabilities)
    with pytest.raises(fq.FreqidError, match="was read from a file"):
        fq.next_test(read)
    with pytest.raises(fq.FreqidError, match="flight 2: is given twice"):
        fq.diagnose_gap(sim, [flight, flight])


def test_two_functions_are_compared(linear, sides):
    found = fq.compare_simulations(
        sides["weak"], sides["sound"], sides["flights"], scenario=linear["scenario"]
    )
    assert found.nearer == "B"
    assert found.to_frame().iloc[0]["misfit A"] > found.to_frame().iloc[0]["misfit B"]
    assert found.provenance["scenario"]["sha256"] == linear["scenario"].sha256


def test_a_study_refuses_a_scenario_that_its_file_does_not_say(linear, tmp_path):
    scenario = linear["scenario"]
    body = msgspec.structs.replace(scenario.vehicle, mass_kg=30.0)
    with pytest.raises(fq.FreqidError, match="works from the scenario's file"):
        fq.study(msgspec.structs.replace(scenario, vehicle=body), tmp_path / "study")
    assert not (tmp_path / "study").exists()
