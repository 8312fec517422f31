"""What a Monte Carlo campaign says: coverage, bias, detections and false alarms against an axis."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import msgspec

from freqid.core.layout import ResultFile, finite_table, table_with_nan
from freqid.core.viewable import Viewable

MEASURES = {
    "coverage": "95 % intervals that hold the reference",
    "bias": "Mean error over its standard error",
    "scatter": "Root mean square of error over standard error",
    "detection": "Gaps that are called, of flights with an effect",
    "alarm": "Gaps that are called, of flights without an effect",
    "right": "Right names, of names given to an effect",
    "value": "Mean of what the stage measured",
    "failed": "Cases without a result",
}
"""Meaning by measure, in the order that a page shows them."""

SHARES = ("coverage", "detection", "alarm", "right", "failed")
"""Measures that are shares from 0 to 1."""


def wilson(hits: float, count: float) -> tuple[float, float]:
    """Return the 95 % interval of a share (E. B. Wilson, JASA 22, 1927)."""
    z = 1.96
    middle = (hits + z**2 / 2) / (count + z**2)
    half = z * math.sqrt(max(hits * (count - hits) / count, 0.0) + z**2 / 4) / (count + z**2)
    return max(middle - half, 0.0), min(middle + half, 1.0)


@dataclass(frozen=True)
class Measured:
    """One measure at one place.

    Attributes
    ----------
    measure : str
        One of `MEASURES`.
    at : float or str
        Value of the axis.
    curve : str
        Value of the setting that makes curves; empty without one.
    quantity : str
        What it is of, such as ``M.de1``; empty over all quantities.
    mean, lo, hi : float
        With its 95 % interval, which allows for rows of one case not being independent; NaN where a single
        case does not tell it.
    count, cases : int
        Rows, and cases that they are from.
    """

    measure: str
    at: float | str
    curve: str
    quantity: str
    mean: float
    lo: float
    hi: float
    count: int
    cases: int


@dataclass(frozen=True)
class MonteCarlo(Viewable):
    """A Monte Carlo campaign, summed up.

    Attributes
    ----------
    stage : str
        What was done with each case.
    axis : str
        Setting that measures are stated against; empty where none varies.
    by : str
        Setting or column that makes curves; empty where there are none.
    measured : tuple of Measured
    settings : dict
        Values of every setting by name.
    cases, rows, failed : int
        Cases, rows of all, and cases without a result.
    failures : dict of int
        Cases by the sentence that said why; the first few sentences.
    provenance : dict
    """

    stage: str
    axis: str
    by: str
    measured: tuple[Measured, ...]
    settings: dict[str, list[Any]]
    cases: int
    rows: int
    failed: int
    failures: dict[str, int] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<MonteCarlo of {self.cases} cases, stage {self.stage!r}, against {self.axis or 'nothing'!r}>"

    @property
    def measures(self) -> list[str]:
        """Measures that there are, in the order of `MEASURES`."""
        there = {m.measure for m in self.measured}
        return [name for name in MEASURES if name in there]

    @property
    def curves(self) -> list[str]:
        """Values of the setting that makes curves."""
        return list(dict.fromkeys(m.curve for m in self.measured))

    @property
    def axis_values(self) -> list[float | str]:
        """Values of the axis: numbers ascending, texts as they were stated."""
        found = list(dict.fromkeys(m.at for m in self.measured))
        return sorted(found) if all(isinstance(v, int | float) for v in found) else found

    def of(self, measure: str, quantity: str = "", curve: str | None = None) -> list[Measured]:
        """Return one measure along the axis.

        Parameters
        ----------
        measure : str
            One of `MEASURES`.
        quantity : str
            Over all quantities where empty.
        curve : str, optional
            Of all curves where absent.
        """
        place = {at: i for i, at in enumerate(self.axis_values)}
        found = [
            m
            for m in self.measured
            if m.measure == measure and m.quantity == quantity and curve in (None, m.curve)
        ]
        return sorted(found, key=lambda m: (m.curve, place[m.at]))

    def to_json(self) -> dict[str, Any]:
        """Return numbers, strings, lists and tables; limits that are not known are null."""
        return finite_table(asdict(self))

    @classmethod
    def from_json(cls, table: Mapping[str, Any]) -> MonteCarlo:
        """Return the campaign that `to_json` made a table of.

        Parameters
        ----------
        table : mapping
            JSON-compatible.

        Raises
        ------
        ValueError
            Where the table is none of a campaign.
        """
        try:
            return msgspec.convert({**table, "measured": table_with_nan(table["measured"])}, cls)
        except (msgspec.ValidationError, LookupError, TypeError) as error:
            raise ValueError(str(error)) from None


FILE = ResultFile("freqid-monte-carlo", MonteCarlo, {}, table="campaign")
write_monte_carlo, read_monte_carlo = FILE.write, FILE.read
