"""What is true of a case that was diagnosed: detectability, places, and how far the true effect closes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from bench import Bench, Case, Circumstances, detectability
from numpy.typing import NDArray
from truth import Part

from freqid.gap import locate
from freqid.gap.attribute import OTHER
from freqid.gap.close import misfit, misfit_with
from freqid.gap.closures import start_of
from freqid.gap.compare import Compared
from freqid.gap.diagnose import Findings
from freqid.gap.evidence import Hypothesis
from freqid.gap.gather import evidence_of
from freqid.gap.refit import refit


def around(case: Case, manoeuvre: int, signals: int = 0) -> Circumstances:
    """Return the circumstances of one of a case's manoeuvres."""
    seed = int(case["seed"])
    return Circumstances(case["noise"], case["gusts"], 10 * seed + manoeuvre, seed, signals)


def of_truth(by: Bench, found: Findings, parts: list[Part], case: Case) -> dict[str, Any]:
    """Return what is true of the case in its own metric: detectability, places, likeness of candidates."""
    each = [_change(by, found.compared, p, case) for p in parts]
    whole = [np.sum([s[i] for s in each], axis=0) for i in range(len(by.at))]
    columns = [{**c.signatures, "truth": s} for c, s in zip(found.compared, whole, strict=True)]
    columns = [{**of, **{f"truth{k}": s[i] for k, s in enumerate(each)}} for i, of in enumerate(columns)]
    evidence = evidence_of(
        found.compared, changes=[(0 * z, of) for z, of in zip(whole, columns, strict=True)]
    )
    at = evidence.column("truth")
    truth = Hypothesis("truth", (at,), (1.0,))
    likeness = {}
    for j in found.judged:
        if "+" in j.name or j.name == OTHER:
            continue
        known = tuple(evidence.column(found.evidence.signatures[c - 1]) for c in j.best.columns)
        likeness[j.name] = evidence.alignment(truth, Hypothesis(j.name, known, j.best.scale))
    mine = locate.gap_map(found.compared, whole)
    return {
        "lambda": float(evidence.metric[at, at]),
        "lambda_each": [
            float(evidence.metric[evidence.column(f"truth{k}"), evidence.column(f"truth{k}")])
            for k in range(len(each))
        ],
        "likeness": likeness,
        "truth_where": {axis: mine.share(axis) for axis in ("row", "band", "input")},
        "truth_cells": [[p.response, *p.band_hz, p.input, p.share] for p in mine.places()],
        "oracle": {"statistic": float(evidence.metric[at, 0]), "size": float(evidence.metric[at, at])},
    }


def _change(by: Bench, compared: Sequence[Compared], part: Part, case: Case) -> list[NDArray[np.complex128]]:
    """Return what a truth makes of each manoeuvre's residual: of two ways to tell the less detectable.

    Tolerances go with the motion that was flown. The nominal vehicle flies another one, along which they do
    not take their share of what is large in all; the vehicle that flew flies another one without the truth,
    and its own scatter there is not this one. Either adds what is not the truth's. Where a truth changes the
    log alone, the vehicle that flew does not move otherwise.
    """

    def told(scatter: bool) -> list[NDArray[np.complex128]]:
        how = [
            around(case, i) if scatter else replace(around(case, i), scatter=None) for i in range(len(by.at))
        ]
        return [by.change(at, [part], c, h) for at, c, h in zip(by.at, compared, how, strict=True)]

    flown = told(scatter=True)
    if part.truth.logged:
        return flown
    return min(told(scatter=False), flown, key=lambda s: detectability(compared, s))


def closed(by: Bench, found: Findings, parts: list[Part], case: Case) -> dict[str, Any]:
    """Return how far the true effect closes manoeuvres that it was not fitted to, beside its own truth."""
    effect = by.candidates[parts[0].truth.id].of(found.compared[0].maneuver.vehicle)
    judged = next((j for j in found.judged if j.name == effect.id), None)
    if judged is None:
        return {"failed": "not judged"}
    how = [around(case, 5 + i, signals=1) for i in range(len(by.at))]
    kept = [
        by.measured(by.fly(at, parts, h), 70 + i, **{effect.id: by.candidates[effect.id]})
        for i, (at, h) in enumerate(zip(by.at, how, strict=True))
    ]
    start = start_of((effect.id,), found.evidence, found.judged, {effect.id: effect}, found.compared)
    fitted = refit(found.compared, [effect], start)
    share = misfit(kept, [effect], fitted.settings).share(0.9)
    s = [by.change(at, parts, c, h) for at, c, h in zip(by.at, kept, how, strict=True)]
    best = misfit_with(kept, s).share(0.9)
    sigma = np.sqrt(np.diag(fitted.covariance))
    return {
        "G": [share.G, share.lo, share.hi],
        "oracle_G": [best.G, best.lo, best.hi],
        "settings": {
            f"{i}.{n}": [float(v), float(e)]
            for (i, n), v, e in zip(fitted.names, fitted.value, sigma, strict=True)
        },
        "at_bound": fitted.at_bound,
        "undetermined": fitted.undetermined,
    }
