"""Clusters are checked against all partitions, tried one by one."""

from itertools import combinations

import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.identify.advance_ratio.clusters import FEWEST, cluster_alpha


def squares(x, labels):
    return sum(np.sum((x[labels == k] - x[labels == k].mean()) ** 2) for k in set(labels.tolist()))


@pytest.mark.parametrize("seed", range(6))
def test_the_partition_is_the_best_of_all(seed):
    x = np.random.default_rng(seed).uniform(0, 0.2, 11)
    ordered = np.sort(x)
    best = min(
        squares(ordered, np.repeat([0, 1, 2], np.diff([0, *cuts, 11])))
        for cuts in combinations(range(1, 11), 2)
        if min(np.diff([0, *cuts, 11])) >= FEWEST
    )
    assert squares(x, cluster_alpha(x, 3)) == pytest.approx(best)


@pytest.mark.parametrize("centres", [[4.0], [2.0, 6.0], [1.0, 5.0, 9.0]])
def test_the_number_is_found(centres):
    rng = np.random.default_rng(3)
    alpha = np.radians(np.repeat(centres, 8) + 0.4 * rng.standard_normal(8 * len(centres)))
    shuffled = rng.permutation(alpha.size)
    labels = cluster_alpha(alpha[shuffled])
    np.testing.assert_array_equal(labels, np.repeat(np.arange(len(centres)), 8)[shuffled])


def test_trims_that_are_held_alike_are_one_cluster():
    assert set(cluster_alpha(np.full(9, 0.07))) == {0}
    assert cluster_alpha(np.array([0.1])).tolist() == [0]
    assert set(cluster_alpha(np.array([0.02, 0.2]))) == {0}  # two manoeuvres make no two clusters


def test_more_clusters_than_manoeuvres_are_refused():
    with pytest.raises(UsageError, match="7 manoeuvres make 2 at most"):
        cluster_alpha(np.linspace(0, 1, 7), 3)
