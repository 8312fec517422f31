"""Deal combs out so that effectors that mirror each other get combs that mirror each other.

Where two effectors alone act on an axis, as two ruddervators do on side force, the net peak there can only
be low if the two signals together are one smooth signal. Whether they can be is decided by who has which
harmonics: see docs/theory/net-loads.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array

Lines = NDArray[np.int64]
Pair = tuple[int, int]

_ALIKE = 0.9  # cosine of the angle between what two effectors do, signs aside


def mirrored(sets: Sequence[Lines], loads: Array) -> tuple[Lines, ...]:
    """Hand the same combs to other effectors.

    Parameters
    ----------
    sets : sequence of ndarray of int, length effector
        Harmonics of each effector.
    loads : ndarray, shape (axis, effector)
        Load of each effector at the rms of its signal, times the importance of the axis.

    Returns
    -------
    sets : tuple of ndarray of int, length effector

    Notes
    -----
    Combs of one stride s mirror each other where the first lines add up to a multiple of s: their
    harmonics are ``s m + r`` and ``s m - r``. The pair with the largest share of an axis chooses first.
    It takes the combs with the largest common divisor of s and r, whose peaks are the lowest. Sets and
    effectors without a partner keep their order.
    """
    pairs = list(zip(_alike(loads), _mirror_images(sets), strict=False))
    effectors = [i for pair, _ in pairs for i in pair]
    combs = [j for _, images in pairs for j in images]
    effectors += [i for i in range(len(sets)) if i not in effectors]
    combs += [j for j in range(len(sets)) if j not in combs]
    given = dict(zip(effectors, combs, strict=True))
    return tuple(sets[given[i]] for i in range(len(sets)))


def _alike(loads: Array) -> list[Pair]:
    """Return disjoint pairs of effectors that do the same but for signs, the weightiest pair first."""
    total = np.sqrt(np.sum(loads**2, axis=1, keepdims=True))
    share = np.abs(loads) / np.where(total > 0.0, total, 1.0)
    size = np.linalg.norm(share, axis=0)
    found = [
        (float(np.max(share[:, i] ** 2 + share[:, j] ** 2)), (i, j))
        for i, j in combinations(range(size.size), 2)
        if share[:, i] @ share[:, j] > _ALIKE * size[i] * size[j] > 0.0
    ]
    return _disjoint(found)


def _mirror_images(sets: Sequence[Lines]) -> list[Pair]:
    """Return disjoint pairs of combs that mirror each other, those with the lowest peaks first."""
    strides = [int(np.gcd.reduce(np.diff(s))) if s.size > 1 else 0 for s in sets]
    found = [
        (float(np.gcd(strides[i], sets[i][0])), (i, j))
        for i, j in combinations(range(len(sets)), 2)
        if strides[i] == strides[j] > 0 and (sets[i][0] + sets[j][0]) % strides[i] == 0
    ]
    return _disjoint(found)


def _disjoint(ranked: Sequence[tuple[float, Pair]]) -> list[Pair]:
    """Return pairs that share no member, the highest rank first."""
    chosen: list[Pair] = []
    for _, pair in sorted(ranked, key=lambda entry: -entry[0]):
        if not any(set(pair) & set(other) for other in chosen):
            chosen.append(pair)
    return chosen
