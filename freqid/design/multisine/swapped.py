"""A second orthogonal set: effectors exchange combs, so that what one set confuses the other splits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from freqid.core.errors import UsageError, nearest
from freqid.core.results.design import Multisine, MultisineDesign


def swap_combs(design: MultisineDesign, pairs: Sequence[tuple[str, str]]) -> MultisineDesign:
    """Return the design with the combs of named effectors exchanged.

    Two effectors that do nearly the same to the aircraft are told apart by what differs between their
    combs. Flown on the exchanged combs as well, each is seen at the other's frequencies too.

    Parameters
    ----------
    design : MultisineDesign
    pairs : sequence of pairs of str
        Effectors, each in one pair at most.

    Returns
    -------
    MultisineDesign
        Harmonics, proportions of amplitudes and phases are those of the partner, so that the relative
        peak factor is the partner's; every effector keeps its rms.

    Raises
    ------
    UsageError
        Where a name is unknown or comes twice.
    """
    partner: dict[str, str] = {}
    for pair in pairs:
        for name, other in (pair, pair[::-1]):
            if name not in design.names:
                raise UsageError(f"the design has no effector '{name}'", remedy=nearest(name, design.names))
            if name in partner or name == other:
                raise UsageError(f"'{name}' is to be swapped more than once", remedy="name it in one pair")
            partner[name] = other
    by_name = {signal.name: signal for signal in design.signals}

    def swapped(own: Multisine) -> Multisine:
        if own.name not in partner:
            return own
        other = by_name[partner[own.name]]
        factor = np.linalg.norm(own.amplitude) / np.linalg.norm(other.amplitude)
        return replace(own, index=other.index, phase=other.phase, amplitude=factor * other.amplitude)

    provenance = {**design.provenance, "swapped": [list(pair) for pair in pairs]}
    return replace(design, signals=tuple(map(swapped, design.signals)), provenance=provenance)
