"""One open case, as a calibration tells it, as a row of ``cases.csv``."""

from __future__ import annotations

from typing import Any

import numpy as np
from known import alike, told_by, top_group

from freqid.gap.calibrate import Table, filled, named, pair_called

STRATA = (15, 50, 200)
LISTED = 0.1
NOT_EFFECTS = ("none", "other")


def row_of(found: dict[str, Any], table: Table) -> dict[str, Any]:
    """Return one case, as a calibration tells it, as a row."""
    case, which = found["case"], found["which"]
    truths = [t["id"] for t in found["truth"]]
    chances = told_by(found, table)
    top = max(chances, key=lambda n: chances[n])
    lam = found.get("lambda") or 0.0
    same = alike(found)
    exists = found["gap"]["exists"]
    names = set(filled(chances, table.level(exists)))
    group = top_group(found, top)
    answer = named(chances, (tuple(group),)) if exists else ()
    judged = {j["name"]: j for j in found["judged"] if "+" not in j["name"]}
    effects = {n: j for n, j in judged.items() if n not in NOT_EFFECTS}
    sparse = [n.partition(":")[0] for n, _ in found["sparse"]]
    criterion = {n: _bic(j, found["rows"]) for n, j in effects.items()}
    given = _given_a_gap(chances)
    by = {
        "likeliest": max(effects, key=lambda n: effects[n]["evidence"]),
        "bic": max(criterion, key=lambda n: criterion[n]),
        "gain": max(effects, key=lambda n: effects[n]["gain"] or 0.0),
        "sparse": sparse[0] if sparse else "none",
    }
    where = (
        {f"f1_{a}": _f1(found["where"][a], found["truth_where"][a]) for a in found["where"]} if truths else {}
    )
    evidence = {j["name"]: j["evidence"] for j in found["judged"]}
    pair = pair_called(evidence, table, found.get("overlap", 1.0)) if exists else ()
    by_criterion = _by_bic(effects, found["rows"])
    right = {"null": {"none"}, "outside": {"other"}}.get(case["kind"], same)
    closed = found.get("closure", {})
    covered = [_covers(t, which["parameters"].get(t["id"], {})) for t in found["truth"] if t["form"] == "own"]
    return {
        "vehicle": case.get("vehicle", "la8"),
        "kind": case["kind"],
        "truth": "+".join(truths),
        "form": "+".join(t["form"] for t in found["truth"]),
        "place": "+".join(t["place"] for t in found["truth"]),
        "size": " ".join(f"{t['size']:.4g}" for t in found["truth"]),
        "stratum": _stratum(case, found),
        "asked": case["lam"],
        "lambda": f"{lam:.4g}",
        "seed": case["seed"],
        "noise": case["noise"],
        "gusts": case["gusts"],
        "statistic": f"{found['gap']['statistic']:.3g}",
        "p": f"{found['gap']['p']:.3g}",
        "naive_p": f"{found['gap']['naive_p']:.3g}",
        "detected": int(exists),
        "top": top,
        "p_top": f"{chances[top]:.3f}",
        "p_truth": f"{sum(chances.get(t, 0.0) for t in truths):.3f}",
        "p_class": f"{sum(chances.get(t, 0.0) for t in same):.3f}",
        "brier": f"{_brier(chances, right):.3f}",
        "named": int(bool(answer)),
        "alone": int(bool(answer) and names <= group),
        "right": int(bool(same & group)) if answer else "",
        "set": " ".join(sorted(names)),
        "set_covers": int(bool(names & right)),
        "pair": "+".join(sorted(pair)),
        **{f"{how}_right": int(name in same) for how, name in by.items()},
        **{f"{how}_brier": f"{_brier({by[how]: 1.0}, right):.3f}" for how in ("gain", "sparse")},
        "bic_brier": f"{_brier(by_criterion, right):.3f}",
        "given_brier": f"{_brier(given, right):.3f}",
        "bic_given_brier": f"{_brier(_given_a_gap(by_criterion), right):.3f}",
        **{f"{how}_top": name for how, name in by.items()},
        "bic_named": int(criterion[by["bic"]] > 0),
        "gain_named": 1,
        "sparse_named": int(bool(sparse)),
        **{f"f1_{a}": where.get(f"f1_{a}", "") for a in ("row", "band", "input")},
        "interval_covers": covered[0] if len(covered) == 1 and case["kind"] == "single" else "",
        "G": closed.get("G", [""])[0],
        "oracle_G": closed.get("oracle_G", [""])[0],
        "seconds": found["seconds"],
        "version": found["version"],
        "code": found["code"],
    }


def _stratum(case: dict[str, Any], found: dict[str, Any]) -> int:
    """Return the stratum that the detectability measured in a case is nearest to, 0 where it is below all.

    Of pairs that of the fainter effect.
    """
    if case["kind"] == "null":
        return 0
    lam = min(found["lambda_each"])
    near = min(STRATA, key=lambda s: abs(np.log(max(lam, 1e-9) / s)))
    return near if lam > STRATA[0] / 2 else 0


def _bic(judged: dict[str, Any], rows: int) -> float:
    """Return half the fall of the Bayesian information criterion."""
    return (judged["gain"] or 0.0) - 0.5 * judged["parameters"] * np.log(rows)


def _by_bic(effects: dict[str, Any], rows: int) -> dict[str, float]:
    """Return probabilities by the criterion alone, none among them."""
    logs = {n: _bic(j, rows) for n, j in effects.items()} | {"none": 0.0}
    most = max(logs.values())
    weight = {n: float(np.exp(x - most)) for n, x in logs.items()}
    return {n: w / sum(weight.values()) for n, w in weight.items()}


def _brier(chances: dict[str, float], same: set[str]) -> float:
    """Return the squared distance of probabilities from the truth, its aliases taken as one name."""
    right = sum(p for n, p in chances.items() if n in same)
    return (1 - right) ** 2 + sum(p**2 for n, p in chances.items() if n not in same)


def _given_a_gap(chances: dict[str, float]) -> dict[str, float]:
    """Return probabilities where it is taken for granted that there is something."""
    kept = {n: p for n, p in chances.items() if n != "none"}
    whole = sum(kept.values())
    return {n: p / whole for n, p in kept.items()} if whole > 0 else chances


def _f1(found: dict[str, float], truth: dict[str, float]) -> float | str:
    """Return how well places that hold a tenth are found; nothing where none holds as much in truth."""
    a = {n for n, share in found.items() if share >= LISTED and n}
    b = {n for n, share in truth.items() if share >= LISTED and n}
    return round(2 * len(a & b) / (len(a) + len(b)), 3) if b else ""


def _covers(truth: dict[str, Any], intervals: dict[str, list[float]]) -> int | str:
    """Return whether the interval of the parameter that was set holds it."""
    for identifier, values in truth["settings"].items():
        for name, value in values.items():
            if identifier == truth["id"] and name in intervals:
                return int(intervals[name][1] <= value <= intervals[name][2])
    return ""
