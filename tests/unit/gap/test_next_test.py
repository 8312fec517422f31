"""The next test: separations by slow formulas, bands that split, pairs that nothing splits, ground tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import LIBRARY, SIZES, Linear, Truth, effect, fly
from scipy.signal import butter, sosfiltfilt
from scipy.stats import norm

from freqid.cli.next_texts import beside, next_text, with_next_test
from freqid.core.design_file import read_design, read_inputs
from freqid.core.scenario import Reference
from freqid.design.multisine import sampled
from freqid.gap import calibration
from freqid.gap.calibrate import APART, Table
from freqid.gap.compare import compare
from freqid.gap.diagnose import Question, diagnose
from freqid.gap.elsewhere import unflown
from freqid.gap.evidence import Evidence
from freqid.gap.excitations import STRONGEST, options
from freqid.gap.explanations import Explanation, alike, apart, as_plain
from freqid.gap.ground_tests import TESTS, UNTESTABLE, distance
from freqid.gap.next_bench import Bench
from freqid.gap.next_flight import next_flight
from freqid.gap.next_test import next_test, on_ground
from freqid.gap.rehearsal import Rehearsal, flown
from freqid.simulate.effects import library

TOLERANT = {**SIZES, "derivatives": 0.02, "responses": 0.01, "dynamics": 0.02, "form": 0.0}


def _gain(settings, signals, dt, kinds):
    return {n: (1 + settings["share"]) * x for n, x in signals.items()}


def _slow_gain(settings, signals, dt, kinds):
    """Return positions that are larger below 0.5 Hz only."""
    slow = butter(4, 0.5, fs=1 / dt, output="sos")
    return {n: x + settings["share"] * sosfiltfilt(slow, x) for n, x in signals.items()}


def _heavy(parameter):
    load = LIBRARY["heavy"].load
    assert load is not None
    return lambda settings, described: load({"fraction": settings[parameter]}, described)


BANDS = {
    "wide": effect("wide", "share", 0.05, act=_gain),
    "slow": effect("slow", "share", 0.05, act=_slow_gain),
}
TWINS = {
    "mass": effect("mass", "fraction", 0.05, load=_heavy("fraction")),
    "downwash_lag": effect("downwash_lag", "strength", 0.2, load=_heavy("strength")),
    "unsteady_lift": effect("unsteady_lift", "time_constant", 0.05, "s", load=_heavy("time_constant")),
}


def evidence(signatures, tolerances):
    """Return the evidence of white columns without data, names and columns by name."""
    columns = np.array([*signatures.values(), *tolerances.values()])
    gram = np.zeros((1, len(columns) + 1, len(columns) + 1))
    gram[0, 1:, 1:] = columns @ columns.T
    return Evidence(gram, tuple(signatures), tuple(tolerances), np.zeros((0, len(tolerances))), 0)


def test_two_directions_are_as_far_apart_as_their_angle_says():
    angle, lam = 0.3, 40.0
    a = np.sqrt(lam) * np.array([1.0, 0.0, 0.0])
    b = np.sqrt(lam) * np.array([np.cos(angle), np.sin(angle), 0.0])
    found = evidence({"a:size": a, "b:size": b}, {})
    one = Explanation("a", {"a:size": 1.0}, (("a:size",),))
    other = Explanation("b", {"b:size": 2.0}, (("b:size",),))
    # the weaker one counts, and c = cos(angle)
    assert apart(found, one, other) == pytest.approx(0.5 * lam * np.sin(angle) ** 2)
    assert apart(found, one, Explanation("none")) == pytest.approx(0.5 * lam)


def test_a_faint_explanation_is_taken_as_plain_as_the_other():
    found = evidence({"a:size": np.array([3.0, 0.0]), "b:size": np.array([0.6, 0.8])}, {})
    one = Explanation("a", {"a:size": 2.0}, (("a:size",),))
    other = Explanation("b", {"b:size": -1.0}, (("b:size",),))
    same, louder = as_plain(found, one, other)
    assert same == one
    assert louder.value == pytest.approx({"b:size": -6.0})
    assert apart(found, same, louder) == pytest.approx(0.5 * 36 * (1 - 0.6**2))
    none = Explanation("none")
    assert as_plain(found, one, none) == (one, none)


def test_tolerances_and_variants_count_as_in_the_full_covariance():
    rng = np.random.default_rng(3)
    s = {f"{n}:{k}": rng.standard_normal(30) for n in "ab" for k in "xy"}
    t = {f"t{i}": rng.standard_normal(30) for i in range(4)}
    found = evidence(s, t)
    one = Explanation("a", {"a:x": 2.0, "a:y": -1.0}, (("a:x", "a:y"),))
    other = Explanation("b", {"b:y": 3.0}, (("b:x",), ("b:y",)))
    whole = np.eye(30) + sum(np.outer(x, x) for x in t.values())
    inverse = np.linalg.inv(whole)

    def left(true, ways):
        """Minimise over a grid-free least squares in the full metric, way by way."""
        root = np.linalg.cholesky(inverse).T
        lefts = []
        for way in ways:
            basis = root @ np.array([s[n] for n in way]).T
            size = np.linalg.lstsq(basis, root @ true, rcond=None)[0]
            lefts.append(float(((root @ true - basis @ size) ** 2).sum()))
        return 0.5 * min(lefts)

    true_a, true_b = 2 * s["a:x"] - s["a:y"], 3 * s["b:y"]
    expected = min(left(true_a, other.ways), left(true_b, one.ways))
    assert apart(found, one, other) == pytest.approx(expected, rel=1e-9)


def test_5_4_is_where_95_of_100_draws_get_the_right_name():
    """A pair at APART, drawn and fitted by least squares: no formula of the diagnosis takes part."""
    rng, c = np.random.default_rng(0), 0.9
    a, b = np.array([1.0, 0.0]), np.array([c, np.sqrt(1 - c**2)])
    size = np.sqrt(2 * APART / (1 - c**2))
    found = evidence({"a:size": a, "b:size": b}, {})
    pair = [Explanation(n, {f"{n}:size": size}, ((f"{n}:size",),)) for n in "ab"]
    assert apart(found, *pair) == pytest.approx(APART)
    data = size * a + rng.standard_normal((20000, 2))
    rate = np.mean((data @ a) ** 2 > (data @ b) ** 2)
    assert rate == pytest.approx(norm.cdf(np.sqrt(APART / 2)), abs=0.005)
    assert rate == pytest.approx(0.95, abs=0.006)


@pytest.fixture(autouse=True)
def evidence_as_it_is(monkeypatch):
    """Whatever the open cases say by now of how careful to be: here it is what follows from a set."""
    monkeypatch.setattr(calibration, "table_for", lambda compared, tolerances: (Table(), "not calibrated"))


@pytest.fixture(scope="module")
def truth():
    """Two flights of an aircraft whose mass is a tenth more."""
    return [fly(Truth(mass=11.0), noise=1.0, seed=s, phases=s, reference=f"u{s}") for s in (1, 2)]


def found_in(maneuvers, candidates, sizes=TOLERANT):
    question = Question(candidates, sizes, (0.1, 2.0), draws=40, close=False)
    return diagnose(Linear(), maneuvers, question), question


def bench(maneuvers, candidates, sizes, values):
    """Return a bench on which effects have given sizes."""
    found, question = found_in(maneuvers, candidates, sizes)
    rivals = {
        n: Explanation(n, {f"{n}:{e.size}": values[n]}, ((f"{n}:{e.size}",),)) for n, e in candidates.items()
    }
    pair = tuple(sorted(candidates))
    return Bench(Linear(), found.compared, found.evidence, rivals, (pair,), question.candidates, sizes)


def test_lines_with_more_power_count_as_columns_that_are_larger(truth):
    compared = compare(Linear(), truth[0], LIBRARY, {**TOLERANT, "form": 0.03}, (0.1, 2.0), count=40)
    rehearsal = flown(compared, {**TOLERANT, "form": 0.03})
    names = ("worn:share", "late:by", "derivatives:M:q")
    power = np.where(np.arange(rehearsal.lines.hz.size) % 2, 3.0, 0.0)
    expected = np.zeros((3 + len(rehearsal.own),) * 2)
    for k in np.flatnonzero(power):  # line by line, with the inverse of what is noise there
        columns = np.array([rehearsal.columns[n][:, k] for n in names] + list(rehearsal.own[:, :, k]))
        noise = rehearsal.floor[k] + np.diag(3.0 * rehearsal.form[:, k])
        expected += 2 * 3.0 * (columns.conj() @ np.linalg.inv(noise) @ columns.T).real
    inner = np.linalg.inv(expected[3:, 3:] + np.eye(len(rehearsal.own)))
    expected = expected[:3, :3] - expected[:3, 3:] @ inner @ expected[3:, :3]
    assert rehearsal.gram(names, power) == pytest.approx(expected, rel=1e-6)


def test_a_band_splits_what_another_band_does_not(truth):
    """Two gains are one below 0.5 Hz; above it one of them is nothing."""
    at = bench(truth[:1], BANDS, {**SIZES, "form": 0.0}, {"wide": 0.01, "slow": 0.01})
    rehearsal = flown(at.compared[0], at.sizes)
    slow = np.where((rehearsal.lines.owner >= 0) & (rehearsal.lines.hz < 0.3), 1.0, 0.0)
    fast = np.where((rehearsal.lines.owner >= 0) & (rehearsal.lines.hz > 1.0), 1.0, 0.0)
    pair = ("slow", "wide")
    below, above = (at.separations(rehearsal.gram(at.columns, p))[pair] for p in (slow, fast))
    assert above < 0.05 * at.separations(at.at_hand)[pair]  # one that does nothing cannot be told by size
    both = at.separations(rehearsal.gram(at.columns, slow + fast))[pair]
    assert both > 20 * (below + above)
    found = next_flight(at)
    assert found is not None
    assert found.after[pair] > 2 * found.now[pair]
    assert found.band_hz[0] < 0.5 < found.band_hz[1]


def test_proposed_signals_stay_within_what_effectors_and_states_may_do(truth):
    at = bench(truth[:1], BANDS, SIZES, {"wide": 0.02, "slow": 0.02})
    found = next_flight(at)
    assert found is not None
    assert found.design is not None
    signals = sampled(found.design)
    record = truth[0].record
    for name, values in zip(signals.names, signals.values, strict=True):
        most = STRONGEST * np.std(record[f"excitation/{name}"])
        assert 0 < np.std(values) <= 1.001 * most
        assert np.abs(values).max() < 0.5
    limit = 0.5 * float(np.abs(record["state/q"]).max())
    rehearsal = flown(at.compared[0], at.sizes)
    whole = next(o for o in options(rehearsal, {"q": limit}) if o.kinds == "all")
    # 80 % of the limit where the flown peak is twice of it
    assert max(whole.gain.values()) == pytest.approx(0.4, rel=0.05)


def test_conditions_furthest_from_those_flown_are_rehearsed_and_hover_only_beside_hover():
    at = {u: Reference(id=f"u{u}", u=u, rho=1.2) for u in (0, 5, 10, 15, 21, 30)}
    high = Reference(id="high", u=25, rho=1.0)
    every = [*at.values(), high]
    assert [r.id for r in unflown(every, [at[10]])] == ["u30", "u21"]
    assert [r.id for r in unflown(every, [at[5], at[30]])] == ["u15", "u21"]
    assert "u5" in [r.id for r in unflown([at[0], at[5], high], [at[0]])]
    assert unflown(every, []) == []


def test_more_flights_of_noise_alone_separate_in_proportion(truth):
    at = bench(truth[:1], BANDS, {**SIZES, "form": 0.0}, {"wide": 0.001, "slow": 0.001})
    found = next_flight(at)
    assert found is not None
    pair = ("slow", "wide")
    count, each = found.flights[pair], found.after[pair] - found.now[pair]
    assert count is not None
    assert found.now[pair] + count * each >= APART
    assert count == 1 or found.now[pair] + 0.6 * count * each < APART


def test_what_makes_the_same_change_is_split_by_no_flight_but_on_the_ground(truth):
    found, question = found_in(truth, {n: TWINS[n] for n in ("mass", "downwash_lag")})
    assert found.diagnosis.gap.exists
    told = next_test(found, Linear(), question)
    assert told.table["separates"] == []
    (group,) = told.table["groups"]
    assert set(group["rivals"]) == {"mass", "downwash_lag"}
    assert "no flight of this kind can, they make the same change" in group["sentence"]
    assert group["splits"]
    assert group["split_by"] == ["weighing"]
    best = told.table["tests"][0]
    assert (best["kind"], best["name"]) == ("ground", "weighing")
    assert told.design is None  # it would tell nothing


def test_what_nothing_can_split_is_said(truth):
    found, question = found_in(truth, {n: TWINS[n] for n in ("unsteady_lift", "downwash_lag")})
    (group,) = next_test(found, Linear(), question).table["groups"]
    assert not group["splits"]
    assert group["split_by"] == []
    assert "none on the ground can" in group["sentence"]
    assert UNTESTABLE["unsteady_lift"].partition(" ")[0] in group["sentence"]


def test_nothing_is_proposed_where_nothing_remains(truth):
    sound = [fly(noise=1.0, seed=s, phases=s) for s in (1, 2)]
    found, question = found_in(sound, LIBRARY)
    assert not found.diagnosis.gap.exists
    assert next_test(found, Linear(), question).table == {}
    found, question = found_in(truth, {"heavy": LIBRARY["heavy"]})
    assert found.diagnosis.which.set == ("heavy",)
    assert next_test(found, Linear(), question).table == {}


def test_a_ground_test_counts_its_instrument_and_what_may_be_off_anyway():
    weighing = next(t for t in TESTS if t.id == "weighing")
    heavy = Explanation("mass", {"mass:fraction": 0.03})
    scale = Explanation("sensor_scale", {"sensor_scale:az": -0.03})
    adds, measured = distance(weighing, heavy, scale, {"mass": 0.01})
    assert adds == pytest.approx(0.5 * 0.03**2 / (0.001**2 + 0.01**2))
    assert measured == ("mass fraction",)
    rig = next(t for t in TESTS if t.id == "sensor rig")
    assert distance(rig, heavy, scale, {})[0] == pytest.approx(0.5 * (0.03 / 0.002) ** 2)
    tables = on_ground(
        {"mass": heavy, "sensor_scale": scale}, {("mass", "sensor_scale"): 1.0}, {"mass": 0.01}
    )
    assert {t["name"] for t in tables} == {"weighing", "sensor rig"}
    assert distance(weighing, Explanation("stall", {"stall:strength": 1.0}), scale, {}) == (0.0, ())


def test_every_effect_has_a_ground_test_or_a_reason_and_every_test_names_effects():
    shipped = library()
    tested = {key.partition(":")[0] for t in TESTS for key in t.sigma}
    assert tested | set(UNTESTABLE) == set(shipped)
    assert not tested & set(UNTESTABLE)
    assert all(error > 0 for t in TESTS for error in t.sigma.values())


def test_a_rehearsal_without_a_column_has_zeros_there():
    one = np.ones((1, 1), dtype=complex)
    made = Rehearsal(
        trial=None,  # type: ignore[arg-type]
        lines=None,  # type: ignore[arg-type]
        floor=one[None],
        form=np.zeros((1, 1)),
        columns={"a:x": one},
        own=np.zeros((0, 1, 1), dtype=complex),
        simulated=False,
    )
    assert made.gram(("a:x", "b:x"), np.ones(1)).tolist() == [[2.0, 0.0], [0.0, 0.0]]
    at = evidence({"a:x": np.array([1.0]), "b:x": np.array([2.0])}, {})
    twins = [Explanation(n, {f"{n}:x": 1.0}, ((f"{n}:x",),)) for n in "ab"]
    assert alike(at, *twins)


def test_a_design_is_written_that_can_be_flown_and_the_result_names_it(truth, tmp_path):
    # a log whose positions are 3 % larger than commanded: a gain, or one of slow motion
    more = {f"effector/d{i}": 0.03 * truth[0].record[f"command/d{i}"] for i in (1, 2)}
    record = truth[0].record
    channels = [replace(record.channel(n), values=record[n] + x) for n, x in more.items()]
    larger = replace(truth[0], record=record.with_channels(*channels))
    found, question = found_in([larger], BANDS, {**SIZES, "form": 0.0})
    which = replace(found.diagnosis.which, set=("wide", "slow"))
    unsure = replace(found, diagnosis=replace(found.diagnosis, which=which))
    assert unsure.diagnosis.gap.exists
    path = beside(tmp_path / "gap.h5")
    planned = with_next_test(unsure, Linear(), question, None, path, "", lambda _: None)
    table = planned.diagnosis.next_flight
    flight = next(t for t in table["tests"] if t["kind"] == "flight")
    assert table["design"] == str(path)
    design = read_design(path)
    assert set(design.names) == set(flight["effectors"])
    assert design.period_s == pytest.approx(20.0)
    signals = read_inputs(path)
    for name, values in zip(signals.names, signals.values, strict=True):
        assert np.std(values) == pytest.approx(flight["rms"][name], rel=0.02)
    assert table["gain"] == pytest.approx(min(p["after"] / p["now"] for p in flight["pairs"]))
    assert "designed in" in next_text(table)
    assert planned.diagnosis.to_json()["next_flight"]["separates"] == [["slow", "wide"]]
