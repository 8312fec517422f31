"""A calibration from known cases: evidence and truths in, a table of how evidence becomes probability out.

References
----------
G. W. Brier, "Verification of forecasts expressed in terms of probability", Monthly Weather Review 78, 1950;
T. Gneiting, A. E. Raftery, "Strictly proper scoring rules, prediction, and estimation", Journal of the
American Statistical Association 102, 2007; V. Vovk, A. Gammerman, G. Shafer,
*Algorithmic Learning in a Random World*, Springer, 2005, sec. 4.2 (split-conformal sets).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from freqid.gap.attribute import NONE
from freqid.gap.calibrate import Table, chances

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

RANGES: dict[str, tuple[float, float]] = {
    "form_error": (0.02, 0.6),
    "temperature": (0.5, 20.0),
    "other": (-6.0, 6.0),
    "none": (-6.0, 6.0),
    "missed": (-6.0, 6.0),
    "missed_slope": (0.0, 4.0),
}
"""Numbers of a table that known cases can settle, and between what."""

UNCALIBRATED = Table()

_RATIOS = ("form_error", "temperature")  # fitted as logarithms
_HELD = 0.0005  # score that a number costs by which a table moves away from where it began


@dataclass(frozen=True, eq=False)
class KnownCases:
    """What evidence said in cases whose truth is known.

    Attributes
    ----------
    names : tuple of str
        Effects and *other*.
    evidence : ndarray, shape (case, name)
        Log Bayes factors against no effect; NaN for what was not judged.
    right : ndarray of bool, shape (case, name + 1)
        Names that count as right, the last being *none*; several where the case cannot tell them apart.
    exists : ndarray of bool, shape (case,)
        Whether a gap was called.
    weight : ndarray, shape (case,)
        How much each counts.
    """

    names: tuple[str, ...]
    evidence: Array
    right: Flags
    exists: Flags
    weight: Array

    @classmethod
    def of(
        cls,
        logs: Sequence[Mapping[str, float]],
        truths: Sequence[str | Sequence[str]],
        exists: Sequence[bool],
        weight: Sequence[float] | None = None,
    ) -> KnownCases:
        """Gather cases one by one.

        Parameters
        ----------
        logs : sequence of dict of float
            Evidence by name, of singles and *other*.
        truths : sequence of str or sequence of str
            The right name, or all names that count as right.
        exists : sequence of bool
        weight : sequence of float, optional

        Raises
        ------
        ValueError
            Where the sequences are not of one length.
        """
        names = tuple(dict.fromkeys(n for one in logs for n in one))
        evidence = np.array([[one.get(n, np.nan) for n in names] for one in logs]).reshape(
            len(logs), len(names)
        )
        every = (*names, NONE)
        classes = [(t,) if isinstance(t, str) else tuple(t) for t in truths]
        right = np.array([[n in c for n in every] for c in classes]).reshape(len(truths), len(every))
        if not len(evidence) == len(right) == len(exists):
            raise ValueError(f"{len(evidence)} cases, {len(right)} truths and {len(exists)} flags")
        counted = np.ones(len(right)) if weight is None else np.asarray(weight, dtype=np.float64)
        return cls(names, evidence, right, np.asarray(exists, dtype=bool), counted)

    def only(self, at: NDArray[np.intp] | Flags) -> KnownCases:
        """Return some of the cases."""
        return KnownCases(self.names, self.evidence[at], self.right[at], self.exists[at], self.weight[at])

    def chances(self, table: Table) -> Array:
        """Return the probabilities that a table gives, shape (case, name + 1)."""
        return chances(self.names, self.evidence, self.exists, table)

    def score(self, table: Table) -> float:
        """Return the mean Brier score: 0 is best, 2 worst; names that count as right are one.

        A lost case costs no more than 2: by the logarithm of the probability a few of them make a table doubt
        all others.
        """
        each = self.chances(table)
        right = np.where(self.right, each, 0.0).sum(axis=1)
        wrong = np.where(self.right, 0.0, each**2).sum(axis=1)
        return float(np.average((1 - right) ** 2 + wrong, weights=self.weight))

    def before(self, table: Table) -> Array:
        """Return the probability of all names that are likelier than the first right one, shape (case,).

        A set that is filled to a level holds a right name where this is below the level.
        """
        each = self.chances(table)
        order = np.argsort(-each, axis=1, kind="stable")
        ranked = np.take_along_axis(each, order, axis=1)
        right = np.take_along_axis(self.right, order, axis=1)
        likelier = np.cumsum(ranked, axis=1) - ranked
        found = likelier[np.arange(len(each)), right.argmax(axis=1)]
        return np.where(right.any(axis=1), np.clip(found, 0.0, 1.0), 1.0)


def fit_table(
    cases: KnownCases,
    base: Table = UNCALIBRATED,
    *,
    fitted: Sequence[str] = tuple(RANGES),
    coverage: float = 0.90,
    source: str = "known cases",
) -> Table:
    """Return the table with the best Brier score on known cases, and sets that hold the truth.

    Parameters
    ----------
    cases : KnownCases
    base : Table
        Where the search begins; what is not fitted stays as it is there.
    fitted : sequence of str
        Names of `RANGES`.
    coverage : float
        Share of the cases in which the set shall hold a right name, where a gap is called and where not.
    source : str
        What the table will say that it was made of.

    Raises
    ------
    ValueError
        Where there is no case.
    """
    if not len(cases.right):
        raise ValueError("there is no case to calibrate on")
    low, high = np.array([RANGES[n] for n in fitted]).reshape(-1, 2).T
    ratio = np.array([n in _RATIOS for n in fitted], dtype=bool)
    start = np.clip([getattr(base, n) for n in fitted], low, high)

    def table_at(x: Array) -> Table:
        values = np.clip(np.where(ratio, np.exp(np.where(ratio, x, 0.0)), x), low, high)
        return replace(base, **dict(zip(fitted, values.tolist(), strict=True)))

    def loss(x: Array) -> float:
        return cases.score(table_at(x)) + _HELD * float(((x - begin) ** 2).sum())

    begin = np.where(ratio, np.log(np.where(ratio, start, 1.0)), start)
    found = begin
    if len(fitted):
        simplex = np.concatenate([begin[None], begin + 0.5 * np.eye(len(begin))])
        options: Any = {"xatol": 0.01, "fatol": 1e-6, "maxiter": 400, "initial_simplex": simplex}
        found = minimize(loss, begin, method="Nelder-Mead", options=options).x
    table = table_at(found)
    return replace(
        table,
        set_level=set_level(cases.only(cases.exists), table, coverage, table.set_level),
        uncalled_set_level=set_level(cases.only(~cases.exists), table, coverage, table.uncalled_set_level),
        calibrated=True,
        source=source,
    )


def set_level(cases: KnownCases, table: Table, coverage: float, otherwise: float) -> float:
    """Return the cumulative probability to which sets are filled, so that they hold a right name as often.

    The split-conformal quantile of `KnownCases.before`. Cases in which a gap was called and those in which
    none was are taken apart, for what one knows is another (Mondrian predictors: Vovk et al., ch. 4).

    Parameters
    ----------
    cases : KnownCases
    table : Table
    coverage : float
    otherwise : float
        What is returned without any case.
    """
    if not len(cases.right):
        return otherwise
    above, weight = cases.before(table), cases.weight
    order = np.argsort(above)
    share = np.cumsum(weight[order]) / (weight.sum() + weight.mean())  # the case to come counts as the worst
    at = int(np.searchsorted(share, coverage))
    if at >= len(order):
        return 1.0
    return float(np.clip(np.nextafter(above[order][at], 2.0), 1e-6, 1.0))


def cross_fitted(
    cases: KnownCases,
    base: Table = UNCALIBRATED,
    *,
    fold: NDArray[np.intp],
    fitted: Sequence[str] = tuple(RANGES),
    coverage: float = 0.90,
) -> list[Table]:
    """Return for each fold the table that is fitted to all others: what it says there it has not seen.

    Parameters
    ----------
    cases : KnownCases
    base : Table
    fold : ndarray of int, shape (case,)
        From 0; cases that share draws, flights or truths belong in one fold.
    fitted : sequence of str
    coverage : float
    """
    return [
        fit_table(cases.only(fold != k), base, fitted=fitted, coverage=coverage)
        for k in range(int(fold.max(initial=0)) + 1)
    ]
