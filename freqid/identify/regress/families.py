"""Terms that enter a model together: many small ones of one kind are seen where each alone is not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import fdtrc

from freqid.identify.regress.structure import Candidates, drop_needless

CHANCE = 5e-5
"""Chance by which a group that does nothing may enter; with 230 groups, that one of them does is 1 %."""
LEAST_FREEDOM = 20.0
"""Degrees of freedom that a group must leave, or its F tells nothing."""


def enter_families(
    problem: Candidates, families: Sequence[Sequence[int]], f_leave: float, enough: float = 0.0
) -> list[int]:
    """Choose among candidates that enter one by one or by families.

    Parameters
    ----------
    problem : Candidates
    families : sequence of sequence of int
        Candidates that are tried together, besides each alone; they may overlap.
    f_leave : float
        Partial F that a term must keep to stay.
    enough : float
        Residual square, unit of the response squared, at which nothing more is taken in.

    Returns
    -------
    list of int
        Chosen candidates, in the order in which they entered.

    Notes
    -----
    Each turn orthogonalises every group against the terms so far, and takes in the one whose F has the least
    chance; terms whose partial F falls below `f_leave` are then dropped one by one. A group is taken in once.
    An effect in which n candidates share alike raises the partial F of each by a part only of what the
    residual without it would allow, whereas the F of the group sees all of it.

    References
    ----------
    Draper & Smith, *Applied Regression Analysis*, Wiley (extra sum of squares); Morelli, J. Aircraft 32(2),
    1995 (orthogonal functions).
    """
    waiting = [tuple(family) for family in families if len(family) > 1]
    waiting += [(j,) for j in range(len(problem.names))]
    chosen: list[int] = []
    while problem.residual_square(chosen) > enough:
        chances = [_chance(problem, chosen, group) for group in waiting]
        if not chances or min(chances) > CHANCE:
            break
        entered = waiting.pop(int(np.argmin(chances)))
        chosen += [j for j in entered if j not in chosen]
        drop_needless(problem, chosen, f_leave)
    return chosen


def _chance(problem: Candidates, chosen: Sequence[int], group: Sequence[int]) -> float:
    """Return the chance that a group which does nothing explains as much of what chosen terms leave."""
    together = [*chosen, *(j for j in group if j not in chosen)]
    added, freedom = len(together) - len(chosen), problem.freedom(len(together))
    if added == 0 or freedom < LEAST_FREEDOM:
        return 1.0
    before, after = (problem.residual_square(terms) for terms in (chosen, together))
    f = (before - after) / added / (after / freedom) if after > 0 else np.inf
    return float(fdtrc(added, freedom, max(f, 0.0)))
