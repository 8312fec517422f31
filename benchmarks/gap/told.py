"""What a diagnosis says of a case, as plain tables, and what comparators make of the same numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from freqid.gap import attribute
from freqid.gap.attribute import OTHER
from freqid.gap.diagnose import Findings
from freqid.gap.evidence import Evidence, everywhere
from freqid.gap.overlap import overlap

_STEPS = 6  # of the sparse regression


def told(found: Findings) -> dict[str, Any]:
    """Return all that the diagnosis says, and what comparators make of the same numbers."""
    d, evidence = found.diagnosis, found.evidence
    names = (*evidence.signatures, *evidence.tolerances)
    statistic, null = attribute.existence(found.judged)
    singles = [j for j in found.judged if "+" not in j.name]
    pairs = [j for j in found.judged if "+" in j.name][:5]
    gains = {j.name: float(evidence.likelihood_gain(j.best)[0]) for j in singles}
    return {
        "gap": {
            "exists": d.gap.exists,
            "p": d.gap.p,
            "naive_p": d.gap.naive_p,
            "statistic": statistic,
            "null": null,
            "smallest_detectable": d.gap.smallest_detectable,
        },
        "rows": evidence.rows,
        "energy": float(evidence.metric[0, 0]),
        "judged": [
            {
                "name": j.name,
                "evidence": j.evidence,
                "null_max": float(j.null.max(initial=-np.inf)),
                "columns": [names[c - 1] for c in j.best.columns] if len(j.best.columns) < 40 else [],
                "value": j.estimate.value if len(j.best.columns) < 40 else [],
                "sigma": np.sqrt(np.diag(j.estimate.covariance)) if len(j.best.columns) < 40 else [],
                "detectability": j.estimate.detectability,
                "gain": gains.get(j.name),
                "parameters": len(j.best.columns),
            }
            for j in (*singles, *pairs)
        ],
        "alignment": _alignments(singles, evidence),
        "overlap": overlap(found.judged, evidence, found.compared),
        "which": {
            "probabilities": d.which.probabilities,
            "set": d.which.set,
            "aliases": d.which.aliases,
            "pair": d.which.pair,
            "not_tested": d.which.not_tested,
            "calibrated": d.which.calibrated,
            "parameters": {
                i: {n: [v.estimate, v.lo, v.hi] for n, v in of.items()}
                for i, of in d.which.parameters.items()
            },
        },
        "where": {axis: found.map.share(axis) for axis in ("row", "band", "input")},
        "places": [[p.response, *p.band_hz, p.input, p.share] for p in d.where],
        "sparse": _sparse(evidence),
        "verdict": d.verdict,
    }


def _alignments(singles: Any, evidence: Evidence) -> dict[str, dict[str, float]]:
    """Return how much alike the strongest explanations are."""
    first = [j for j in singles if j.name != OTHER][:8]
    return {a.name: {b.name: evidence.alignment(a.best, b.best) for b in first if b is not a} for a in first}


def _sparse(evidence: Evidence) -> list[list[Any]]:
    """Return effects in the order of a stepwise regression on all signatures, with half the misfit's fall.

    In the manner of sparse discrepancy models (SINDy): one column at a time, the one that helps most, while
    the Bayesian information criterion falls.
    """
    count = 1 + sum(map(everywhere, evidence.signatures))
    metric = evidence.metric[:count, :count]
    chosen: list[int] = []
    before, entered = 0.0, []
    while len(chosen) < _STEPS:
        best, gain = 0, before
        for column in range(1, len(metric)):
            if column in chosen or metric[column, column] < 1e-12:
                continue
            at = [*chosen, column]
            gram = metric[np.ix_(at, at)]
            fit = 0.5 * metric[at, 0] @ np.linalg.pinv(gram, rcond=1e-9, hermitian=True) @ metric[at, 0]
            if fit > gain:
                best, gain = column, float(fit)
        if not best or gain - before < 0.5 * np.log(evidence.rows):
            break
        chosen.append(best)
        entered.append([evidence.signatures[best - 1], gain - before])
        before = gain
    return entered


def plain(value: Any) -> Any:
    """Return what JSON can hold: six digits, and nothing in place of what is not finite."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return (
            round(value, 6)
            if np.isfinite(value) and abs(value) > 1e-3
            else value
            if np.isfinite(value)
            else None
        )
    return value
