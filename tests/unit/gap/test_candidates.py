"""Candidate effects on the linear aircraft: weights between sizes, proportional ones, what is not tested."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import LAG, LIBRARY, Linear, Truth, effect, fly, servo

from freqid.core.errors import ImpossibleSettings
from freqid.gap.model.candidate import OTHER, Candidate, Place
from freqid.gap.model.candidates import candidates, recomputed
from freqid.gap.model.changes import change
from freqid.gap.model.refine import refined
from freqid.gap.stack.block import stack_of
from freqid.simulate.effects import motor_lag
from freqid.simulate.effects.places import one_each

BAND = (0.05, 2.0)


def bent(settings, replay):
    """A load that goes with size and with its square."""
    found = np.zeros((6, replay.record.time.size))
    found[2] = (settings["size"] + settings["size"] ** 2) * (replay.record["state/w"] - 1.0)
    return found


BENT = effect("bent", "size", 0.2, replay=bent)
ROTORS = dict.fromkeys(("d1", "d2"), "rotor")
SLOWER = replace(
    motor_lag.EFFECT,
    act=lambda settings, signals, dt, _: motor_lag.EFFECT.act(settings, signals, dt, ROTORS),
    for_vehicle=lambda v: one_each(v, motor_lag.EFFECT.parameters["extra"], ("surface",)),
)
NOWHERE = replace(effect("nowhere", "size", 0.2, replay=bent), needs=("rotor",))


@pytest.fixture(scope="module")
def blocks():
    return stack_of(Linear(), [fly(noise=1.0, duration=40.0)], ["one"], BAND)


@pytest.fixture(scope="module")
def found(blocks):
    return candidates({**LIBRARY, "bent": BENT, "nowhere": NOWHERE}, blocks)


def of(found, name):
    (one,) = (c for c in found[0] if c.effect == name)
    return one


def test_weights_give_parabolas_back_and_are_proportional_beyond_the_sizes():
    sizes = np.array([-2.0, 1.0, 3.0])
    one = Candidate("x", Place("", ("x",)), "scalar", sizes, np.array([1.0]), [])
    assert one.weights(1.0) == pytest.approx([0, 1, 0])
    assert not one.weights(0.0).any()
    changes = sizes + 0.3 * sizes**2
    between = np.linspace(-2, 3, 41)
    assert one.weights(between) @ changes == pytest.approx(between + 0.3 * between**2)
    assert one.weights(4.5) == pytest.approx([0, 0, 1.5])
    assert one.weights(-3.0) == pytest.approx([1.5, 0, 0])


def test_weights_of_one_size_are_proportional_on_either_side():
    one = Candidate("x", Place("", ("x",)), "scalar", np.array([2.0]), np.array([1.0]), [])
    assert one.weights(np.array([-1.0, 1.0, 5.0]))[:, 0] == pytest.approx([-0.5, 0.5, 2.5])


@pytest.mark.parametrize("name", ["worn", "heavy", "gyro", "drag"])
def test_a_proportional_effect_has_one_column(found, name):
    assert of(found, name).sizes.size == 1


def test_other_effects_have_one_for_each_of_several_sizes_of_both_signs(found):
    sizes = of(found, "bent").curve.sizes
    assert sizes.size > 8
    assert sizes.min() < 0 < sizes.max()
    assert 0 not in sizes


@pytest.mark.parametrize("name", ["worn", "heavy", "gyro", "drag", "bent", "late"])
def test_columns_at_any_size_make_what_the_formula_makes(found, blocks, name):
    one, (block,) = of(found, name), blocks
    what = {**LIBRARY, "bent": BENT}[name]
    parameter = one.place.parameters[0]
    for share in (0.11, 0.5):
        size = share * one.prior.max()
        exact = block.transform(change(what, block.trial, {parameter: size}))
        made = np.tensordot(one.weights(size), one.columns[0], 1)
        white = np.sqrt(block.noise_power)
        assert np.linalg.norm((made - exact) / white) < 0.06 * np.linalg.norm(exact / white)


def test_a_flight_that_has_an_effect_leaves_its_column(blocks):
    """The truth is integrated with 7 % of a surface lost: a residual of seven times the share's column."""
    worn = stack_of(Linear(), [fly(Truth(loss=0.07), noise=1.0, duration=40.0)], ["worn"], BAND)
    one = of(candidates(LIBRARY, worn), "worn")
    z = np.tensordot(one.weights(0.07), one.columns[0], 1)
    (block,), (whole,) = worn, stack_of(Linear(), [fly(Truth(), noise=1.0, duration=40.0)], ["whole"], BAND)
    before, after = (float((block.white(x) ** 2).mean()) for x in (block.residual, block.residual - z))
    assert before > 10
    # no more than the same noise leaves where nothing is lost
    assert after < 1.05 * float((whole.white(whole.residual) ** 2).mean())


def test_the_last_one_is_free_changes_of_the_simulations_terms(found):
    last = found[0][-1]
    assert (last.effect, last.kind) == (OTHER, "vector")
    assert sum(c.effect == OTHER for c in found[0]) == 1


def test_what_needs_what_is_not_there_is_not_tested(found):
    assert all(c.effect != "nowhere" for c in found[0])
    assert "rotor" in found[1]["nowhere"]


def test_a_vector_is_recomputed_where_one_sigma_of_it_is_no_body(blocks, monkeypatch):
    """As a moment of inertia that exceeds the sum of the other two: the opposite sign will do."""

    def only_less(effect, trial, settings, *, first_order):
        if settings.get("a", 0.0) > 0:
            raise ImpossibleSettings("no body")
        return trial.rows(sum(settings.values()) * trial.predicted)

    two = replace(BENT, id="two", parameters=dict.fromkeys("ab", BENT.parameters["size"]))
    vector = Candidate("two", Place("all", ("a", "b")), "vector", np.array([0.1, 0.2]), np.ones(1), [])
    monkeypatch.setattr("freqid.gap.model.candidates.change", only_less)
    (made,) = recomputed(vector, {"two": two}, blocks)
    whole = blocks[0].transform(blocks[0].trial.rows(blocks[0].trial.predicted))
    np.testing.assert_allclose(made, [0.1 * whole, 0.2 * whole], rtol=1e-12, atol=1e-12 * np.abs(whole).max())


def test_what_was_taken_for_straight_is_computed_at_its_size_where_that_is_seen(blocks):
    """Two per cent of a change that stands a thousand standard deviations out of the noise are seen."""

    def nearly(settings, replay):
        found = np.zeros((6, replay.record.time.size))
        found[2] = 1e4 * (settings["size"] + 0.02 * settings["size"] ** 2) * (replay.record["state/w"] - 1.0)
        return found

    library = {"nearly": effect("nearly", "size", 0.2, replay=nearly)}
    (one,) = (c for c in candidates(library, blocks)[0] if c.effect == "nearly")
    assert one.sizes.size == 1
    new = refined(one, 0.7, library, blocks)
    exact = change(library["nearly"], blocks[0].trial, {"size": 0.7})
    made = np.tensordot(new.weights(0.7), new.columns[0], 1)
    np.testing.assert_allclose(made, blocks[0].transform(exact), rtol=1e-9)


def test_sizes_at_which_a_simulation_says_nothing_are_passed_over(blocks):
    """An owner's polynomials may blow up far from where they were fitted: 1e187 N in a tail wind."""

    def without_bounds(settings, replay):
        found = np.zeros((6, replay.record.time.size))
        size = settings["size"]
        found[2] = (size + np.expm1(400 * max(abs(size) - 0.3, 0.0))) * (replay.record["state/w"] - 1.0)
        return found

    library = {"unbounded": effect("unbounded", "size", 0.2, replay=without_bounds)}
    (one,) = (c for c in candidates(library, blocks)[0] if c.effect == "unbounded")
    assert np.isfinite(one.columns[0]).all()
    sizes = one.sizes if one.curve is None else one.curve.sizes
    assert np.abs(sizes).max() < 0.5
    assert np.abs(one.columns[0]).max() < 1e12


def test_a_slower_actuator_is_slower_than_the_simulations_own_one(blocks):
    """Not than one of some usual time constant, which would make another size of it and another shape."""
    made, _ = candidates({"motor_lag": SLOWER}, blocks)
    own = [c for c in made if c.place.fixed]
    assert {c.place.parameters for c in own} == {("extra",), ("d1",), ("d2",)}
    assert [dict(c.place.fixed)["time_constant"] for c in own] == pytest.approx([LAG] * 3, rel=0.02)
    (block,), extra = blocks, 0.8 * LAG
    sent, every = {n: block.trial.sent[f"command/{n}"] for n in ROTORS}, block.trial.every
    moved = {n: (servo(x, LAG + extra) - servo(x, LAG))[::every] for n, x in sent.items()}
    exact = block.transform(block.trial.rows(positions=moved))
    (of_all,) = (c for c in own if c.place.parameters == ("extra",))
    z = np.tensordot(of_all.weights(extra), of_all.columns[0], 1)
    white = np.sqrt(block.noise_power)
    assert np.linalg.norm((z - exact) / white) < 0.06 * np.linalg.norm(exact / white)


def test_a_slower_actuator_is_looked_for_at_usual_time_constants_where_none_is_simulated():
    (block,) = stack_of(Linear(actuators=False), [fly(noise=1.0, duration=40.0)], ["one"], BAND)
    made, _ = candidates({"motor_lag": SLOWER}, [block])
    given = {dict(c.place.fixed).get("time_constant") for c in made if c.effect == "motor_lag"}
    assert given == {None, *motor_lag.EFFECT.parameters["time_constant"].looked_at}
