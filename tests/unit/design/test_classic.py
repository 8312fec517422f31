"""Classic inputs and swapped combs: shapes, spectra, limits."""

import msgspec
import numpy as np
import pytest
from linear_design import VEHICLE, design

from freqid.core.errors import UsageError
from freqid.design.classic import doublet, frequency_sweep, in_turn, multistep, three_two_one_one
from freqid.design.finish import swap_combs
from freqid.design.multisine.signals import relative_peak_factor

DT = 0.02


def test_a_doublet_is_up_then_down_and_sums_to_nothing():
    got = doublet(0.5, DT)
    np.testing.assert_array_equal(got, [1.0] * 25 + [-1.0] * 25 + [0.0])


def test_steps_last_three_two_one_and_one():
    got = three_two_one_one(0.3, DT)
    edges = np.flatnonzero(np.diff(got)) + 1
    np.testing.assert_array_equal(edges, [45, 75, 90, 105])
    np.testing.assert_array_equal(got[[0, 44, 45, 74, 75, 89, 90, 104, 105]], [1, 1, -1, -1, 1, 1, -1, -1, 0])
    # Its transform, from the closed form of four rectangles.
    f, time = np.array([0.2, 0.8, 1.5]), DT * np.arange(got.size)
    bounds = 0.3 * np.array([0, 3, 5, 6, 7])
    steps = np.diff(np.exp(-2j * np.pi * f[:, None] * bounds)) / (-2j * np.pi * f[:, None])
    hold = (1 - np.exp(-2j * np.pi * f * DT)) / (2j * np.pi * f)  # each sample lasts to the next
    measured = hold * (np.exp(-2j * np.pi * np.outer(f, time)) @ got)
    np.testing.assert_allclose(measured, steps @ [1, -1, 1, -1], rtol=1e-12)


def test_steps_with_a_rise_are_ramps_of_one_rate_that_end_at_zero():
    got = multistep((0.5, 0.5), DT, rise_s=0.1)
    assert (got[0], got[-1]) == (0.0, 0.0)
    assert np.abs(np.diff(got)).max() == pytest.approx(DT / 0.1)
    assert got.size == 51
    np.testing.assert_allclose(got[[5, 20, 25, 30, 45]], [1, 1, 0, -1, -1], atol=1e-12)
    assert got.sum() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("spacing", ["linear", "logarithmic"])
def test_a_sweep_passes_its_frequencies_when_it_should(spacing):
    band, duration = (0.1, 2.0), 80.0
    got = frequency_sweep(band, duration, DT, fade_s=4.0, spacing=spacing)
    time = DT * np.arange(got.size)
    assert got.size == 4001
    assert got[0] == 0.0
    assert abs(got[-1]) < 1e-12
    assert np.abs(got).max() <= 1.0
    before = np.flatnonzero(got[:-1] * got[1:] < 0)
    crossings = time[before] - DT * got[before] / (got[before + 1] - got[before])
    middle = crossings[(crossings > 6) & (crossings < 74)]
    measured = 0.5 / np.diff(middle)
    at = 0.5 * (middle[1:] + middle[:-1])
    if spacing == "linear":
        expected = 0.1 + 1.9 * at / duration
    else:
        expected = 0.1 * 20.0 ** (at / duration)
    np.testing.assert_allclose(measured, expected, rtol=0.02)


def test_effectors_take_turns_with_rests_and_repeats():
    shape = doublet(0.4, DT, rise_s=0.1)
    amplitude = {"de": 0.1, "n1": -30.0}
    got = in_turn(shape, amplitude, VEHICLE, DT, rest_s=2.0, repeats=2, trim={"n1": 420.0})
    turn = 100 + shape.size
    assert (got.names, got.units) == (("de", "n1"), ("rad", "rad/s"))
    assert got.values.shape == (2, 4 * turn + 100)
    np.testing.assert_allclose(np.diff(got.time), DT)
    expected = np.zeros_like(got.values)
    for start in (0, 2 * turn):
        expected[0, start + 100 : start + turn] = 0.1 * shape
        expected[1, start + turn + 100 : start + 2 * turn] = -30.0 * shape
    np.testing.assert_array_equal(got.values, expected)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: doublet(0.0, DT), "shortest step lasts 0 s"),
        (lambda: doublet(0.2, DT, rise_s=0.15), "twice the rise of 0.15 s"),
        (lambda: frequency_sweep((0.1, 30.0), 60, DT, fade_s=3), "Nyquist, 25 Hz"),
        (lambda: frequency_sweep((2.0, 0.1), 60, DT, fade_s=3), "sweep from 2 to 0.1 Hz"),
        (lambda: frequency_sweep((0.1, 2.0), 5, DT, fade_s=1), "lowest frequency, 10 s"),
        (lambda: frequency_sweep((0.1, 2.0), 60, DT, fade_s=0), "fades of 0 s"),
        (lambda: in_turn(doublet(1, DT), {"dx": 1.0}, VEHICLE, DT, rest_s=1), "no effector 'dx'"),
        (lambda: in_turn(doublet(1, DT), {"de": 0.1}, VEHICLE, DT, rest_s=1, repeats=0), "0 repeats"),
    ],
)
def test_what_cannot_be_flown_is_named(make, message):
    with pytest.raises(UsageError, match=message.replace(".", r"\.")):
        make()


def test_limits_are_kept_and_the_nearest_feasible_is_named():
    with pytest.raises(UsageError, match=r"amplitude of 'de' is 0\.5 rad .* at most 0\.4 is feasible"):
        in_turn(doublet(1, DT), {"de": 0.5}, VEHICLE, DT, rest_s=1, trim={"de": 0.1})
    slow = tuple(msgspec.structs.replace(e, rate_limit=2.0) for e in VEHICLE.effectors)
    vehicle = msgspec.structs.replace(VEHICLE, effectors=slow)
    with pytest.raises(
        UsageError, match=r"needs 40 rad/s where its rate_limit is 2; at most 0\.02 .* a rise_s of 0\.2 s"
    ):
        in_turn(doublet(1, DT), {"de": 0.4}, vehicle, DT, rest_s=1)
    got = in_turn(doublet(1, DT, rise_s=0.2), {"de": 0.4}, vehicle, DT, rest_s=1)
    assert np.abs(np.diff(got.values)).max() / DT == pytest.approx(2.0)


def test_swapped_combs_stay_orthogonal_and_keep_each_rms():
    first = design()
    second = swap_combs(first, [("de", "dr")])
    a, b = ({s.name: s for s in d.signals} for d in (first, second))
    np.testing.assert_array_equal(b["de"].index, a["dr"].index)
    np.testing.assert_array_equal(b["dr"].index, a["de"].index)
    assert b["da"] is a["da"]
    for name in a:
        assert np.linalg.norm(b[name].amplitude) == pytest.approx(np.linalg.norm(a[name].amplitude))
    every = np.concatenate([s.index for s in second.signals])
    assert np.unique(every).size == every.size
    factor = [relative_peak_factor(s.index, s.amplitude, s.phase) for s in (b["de"], a["dr"])]
    assert factor[0] == pytest.approx(factor[1])
    assert (b["de"].unit, second.names) == ("rad", first.names)
    assert second.provenance["swapped"] == [["de", "dr"]]
    with pytest.raises(UsageError, match="no effector 'dx'"):
        swap_combs(first, [("de", "dx")])
    with pytest.raises(UsageError, match="'de' is to be swapped more than once"):
        swap_combs(first, [("de", "dr"), ("da", "de")])
