"""The table of open cases: how often a gap is found, named, placed and closed, with Wilson intervals.

    python benchmarks/gap/table.py FOLDER...

Folders are those of run.py; ``cases.csv`` beside this script gets one row a case, and ``cases.tar.xz`` all
that the diagnosis said of each. Without a folder the table is made of the former. Probabilities are
cross-fitted: each case is told by a calibration that has not seen it.
"""

from __future__ import annotations

import csv
import sys
import tarfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from known import known_cases, read
from rows import STRATA, row_of

from freqid.core.store import replacing
from freqid.gap.fit_table import cross_fitted, fit_table

CSV = Path(__file__).resolve().with_name("cases.csv")
KEPT = CSV.with_suffix(".tar.xz")
FOLDS = 5


def rate(flags: Iterable[Any]) -> str:
    """Return a rate, its count and its 95 % Wilson interval."""
    values = [int(f) for f in flags if f != ""]
    n = len(values)
    if not n:
        return "no cases"
    share, z = sum(values) / n, 1.96
    middle = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z * np.sqrt(share * (1 - share) / n + z**2 / (4 * n**2)) / (1 + z**2 / n)
    return (
        f"{100 * share:5.1f} %  {sum(values)}/{n}  [{100 * (middle - half):.0f}, {100 * (middle + half):.0f}]"
    )


def _mean(values: Iterable[Any]) -> str:
    known = np.array([float(v) for v in values if v not in ("", None, "nan")])
    if not known.size:
        return "no cases"
    error = known.std() / np.sqrt(known.size)
    return f"{known.mean():.3f} +- {error:.3f}  n {known.size}, median {np.median(known):.3f}"


def _pooled(rows: Sequence[dict[str, Any]], flag: str) -> str:
    """Return the mean of the strata's rates."""
    each = [[int(r[flag]) for r in rows if r[flag] != "" and int(r["stratum"]) == s] for s in STRATA]
    known = [np.mean(e) for e in each if e]
    return f"{100 * np.mean(known):5.1f} % over {len(known)} strata" if known else "no cases"


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the lines of the table."""
    of = {k: [r for r in rows if r["kind"] == k] for k in ("null", "single", "double", "outside")}
    calm = [r for r in of["null"] if not float(r["gusts"])]
    single = [r for r in of["single"] if int(r["stratum"])]
    found = [r for r in single if int(r["detected"])]
    seen = [r for r in single if int(r["stratum"]) >= 50]
    both = [
        (int(r["pair"] == "+".join(sorted(r["truth"].split("+")))), int(r["stratum"])) for r in of["double"]
    ]
    either = [int(r["top"] in r["truth"].split("+")) for r in of["double"]]
    naive = [int(float(r["naive_p"]) < 0.02) for r in of["null"]]
    ratios = [
        float(r["G"]) / float(r["oracle_G"]) for r in single if _number(r["G"]) and _number(r["oracle_G"])
    ]
    lines = [
        f"cases {len(rows)}: " + ", ".join(f"{k} {len(v)}" for k, v in of.items()),
        f"false alarm on nulls             {rate(r['detected'] for r in of['null'])}",
        f"  without gusts                  {rate(r['detected'] for r in calm)}",
        f"  by chi-square, no tolerances   {rate(naive)}",
    ]
    for s in STRATA:
        here = [r for r in single if int(r["stratum"]) == s]
        lines.append(f"lambda {s:3d}: detection            {rate(r['detected'] for r in here)}")
        lines.append(f"  right name when named          {rate(r['right'] for r in here)}")
        lines.append(f"  named                          {rate(r['named'] for r in here)}")
        lines.append(f"  probability on the truth       {_mean(r['p_truth'] for r in here)}")
        lines.append(f"  on it and its aliases          {_mean(r['p_class'] for r in here)}")
    lines += [
        f"detection, pooled                {_pooled(single, 'detected')}",
        f"  of all                         {rate(r['detected'] for r in single)}",
        f"right name when named, pooled    {_pooled(found, 'right')}",
        f"  of all                         {rate(r['right'] for r in found)}",
        f"answer rate, of those found      {rate(r['named'] for r in found)}",
        f"  with nothing else in the set   {rate(r['alone'] for r in found)}",
        f"mean probability on the truth    {_mean(r['p_truth'] for r in single)}",
        f"  with its aliases               {_mean(r['p_class'] for r in single)}",
        f"Brier score                      {_mean(r['brier'] for r in single)}",
        *(
            f"F1 of {a:<6}                     {_mean(r[f'f1_{a}'] for r in single)}"
            for a in ("row", "band", "input")
        ),
        *(
            f"  {a + ', lambda >= 50':<31}{_mean(r[f'f1_{a}'] for r in seen)}"
            for a in ("row", "band", "input")
        ),
        f"outside: wrongly named           {rate(r['named'] for r in of['outside'])}",
        f"set holds the truth              {rate(r['set_covers'] for r in single)}",
        f"90 % intervals, own forms        {rate(r['interval_covers'] for r in single)}",
        f"G of the true effect             {_mean(r['G'] for r in single)}",
        f"G of the oracle                  {_mean(r['oracle_G'] for r in single)}",
        f"G over the oracle's              {_mean(ratios)}",
        f"doubles: both named as a pair    {rate(right for right, _ in both)}",
        f"  both of stratum 50 or 200      {rate(right for right, stratum in both if stratum >= 50)}",
        f"doubles: top is one of them      {rate(either)}",
        f"called a pair: singles found     {rate(int(bool(r['pair'])) for r in found)}",
        f"  the truth is in it             {rate(_in_pair(r) for r in found if r['pair'])}",
        f"  outside                        {rate(int(bool(r['pair'])) for r in of['outside'])}",
        f"  nulls                          {rate(int(bool(r['pair'])) for r in of['null'])}",
        f"verdicts, a name or a pair: right {rate(_verdicts(found))}",
        f"  given outside                  {rate(_given(r) for r in of['outside'])}",
        "comparators, right name of all singles (aliases merged):",
        f"  this tool's likeliest          {rate(int(_top_right(r)) for r in single)}",
        f"  the same, an effect always     {rate(r['likeliest_right'] for r in single)}",
        f"  criterion alone (BIC)          {rate(r['bic_right'] for r in single)}",
        f"  largest residual reduction     {rate(r['gain_right'] for r in single)}",
        f"  sparse regression's first      {rate(r['sparse_right'] for r in single)}",
        "right name when one is given, and names given to nulls:",
        *(_when_named(label, how, single, of["null"]) for label, how in _NAMERS),
        "Brier score of all cases but pairs:",
        *(
            f"  {label:<30} {_mean(r[column] for r in rows if r['kind'] != 'double')}"
            for label, column in _TOOLS
        ),
        "Brier score of singles and nulls, each by half:",
        *(f"  {label:<30} {_halved(single, of['null'], column):.3f}" for label, column in _TOOLS),
        "Brier score of singles:",
        f"  this tool                      {_mean(r['brier'] for r in single)}",
        f"  criterion alone (BIC)          {_mean(r['bic_brier'] for r in single)}",
        f"  largest residual reduction     {_mean(r['gain_brier'] for r in single)}",
        f"  sparse regression's first      {_mean(r['sparse_brier'] for r in single)}",
        "the same, given that there is a gap:",
        f"  this tool                      {_mean(r['given_brier'] for r in single)}",
        f"  criterion alone (BIC)          {_mean(r['bic_given_brier'] for r in single)}",
        "by effect: found, top name right, of",
    ]
    for name in sorted({r["truth"] for r in single}):
        here = [r for r in single if r["truth"] == name]
        tops = " ".join(r["top"] if int(r["detected"]) else "-" for r in here)
        lines.append(f"  {name:<22} {sum(int(r['detected']) for r in here)}/{len(here)}  {tops}")
    return lines


def _in_pair(row: dict[str, Any]) -> int:
    """Return whether the truth is one of the two effects that are called."""
    return int(row["truth"] in row["pair"].split("+"))


def _given(row: dict[str, Any]) -> int:
    """Return whether the verdict gives a pair or a name; a pair comes before a name, as in `verdict`."""
    return int(bool(row["pair"]) or bool(int(row["named"])))


def _verdicts(found: Sequence[dict[str, Any]]) -> list[int]:
    """Return of single effects that are given a name or a pair whether it is the name alone, and right."""
    return [int(not r["pair"] and bool(int(r["right"]))) for r in found if _given(r)]


_TOOLS = (
    ("this tool", "brier"),
    ("criterion alone (BIC)", "bic_brier"),
    ("largest residual reduction", "gain_brier"),
    ("sparse regression's first", "sparse_brier"),
)


_NAMERS = (
    ("this tool", ""),
    ("criterion alone (BIC)", "bic_"),
    ("largest residual reduction", "gain_"),
    ("sparse regression's first", "sparse_"),
)


def _when_named(
    label: str, how: str, single: Sequence[dict[str, Any]], null: Sequence[dict[str, Any]]
) -> str:
    """Return how often a name that is given is right, and how often one is given where there is nothing."""
    right = rate(r[f"{how}right"] for r in single if int(r[f"{how}named"]))
    return f"  {label:<30} {right}; nulls {rate(r[f'{how}named'] for r in null)}"


def _halved(single: Sequence[dict[str, Any]], null: Sequence[dict[str, Any]], column: str) -> float:
    """Return the mean of a score over both kinds, each by half."""
    return float(np.mean([np.mean([float(r[column]) for r in k]) for k in (single, null) if k]))


def _top_right(row: dict[str, Any]) -> bool:
    return row["top"] == row["truth"] or (float(row["p_class"]) >= float(row["p_top"]) - 1e-9)


def _number(value: Any) -> bool:
    return value not in ("", None) and np.isfinite(float(value)) and abs(float(value)) > 1e-9


def _of_c172p(found: dict[str, Any]) -> bool:
    return found["case"].get("vehicle") == "c172p"


def keep(folders: Sequence[str | Path]) -> None:
    """Keep cases and sizes of folders, by the name of each, so that a run can go on from them."""
    with replacing(KEPT) as partial, tarfile.open(partial, "w:xz") as archive:
        for folder in map(Path, folders):
            for path in sorted(p for p in folder.glob("*/*.json") if p.name != "units.json"):
                archive.add(path, str(path.relative_to(folder.parent)), filter=_anonymous)


def _anonymous(entry: tarfile.TarInfo) -> tarfile.TarInfo:
    """Return an entry without who made it and when: the same cases are the same bytes."""
    entry.uid = entry.gid = entry.mtime = 0
    entry.uname = entry.gname = ""
    return entry


def main() -> None:
    if len(sys.argv) > 1:
        keep(sys.argv[1:])
        found = read(sys.argv[1:])
        # seeds count the truth in hundreds: a truth's strata are left out together
        fold = np.array([(f["case"]["seed"] + f["case"]["seed"] // 100) % FOLDS for f in found])
        tables = cross_fitted(known_cases(found), fold=fold)
        rows = [row_of(f, tables[k]) for f, k in zip(found, fold, strict=True)]
        rows.sort(key=lambda r: (r["vehicle"], r["kind"], r["truth"], r["form"], r["stratum"], r["seed"]))
        with CSV.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
        by_la8 = fit_table(known_cases([f for f in found if not _of_c172p(f)]))
        told = [row_of(f, by_la8) for f in found if _of_c172p(f)]
        print("c172p by the calibration of the la8 alone\n" + "\n".join(table(told)) + "\n")
    with CSV.open(newline="") as file:
        known = list(csv.DictReader(file))
    print("\n".join(table(known)))
    for vehicle in sorted({r["vehicle"] for r in known}):
        print(f"\n{vehicle} alone\n" + "\n".join(table([r for r in known if r["vehicle"] == vehicle])))


if __name__ == "__main__":
    main()
