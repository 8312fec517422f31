"""Rows of a residual over one manoeuvre."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from freqid.core.arrays import Array

Kind = Literal["response", "actuator", "kinematic"]


@dataclass(frozen=True)
class Row:
    """One channel of a residual.

    Attributes
    ----------
    name : str
        ``M``; ``actuator/de1``; ``kinematic/w``.
    unit : str
    kind : {"response", "actuator", "kinematic"}
        Where a gap in it acts: in the loads, between command and position, or in the sensors.
    """

    name: str
    unit: str
    kind: Kind


@dataclass(frozen=True, eq=False)
class Histories:
    """Rows over one manoeuvre as ``direct + d(momentum)/dt``: nothing measured need be differentiated.

    Attributes
    ----------
    rows : tuple of Row
    direct : ndarray, shape (row, sample)
    momentum : ndarray, shape (row, sample)
        Unit of the row times s.
    """

    rows: tuple[Row, ...]
    direct: Array
    momentum: Array

    def __sub__(self, other: Histories) -> Histories:
        return Histories(self.rows, self.direct - other.direct, self.momentum - other.momentum)

    def __add__(self, other: Histories) -> Histories:
        return Histories(self.rows, self.direct + other.direct, self.momentum + other.momentum)

    def __mul__(self, factor: float) -> Histories:
        return Histories(self.rows, factor * self.direct, factor * self.momentum)
