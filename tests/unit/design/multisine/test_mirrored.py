import numpy as np
import pytest

from freqid.core.results.design import Multisine
from freqid.design.multisine.allocation import interleave, mirrored
from freqid.design.multisine.net_load import load_gains, lowest_nets, net_loads
from freqid.design.multisine.phases import lowest_peaks

# Two flaps that lift and roll, two ruddervators that alone push sideways, and two lifting rotors.
LOADS = np.array(
    [
        [1.0, 1.0, 0.2, 0.2, 2.0, 2.1],
        [0.0, 0.0, 1.0, -1.0, 0.0, 0.01],
        [0.7, -0.7, 0.1, -0.1, 0.3, 0.5],
    ]
)
SETS = interleave(np.arange(3, 51), 6)


def residues(sets, stride=6):
    return [int(s[0] % stride) for s in sets]


def test_effectors_that_mirror_each_other_get_combs_that_do():
    flap, other_flap, left, right, rotor, other_rotor = residues(mirrored(SETS, LOADS))
    assert {left, right} == {2, 4}  # the pair with the largest share of an axis, 2 dividing the stride
    assert {rotor, other_rotor} == {1, 5}
    assert {flap, other_flap} == {0, 3}  # each its own mirror image


def test_axes_without_importance_decide_nothing():
    importance = np.array([[1.0], [0.0], [0.0]])
    _, _, left, right, rotor, other_rotor = residues(mirrored(SETS, importance * LOADS))
    assert {rotor, other_rotor} == {2, 4}  # the rotors lift most
    assert residues(mirrored(SETS, 0.0 * LOADS)) == residues(SETS)
    assert {left, right} <= {0, 1, 3, 5}


def test_every_comb_is_dealt_once():
    assert sorted(residues(mirrored(SETS, LOADS))) == list(range(6))


def test_sets_that_have_no_mirror_image_stay_where_they_are():
    sets = (np.array([3, 8, 10]), np.array([4]), np.array([5, 9, 17]), np.array([6, 11]))
    for dealt, given in zip(mirrored(sets, LOADS[:, :4]), sets, strict=True):
        np.testing.assert_array_equal(dealt, given)


@pytest.mark.parametrize(("power", "less"), [(None, 0.95), ((0.5, 2.0), 1.0)], ids=["flat", "3 dB"])
def test_the_pair_that_acts_alone_can_then_be_played_more_smoothly(power, less):
    side = {}
    for name, sets in (("dealt in turn", SETS), ("mirrored", mirrored(SETS, LOADS))):
        waves = lowest_peaks(sets[2:4], limits=power, starts=8)
        pair = [Multisine(f"e{j}", "rad", w.index, w.amplitude, w.phase) for j, w in enumerate(waves)]
        loads = LOADS[1:2, 2:4]
        side[name] = np.abs(
            net_loads(lowest_nets(pair, load_gains(pair, loads), np.ones(1), limits=power), loads)
        ).max()
    assert side["mirrored"] < less * side["dealt in turn"]
