"""The words that an effect has for either sign of its change agree with what the change does."""

from pathlib import Path

import numpy as np
import pytest

from freqid.core.record import Channel, FlightRecord
from freqid.core.scenario import read_scenario
from freqid.simulate.effects import find, shipped

VEHICLE = read_scenario(Path(__file__).parents[4] / "scenarios" / "la8.toml")[0].aircraft()
TIME = 0.02 * np.arange(500)


def said(effect, parameter, change):
    """What is said of a change whose interval is half of it to either side."""
    ends = sorted((0.5 * change, 1.5 * change))
    return find(effect).signed_meaning({parameter: (ends[0], ends[1])})


def usual(effect, **changed):
    own = find(effect).of(VEHICLE)
    return {n: p.default for n, p in own.parameters.items()} | {own.size: 0.0} | changed


@pytest.mark.parametrize("effect", shipped().values(), ids=lambda e: e.id)
def test_what_may_change_either_way_has_words_for_both(effect):
    for name, p in effect.of(VEHICLE).parameters.items():
        sized = name in (effect.size, *(n for n, q in effect.parameters.items() if q.default == 0))
        if sized and p.scale and p.low < p.default < p.high:
            up, down = said(effect.id, name, 0.1), said(effect.id, name, -0.1)
            assert len({up, down, effect.meaning.rstrip(".")}) >= 2
            assert up != down
            assert not up.endswith(".")


def test_an_interval_that_holds_zero_or_is_a_point_leaves_the_meaning():
    mass = find("mass")
    for ends in ((-0.1, 0.2), (0.1, 0.1)):
        assert mass.signed_meaning({"fraction": ends}) == mass.meaning.rstrip(".")
    assert mass.signed_meaning({}) == mass.meaning.rstrip(".")


@pytest.mark.parametrize(
    ("effect", "parameter", "figure", "more"),
    [
        ("mass", "fraction", lambda m: m.mass_kg, "heavier"),
        ("cg_offset", "x", lambda m: m.cg_m[0], "forward"),  # body axes: x forward, y right, z down
        ("cg_offset", "y", lambda m: m.cg_m[1], "right"),
        ("cg_offset", "z", lambda m: m.cg_m[2], "lower"),
        ("inertia", "yy", lambda m: m.inertia.yy, "in pitch is larger"),
        ("mass_properties", "zz", lambda m: m.inertia.zz, "in yaw is larger"),
    ],
)
def test_words_of_mass_properties_follow_what_is_loaded(effect, parameter, figure, more):
    for change in (0.03, -0.03):
        loaded = find(effect).load(usual(effect, **{parameter: change}), VEHICLE)
        grown = figure(loaded.mass_properties) > figure(VEHICLE.mass_properties)
        assert (more in said(effect, parameter, change)) is grown


def test_words_of_effectors_follow_what_the_air_feels():
    for effect, name, less in (
        ("weak_rotor", "n3", "thrusts less"),
        ("surface_effectiveness", "de1", "feels less"),
    ):
        for loss in (0.2, -0.2):
            felt = find(effect).feel(
                usual(effect, **{name: loss}), {name: np.ones(3)}, 0.02, VEHICLE.effector_kinds
            )
            assert (less in said(effect, name, loss)) is bool(felt[name][0] < 1)


def test_words_of_delays_and_of_time_stamps_follow_the_signal():
    ramp = {"de1": TIME.copy()}
    for late in (0.08, -0.08):
        moved = find("actuator_delay").act(
            usual("actuator_delay", de1=late), ramp, 0.02, VEHICLE.effector_kinds
        )
        assert ("later" in said("actuator_delay", "de1", late)) is bool(moved["de1"][250] < TIME[250])
        record = FlightRecord(TIME, {"state/q": Channel("state/q", "rad/s", TIME.copy(), 50.0, "made")})
        logged = find("time_skew").distort(usual("time_skew", rates=late), record)
        assert ("older" in said("time_skew", "rates", late)) is bool(logged["state/q"][250] < TIME[250])


def test_several_changes_are_said_where_each_is_sure():
    text = find("cg_offset").signed_meaning({"x": (0.01, 0.03), "y": (-0.01, 0.02), "z": (-0.03, -0.01)})
    assert text == (
        "The centre of gravity is farther forward than it is described; "
        "The centre of gravity is higher than it is described"
    )


def test_a_size_at_one_effector_has_the_words_of_the_effects_size():
    strong = find("surface_effectiveness").of(VEHICLE).signed_meaning({"de1": (-0.31, -0.23)})
    assert "more of a control surface" in strong
    weak = find("surface_effectiveness").of(VEHICLE).signed_meaning({"de1": (0.23, 0.31)})
    assert "less of a control surface" in weak
