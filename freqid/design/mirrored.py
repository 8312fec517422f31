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

Array = NDArray[np.float64]
Lines = NDArray[np.int64]

_ALIKE = 0.9  # cosine of the angle between what two effectors do, signs aside


def mirrored(sets: Sequence[Lines], loads: Array, kinds: Sequence[str] | None = None) -> tuple[Lines, ...]:
    """Hand the same combs to other effectors.

    Parameters
    ----------
    sets : sequence of ndarray of int, length effector
        Harmonics of each effector.
    loads : ndarray, shape (axis, effector)
        Load of each effector at the rms of its signal; an axis that does not count is left out.
    kinds : sequence of str, length effector, optional
        Sets are exchanged among effectors of one kind only; all are of one kind where absent.

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
    kinds = kinds or [""] * len(sets)
    dealt = list(sets)
    for kind in dict.fromkeys(kinds):
        members = [i for i, k in enumerate(kinds) if k == kind]
        effectors, combs = _alike(loads, members), _mirror_images(sets, members)
        pairs = list(zip(effectors, combs, strict=False))
        free_effectors = [i for i in members if not any(i in pair for pair, _ in pairs)]
        free_combs = [j for j in members if not any(j in comb for _, comb in pairs)]
        taken = [*(p for pair, _ in pairs for p in pair), *free_effectors]
        given = [*(c for _, comb in pairs for c in comb), *free_combs]
        for i, j in zip(taken, given, strict=True):
            dealt[i] = sets[j]
    return tuple(dealt)


def _alike(loads: Array, members: Sequence[int]) -> list[tuple[int, int]]:
    """Return disjoint pairs of effectors that do the same but for signs, the weightiest pair first."""
    total = np.sqrt(np.sum(loads**2, axis=1, keepdims=True))
    share = np.abs(loads) / np.where(total > 0.0, total, 1.0)
    size = np.linalg.norm(share, axis=0)
    found = [
        (float(np.max(share[:, i] ** 2 + share[:, j] ** 2)), i, j)
        for i, j in combinations(members, 2)
        if share[:, i] @ share[:, j] > _ALIKE * size[i] * size[j] > 0.0
    ]
    return _disjoint(sorted(found, key=lambda pair: -pair[0]))


def _mirror_images(sets: Sequence[Lines], members: Sequence[int]) -> list[tuple[int, int]]:
    """Return disjoint pairs of combs that mirror each other, those with the lowest peaks first."""
    strides = [int(np.gcd.reduce(np.diff(s))) if len(s) > 1 else 0 for s in sets]
    found = [
        (int(np.gcd(strides[i], sets[i][0])), i, j)
        for i, j in combinations(members, 2)
        if strides[i] == strides[j] > 0 and (sets[i][0] + sets[j][0]) % strides[i] == 0
    ]
    return _disjoint(sorted(found, key=lambda pair: -pair[0]))


def _disjoint(pairs: Sequence[tuple[float, int, int]]) -> list[tuple[int, int]]:
    taken: set[int] = set()
    kept = []
    for _, i, j in pairs:
        if not taken & {i, j}:
            taken |= {i, j}
            kept.append((i, j))
    return kept
