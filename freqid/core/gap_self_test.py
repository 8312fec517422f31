"""What a diagnosis would have found on the user's own simulation and flights, had each effect been there."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

SEVERAL = "several"
"""Answer of draws in which a gap was called and the set holds more than one name or alias group."""

ENDS = ("other", SEVERAL, "none")
"""Answers that are no effect."""


@dataclass(frozen=True)
class Rate:
    """How often something happened.

    Attributes
    ----------
    count, of : int
    lo, hi : float
        95 % Wilson interval of the share; 0 and 1 where there was no occasion.
    """

    count: int
    of: int
    lo: float
    hi: float

    @property
    def share(self) -> float:
        """Count over occasions; NaN where there was none."""
        return self.count / self.of if self.of else math.nan

    @classmethod
    def over(cls, flags: Iterable[bool]) -> Rate:
        """Return the rate of what is true (E. B. Wilson, JASA 22, 1927)."""
        known = [bool(f) for f in flags]
        count, n, z = sum(known), len(known), 1.96
        if not n:
            return cls(0, 0, 0.0, 1.0)
        middle = (count + z**2 / 2) / (n + z**2)
        half = z * math.sqrt(count * (n - count) / n + z**2 / 4) / (n + z**2)
        return cls(count, n, max(middle - half, 0.0), min(middle + half, 1.0))


@dataclass(frozen=True)
class Reach:
    """What size of an effect is found at one of its places.

    Attributes
    ----------
    effect, parameter : str
        The parameter that was set, with the value of another where one was given: ``size|at=0.3``.
    unit : str
    size : float
        Found in 95 of 100 draws, as a change of the parameter; NaN where no size within its range is.
    detectability : float
        ``s^T S^-1 s`` of it.
    linear : float
        The size that the first-order formula states.
    largest : float
        Size up to which the effect was inserted.
    """

    effect: str
    parameter: str
    unit: str
    size: float
    detectability: float
    linear: float
    largest: float


@dataclass(frozen=True)
class Stratum:
    """What was answered to insertions of one detectability.

    Attributes
    ----------
    detectability : float
    answers : dict of dict of int
        Draws by inserted effect and by answer: an effect, ``other``, ``several``, or ``none`` where no gap
        was called or no effect explains it. A group of aliases that holds the truth counts as its name.
    detected, named, right, covered : Rate
        A gap called, of all; one name or alias group given, of those; the right one, of those; the set
        holds the truth or an alias of it, of those detected.
    """

    detectability: float
    answers: dict[str, dict[str, int]]
    detected: Rate
    named: Rate
    right: Rate
    covered: Rate

    def shares(self) -> tuple[list[str], list[str], list[list[float]]]:
        """Return effects inserted, answers given, and the share of each answer, by effect."""
        rows = list(self.answers)
        seen = {a for row in self.answers.values() for a in row}
        rest = sorted(a for a in seen if a not in rows and a not in ENDS)
        columns = [*rows, *rest, *(a for a in ENDS if a in seen)]
        total = {n: max(sum(row.values()), 1) for n, row in self.answers.items()}
        return rows, columns, [[self.answers[n].get(a, 0) / total[n] for a in columns] for n in rows]


@dataclass(frozen=True)
class SelfTest:
    """A diagnosis tried on insertions whose truth is known.

    Attributes
    ----------
    draws : int
        Of noise and tolerances, for each inserted effect and detectability.
    level : float
        At which a gap was called.
    form_error : float
        By how much, relative to its size, each insertion of the answers was made unlike its own formula.
    reach : tuple of Reach
    strata : tuple of Stratum
    false_alarm : Rate
        Of draws with nothing inserted, each half judged by the other.
    outside : dict of Rate
        Insertions whose effect was taken out of the library: ``named`` wrongly, ``other``, ``several``,
        ``none``.
    table : dict of float
        The calibration that was fitted.
    score : dict of float
        Mean Brier score (0 is best), ``before`` and ``after`` calibration, cross-fitted.
    not_inserted : dict of str
        Why, by effect.
    """

    draws: int
    level: float
    form_error: float
    reach: tuple[Reach, ...]
    strata: tuple[Stratum, ...]
    false_alarm: Rate
    outside: dict[str, Rate]
    table: dict[str, float]
    score: dict[str, float]
    not_inserted: dict[str, str] = field(default_factory=dict)
