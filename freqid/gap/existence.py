"""Whether there is a gap, and how small an effect would be found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from freqid.core.diagnosis import Existence
from freqid.gap import attribute
from freqid.gap.attribute import LEAST_ODDS, OTHER, Judged
from freqid.gap.compare import Compared
from freqid.gap.evidence import Evidence
from freqid.gap.reach import first_order_size
from freqid.gap.self_test import Tested
from freqid.gap.signature import GIVEN
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]


def existence_of(
    statistic: float,
    null: Array,
    used: Sequence[Compared],
    evidence: Evidence,
    judged: Sequence[Judged],
    library: Mapping[str, Effect],
    level: float,
) -> Existence:
    """Return whether there is a gap, and what size of each effect would be found in 95 of 100 cases."""
    p = attribute.p_value(statistic, null)
    raw = sum(float((c.white(c.residual) ** 2).sum()) for c in used)
    threshold = attribute.critical(null, level)
    smallest, unit = {}, {}
    count = len([j for j in judged if "+" not in j.name])
    for j in judged:
        if j.name == OTHER or "+" in j.name:
            continue
        options = len(attribute.variants(library[j.name], evidence))
        smallest[j.name] = first_order_size(evidence, j.best, threshold, count, options)
        parameter = evidence.signatures[j.best.columns[0] - 1].partition(":")[2].partition(GIVEN)[0]
        unit[j.name] = library[j.name].parameters[parameter].unit
    return Existence(
        p < level and statistic > LEAST_ODDS, p, level, float(chi2.sf(raw, evidence.rows)), smallest, unit
    )


def with_reached(
    existence: Existence, tested: Tested, evidence: Evidence, judged: Sequence[Judged]
) -> Existence:
    """Return it with the smallest sizes found, by insertion where an effect was inserted at its place.

    Without effects that no size within their range makes found.
    """
    known = {f"{r.effect}:{r.parameter}": r.size for r in tested.result.reach}
    columns = {j.name: evidence.signatures[j.best.columns[0] - 1] for j in judged if j.name != OTHER}
    found = {n: known.get(columns[n], size) for n, size in existence.smallest_detectable.items()}
    sizes = {n: size for n, size in found.items() if np.isfinite(size)}
    return replace(existence, smallest_detectable=sizes)
