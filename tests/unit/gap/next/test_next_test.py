"""The next test: separations by dense formulas, flights within limits, ground tests, and what is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pitching import BANDS, SIZES, VEHICLE, Pitching, effect, flight
from scipy.stats import norm

from freqid.core.results.design import read_design, read_inputs
from freqid.core.scenario import Reference, read_scenario
from freqid.gap.diagnose import Question, diagnose
from freqid.gap.infer.block_matrices import Form, Products
from freqid.gap.infer.system import System
from freqid.gap.infer.which import APART
from freqid.gap.model.candidate import Candidate, Place
from freqid.gap.next.excitations import STRONGEST, largest_scale, unflown
from freqid.gap.next.ground_tests import TESTS, UNTESTABLE, distance
from freqid.gap.next.next_test import ground_tables, propose_test
from freqid.gap.next.predicted_flight import FlightContext, fly_alone, predict_columns
from freqid.gap.next.rivals import RivalExplanations, rivals_of
from freqid.simulate.effects import library


def scalar(name, parameter="size", bound=10.0):
    prior = bound * np.array([-1.0, -0.1, 0.1, 1.0])
    return Candidate(name, Place("", (parameter,)), "scalar", np.ones(1), prior, [])


def rivals(columns, estimates, tolerances=()):
    """Return rivals of one white column each; tolerances are columns of one sigma."""
    x = np.array(list(columns.values()))
    t = np.array(tolerances).reshape(-1, x.shape[1])
    none = np.zeros((0, x.shape[1]))
    block = Products.of(x, t, np.zeros(x.shape[1]), none, none, none).matrices()
    names = tuple(columns)
    found = [scalar(n) for n in names]
    system = System(found, tuple(f"t{i}" for i in range(len(t))), [block], (Form(0.0, 0.0),))
    sizes = {n: np.array([s]) for n, s in zip(names, estimates, strict=True)}
    places = {n: (i,) for i, n in enumerate(names)}
    return RivalExplanations((names,), (names,), system, places, sizes, Form(0.0, 0.0))


def test_separation_is_what_the_other_effect_leaves_in_the_full_covariance():
    rng = np.random.default_rng(3)
    a, b = rng.standard_normal((2, 30))
    t = rng.standard_normal((4, 30))
    both = rivals({"a": a, "b": b}, (2.0, 2.0), t)
    metric = np.linalg.inv(np.eye(30) + t.T @ t)
    c2 = (a @ metric @ b) ** 2 / (a @ metric @ a) / (b @ metric @ b)
    most = 4 * max(a @ metric @ a, b @ metric @ b)  # the fainter one is taken as plain as the other
    assert both.now["a", "b"] == pytest.approx(most * (1 - c2), rel=1e-9)


def test_right_names_in_95_of_100_draws_where_two_are_apart():
    """A pair at APART, drawn and fitted by least squares: no formula of the diagnosis takes part."""
    rng, c = np.random.default_rng(0), 0.9
    a, b = np.array([1.0, 0.0]), np.array([c, np.sqrt(1 - c**2)])
    size = np.sqrt(APART / (1 - c**2))
    assert rivals({"a": a, "b": b}, (size, size)).now["a", "b"] == pytest.approx(APART)
    data = size * a + rng.standard_normal((20000, 2))
    rate = np.mean((data @ a) ** 2 > (data @ b) ** 2)
    # free sizes: half the angle instead of half the distance, alike for small angles
    assert rate == pytest.approx(norm.cdf(np.sqrt(APART) / 2), abs=0.008)


def test_what_differs_by_nothing_is_the_same_change():
    a = np.array([3.0, 0.0])
    twins, others = rivals({"a": a, "b": 2 * a}, (1, 1)), rivals({"a": a, "b": np.array([3.0, 0.1])}, (1, 1))
    assert twins.same(twins.system) == {("a", "b")}
    assert not others.same(others.system)


@pytest.fixture(scope="module")
def unsure():
    """A diagnosis that leaves two gains possible, and its question."""
    question = Question(BANDS, SIZES, (0.1, 2.0), close=False)
    found = diagnose(Pitching(), [flight(1, 0.05)], question)
    assert found.diagnosis.gap.exists
    return leave(found, ("wide", "slow")), question


def leave(found, names):
    """Return findings whose set holds some names."""
    which = replace(found.diagnosis.which, set=names, aliases=())
    return replace(found, diagnosis=replace(found.diagnosis, which=which))


def around(found, question, simulation):
    both = rivals_of(found)
    assert both is not None
    return FlightContext(
        simulation, both, question.candidates, question.tolerances, (0.1, 2.0), found.blocks, found.columns
    )


def test_a_flight_flown_again_is_predicted_as_it_was(unsure):
    """The signals at hand as a proposal: the columns are those that the diagnosis had."""
    found, question = unsure
    here, like = around(found, question, Pitching()), found.blocks[0]
    record = like.motion.maneuver.record
    again = Pitching().fly(record)
    assert again is not None
    channels = [replace(record.channel(n), values=x) for n, x in again.items()]
    predicted = predict_columns(here, record.with_channels(*channels), like, 1)
    assert predicted is not None
    matrices = predicted.matrices()
    old = here.rivals.system.blocks[0].at_loads(here.rivals.form_error.loads)
    n = here.rivals.system.columns
    new = matrices.at_loads(here.rivals.form_error.loads)
    assert new[:n, :n] == pytest.approx(old[:n, :n], rel=0.1, abs=1e-3 * np.abs(old[:n, :n]).max())
    apart = here.rivals.separations(here.rivals.with_flight(matrices))
    assert apart["slow", "wide"] > 1.5 * here.rivals.now["slow", "wide"]


def test_the_proposed_flight_adds_separation_within_limits_and_can_be_flown(unsure, tmp_path):
    found, question = unsure
    path = tmp_path / "next.h5"
    table = propose_test(found, Pitching(), question, None, path)
    (test,) = (t for t in table["tests"] if t["kind"] == "flight")
    (pair,) = test["pairs"]
    assert pair["after"] > 1.5 * pair["now"]
    assert table["gain"] == pytest.approx(pair["after"] / pair["now"])
    assert (table["design"], table["no_flight"]) == (str(path), "")
    design, signals = read_design(path), read_inputs(path)
    assert set(design.names) == set(test["effectors"])
    flown = found.blocks[0].maneuvers[0].record
    for name, values in zip(signals.names, signals.values, strict=True):
        assert np.std(values) == pytest.approx(test["rms"][name], rel=0.02)
        assert np.std(values) <= 1.01 * STRONGEST * np.std(flown[f"excitation/{name}"])
    record = fly_alone(Pitching(), design, "c1", found.blocks[0])
    assert record is not None
    assert largest_scale(record, VEHICLE, {}) >= 0.99


SCENARIO = """
[vehicle]
name = "pitching"
mass_kg = 10.0
inertia = { xx = 1.5, yy = 2.0, zz = 3.0 }
[[effector]]
name = "d1"
kind = "surface"
limits = [-0.3, 0.3]
[[effector]]
name = "d2"
kind = "surface"
limits = [-0.3, 0.3]
[[reference]]
id = "c1"
u = 20.0
rho = 1.2
[excitation]
band_hz = [0.1, 2.0]
period_s = 20.0
periods = 1
dt_s = 0.05
effectors = ["d1", "d2"]
"""


def stating(folder, amplitude, rest=""):
    """Return a scenario of the pitching body with an excitation of both surfaces."""
    (folder / "scenario.toml").write_text(f"{SCENARIO}amplitude = {amplitude}\n{rest}")
    return read_scenario(folder / "scenario.toml")[0]


def test_a_limit_that_is_stated_for_the_condition_is_kept(unsure, tmp_path):
    found, question = unsure
    free = stating(tmp_path, 0.03)
    design = tmp_path / "next.h5"
    propose_test(found, Pitching(), question, free, design)
    peak = largest_rate(design, found.blocks[0])
    limited = stating(tmp_path, 0.03, f"[excitation.at.c1]\nabort = {{ q = {peak / 2} }}\n")
    propose_test(found, Pitching(), question, limited, design)
    assert largest_rate(design, found.blocks[0]) <= 0.81 * peak / 2


def largest_rate(path, block):
    record = fly_alone(Pitching(), read_design(path), "c1", block)
    assert record is not None
    return float(np.abs(record["state/q"] - record["state/q"][0]).max())


def test_what_is_excited_without_an_amplitude_is_said(unsure, tmp_path):
    found, question = unsure
    table = propose_test(found, Pitching(), question, stating(tmp_path, "{ d1 = 0.03 }"), tmp_path / "n.h5")
    assert (
        table["no_flight"]
        == "no excitation can be designed: excitation.amplitude lacks 'd2'; give it an amplitude."
    )


def test_a_limit_lowers_all_signals(unsure):
    record = unsure[0].blocks[0].motion.maneuver.record
    peak = float(np.abs(record["state/q"] - record["state/q"][0]).max())
    assert largest_scale(record, VEHICLE, {"q": 0.5 * peak}) == pytest.approx(0.4)


def test_a_simulation_that_cannot_fly_gets_ground_tests_alone(unsure):
    two = {"mass": effect("mass"), "inertia": replace(BANDS["slow"], id="inertia")}
    question = replace(unsure[1], candidates=two)
    still = Pitching(can_fly=False)
    found = leave(diagnose(still, [flight(1, 0.05)], question), ("mass", "inertia"))
    table = propose_test(found, still, question, None, None)
    assert {t["kind"] for t in table["tests"]} == {"ground"}
    assert table["no_flight"] == "pitching cannot fly, so no flight was predicted"
    assert table["no_flight"] in table["groups"][0]["sentence"]
    assert table["tests"][0]["name"] == "weighing"


def test_what_makes_the_same_change_is_split_on_the_ground_or_not_at_all(unsure):
    for names, splits in ((("mass", "downwash_lag"), ["weighing"]), (("unsteady_lift", "downwash_lag"), [])):
        question = replace(unsure[1], candidates={n: effect(n) for n in names})
        found = leave(diagnose(Pitching(), [flight(1, 0.05)], question), names)
        table = propose_test(found, Pitching(), question, None, None)
        (group,) = table["groups"]
        assert "they make the same change" in group["sentence"]
        assert group["split_by"] == splits
        assert group["splits"] == bool(splits)
        assert table["separates"] == []


def test_nothing_is_proposed_where_nothing_remains(unsure):
    found, question = unsure
    assert propose_test(leave(found, ("wide",)), Pitching(), question, None, None) == {}
    sound = diagnose(Pitching(), [flight(1)], question)
    assert not sound.diagnosis.gap.exists
    assert propose_test(sound, Pitching(), question, None, None) == {}


def test_a_ground_test_counts_its_instrument_and_what_may_be_off_anyway():
    both = rivals({"mass": np.array([1.0, 0.0]), "inertia": np.array([0.0, 1.0])}, (0.03, 0.1))
    weighing = next(t for t in TESTS if t.id == "weighing")
    adds, measured = distance(weighing, both, ("mass", "inertia"), {"mass": 0.01})
    assert adds == pytest.approx(0.03**2 / (0.001**2 + 0.01**2))
    assert measured == ("mass size",)
    assert [t["name"] for t in ground_tables(both, {"mass": 0.01})] == ["weighing", "inertia swing"]


def test_every_effect_has_a_ground_test_or_a_reason_and_every_test_names_effects():
    tested = {key.partition(":")[0] for t in TESTS for key in t.sigma}
    assert tested | set(UNTESTABLE) == set(library())
    assert not tested & set(UNTESTABLE)
    assert all(error > 0 for t in TESTS for error in t.sigma.values())


def test_conditions_furthest_from_those_flown_come_first_and_hover_only_beside_hover():
    at = {u: Reference(id=f"u{u}", u=u, rho=1.2) for u in (0, 5, 10, 15, 21, 30)}
    every = [*at.values(), Reference(id="high", u=25, rho=1.0)]
    assert [r.id for r in unflown(every, [at[10]], 2)] == ["u30", "u21"]
    assert [r.id for r in unflown(every, [at[5], at[30]], 2)] == ["u15", "u21"]
    assert "u5" in [r.id for r in unflown([at[0], at[5]], [at[0]], 2)]
    assert unflown(every, [], 2) == []
