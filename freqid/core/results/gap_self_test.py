"""What a diagnosis finds of effects that were inserted into the user's own simulation along the flights."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

from freqid.core.results.judged.monte_carlo import wilson

SEVERAL = "several"
"""Answer of draws in which a gap was called and no single name, or group of aliases, is likely enough."""

ENDS = ("other", SEVERAL, "none")
"""Answers that are no effect."""

ACCURACY = 0.05
"""To which a stated probability is meant; a smaller error is said, and leaves it calibrated."""


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
        """Return the rate of what is true."""
        known = list(flags)
        return cls(sum(known), len(known), *(wilson(sum(known), len(known)) if known else (0.0, 1.0)))


@dataclass(frozen=True)
class SmallestSize:
    """The size of an effect at one of its places from which it is called a gap in 95 of 100 draws.

    Attributes
    ----------
    effect, place : str
    unit : str
    size : float
        NaN where no size within its range is.
    detectability : float
        ``s' S^-1 s`` of it.
    largest : float
        Size up to which was looked.
    """

    effect: str
    place: str
    unit: str
    size: float
    detectability: float
    largest: float


@dataclass(frozen=True)
class Stratum:
    """What was answered to insertions of one detectability.

    Attributes
    ----------
    detectability : float
    answers : dict of dict of int
        Draws by inserted effect and by answer: an effect, ``other``, ``several``, or ``none`` where no gap
        was called. A group of aliases that holds the truth counts as its name.
    detected, named, right, covered : Rate
        A gap called, of all; one name or alias group given, of those; the right one, of those named; the set
        holds the truth or an alias of it, of those detected.
    truth_probability : float
        Mean probability given to the truth, of those detected.
    """

    detectability: float
    answers: dict[str, dict[str, int]]
    detected: Rate
    named: Rate
    right: Rate
    covered: Rate
    truth_probability: float

    def shares(self) -> tuple[list[str], list[str], list[list[float]]]:
        """Return effects inserted, answers given, and the share of each answer, by effect."""
        rows = list(self.answers)
        seen = {a for row in self.answers.values() for a in row}
        rest = sorted(a for a in seen if a not in rows and a not in ENDS)
        columns = [*rows, *rest, *(a for a in ENDS if a in seen)]
        total = {n: max(sum(row.values()), 1) for n, row in self.answers.items()}
        return rows, columns, [[self.answers[n].get(a, 0) / total[n] for a in columns] for n in rows]


@dataclass(frozen=True)
class ReliabilityBin:
    """Answers whose probability lies in one range.

    Attributes
    ----------
    low, high : float
    probability : float
        Mean of those given; NaN where there are none.
    right : Rate
    """

    low: float
    high: float
    probability: float
    right: Rate


@dataclass(frozen=True)
class Reliability:
    """What was given to the likeliest effect beside how often it was the truth.

    Of draws in which a gap was called. The likeliest effect counts with those that it cannot be told from.

    Attributes
    ----------
    probability : float
        Mean of those given.
    right : Rate
    error : float
        One standard error of the share that was right less the probability given. Draws of one insertion are
        not independent of each other, so it is counted by insertions.
    insertions : int
        That were called a gap at least once.
    bins : tuple of ReliabilityBin
    """

    probability: float
    right: Rate
    error: float
    insertions: int
    bins: tuple[ReliabilityBin, ...] = ()

    @property
    def off(self) -> float:
        """Share that was right less the probability given; positive where the probabilities are too low."""
        return self.right.share - self.probability

    @property
    def beyond_counting(self) -> bool:
        """Whether probabilities are off by more than the 95 % error of counting."""
        return abs(self.off) > 1.96 * self.error

    @property
    def holds(self) -> bool:
        """Whether they are off by no more than counting error or `ACCURACY`; of one insertion never."""
        return self.insertions > 1 and (not self.beyond_counting or abs(self.off) <= ACCURACY)

    def sentence(self) -> str:
        """Return what is said of it, with counts."""
        if not self.right.of:
            return "no insertion was called a gap, so nothing is known of the probabilities"
        counts = (
            f"on average {self.probability:.2f} was given to the likeliest effect, which was the inserted "
            f"one in {self.right.count} of {self.right.of} draws ({self.right.share:.2f})"
        )
        if not self.beyond_counting:
            return f"the probabilities hold within counting error: {counts}"
        how = "low" if self.off > 0 else "high"
        return f"the probabilities are too {how} by {abs(self.off):.2f} +- {1.96 * self.error:.2f}: {counts}"


@dataclass(frozen=True)
class SelfTest:
    """A diagnosis tried on insertions whose truth is known.

    Attributes
    ----------
    draws : int
        Of noise, tolerances and error of form, for each inserted effect and detectability.
    level : float
        At which a gap is called.
    form_error : float
        Likeliest error of form, of the draws too.
    smallest : tuple of SmallestSize
    strata : tuple of Stratum
    false_alarm, false_name : Rate
        A gap called, and a name given, of draws with nothing inserted.
    outside : dict of Rate
        Insertions whose effect was taken out of the library: ``named``, which is wrong, ``other``,
        ``several``, ``none``.
    reliability : Reliability
    not_inserted : dict of str
        Why, by effect.
    """

    draws: int
    level: float
    form_error: float
    smallest: tuple[SmallestSize, ...]
    strata: tuple[Stratum, ...]
    false_alarm: Rate
    false_name: Rate
    outside: dict[str, Rate]
    reliability: Reliability
    not_inserted: dict[str, str] = field(default_factory=dict)

    @property
    def calibrated(self) -> bool:
        """Whether the verdict's probabilities hold here."""
        return self.reliability.holds
