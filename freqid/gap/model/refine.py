"""Candidates computed again near their estimated size, where interpolation between sizes is too coarse."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from freqid.core.errors import ImpossibleSettings
from freqid.gap.model.candidates import Candidate, Curve, recomputed
from freqid.gap.model.changes import change
from freqid.gap.model.testable import in_force_of
from freqid.gap.stack.block import Block
from freqid.simulate.effects.effect import Effect

_NEAR = (0.8, 1.0, 1.25)  # of the estimated size


def refined(
    candidate: Candidate, size: float, library: Mapping[str, Effect], blocks: Sequence[Block]
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
    """
    c = candidate
    if c.kind != "scalar" or c.effect not in library or size == 0:
        return c
    if blocks[0].trial.approximates:  # weighed by derivatives so far
        c = replace(c, columns=recomputed(c, library, blocks))
    if c.sizes.size == 1:
        return c
    effect = library[c.effect].of(blocks[0].trial.maneuver.vehicle)
    force = in_force_of(effect, blocks[0].trial.simulation)
    low, high = c.bounds
    extra: list[tuple[float, list]] = []
    for s in (n * size for n in _NEAR):
        if not low <= s <= high or np.min(np.abs((c.curve or c).sizes / s - 1)) < 0.05:
            continue
        settings = {n: force[n] + s for n in c.place.parameters} | dict(c.place.fixed)
        try:
            extra.append((s, [b.transform(change(effect, b.trial, settings)) for b in blocks]))
        except ImpossibleSettings:
            continue
    if not extra:
        return c
    more = [s for s, _ in extra]
    columns = [
        np.concatenate([own, np.array([made[b] for _, made in extra])]) for b, own in enumerate(c.columns)
    ]
    known, mix = c.curve or Curve(c.sizes, np.eye(c.sizes.size))
    known, mix = np.concatenate([known, more]), block_diag(mix, np.eye(len(more)))
    order = np.argsort(known)
    return replace(
        c, sizes=np.concatenate([c.sizes, more]), columns=columns, curve=Curve(known[order], mix[order])
    )
