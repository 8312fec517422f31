"""The sizes at which a change is computed, so few that cubic lines between them are near enough."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise

import numpy as np
from scipy.linalg import qr

from freqid.core.arrays import Array, Complex
from freqid.gap.stack.block import Block

SMALLEST = 1 / 16
"""Size that is looked at, of an effect's scale."""

_STRAIGHT = 0.03  # departure from proportionality, of the change at the largest size, that counts as none
_BENT = 0.3  # ... of the change half way between two sizes, from which more sizes are taken between them
_DEPTH = 3  # times that a distance between sizes is halved at most
_SIZES = 7  # at which an effect that is not proportional is computed, either sign
_SEEN = 1e-3  # of energy over noise, below which a change at its largest size is none
_SAME = 1e-3  # of the strongest change: what is left of another beyond a sum of those kept
_UNSEEN = 0.03  # ... in standard deviations of the noise
_NO_ANSWER = 1e8  # standard deviations of the noise: no load that flew is as large

At = Callable[[float], list[Complex] | None]
Made = tuple[float, list[Complex]]  # a size and the change there, by block


def about_zero(at: At, up: float, down: float, scale: float) -> list[Made]:
    """Return the change at a small size and at both ends, and at more where it is not proportional.

    Parameters
    ----------
    at : callable
        Returns the change at a size by block, shape (row, line) each; None where nothing can be so.
    up, down : float
        Largest sizes, of either sign.
    scale : float
        Of a usual size.
    """
    ends = [end for end in (up, down) if end]
    near = np.sign(ends[0]) * min(scale / 2, abs(ends[0]) / 2)
    found = [(s, c) for s, c in [(near, at(float(near))), *(_farthest(at, end, near) for end in ends)] if c]
    if len(found) < 2 or found[0][0] != near:
        return found
    for end, last in found[1:]:
        apart = _energy(b - a * (end / near) for a, b in zip(found[0][1], last, strict=True))
        if apart > _STRAIGHT**2 * _energy(last):
            inner = np.sign(end) * np.geomspace(SMALLEST * 4 * scale, abs(end), _SIZES)[:-1]
            more = [(float(s), c) for s in inner if abs(s - near) > 0.1 * scale and (c := at(float(s)))]
            found += more
            outwards = sorted([(end, last), *more], key=lambda one: -abs(one[0]))
            for outer, next_ in pairwise(outwards):  # the inner ones are closer together
                between = _between(at, outer, next_)
                found += between
                if len(between) < 2:
                    break
    return found


def from_onset(at: At, sizes: Sequence[float], blocks: Sequence[Block]) -> list[Made]:
    """Return the change at ascending sizes from the largest on that does nothing, as a limit has one.

    Straight lines to zero would give a limit an effect where it is never reached.
    """
    every = [(s, c) for s in sizes if (c := at(s))]
    first = next((k for k, (_, c) in enumerate(every) if seen(c, blocks)), None)
    if first is None:
        return []
    found = every[max(first - 1, 0) :]
    return found + [one for a, b in pairwise(found) for one in _between(at, a, b)]


def proportional(made: Sequence[Made], blocks: Sequence[Block]) -> int | None:
    """Return the column that all others are multiples of, seen in the metric of the noise, or None."""
    first = min(range(len(made)), key=lambda k: abs(made[k][0]))
    unit = [z / made[first][0] for z in made[first][1]]
    for size, columns in made:
        apart = [
            (z - size * u) / np.sqrt(b.noise_power) for z, u, b in zip(columns, unit, blocks, strict=True)
        ]
        whole = [z / np.sqrt(b.noise_power) for z, b in zip(columns, blocks, strict=True)]
        if _energy(apart) > _STRAIGHT**2 * _energy(whole):
            return None
    return first


def few_of(columns: Sequence[Complex], blocks: Sequence[Block]) -> tuple[list[int], Array]:
    """Return which columns, by block of shape (column, row, line), all are sums of, and these sums.

    By a pivoted QR decomposition in the metric of the noise (G. H. Golub, C. F. Van Loan, Matrix
    Computations, 4th ed., section 5.4): as a delay grows its change moves in a few directions only.

    Returns
    -------
    few : list of int
        Ascending.
    mix : ndarray, shape (column, kept)
    """
    white = [(z / np.sqrt(b.noise_power)).reshape(len(z), -1) for z, b in zip(columns, blocks, strict=True)]
    stacked = np.concatenate([part for z in white for part in (z.real, z.imag)], axis=1)
    r, pivot = qr(stacked.T, mode="r", pivoting=True, check_finite=False)
    size = np.abs(np.diag(r))
    count = max(int((size > max(_SAME * size[0], _UNSEEN)).sum()), 1)
    mix = np.zeros((len(stacked), count))
    mix[pivot] = np.concatenate([np.eye(count), np.linalg.solve(r[:count, :count], r[:count, count:]).T])
    order = np.argsort(pivot[:count])
    return [int(k) for k in pivot[:count][order]], mix[:, order]


def seen(change: Sequence[Complex], blocks: Sequence[Block]) -> bool:
    """Return whether a change, by block, stands out of the noise at all."""
    powers = (np.abs(z) ** 2 / b.noise_power for z, b in zip(change, blocks, strict=True))
    return sum(float(p.sum()) for p in powers) > _SEEN


def absurd(change: Sequence[Complex], blocks: Sequence[Block]) -> bool:
    """Return whether a simulation was asked so far from what it was made for that its answer means nothing.

    Polynomials without bounds say 1e187 N in a tail wind that is as fast as the aircraft.
    """
    powers = (np.abs(z) / np.sqrt(b.noise_power) for z, b in zip(change, blocks, strict=True))
    return any(float(p.max(initial=0.0)) > _NO_ANSWER for p in powers)


def _farthest(at: At, end: float, near: float) -> tuple[float, list[Complex] | None]:
    """Return the change at a largest size, or at a half of it, and so on, where there can be none."""
    size = end
    while (made := at(float(size))) is None and abs(size) > 2 * abs(near):
        size /= 2
    return size, made


def _between(at: At, one: Made, other: Made, depth: int = 0) -> list[Made]:
    """Return the change at sizes between two, so many that cubic lines between them are near enough.

    A delay turns the phase: half way between two that are far apart it is not their mean. Where it is that
    within `_BENT`, a cubic is right within a hundredth.
    """
    size = (one[0] + other[0]) / 2
    made = at(size)
    if not made:
        return []
    apart = _energy(z - (a + b) / 2 for z, a, b in zip(made, one[1], other[1], strict=True))
    middle = (size, made)
    if depth == _DEPTH or apart < _BENT**2 * _energy(made):
        return [middle]
    return [
        middle,
        *_between(at, one, middle, depth + 1),
        *_between(at, middle, other, depth + 1),
    ]


def _energy(change: Iterable[Complex]) -> float:
    return sum(float((np.abs(z) ** 2).sum()) for z in change)
