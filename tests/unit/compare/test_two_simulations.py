"""Which of two simulations is nearer: the statistic beside whole matrices, verdicts on linear flights."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from linear_pair import SLOPES, fly, simulation
from scipy.stats import false_discovery_control

from freqid.compare.two_simulations import compare_two, difference_of, holm
from freqid.core.errors import UsageError
from freqid.core.record import Channel, Maneuver
from freqid.core.results.rivals import Rivals
from freqid.core.vehicle import Effector, Rotor
from freqid.gap.infer.block_matrices import Products
from freqid.simulate.effects import library

BAND_HZ = (0.1, 2.0)
DURATION = 40.0


def _compare(a, b, flights, tolerances=None, **more):
    names = [f"flight {i}" for i in range(len(flights))]
    return compare_two((a, b), flights, names, library(), tolerances or {}, BAND_HZ, **more)


def _flights(loss=0.0, seeds=(1, 2), **more):
    return [fly(loss, seed=s, phases=s, reference=f"u{s}", **more) for s in seeds]


@pytest.fixture(scope="module")
def worn():
    return _compare(simulation("plain"), simulation("worn", loss=0.4), _flights(0.4, duration=DURATION))


def _matrices(numbers, tolerances=3, own=2, form=4, draws=5, seed=0):
    """Return columns ``[T, noise A, noise B, all noise, a, b]``, a record's own, and errors of form."""
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((tolerances + 3 * draws + 2, numbers))
    return columns, rng.standard_normal((own, numbers)), rng.standard_normal((form, numbers))


def _difference(columns, own, form, tolerances=3, draws=5, size=0.5, wrong=None):
    wrong = np.zeros((tolerances, tolerances)) if wrong is None else wrong
    made = Products.of(columns, columns[:0], columns[-1], own, form, columns[:0]).matrices()
    return difference_of([made], tolerances, draws, size, wrong)


def test_the_difference_is_that_of_whole_matrices():
    columns, own, form = _matrices(40)
    w = _difference(columns, own, form)
    scattered = np.concatenate([columns[:3], 0.5 * form])
    metric = np.eye(40) + scattered.T @ scattered + own.T @ own
    inverse = np.linalg.inv(metric)
    a, b, noise_a, noise_b = columns[-2], columns[-1], columns[3:8], columns[8:13]
    each = np.einsum("kn,nm,km->k", noise_a, inverse, noise_a)
    each = each - np.einsum("kn,nm,km->k", noise_b, inverse, noise_b)
    assert w.count == 40
    assert w.value == pytest.approx(a @ inverse @ a - b @ inverse @ b - each.mean())
    assert w.value == pytest.approx(w.misfits[0] - w.misfits[1])
    d = a - b
    assert w.noise == pytest.approx(np.sqrt(4 * d @ inverse @ d + each.var(ddof=1) * (1 + 1 / 5)))
    lacking = scattered @ inverse @ (b if w.value > 0 else a)
    apart = scattered @ inverse @ d
    allowed = scattered @ inverse @ scattered.T
    number = np.trace(allowed @ allowed)
    share = min(1.0, apart @ apart / (2 * number) + np.sqrt(2 / number))
    assert w.scatter == pytest.approx(np.sqrt(8 * share * lacking @ lacking))


def test_errors_of_columns_widen_the_deviation_alone():
    columns, own, form = _matrices(40)
    before, after = (_difference(columns, own, form, wrong=q * np.eye(3)) for q in (0.0, 5.0))
    assert after.value == before.value
    assert after.deviation > before.deviation


def test_equal_simulations_differ_by_no_more_than_the_deviation():
    """Independent tolerances in each, and a gap in both that is six sigma of a tolerance."""
    rng = np.random.default_rng(2)
    allowed = 3 * rng.standard_normal((6, 60))
    gap, z = 6 * allowed[0], []
    for _ in range(400):
        noise, one, other = rng.standard_normal(60), *(rng.standard_normal((2, 6)) @ allowed)
        columns = np.concatenate([allowed, np.zeros((6, 60)), [gap + one + noise, gap + other + noise]])
        w = _difference(columns, np.zeros((0, 60)), np.zeros((0, 60)), tolerances=6, draws=2)
        z.append(w.value / w.deviation)
    assert np.mean(np.abs(z) > 1.96) < 0.1


def test_noise_of_the_flown_states_is_taken_out_of_the_difference():
    """Both are perfect: all that differs is that one hands on twice the noise of a state."""
    rng, z = np.random.default_rng(3), []
    for _ in range(200):
        state, rest = rng.standard_normal((2, 13, 60))
        noise_a, noise_b = 2 * state + rest, state + rest
        columns = np.concatenate([noise_a[:12], noise_b[:12], rest[:12], noise_a[12:], noise_b[12:]])
        w = _difference(columns, np.zeros((0, 60)), np.zeros((0, 60)), tolerances=0, draws=12)
        z.append(w.value / w.deviation)
    assert abs(np.mean(z)) < 0.25
    assert np.mean(np.abs(z) > 1.96) < 0.08


def test_holm_is_the_step_down_procedure():
    p = [0.01, 0.04, 0.03, 0.005]
    assert holm(p).tolist() == pytest.approx([0.03, 0.06, 0.06, 0.02])  # Holm 1979
    assert holm([]).size == 0
    many = np.random.default_rng(4).uniform(size=30)
    assert (holm(many) >= false_discovery_control(many) - 1e-12).all()


def test_the_one_that_knows_what_flew_is_nearer(worn):
    assert worn.nearer == "B"
    assert worn.verdict.startswith("B (worn) is nearer beyond noise and tolerances: ")
    assert "A (plain) is nearer nowhere" in worn.verdict
    assert {c.response for c in worn.contests if c.nearer} <= {"Z", "M"}  # the elevator makes no X
    assert "M" in {c.response for c in worn.contests if c.nearer}
    assert worn.overall.p_adjusted < worn.level
    assert worn.overall.difference.lo > 0
    assert worn.overall.maneuvers == 2
    assert worn.form_errors[0] >= worn.form_errors[1]
    assert any("error of form" in remark for remark in worn.remarks)


def test_to_swap_them_swaps_the_verdict(worn):
    flights = _flights(0.4, duration=DURATION)
    other = _compare(simulation("worn", loss=0.4), simulation("plain"), flights)
    assert other.nearer == "A"
    assert other.form_errors == worn.form_errors[::-1]
    assert other.overall.difference.value == pytest.approx(-worn.overall.difference.value, rel=1e-6)
    assert [c.p for c in other.contests] == pytest.approx([c.p for c in worn.contests], rel=1e-5)


def test_what_is_the_same_is_equal_exactly():
    found = _compare(simulation(), simulation("twin"), _flights(0.4, seeds=(1,)))
    assert found.identical
    assert found.nearer == ""
    assert found.contests == ()
    assert found.overall.difference.value == 0.0
    assert found.overall.p == 1.0
    assert "exactly the same" in found.verdict


def test_what_tolerances_make_is_equal():
    rng = np.random.default_rng(5)
    a, b = (simulation(n, factors=1 + 0.05 * rng.standard_normal(SLOPES.shape)) for n in "AB")
    found = _compare(a, b, _flights(duration=60.0))
    assert found.nearer == ""
    assert not found.identical
    assert "cannot tell" in found.verdict
    assert "noise and tolerances could make" in found.verdict


def test_each_counts_the_rotors_as_it_states():
    """One whose M has what speeding up a rotor about y takes says what one says that leaves it out."""
    inertia, flights = 0.05, []
    for flown in _flights(duration=DURATION):
        record, time = flown.record, flown.record.time
        speed = Channel("effector/n1", "rad/s", 300 + 20 * np.sin(2 * np.pi * 0.1 * time), 50.0, "made here")
        rotor = Rotor(name="n1", spin=1, inertia=inertia, axis=(0.0, 1.0, 0.0))
        carried = msgspec.structs.replace(
            flown.vehicle,
            effectors=(*flown.vehicle.effectors, Effector(name="n1", kind="rotor", limits=(0.0, 900.0))),
            rotors=(rotor,),
        )
        flights.append(Maneuver(record.with_channels(speed), carried))
    inside, outside = simulation("inside"), simulation("outside")
    loads = outside.function

    def with_rotor(time, state, effector, air, parameters):
        found = loads(time, state, effector, air, parameters)
        return {**found, "M": found["M"] + inertia * np.gradient(effector["n1"], time)}

    pair = replace(inside, gyroscopic=False), replace(outside, function=with_rotor, gyroscopic=True)
    rivals = _compare(*pair, flights)
    assert rivals.overall.difference.value == pytest.approx(0, abs=1.0)
    assert any(r.startswith("A: ") and "not subtracted" in r for r in rivals.remarks)


def test_a_noisier_input_is_no_sign_of_the_other_being_nearer():
    """The vane is three times as noisy as w, and both are right: a larger residual says nothing."""
    found = _compare(simulation("w"), simulation("vane", vane=True), _flights(duration=DURATION))
    assert found.nearer == ""
    assert found.overall.difference.lo < 0 < found.overall.difference.hi


def test_two_that_fly_are_compared_on_one_motion():
    a, b = simulation("plain", flies=True), simulation("worn", loss=0.4, flies=True)
    found = _compare(a, b, _flights(0.4, duration=DURATION))
    assert found.nearer == "B"


def test_repeats_are_averaged_and_tell_the_noise():
    flights = [fly(0.4, seed=s, duration=DURATION) for s in (1, 2, 3)]
    found = _compare(simulation("plain"), simulation("worn", loss=0.4), flights)
    assert found.nearer == "B"
    assert found.overall.maneuvers == 3
    assert any("repeats" in remark for remark in found.remarks)


def test_responses_in_common_are_compared_and_the_rest_is_said():
    found = _compare(simulation(), simulation("pitch", responses=("M",)), _flights(seeds=(1,)))
    assert found.identical
    assert found.remarks[0] == "A alone predicts X, Z: not compared, B does not"


@pytest.mark.parametrize(
    ("responses", "tolerances", "sentence"),
    [(("M",), {}, "no response in common"), (("X", "Z"), {"drag": 0.1}, "has no 'drag'")],
)
def test_what_cannot_be_compared_is_refused(responses, tolerances, sentence):
    a, b = simulation(responses=("X",)), simulation(responses=responses)
    with pytest.raises(UsageError, match=sentence):
        _compare(a, b, _flights(seeds=(1,), duration=10.0), tolerances)


def test_the_table_comes_back(worn):
    assert Rivals.from_json(worn.to_json()) == worn
    with pytest.raises(ValueError, match="level"):
        Rivals.from_json({**worn.to_json(), "level": "low"})
