"""How far two effects act in the same rows: what a wrong formula of one may be taken for the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from freqid.gap.attribute import Judged
from freqid.gap.compare import Compared
from freqid.gap.evidence import Evidence

Array = NDArray[np.float64]


def overlap(judged: Sequence[Judged], evidence: Evidence, compared: Sequence[Compared]) -> float:
    """Return how far the effects of the strongest pair act in the same rows, 0 to 1; 1 without a pair.

    Parameters
    ----------
    judged : sequence of Judged
        Strongest first.
    evidence : Evidence
        That they come from.
    compared : sequence of Compared

    Returns
    -------
    float
        Bhattacharyya's coefficient of how the energies of the two changes are spread over the rows.
    """
    pair = next((j for j in judged if "+" in j.name), None)
    if pair is None:
        return 1.0
    one, other = (_spread(pair, name, evidence, compared) for name in pair.name.split("+"))
    names = one.keys() & other.keys()
    return float(sum(np.sqrt(one[n] * other[n]) for n in names))


def _spread(pair: Judged, effect: str, evidence: Evidence, compared: Sequence[Compared]) -> dict[str, float]:
    """Return the share of an effect's energy over the noise in each row, by name."""
    every = (*evidence.signatures, *evidence.tolerances)
    sizes = {every[c - 1]: x for c, x in zip(pair.best.columns, pair.estimate.value, strict=True)}
    mine = {n: x for n, x in sizes.items() if n.startswith(f"{effect}:")}
    found: dict[str, float] = {}
    for c in compared:
        change = sum(
            (x * c.signatures[n] for n, x in mine.items() if n in c.signatures), np.zeros_like(c.residual)
        )
        for row, energy in zip(c.rows, c.energy(change), strict=True):
            found[row.name] = found.get(row.name, 0.0) + float(energy)
    total = max(sum(found.values()), np.finfo(float).tiny)
    return {n: x / total for n, x in found.items()}
