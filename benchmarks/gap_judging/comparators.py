"""Plain methods beside the ideal scan: `python benchmarks/gap_judging/comparators.py OUT -o comparators.md`.

OUT holds vehicles' cases and matrices of generate.py. Three methods explain a case's residual (the owner's
simulation replayed on its records, mean of two repeats) by columns of effects, each with a free amplitude:

- **BIC**: the column that lowers n log(RSS / n) + k log n most enters, one after another, up to six, while it
  falls; also with falls of more than 10.
- **largest reduction**: the same order of columns, each kept by an F-test at 2 % over all columns (Sidak).
- **sparse regression**: LASSO, its penalty by cross-validation between conditions: that of the least error of
  prediction, or the largest within one standard error of it.

There is a gap where any column enters. The first to enter (LASSO: the one that explains most) gives the name,
the first two names are the answer to a pair.

They are favoured: their columns are the true shapes, of every parameter and place, at the sizes of the strata
(LASSO: at 200), which no method would have. They are whitened in three ways: by the noise alone, which is all
that such methods know; by noise and tolerances; and so with the owner's error of form, which nobody knows,
taken off as well. The ideal scan's line is what `case.json` says; it knows no pairs.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import pickle
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from aliases import equivalent, merged
from detectability import Metric, Signatures
from multisine import load_module
from numpy.typing import NDArray
from scipy.stats import f as f_distribution
from stack import stack
from table import rate

from freqid.core.record import read_record

HERE = Path(__file__).resolve().parent
Array = NDArray[np.float64]
STEPS = 6  # columns that may enter
LEVEL = 0.02
PENALTIES = np.geomspace(1.0, 1e-3, 25)  # of the LASSO, as shares of the least that selects nothing
SWEEPS = 200
WHITENED = ("noise", "noise + tolerances", "noise + tolerances, form known")
METHODS = (
    "BIC",
    "BIC, fall above 10",
    "largest reduction",
    "sparse regression, least error",
    "sparse regression, one standard error",
)


@dataclass(frozen=True)
class Residuals:
    """A case's residuals and the columns in one metric.

    Attributes
    ----------
    y : ndarray, shape (number,)
        Mean of two repeats, all conditions.
    X : ndarray, shape (number, column)
    conditions : list of (ndarray, ndarray)
        By condition: each repeat's residual, shape (repeat, number of its own), and the columns.
    """

    y: Array
    X: Array
    conditions: list[tuple[Array, Array]]


@dataclass(frozen=True)
class Answer:
    """What a method says: the ids that entered, first the likeliest."""

    ids: list[str]

    @property
    def called(self) -> bool:
        """Whether there is a gap."""
        return bool(self.ids)


class Vehicle:
    """A vehicle's columns, whitened in all ways.

    Parameters
    ----------
    name : str
    m : Metric
    known : Signatures
    """

    def __init__(self, name: str, m: Metric, known: Signatures) -> None:
        self.m = m
        self.truth = load_module(HERE / name / "truth.py")
        self.simulation = load_module(self.truth.SIMULATION)
        sized = ~np.isnan(known.size)
        self.ids = [known.candidates[i].id for i, _ in np.argwhere(sized)]
        rows = len(m.rows)
        lines = m.nominal.shape[2]
        own = rows * (2 * lines - 1)
        self.blocks = [slice(c * own, (c + 1) * own) for c in range(len(m.nominal))]
        columns = known.column[sized].T
        T = m.tolerance
        every = [_inverse_root(T), *(_inverse_root(T[b]) for b in self.blocks)]
        same = [lambda v: v] * len(every)
        self.white = {w: (same if w == "noise" else every) for w in WHITENED}
        self.columns = {
            w: [roots[0](columns), *(r(columns[b]) for r, b in zip(roots[1:], self.blocks, strict=True))]
            for w, roots in self.white.items()
            if w != WHITENED[2]
        }
        self.columns[WHITENED[2]] = self.columns[WHITENED[1]]

    def residuals(self, folder: Path, case: dict[str, Any]) -> Iterator[tuple[str, Residuals]]:
        """Yield a case's residuals in each metric, by its name."""
        conditions = list(self.truth.TRIM)
        repeats = [[f for f in case["use"] if f.startswith(f"{c}_")] for c in conditions]
        flown = np.array(
            [[self._stack(folder / f, c) for f in r] for c, r in zip(conditions, repeats, strict=True)]
        )
        for w in WHITENED:
            form = self.m.bias if w == WHITENED[2] else 0.0
            by_repeat = [self.m.whiten(flown[:, k] - form) for k in range(flown.shape[1])]
            whole, *parts = self.white[w]
            X, *own = self.columns[w]
            each = [
                (np.array([root(y[b]) for y in by_repeat]), x)
                for root, b, x in zip(parts, self.blocks, own, strict=True)
            ]
            yield w, Residuals(whole(np.mean(by_repeat, axis=0)), X, each)

    def _stack(self, path: Path, condition: str) -> NDArray[np.complex128]:
        record = read_record(path)
        channels = {n: c.values for n, c in record.channels.items()}
        return stack(self.truth, self.simulation, channels, self.truth.TRIM[condition]["rho"])


def _inverse_root(T: Array) -> Callable[[Array], Array]:
    """Return the function that multiplies by the inverse root of unit noise and tolerances together."""
    U, s, _ = np.linalg.svd(T, full_matrices=False)
    change = 1 / np.sqrt(1 + s**2) - 1

    def root(v: Array) -> Array:
        return v + U @ (change * (U.T @ v).T).T

    return root


def forward(r: Residuals) -> list[tuple[int, float, float]]:
    """Return columns in the order in which they help most, each with RSS before and after."""
    G, b, rss = r.X.T @ r.X, r.X.T @ r.y, float(r.y @ r.y)
    size = np.diag(G).copy()
    out = []
    for _ in range(STEPS):
        left = np.diag(G)
        gain = np.where(left > 1e-6 * size, b**2 / np.maximum(left, 1e-12), 0.0)
        k = int(np.argmax(gain))
        out.append((k, rss, rss - gain[k]))
        rss -= gain[k]
        across, pivot, at = G[:, k].copy(), G[k, k], b[k]
        b = b - across * at / pivot
        G = G - np.outer(across, across) / pivot
    return out


def by_bic(steps: Sequence[tuple[int, float, float]], n: int, fall: float) -> list[int]:
    """Return the columns that enter while the criterion falls by more than `fall`."""
    out = []
    for k, before, after in steps:
        if n * np.log(before / after) - np.log(n) <= fall:
            break
        out.append(k)
    return out


def by_f_test(steps: Sequence[tuple[int, float, float]], n: int, columns: int) -> list[int]:
    """Return the columns that enter while an F-test at 2 % over all columns keeps them."""
    level = 1 - (1 - LEVEL) ** (1 / columns)
    out = []
    for k, before, after in steps:
        freedom = n - len(out) - 1
        if f_distribution.sf((before - after) / (after / freedom), 1, freedom) > level:
            break
        out.append(k)
    return out


def lasso(G: Array, b: Array, penalties: Array) -> Array:
    """Return coefficients by coordinate descent for falling penalties, shape (penalty, column)."""
    a, out = np.zeros(len(b)), []
    left = b.copy()  # b - G a
    for penalty in penalties:
        for _ in range(SWEEPS):
            most = 0.0
            for k in range(len(b)):
                z = left[k] + a[k]  # columns have unit norm
                new = np.sign(z) * max(abs(z) - penalty, 0.0)
                if new != a[k]:
                    most = max(most, abs(new - a[k]))
                    left -= G[k] * (new - a[k])
                    a[k] = new
            if most < 1e-4 * max(penalty, 1e-12):
                break
        out.append(a.copy())
    return np.array(out)


def by_lasso(r: Residuals) -> tuple[list[int], list[int]]:
    """Return the columns that cross-validation between conditions keeps, first that which explains most.

    Of the penalty with the least error, and of the largest within one standard error of it.
    """
    grams = [x.T @ x for _, x in r.conditions]
    products = [x.T @ y.mean(axis=0) for y, x in r.conditions]
    norm = np.sqrt(sum(np.diag(g) for g in grams))
    unit = np.outer(norm, norm)
    most = max(np.abs(p / norm).max() for p in [*products, sum(products)])
    penalties = PENALTIES * most
    errors = []
    for held, (y, x) in enumerate(r.conditions):
        rest = [c for c in range(len(grams)) if c != held]
        a = _scaled_lasso(sum(grams[c] for c in rest), sum(products[c] for c in rest), penalties)
        for repeat in y:
            fitted = np.einsum("pi,ij,pj->p", a, grams[held], a)
            errors.append(repeat @ repeat - 2 * a @ (x.T @ repeat) + fitted)
    errors = np.array(errors)
    mean, spread = errors.mean(axis=0), errors.std(axis=0, ddof=1) / np.sqrt(len(errors))
    best = int(np.argmin(mean))
    plain = int(np.argmax(mean <= mean[best] + spread[best]))
    path = lasso(sum(grams) / unit, sum(products) / norm, penalties[: best + 1])
    least, sparser = ([int(k) for k in np.argsort(-np.abs(a)) if a[k]] for a in (path[best], path[plain]))
    return least, sparser


def _scaled_lasso(G: Array, b: Array, penalties: Array) -> Array:
    """Return coefficients of columns as they are, of a LASSO with columns of unit norm."""
    norm = np.sqrt(np.maximum(np.diag(G), 1e-12))
    return lasso(G / np.outer(norm, norm), b / norm, penalties) / norm


def answers(ids: Sequence[str], r: Residuals, few: Array) -> dict[str, Answer]:
    """Return what every method says.

    Parameters
    ----------
    ids : sequence of str
        Of the columns.
    r : Residuals
    few : ndarray of int
        One column of each candidate, for the sparse regression.
    """
    steps, n = forward(r), r.y.size
    sparse = Residuals(r.y, r.X[:, few], [(y, x[:, few]) for y, x in r.conditions])
    least, sparser = by_lasso(sparse)
    kept = {
        METHODS[0]: by_bic(steps, n, 0.0),
        METHODS[1]: by_bic(steps, n, 10.0),
        METHODS[2]: by_f_test(steps, n, len(ids)),
        METHODS[3]: [int(few[k]) for k in least],
        METHODS[4]: [int(few[k]) for k in sparser],
    }
    return {name: Answer(list(dict.fromkeys(ids[k] for k in at))) for name, at in kept.items()}


def judged(case: dict[str, Any], answer: Answer) -> dict[str, Any]:
    """Return whether a case is called and named right; a pair by the first two names."""
    places = case["place"]
    words = {i: [*parts, *([places[i]] if places.get(i) else [])] for i, parts in case["effects"].items()}
    same = equivalent(words)
    named = merged(answer.ids)[: max(len(same), 1)]
    right = len(named) == len(same) and all(any(a & s for a in named) for s in same.values())
    return {
        "called": answer.called,
        "named": " ".join(answer.ids[:STEPS]),
        "right": right and answer.called,
        "only": right and answer.called and len(merged(answer.ids)) == len(same),
    }


def run(out: Path) -> Iterator[dict[str, Any]]:
    """Yield a row for each case, metric and method."""
    for kept in sorted(out.glob("*.pickle")):
        m, known, _ = pickle.loads(kept.read_bytes())
        vehicle = Vehicle(kept.stem, m, known)
        few, at = [], 0
        for sized in ~np.isnan(known.size):
            own = np.flatnonzero(sized)
            if own.size:
                few.append(at + int(np.argmin(np.abs(own - 2))))  # nearest to the stratum of 200
            at += own.size
        for path in sorted((out / kept.stem).glob("*/case.json")):
            case = json.loads(path.read_text())
            about = {"vehicle": kept.stem, **{k: case[k] for k in ("case", "kind", "stratum")}}
            for white, r in vehicle.residuals(path.parent, case):
                for method, answer in answers(vehicle.ids, r, np.array(few)).items():
                    yield about | {"white": white, "method": method} | judged(case, answer)
            ideal = case["ideal"]
            scan = Answer([ideal["best"]] if ideal["found"] else [])
            yield about | {"white": "all of them", "method": "ideal scan"} | judged(case, scan)
            print(case["case"], file=sys.stderr, flush=True)


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the Markdown table."""
    strata = sorted({r["stratum"] for r in rows if r["kind"] == "single"})
    head = [
        "method",
        "whitened by",
        "called on nulls",
        *(f"found at {s:g}" for s in strata),
        "first name right, singles found",
        "first name right, all singles",
        "only the truth named, all singles",
        "outsiders called",
        "pairs, both first names right",
    ]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for method in ("ideal scan", *METHODS):
        for white in dict.fromkeys(r["white"] for r in rows if r["method"] == method):
            own = [r for r in rows if r["method"] == method and r["white"] == white]
            single = [r for r in own if r["kind"] == "single"]
            cells = [method, white, rate(r["called"] for r in own if r["kind"] == "null")]
            cells += [rate(r["called"] for r in single if r["stratum"] == s) for s in strata]
            cells.append(rate(r["right"] for r in single if r["called"]))
            cells += [rate(r[w] for r in single) for w in ("right", "only")]
            cells.append(rate(r["called"] for r in own if r["kind"] == "outsider"))
            pairs = [] if method == "ideal scan" else [r for r in own if r["kind"] == "pair"]
            cells.append(rate(r["right"] for r in pairs) if pairs else "-")
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Run all comparators and write their table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("out", type=Path, help="folder of generate.py")
    parser.add_argument("-o", "--output", type=Path, help="Markdown file")
    parser.add_argument("--cases", type=Path, help="CSV file of each case's answers")
    asked = parser.parse_args()
    rows = list(run(asked.out))
    if asked.cases:
        with asked.cases.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    text = table(rows)
    print(text)
    if asked.output:
        asked.output.write_text(f"# Comparators\n\n{__doc__}\n{text}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
