"""Open cases as a calibration sees them: evidence, truth, and which names count as the same."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from freqid.gap.attribute import LEAST_ODDS, NONE, OTHER
from freqid.gap.calibrate import APART, Table, chances
from freqid.gap.fit_table import KnownCases

Found = Mapping[str, Any]


def read(folders: Sequence[str | Path]) -> list[dict[str, Any]]:
    """Return all cases that run.py left in folders; a case that is there twice would count twice."""
    paths = [p for folder in folders for p in sorted((Path(folder) / "cases").glob("*.json"))]
    every = (json.loads(p.read_text()) for p in paths if p.name != "units.json")
    found = [f for f in every if "case" in f]
    times = Counter(json.dumps(f["case"], sort_keys=True) for f in found)
    if twice := [case for case, n in times.items() if n > 1]:
        raise SystemExit(
            f"{len(twice)} cases are there more than once, first {twice[0]}; remove the older files"
        )
    for f in found:  # cases that were run when less was enough to call a gap
        f["gap"]["exists"] &= f["gap"]["statistic"] > LEAST_ODDS
    return found


def alike(found: Found) -> set[str]:
    """Return the true names, and those that these data cannot tell from a single one."""
    truths = {t["id"] for t in found["truth"]}
    if found["case"]["kind"] != "single":
        return truths
    lam = found.get("lambda") or 0.0
    return truths | {n for n, c in found.get("likeness", {}).items() if lam * (1 - c) < APART}


def top_group(found: Found, top: str) -> set[str]:
    """Return a name and those that data do not separate from it, by what the diagnosis knows."""
    judged = {j["name"]: j for j in found["judged"] if "+" not in j["name"]}
    like = found["alignment"].get(top, {})
    size = judged[top]["detectability"] if top in judged else 0.0
    return {top} | {n for n, c in like.items() if size * (1 - c) < APART}


def logs_of(found: Found) -> dict[str, float]:
    """Return the evidence of singles and *other*."""
    return {j["name"]: j["evidence"] for j in found["judged"] if "+" not in j["name"]}


def told_by(found: Found, table: Table) -> dict[str, float]:
    """Return the probabilities that a calibration makes of a case."""
    logs = logs_of(found)
    each = chances(tuple(logs), np.array([list(logs.values())]), np.array([found["gap"]["exists"]]), table)[0]
    return dict(zip((*logs, NONE), each.tolist(), strict=True))


def known_cases(found: Sequence[Found]) -> KnownCases:
    """Return cases to calibrate on."""
    classes = []
    for f in found:
        kind = f["case"]["kind"]
        right = alike(f)
        classes.append((NONE,) if kind == "null" else (OTHER,) if kind == "outside" else tuple(sorted(right)))
    # every case the same: strata of a few would outweigh all others, and folds without them go astray
    share = {"null": 1.0, "single": 1.0, "outside": 0.5, "double": 0.25}
    weight = [share[f["case"]["kind"]] for f in found]
    mean = float(np.mean(weight))
    return KnownCases.of(
        [logs_of(f) for f in found], classes, [f["gap"]["exists"] for f in found], [w / mean for w in weight]
    )
