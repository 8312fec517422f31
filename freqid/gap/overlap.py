"""How far two effects act in the same rows: what a wrong formula of one may be taken for the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.gap.attribute import Judged, coefficients
from freqid.gap.compare import Compared
from freqid.gap.evidence import Evidence
from freqid.gap.locate import explained, gap_map


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
    sizes = coefficients(pair, evidence)
    one, other = (
        gap_map(compared, explained(compared, mine)).share("row")
        for mine in ({n: x for n, x in sizes.items() if n.startswith(f"{e}:")} for e in pair.name.split("+"))
    )
    return float(sum(np.sqrt(one[row] * other[row]) for row in one))
