"""Candidates computed again near their estimated size, where interpolation between sizes is too coarse."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.linalg import block_diag

from freqid.core.arrays import Complex
from freqid.core.errors import ImpossibleSettings
from freqid.gap.model.candidate import Candidate, Curve, near
from freqid.gap.model.candidates import recomputed
from freqid.gap.model.changes import acts_on, among
from freqid.gap.model.sizes import few_of, seen
from freqid.gap.model.testable import in_force_of
from freqid.gap.stack.block import Block
from freqid.simulate.effects.effect import Effect

_NEAR = (0.8, 1.0, 1.25)  # of the estimated size


def refined(
    candidate: Candidate,
    size: float,
    library: Mapping[str, Effect],
    blocks: Sequence[Block],
    others: Sequence[tuple[str, dict[str, float]]] = (),
    later: Sequence[tuple[str, dict[str, float]]] = (),
) -> Candidate:
    """Return a scalar candidate with columns at sizes about one; itself where it is proportional.

    What was weighed by derivatives is replayed in full.

    Parameters
    ----------
    candidate : Candidate
    size : float
        Estimated.
    library : dict of Effect
    blocks : sequence of Block
    others : sequence of (str, dict of float)
        Effects that act before it, with their parameters: where these change what it does, it is computed
        anew at all its sizes.
    later : sequence of (str, dict of float)
        Effects that act after it, in the same way.
    """
    c = candidate
    if c.kind != "scalar" or c.effect not in library or size == 0:
        return c
    vehicle = blocks[0].trial.maneuver.vehicle
    effect = library[c.effect].of(vehicle)
    at = acts_on(effect, blocks[0].trial)
    before, after = (
        tuple(o for o in some if at and acts_on(library[o[0]].of(vehicle), blocks[0].trial) == at)
        for some in (others, later)
    )
    anew = (before, after) != (c.beside, c.after) or bool(after and size != c.about)
    if blocks[0].trial.approximates and not anew:  # weighed by derivatives so far
        c = replace(c, columns=recomputed(c, library, blocks))
    first, last = ([(library[n].of(vehicle), x) for n, x in some] for some in (before, after))
    trials = [among(first, last, size, b.drawn) for b in blocks]
    force = in_force_of(effect, blocks[0].trial.simulation)
    known = c.curve or Curve(c.sizes, np.eye(c.sizes.size))
    low, high = c.bounds

    def at_size(s: float) -> list[Complex]:
        settings = partial(c.place.settings, force)
        return [b.transform(t.change(effect, settings, s)) for b, t in zip(blocks, trials, strict=True)]

    if c.sizes.size == 1 and not anew and _is_straight(c, size, at_size, blocks):
        return c
    far = known.sizes[~near(known.sizes, size)] if anew and after else known.sizes
    wanted = [s for s in (n * size for n in _NEAR) if low <= s <= high]
    wanted = [s for s in wanted if np.abs(far / s - 1).min(initial=np.inf) >= 0.05]
    made: list[tuple[float, list]] = []
    for s in [*far.tolist(), *wanted] if anew else wanted:
        with suppress(ImpossibleSettings):
            made.append((s, at_size(s)))
    if not made:
        return c
    more = [s for s, _ in made]
    columns = [np.array([one[b] for _, one in made]) for b in range(len(blocks))]
    if anew:
        order = np.argsort(more)
        sizes, columns = np.array(more)[order], [z[order] for z in columns]
        few, mix = few_of(columns, blocks)
        curve = Curve(sizes, mix) if len(few) < sizes.size else None
        return replace(
            c,
            sizes=sizes[few],
            columns=[z[few] for z in columns],
            curve=curve,
            beside=before,
            after=after,
            about=size,
        )
    columns = [np.concatenate(pair) for pair in zip(c.columns, columns, strict=True)]
    sizes, mix = np.concatenate([known.sizes, more]), block_diag(known.mix, np.eye(len(more)))
    order = np.argsort(sizes)
    return replace(
        c, sizes=np.concatenate([c.sizes, more]), columns=columns, curve=Curve(sizes[order], mix[order])
    )


def _is_straight(
    candidate: Candidate, size: float, at: Callable[[float], list[Complex]], blocks: Sequence[Block]
) -> bool:
    """Return whether what a candidate's only column is multiplied by its size is not seen to be wrong.

    Weighing takes for straight what departs by a few per cent, and those of a large effect are seen.
    """
    low, high = candidate.bounds
    if not low <= size <= high:
        return True
    share = size / candidate.sizes[0]
    try:
        apart = [z - share * c[0] for z, c in zip(at(size), candidate.columns, strict=True)]
    except ImpossibleSettings:
        return True
    return not seen(apart, blocks)
