"""Manoeuvres in clusters of trim angle of attack."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.errors import UsageError

FEWEST = 3  # manoeuvres that a cluster of its own has; fewer make no law
HELD_WITHIN = np.radians(0.25)  # a trim's angle of attack is held and measured no better


def cluster_alpha(alpha: Array, count: int | None = None) -> NDArray[np.int64]:
    """Group trim angles of attack.

    Parameters
    ----------
    alpha : ndarray, shape (n,)
        rad.
    count : int, optional
        Number of clusters; where absent, the number with the lowest Bayesian information criterion of
        normal clusters that share one spread.

    Returns
    -------
    ndarray of int, shape (n,)
        Cluster of each, from 0, ascending in angle of attack.

    Raises
    ------
    UsageError
        Where `count` clusters of three manoeuvres or more cannot be made.

    Notes
    -----
    For each number the partition with the least sum of squares is found exactly, by dynamic programming over
    the sorted angles (Fisher 1958).
    """
    alpha = np.asarray(alpha, dtype=np.float64)
    n = alpha.size
    most = max(n // FEWEST, 1)
    if count is not None and not 1 <= count <= most:
        raise UsageError(
            f"{count} clusters of trim angle of attack are asked for, but {n} manoeuvres make {most} at most "
            f"with {FEWEST} each",
            remedy="ask for fewer or fly more trims",
        )
    order = np.argsort(alpha, kind="stable")
    partitions = _best_partitions(alpha[order], most if count is None else count)
    if count is None:
        chosen = min(partitions, key=lambda sizes: _criterion(alpha[order], sizes))
    else:
        chosen = partitions[count - 1]
    labels = np.empty(n, dtype=np.int64)
    labels[order] = np.repeat(np.arange(len(chosen)), chosen)
    return labels


def _best_partitions(x: Array, most: int) -> list[tuple[int, ...]]:
    """Return the sizes of the best 1, 2, ... `most` clusters of sorted values, shape (n,)."""
    n = x.size
    first, second = (np.append(0.0, np.cumsum((x - x.mean()) ** power)) for power in (1, 2))

    def scatter(start: NDArray[np.intp], stop: int) -> Array:
        return second[stop] - second[start] - (first[stop] - first[start]) ** 2 / (stop - start)

    cost = np.full((most + 1, n + 1), np.inf)
    cost[0, 0] = 0.0
    cut = np.zeros((most + 1, n + 1), dtype=np.int64)
    for k in range(1, most + 1):
        for stop in range(min(k * FEWEST, n), n + 1):
            starts = np.arange(max(stop - FEWEST + 1, 1)) if k > 1 else np.zeros(1, dtype=np.intp)
            total = cost[k - 1, starts] + scatter(starts, stop)
            cut[k, stop] = starts[total.argmin()]
            cost[k, stop] = total.min()
    partitions = []
    for k in range(1, most + 1):
        sizes, stop = [], n
        for j in range(k, 0, -1):
            sizes.append(int(stop - cut[j, stop]))
            stop = int(cut[j, stop])
        partitions.append(tuple(reversed(sizes)))
    return partitions


def _criterion(x: Array, sizes: tuple[int, ...]) -> float:
    """Return the Bayesian information criterion of normal clusters with one spread."""
    parts = np.split(x, np.cumsum(sizes)[:-1])
    share = np.array(sizes) / x.size
    squares = sum(float(np.sum((part - part.mean()) ** 2)) for part in parts)
    spread = squares / x.size + HELD_WITHIN**2
    log_likelihood = float(np.sum(share * np.log(share))) * x.size - 0.5 * x.size * np.log(spread)
    return -2 * log_likelihood + 2 * len(sizes) * np.log(x.size)
