"""Open cases of gap diagnosis, each flown and diagnosed: one JSON a case, resumable.

python benchmarks/gap/run.py FOLDER [--vehicle la8|c172p] [--jobs 2] [--only null|single|outside|double]
    [--first N]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import time
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import cases  # first: it finds what lies beside it
import numpy as np

from freqid import __version__
from freqid.core.record import Maneuver
from freqid.gap import attribute, diagnose, locate
from freqid.gap.attribute import OTHER
from freqid.gap.close import Misfit, misfit, refit
from freqid.gap.closures import start_of
from freqid.gap.compare import compare, evidence_of
from freqid.gap.diagnose import Findings, Question
from freqid.gap.evidence import Evidence, Hypothesis
from freqid.simulate import runner

HERE = Path(__file__).resolve()
VEHICLES = {"la8": "cases", "c172p": "c172p_cases"}
CLOSED = 50  # detectability from which every third case is closed
_STEPS = 6  # of the sparse regression


def _flown_by(case: dict[str, Any]) -> ModuleType:
    """Return what flies a case: cases that name no vehicle are the LA-8's."""
    return import_module(VEHICLES[case.get("vehicle", "la8")])


def work(path: Path, folder: str, **case: Any) -> None:
    """Fly and diagnose one case; write what was found."""
    by = _flown_by(case)
    began = time.perf_counter()
    home = Path(folder)
    parts = by.parts_of(case, home / "sizes")
    seed = int(case["seed"])
    flights = [
        by.flown(
            at,
            parts,
            noise=case["noise"],
            gusts=case["gusts"],
            seed=_seed(case, i),
            scatter=seed,
        )
        for i, at in enumerate(by.AT)
    ]
    question = Question(by.LIBRARY, by.TOLERANCES, by.BAND_HZ, draws=by.DRAWS, seed=seed, close=False)
    found = diagnose.diagnose(by.SIMULATION, [Maneuver.of(f) for f in flights], question, names=by.AT)
    table: dict[str, Any] = {
        "case": case,
        "version": __version__,
        "code": os.environ.get("BENCH_CODE", ""),
        "truth": [
            {
                "id": p.truth.id,
                "form": p.truth.form,
                "place": p.place,
                "size": p.size,
                "settings": p.truth.settings(p.size, p.place) if p.truth.form == "own" else {},
                "in_force": by.in_force(p.truth.id) if p.truth.id in by.LIBRARY else {},
            }
            for p in parts
        ],
        **_told(found),
    }
    if parts:
        table |= _of_truth(found, parts, case)
        if case["kind"] == "single" and case["lam"] >= CLOSED and seed % 3 == 0:
            table["closure"] = _closed(found, parts, case)
    table["seconds"] = round(time.perf_counter() - began, 1)
    path.write_text(json.dumps(_plain(table), allow_nan=False) + "\n")
    with (home / "bench.log").open("a") as log:
        top = next(iter(found.diagnosis.which.probabilities.items()))
        log.write(
            f"{time.strftime('%H:%M:%S')} {by.described(case)} lambda {table.get('lambda')}: "
            f"p {found.diagnosis.gap.p:.2g}, {top[0]} {top[1]:.2f} ({table['seconds']} s)\n"
        )
    _keep(home / "evidence" / f"{path.name.strip('.').split('.')[0]}.npz", found.evidence, case)


def _seed(case: dict[str, Any], manoeuvre: int) -> int:
    return 10 * int(case["seed"]) + manoeuvre


def _told(found: Findings) -> dict[str, Any]:
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
    metric = evidence.metric[: 1 + len(evidence.signatures), : 1 + len(evidence.signatures)]
    chosen: list[int] = []
    before, told = 0.0, []
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
        told.append([evidence.signatures[best - 1], gain - before])
        before = gain
    return told


def _of_truth(found: Findings, parts: list[cases.Part], case: dict[str, Any]) -> dict[str, Any]:
    """Return what is true of the case in its own metric: detectability, places, likeness of candidates."""
    by = _flown_by(case)
    how = {"gusts": case["gusts"], "scatter": int(case["seed"])}
    each = [
        [
            by.change(at, [p], c, seed=_seed(case, i), **how)
            for i, (at, c) in enumerate(zip(by.AT, found.compared, strict=True))
        ]
        for p in parts
    ]
    whole = [np.sum([s[i] for s in each], axis=0) for i in range(len(by.AT))]
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


def _closed(found: Findings, parts: list[cases.Part], case: dict[str, Any]) -> dict[str, Any]:
    """Return how far the true effect closes manoeuvres that it was not fitted to, beside its own truth."""
    by = _flown_by(case)
    effect = by.LIBRARY[parts[0].truth.id].of(found.compared[0].maneuver.vehicle)
    judged = next((j for j in found.judged if j.name == effect.id), None)
    if judged is None:
        return {"failed": "not judged"}
    allowed = {**by.ALLOWED, effect.id: by.LIBRARY[effect.id]}
    kept = []
    for i, at in enumerate(by.AT):
        record = by.flown(
            at,
            parts,
            noise=case["noise"],
            gusts=case["gusts"],
            seed=_seed(case, 5 + i),
            scatter=int(case["seed"]),
            signals=1,
        )
        kept.append(
            compare(
                by.SIMULATION,
                Maneuver.of(record),
                allowed,
                by.TOLERANCES,
                by.BAND_HZ,
                count=by.DRAWS,
                seed=70 + i,
            )
        )
    start = start_of((effect.id,), found.evidence, found.judged, {effect.id: effect}, found.compared)
    fitted = refit(found.compared, [effect], start)
    share = misfit(kept, [effect], fitted.settings).share(0.9)
    how = {"gusts": case["gusts"], "scatter": int(case["seed"]), "signals": 1}
    s = [
        by.change(at, parts, c, seed=_seed(case, 5 + i), **how)
        for i, (at, c) in enumerate(zip(by.AT, kept, strict=True))
    ]
    evidence = evidence_of(kept, changes=[(0 * z, {"change": z}) for z in s])
    before, shift, size = (float(evidence.metric[at]) for at in ((0, 0), (0, 1), (1, 1)))
    across = 2 * evidence.null_products(1)
    best = Misfit(evidence.rows, before, before + size - 2 * shift, evidence.null_energy, across).share(0.9)
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


def _keep(path: Path, evidence: Evidence, case: dict[str, Any]) -> None:
    """Keep the metric, from which every judgement can be made again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        path,
        metric=evidence.metric.astype(np.float32),
        data=evidence.metric[:, 0],
        signatures=np.array(evidence.signatures),
        tolerances=np.array(evidence.tolerances),
        null=evidence.null,
        rows=evidence.rows,
        case=json.dumps(case),
    )


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
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


def _code() -> str:
    """Return what was run: the commit."""
    told = subprocess.run(
        ["git", "describe", "--always", "--dirty"], cwd=HERE.parent, capture_output=True, text=True
    )
    return told.stdout.strip()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--vehicle", choices=tuple(VEHICLES), default="la8")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", default="")
    parser.add_argument("--first", type=int, default=None)
    given = parser.parse_args()
    folder = given.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    planned = import_module(VEHICLES[given.vehicle]).planned()
    wanted = [c for c in planned if given.only in ("", c["kind"])][: given.first]
    os.environ["BENCH_CODE"] = _code()
    told = [{"folder": str(folder), **case} for case in wanted]
    runner.run(work, told, folder / "cases", jobs=given.jobs)


if __name__ == "__main__":
    main()
