"""What an effect changes comes on top of what a simulation has of it already."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.gap import closest_flight
from freqid.gap.connect.scenario import ScenarioSimulation
from freqid.gap.model.candidate import Place
from freqid.gap.model.changes import beside, change
from freqid.gap.stack.trial import Trial
from freqid.simulate.effects import library
from freqid.simulate.maneuver import with_effects
from freqid.workflows.inputs import scenario_of

SCENARIO = scenario_of(Path(__file__).parents[3] / "scenarios" / "linear.toml")
TIME = 0.02 * np.arange(151)
WAVE = np.sin(2 * np.pi * TIME)
LEVELS = {"de": (0.02, 0.05), "da": (0.0, 0.05), "dr": (0.0, 0.05), "n1": (420.0, 20.0)}


def flown(in_force):
    """Return a trial of a scenario whose actuators are late already by some seconds."""
    rows = {"air/rho": ("kg/m3", 1.225)}
    rows |= {f"state/{n}": ("m/s", x) for n, x in zip("uvw", (20.0, 0.0, WAVE), strict=True)}
    rows |= {f"state/{n}": ("rad/s", 0.01 * WAVE) for n in "pqr"}
    rows |= {f"state/{n}": ("rad", 0.0) for n in ("phi", "theta", "psi")}
    rows |= {f"state/{n}": ("m/s2", x) for n, x in (("ax", 0.0), ("ay", 0.0), ("az", -9.8))}
    for name, (level, size) in LEVELS.items():
        for group in ("effector", "command"):
            rows[f"{group}/{name}"] = ("rad/s" if name == "n1" else "rad", level + size * WAVE)
    channels = {n: Channel(n, unit, x + 0 * TIME, 50.0, "test") for n, (unit, x) in rows.items()}
    scenario = with_effects(SCENARIO, {"actuator_delay": {"extra": in_force}}) if in_force else SCENARIO
    vehicle = SCENARIO.aircraft()
    return Trial.of(
        ScenarioSimulation(scenario),
        Maneuver(FlightRecord(TIME, channels, vehicle, reference="u20"), vehicle),
    )


def lateness(moved, position):
    rate, middle = np.gradient(position, 0.02), slice(30, 120)
    return -(moved[middle] @ rate[middle]) / (rate[middle] @ rate[middle])


@pytest.mark.parametrize("in_force", [0.0, 0.03])
@pytest.mark.parametrize("size", [-0.01, 0.001, 0.02])
def test_a_further_delay_is_as_late_whatever_delay_is_simulated(in_force, size):
    trial, effect = flown(in_force), library()["actuator_delay"]
    row = [r.name for r in trial.measured.rows].index("actuator/de")
    moved = change(effect, trial, {"extra": size}).direct[row]
    assert lateness(moved, trial.positions["de"]) == pytest.approx(size, abs=2e-4)
    if size > 0:
        after = beside([(effect, {"extra": size})], trial).positions["de"]
        assert lateness(after - trial.positions["de"], trial.positions["de"]) == pytest.approx(size, abs=2e-4)


def test_sizes_of_each_effector_are_asked_for_at_once(monkeypatch):
    trial, effect = flown(0.0), library()["actuator_delay"]
    each = {"de": 0.01, "da": 0.02, "n1": 0.03}
    alone = {n: beside([(effect, {n: size})], trial).positions[n] for n, size in each.items()}
    calls, positions = [], ScenarioSimulation.positions
    monkeypatch.setattr(
        ScenarioSimulation, "positions", lambda self, *asked: calls.append(asked) or positions(self, *asked)
    )
    together = beside([(effect, each)], trial).positions
    assert len(calls) == 1
    for name in each:
        np.testing.assert_allclose(together[name], alone[name], rtol=1e-12)
        assert np.abs(together[name] - trial.positions[name]).max() > 1e-3


def test_the_simulation_flies_with_what_was_found_on_top_of_what_it_has(monkeypatch):
    monkeypatch.setattr(closest_flight, "joint_estimates", lambda *_: [SimpleNamespace(size=np.array([0.3]))])
    found = SimpleNamespace(kind="scalar", effect="gyroscopic", place=Place("", ("strength",)))
    evidence = SimpleNamespace(candidate=np.ones(1), system=SimpleNamespace(candidates=[found]))
    simulation = SimpleNamespace(effects={"gyroscopic": {"strength": 1.0}})
    flown = closest_flight.effect_of_its_own(evidence, simulation, library())
    assert flown["effects"]["gyroscopic"]["strength"] == pytest.approx(1.3)
