"""Sizes that are equally likely, down to the smallest one that the records show.

An effect's own scale tells how large it is on a usual aircraft, not how small a size a record shows. Where a
lag of 2 ms is seen clearly, a prior that begins at 3 ms makes it the least likely effect of all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from freqid.core.arrays import Array
from freqid.gap.infer.system import System
from freqid.gap.model.candidate import OTHER, Candidate

_SEEN = 1.0  # detectability of a change by one standard deviation of noise, form and tolerances
_STEP = 10**0.5  # at most, from one standard deviation of a vector to the next
_FINE = 200  # sizes among which one of a given detectability is looked for


def down_to_seen(system: System) -> System:
    """Return a system whose effects are looked for at all sizes that its data show.

    *Other* keeps its sizes: smaller ones are errors of form.

    Parameters
    ----------
    system : System
        What its data show is judged at the first of its errors of form.
    """
    G = system.reduced(system.form_errors[0]).G
    parts = map(system.columns_of, range(len(system.candidates)))
    new = [
        c if c.effect == OTHER else replace(c, prior=_prior(c, G[at, at]))
        for c, at in zip(system.candidates, parts, strict=True)
    ]
    return replace(system, candidates=new)


def _prior(c: Candidate, G: Array) -> Array:
    if c.kind == "vector":
        least = float(c.prior.min())
        seen = np.sqrt(_SEEN / max(np.trace(G), np.finfo(float).tiny))
        steps = int(np.ceil(np.log(least / seen) / np.log(_STEP))) if seen < least else 0
        return np.concatenate([np.geomspace(seen, least, steps + 1)[:-1], c.prior]) if steps else c.prior
    sides = []
    for sign in np.unique(np.sign(c.prior)):
        side = np.abs(c.prior[np.sign(c.prior) == sign])
        seen = abs(size_at(c, G, _SEEN, float(sign)))
        if seen < side.min():
            side = np.geomspace(seen, side.max(), side.size)
        sides.append(sign * side)
    return np.sort(np.concatenate(sides))


def size_at(candidate: Candidate, G: Array, goal: float, sign: float) -> float:
    """Return the smallest size of a scalar, of one sign, that has a detectability; NaN where none has.

    Parameters
    ----------
    candidate : Candidate
    G : ndarray, shape (column, column)
        Of its columns.
    goal : float
    sign : {-1, 1}
    """
    c = candidate
    side = np.abs(c.prior[np.sign(c.prior) == sign])
    if not side.size:
        return np.nan
    sizes = np.geomspace(1e-2 * side.min(), side.max(), _FINE)
    w = c.weights(sign * sizes)
    power = np.einsum("sc,cd,sd->s", w, G, w)
    above = np.flatnonzero(power >= goal)
    if not above.size:
        return np.nan
    k = int(above[0])
    if k == 0 or c.sizes.size == 1:
        return float(sign * sizes[k] * np.sqrt(goal / power[k]))
    return float(sign * np.interp(np.sqrt(goal), np.sqrt(power[k - 1 : k + 1]), sizes[k - 1 : k + 1]))
