"""What a scenario must say of the airframe, and how a slip in it is reported."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.core.scenario import Scenario, read_scenario
from freqid.simulate import effects
from freqid.simulate.effects import library
from freqid.simulate.loads.description import parameters

SCENARIO = read_scenario(Path(__file__).resolve().parents[4] / "scenarios" / "la8.toml")[0]


def changed(edit) -> Scenario:
    table = msgspec.to_builtins(SCENARIO)
    edit(table["simulation"]["airframe"], table)
    return msgspec.convert(table, Scenario)


def test_parameters_follow_the_description():
    built = parameters(SCENARIO)
    np.testing.assert_allclose(built.wings.width.sum(axis=1), 1.83)
    area = (built.wings.width * built.wings.chord).sum()
    np.testing.assert_allclose(area, SCENARIO.vehicle.area_m2, rtol=2e-3)
    np.testing.assert_allclose(built.slipstreams.distance, 0.2)
    np.testing.assert_allclose(built.frames.pivot[1], [-0.62, 0, -0.15])
    # hubs come out where the scenario puts them
    frames = built.propellers.frame @ built.frames.pivot
    np.testing.assert_allclose(frames + built.propellers.hub, [r.position_m for r in SCENARIO.rotor])
    # every surface moves something, and neighbours share the strip that their border crosses
    assert np.all(np.abs(built.wings.flap).sum(axis=(0, 1))[:8] > 0)
    assert np.all(np.abs(built.tail.flap).sum(axis=0)[8:] > 0)
    whole = np.abs(built.wings.flap[0, :, [0, 4]]).sum(axis=0)
    assert whole[:7] == pytest.approx(whole[1])
    assert built.wakes.halves.sum(axis=2) == pytest.approx(np.ones((2, 2)))


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda a, t: a.pop("tail"), "tail"),
        (lambda a, t: a["aerofoil"].update(stal_rad=0.3), "stall_rad"),
        (lambda a, t: a["wing"].reverse(), "same order"),
        (lambda a, t: a["surface"][0].update(name="de9"), "did you mean 'de4'"),
        (lambda a, t: a["surface"][0].update(on="fornt"), "front"),
        (lambda a, t: a["surface"].pop(), "dr2"),
        (lambda a, t: t["rotor"][0].pop("diameter_m"), "diameter_m"),
        (lambda a, t: t["rotor"][0].update(axis=[0.9, 0.0, 0.1]), "along the chord"),
        (lambda a, t: t["simulation"].update(airframe={}), "simulation.airframe"),
        (lambda a, t: t["simulation"].update(effects={"slipstraem": 0.0}), "slipstream"),
        (lambda a, t: t["simulation"].update(effects={"slipstream": {"stregth": 0.0}}), "strength"),
        (lambda a, t: t["simulation"].update(effects={"slipstream": "off"}), "number"),
    ],
)
def test_a_slip_is_reported_with_what_is_expected(edit, words):
    with pytest.raises(UsageError, match=words):
        parameters(changed(edit))


def test_effects_are_set_by_size_or_by_name():
    found = effects.settings({"slipstream": 0.5, "wing_wake": {"strength": 0}})
    assert found["slipstream"] == {"strength": 0.5}
    assert found["wing_wake"] == {"strength": 0.0}
    assert found["rotor_inplane_force"] == {"strength": 1.0, "hub_moment": 1.0}


def test_every_effect_declares_itself_in_the_file_of_its_name():
    for identifier, effect in library().items():
        assert effect.id == identifier
        assert effect.meaning.endswith(".")
        assert effect.parameters
        assert (Path(effects.__file__).parent / f"{identifier}.py").is_file()
