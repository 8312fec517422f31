"""Gauss-Newton with line search, bounds and damping, for any likelihood that gives its Fisher information."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array

STEPS = 100
SETTLED = 3e-3
"""Steps this small in units of the standard errors end the iteration."""
HALVINGS = 4  # of a step before it is damped instead
DAMPINGS = 12  # each ten times the one before
FIRST_DAMPING = 1e-3
SINGULAR = 1e-12
"""Eigenvalues of the information in unit scale, relative to the largest, that count as zero: their
directions are not excited. It is the square of the ratio 1e-6 of singular values."""
LONGER, LONGEST = 1.3, 8.0  # share of a step from which a longer one is tried, and the most that is
SUFFICIENT = 1e-4  # share of the decrease that the slope promises which a step must bring


@dataclass(frozen=True, eq=False)
class Point:
    """A likelihood at one place.

    Attributes
    ----------
    cost : float
        Negative logarithm of the likelihood, apart from constants.
    gradient : ndarray, shape (f,)
    information : ndarray, shape (f, f)
    """

    cost: float
    gradient: Array
    information: Array


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where the iteration ended.

    Attributes
    ----------
    free : ndarray, shape (f,)
    point : Point
    converged : bool
    steps : int
    at_bound : ndarray of bool, shape (f,)
        Numbers at a bound that the likelihood would leave.
    """

    free: Array
    point: Point
    converged: bool
    steps: int
    at_bound: NDArray[np.bool_]


def minimise(
    cost: Callable[[Array], float],
    linearise: Callable[[Array], Point],
    start: Array,
    lower: Array,
    upper: Array,
) -> Minimum | None:
    """Find the least cost within bounds.

    Parameters
    ----------
    cost : callable
        ``cost(free)``; infinite where the model diverges.
    linearise : callable
        ``linearise(free)``.
    start, lower, upper : ndarray, shape (f,)

    Returns
    -------
    Minimum or None
        None where the cost is not finite at the start.

    Notes
    -----
    A full Gauss-Newton step is tried first and halved while the cost does not go down enough; where halving
    does not help, the information is damped as by Levenberg and Marquardt, in its own scale. Numbers at a
    bound that the gradient pushes outward are left out of the step. Directions without information are not
    moved along.
    """
    free, damping = np.clip(start, lower, upper), 0.0
    now = linearise(free)
    if not np.isfinite(now.cost):
        return None
    pushed = np.zeros(free.shape, dtype=bool)
    for turn in range(STEPS):
        pushed = ((free <= lower) & (now.gradient > 0)) | ((free >= upper) & (now.gradient < 0))
        open_ = ~pushed
        if not open_.any() or _in_standard_errors(solve(now, open_, 0.0), now) < SETTLED:
            return Minimum(free, now, True, turn, pushed)
        for _ in range(DAMPINGS):
            step = solve(now, open_, damping)
            found = _search(cost, free, step, now, lower, upper)
            if found is not None:
                break
            damping = max(10 * damping, FIRST_DAMPING)
        else:
            return Minimum(free, now, False, turn, pushed)
        free, share = found
        damping = damping / 10 if share == 1 and damping > FIRST_DAMPING else 0.0 if share == 1 else damping
        then = linearise(free)
        if now.cost - then.cost <= 1e-12 * abs(now.cost) and share < 1:
            return Minimum(free, then, True, turn + 1, pushed)
        now = then
    return Minimum(free, now, False, STEPS, pushed)


def solve(point: Point, open_: NDArray[np.bool_], damping: float) -> Array:
    """Return the step, shape (f,), zero for numbers that are not open and directions not excited."""
    step = np.zeros_like(point.gradient)
    open_ = open_ & (np.diag(point.information) > 0)
    if not open_.any():
        return step
    information = point.information[np.ix_(open_, open_)]
    size = np.sqrt(np.diag(information))
    values, vectors = np.linalg.eigh(information / size[:, None] / size)
    seen = values > SINGULAR * values[-1]
    along = vectors[:, seen]
    push = along.T @ (point.gradient[open_] / size)
    step[open_] = -(along @ (push / (values[seen] + damping))) / size
    return step


def _in_standard_errors(step: Array, point: Point) -> float:
    return float(np.sqrt(max(step @ point.information @ step, 0.0)))


def _search(
    cost: Callable[[Array], float], free: Array, step: Array, now: Point, lower: Array, upper: Array
) -> tuple[Array, float] | None:
    """Return where a step leads and the share of it that was taken; None where no share goes down.

    Gauss-Newton takes residuals to be small. Where they are not, as with coloured residuals of real flights,
    it steps too short along some direction, again and again; the parabola through the costs says by how much.
    """
    share = 1.0
    for _ in range(HALVINGS):
        trial = np.clip(free + share * step, lower, upper)
        promised, there = float(now.gradient @ (trial - free)), cost(trial)
        if there <= now.cost + SUFFICIENT * min(promised, 0.0):
            break
        share /= 2
    else:
        return None
    bend = there - now.cost - promised
    if share < 1 or not promised < 0 or bend <= 0:
        return trial, share
    best = min(-promised / (2 * bend), LONGEST)
    if best > LONGER:
        further = np.clip(free + best * step, lower, upper)
        if cost(further) < there:
            return further, share
    return trial, share


def unexcited(information: Array) -> tuple[list[int], dict[int, list[int]]]:
    """Return the numbers to hold so that the rest are determined, and those that each cannot be told from.

    Parameters
    ----------
    information : ndarray, shape (f, f)

    Returns
    -------
    hold : list of int
    others : dict of int to list of int
        Empty list for a number that has no influence at all.
    """
    hold: list[int] = []
    others: dict[int, list[int]] = {}
    left = list(range(len(information)))
    for i in list(left):
        if not information[i, i] > 0:
            hold.append(i)
            others[i] = []
            left.remove(i)
    while left:
        part = information[np.ix_(left, left)]
        size = np.sqrt(np.diag(part))
        values, vectors = np.linalg.eigh(part / size[:, None] / size)
        if values[0] > SINGULAR * values[-1]:
            break
        taking_part = np.abs(vectors[:, 0])
        worst = int(np.argmax(taking_part))
        others[left[worst]] = [left[k] for k in np.flatnonzero(taking_part > 0.1) if k != worst]
        hold.append(left.pop(worst))
    return hold, others
