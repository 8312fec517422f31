"""Rows of a campaign: one table a unit of work, in Parquet, and what all of them say, one at a time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from freqid.core.errors import UsageError
from freqid.core.extras import extra
from freqid.core.results.judged.monte_carlo import Measured, wilson
from freqid.workflows.monte_carlo.plan import Setting, label

Columns = Mapping[str, Any]
NUMBERS = ("estimate", "std_error", "lo", "hi", "reference", "value", "r2", "p")
FLAGS = ("covered", "present", "called", "right", "in_set", "inside")
TEXTS = ("quantity", "named", "failure", "unit")
"""Columns that every file has, each of one type also where a unit has nothing in it: programs that read a
folder take the columns and types of its first file for those of all."""
_MOST_FAILURES = 20
"""Sentences of failed cases that are kept; the rows hold all."""


def write_rows(path: Path, setting: Setting, tables: Sequence[tuple[int, Columns]]) -> None:
    """Write the cases of a unit as one Parquet file, with the setting and the seed of every row.

    Parameters
    ----------
    path : Path
    setting : dict
    tables : sequence of (int, mapping)
        Seed, and columns by name; a scalar stands for a column of it.

    Raises
    ------
    UsageError
        Where columns are of several lengths, or have the name of a setting.
    """
    pa, pq = extra("pyarrow", "parquet"), extra("pyarrow.parquet", "parquet")
    parts = []
    for seed, columns in tables:
        clash = sorted({*columns} & {*setting, "seed"})
        if clash:
            raise UsageError(
                f"the stage returns a column '{clash[0]}', which is a setting", remedy="name it otherwise"
            )
        lengths = {n: len(v) for n, v in columns.items() if not np.isscalar(v) and v is not None}
        if len(set(lengths.values())) > 1:
            raise UsageError(f"the stage returns columns of lengths {lengths}", remedy="make them of one")
        count = next(iter(lengths.values()), 1)
        row = {n: label(v) for n, v in setting.items()} | {"seed": seed}
        columns = {n: v if n in lengths else [v] * count for n, v in columns.items()}
        known = {
            **{n: pa.string() for n in TEXTS},
            **{n: pa.float64() for n in NUMBERS},
            **{n: pa.bool_() for n in FLAGS},
        }
        arrays = {n: pa.array([v] * count) for n, v in row.items()}
        for n, kind in known.items():
            arrays[n] = _typed(pa, columns.get(n), kind, count)
        arrays |= {n: pa.array(v) for n, v in columns.items() if n not in known}
        parts.append(pa.table(arrays))
    table = pa.concat_tables(parts, promote_options="default")
    pq.write_table(table, path, compression="zstd")


def _typed(pa: Any, values: Any, kind: Any, count: int) -> Any:
    if values is None:
        return pa.nulls(count, kind)
    if pa.types.is_floating(kind):
        values = np.asarray([np.nan if v is None else v for v in values], dtype=float)
        return pa.array(values, mask=np.isnan(values))
    return pa.array(list(values) if pa.types.is_string(kind) else values, type=kind)


@dataclass
class _Sums:
    """Sums over cases of what one measure needs: a ratio of two sums, with its scatter between cases."""

    hits: float = 0.0
    count: float = 0.0
    hits_hits: float = 0.0
    hits_count: float = 0.0
    count_count: float = 0.0
    cases: int = 0

    def add(self, values: np.ndarray, case: np.ndarray) -> None:
        """Take in values, with the number of the case of each."""
        h = np.bincount(case, weights=values)
        n = np.bincount(case).astype(float)
        h, n = h[n > 0], n[n > 0]
        self.hits += float(h.sum())
        self.count += float(n.sum())
        self.hits_hits += float(h @ h)
        self.hits_count += float(h @ n)
        self.count_count += float(n @ n)
        self.cases += h.size

    @property
    def mean(self) -> float:
        return self.hits / self.count

    @property
    def variance(self) -> float:
        """Of the mean: that of a ratio of sums over cases, which need not be independent inside a case.

        W. G. Cochran, Sampling Techniques, 3rd ed., eq. 6.13 (1977).
        """
        if self.cases < 2:
            return math.inf
        p = self.mean
        spread = max(self.hits_hits - 2 * p * self.hits_count + p * p * self.count_count, 0.0)
        return spread / self.count**2 * self.cases / (self.cases - 1)

    def interval(self, share: bool) -> tuple[float, float]:
        """Return the 95 % interval of the mean; of a share Wilson's, by as many cases as scatter so."""
        p, v = self.mean, self.variance
        if not share:
            half = 1.96 * math.sqrt(v)
            return (p - half, p + half) if math.isfinite(half) else (math.nan, math.nan)
        n = float(self.cases)
        if 0 < p < 1 and 0 < v < math.inf:
            n = min(max(p * (1 - p) / v, 1.0), self.count)
        return wilson(p * n, n)


@dataclass
class Summary:
    """What rows say against an axis, taken in one file at a time."""

    axis: str
    by: str
    sums: dict[tuple[str, Any, str, str], _Sums] = field(default_factory=dict)
    cases: int = 0
    rows: int = 0
    failed: int = 0
    failures: dict[str, int] = field(default_factory=dict)

    def add(self, path: Path) -> None:
        """Take in the rows of a unit.

        Raises
        ------
        UsageError
            Where the rows have no column that makes the curves.
        """
        table = extra("pyarrow.parquet", "parquet").ParquetFile(path).read()
        names = set(table.column_names)
        if self.by and self.by not in names:
            raise UsageError(
                f"the rows have no column '{self.by}' that would make curves",
                remedy=f"choose one of {', '.join(sorted(names))}",
            )
        case = _codes(table, ["seed", *(["trial"] if "trial" in names else [])])
        self.rows += table.num_rows
        at = table.column(self.axis)[0].as_py() if self.axis else 0.0
        curves = _labels(table, self.by) if self.by else {"": np.ones(table.num_rows, dtype=bool)}
        quantities = _labels(table, "quantity")
        failed = np.asarray(table.column("failure").is_valid())
        self.cases += int(case.max()) + 1
        self.failed += np.unique(case[failed]).size
        for text in table.column("failure").drop_null().to_pylist():
            if text in self.failures or len(self.failures) < _MOST_FAILURES:
                self.failures[text] = self.failures.get(text, 0) + 1
        for measure, values, known in _measures(table, failed):
            for curve, inside in curves.items():
                chosen = known & inside
                if not chosen.any():
                    continue
                if measure != "value":
                    self._sum(measure, at, curve, "").add(values[chosen], case[chosen])
                if measure in ("coverage", "bias", "scatter", "value"):
                    for quantity, rows in quantities.items():
                        one = chosen & rows
                        if one.any():
                            self._sum(measure, at, curve, quantity).add(values[one], case[one])

    def _sum(self, measure: str, at: Any, curve: str, quantity: str) -> _Sums:
        return self.sums.setdefault((measure, at, curve, quantity), _Sums())

    def measured(self) -> tuple[Measured, ...]:
        """Return each measure, by place on the axis, curve and quantity."""
        found = []
        for (measure, at, curve, quantity), s in self.sums.items():
            value, (lo, hi) = s.mean, s.interval(measure not in ("bias", "scatter", "value"))
            if measure == "scatter":  # sums are of squares
                value, lo, hi = (math.sqrt(max(x, 0.0)) if x == x else x for x in (value, lo, hi))
            found.append(Measured(measure, at, curve, quantity, value, lo, hi, int(s.count), s.cases))
        return tuple(found)


def summary_of(paths: Iterable[Path], axis: str, by: str = "") -> Summary:
    """Return what the rows of all units say; never more than one unit is in memory."""
    summary = Summary(axis, by)
    for path in paths:
        summary.add(path)
    return summary


def _measures(table: Any, failed: np.ndarray) -> Iterable[tuple[str, np.ndarray, np.ndarray]]:
    """Yield each measure that rows have: its name, values, and of which rows."""
    columns = {n: _column(table, n) for n in (*NUMBERS, *FLAGS)}
    yield "failed", failed.astype(float), np.ones(failed.size, dtype=bool)
    covered, known = columns["covered"]
    (lo, lo_known), (hi, hi_known), (truth, truth_known) = (columns[n] for n in ("lo", "hi", "reference"))
    if not known.any():
        covered, known = ((lo <= truth) & (truth <= hi)).astype(float), lo_known & hi_known & truth_known
    yield "coverage", covered, known
    (estimate, estimated), (error, with_error) = columns["estimate"], columns["std_error"]
    known = estimated & with_error & truth_known & (np.nan_to_num(error) > 0)
    normalised = np.divide(estimate - truth, error, out=np.zeros_like(error), where=known)
    yield "bias", normalised, known
    yield "scatter", normalised**2, known
    (called, said), (present, stated) = columns["called"], columns["present"]
    yield "detection", called, said & stated & (present > 0)
    yield "alarm", called, said & stated & (present == 0)
    yield "right", *columns["right"]
    yield "value", *columns["value"]


def _column(table: Any, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return a column as numbers, and where it is known."""
    column = table.column(name)
    known = np.asarray(column.is_valid())
    kind = extra("pyarrow", "parquet").float64()
    return np.nan_to_num(np.asarray(column.cast(kind), dtype=float)), known


def _labels(table: Any, name: str) -> dict[str, np.ndarray]:
    """Return by value of a column the rows that have it."""
    coded = table.column(name).combine_chunks().dictionary_encode()
    codes = np.asarray(coded.indices.fill_null(-1))
    return {str(v): codes == i for i, v in enumerate(coded.dictionary.to_pylist())}


def _codes(table: Any, names: list[str]) -> np.ndarray:
    """Return the number of each row's case: rows of one seed, and trial where that is there, are one."""
    codes = np.zeros(table.num_rows, dtype=np.int64)
    for name in names:
        values = np.asarray(table.column(name))
        _, inverse = np.unique(values, return_inverse=True)
        codes = codes * (int(inverse.max()) + 1) + inverse
    return np.unique(codes, return_inverse=True)[1]
