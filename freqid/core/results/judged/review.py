"""What a team decides from a set of results: answers, envelope, risks, what would overturn them; its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import msgspec

from freqid.core.layout import ResultFile, finite_table, table_with_nan

Answer = Literal["use", "use with limits", "do not use", "not decided"]
Subject = Literal["model", "simulation", "next flight"]


@dataclass(frozen=True)
class Source:
    """One file that was reviewed.

    Attributes
    ----------
    name : str
        Without its folder.
    kind : str
        Format, as ``freqid-point``.
    sha256 : str
        Of its bytes.
    created, freqid_version : str
        When and by which release it was written.
    scenario_sha256 : str
        Of the scenario that it was made with; empty where it has none.
    """

    name: str
    kind: str
    sha256: str
    created: str = ""
    freqid_version: str = ""
    scenario_sha256: str = ""


@dataclass(frozen=True)
class Reversal:
    """A figure that decides an answer: where it stands, and the bound beyond which the answer is another.

    Attributes
    ----------
    text, unit : str
    now, bound : float
    where : str
        Condition or response that the figure is of.
    side : {"at most", "at least"}
        Which side of the bound speaks for use.
    weight : {"good", "risk", "stop"}
        What it is beyond the bound: a risk, or what forbids use; ``good`` of one that speaks against use as
        long as it is within.
    subject : {"", "model", "simulation", "next flight"}
        Of the answer.
    """

    text: str
    now: float
    bound: float
    where: str = ""
    unit: str = "1"
    side: Literal["at most", "at least"] = "at most"
    weight: Literal["good", "risk", "stop"] = "risk"
    subject: Literal["", "model", "simulation", "next flight"] = ""

    @property
    def room(self) -> float:
        """How far it is within its bound, in its unit; negative beyond."""
        return self.bound - self.now if self.side == "at most" else self.now - self.bound

    @property
    def room_share(self) -> float:
        """`room` over the size of the bound; of a bound at zero, over that of the figure."""
        return self.room / (abs(self.bound) or abs(self.now) or 1.0)


@dataclass(frozen=True)
class Ground:
    """One reason for an answer.

    Attributes
    ----------
    subject : {"model", "simulation", "next flight"}
    weight : {"good", "risk", "stop"}
        Speaks for use; is an open risk; forbids use until it is answered.
    text : str
        One sentence.
    source : str
        Name of the file that says so.
    figures : tuple of Reversal
        The numbers that its weight follows from.
    """

    subject: Subject
    weight: Literal["good", "risk", "stop"]
    text: str
    source: str = ""
    figures: tuple[Reversal, ...] = ()


@dataclass(frozen=True)
class Decision:
    """The answer on one subject: what its grounds leave.

    Attributes
    ----------
    subject : {"model", "simulation", "next flight"}
    answer : {"use", "use with limits", "do not use", "not decided"}
    because : str
        The ground that decided it.
    """

    subject: Subject
    answer: Answer
    because: str


@dataclass(frozen=True)
class Limit:
    """One side of the envelope that was covered.

    Attributes
    ----------
    name, unit : str
    low, high : float
        SI.
    """

    name: str
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Use:
    """One side of what the results may be used for.

    Attributes
    ----------
    label, text : str
        Such as ``Axes``, and a sentence without the full stop.
    """

    label: str
    text: str


@dataclass(frozen=True)
class Quantity:
    """A number that two releases are compared by.

    Attributes
    ----------
    value, std_error : float
        The error is zero where none is known.
    unit : str
    """

    value: float
    std_error: float
    unit: str


@dataclass(frozen=True)
class Change:
    """A number, or an answer, that is not what it was.

    Attributes
    ----------
    what : str
    before, after : str
    sigmas : float
        Difference over the standard error of both; nan where none is known.
    """

    what: str
    before: str
    after: str
    sigmas: float = float("nan")


@dataclass(frozen=True)
class WorstFit:
    """The response that fits worst, and where in frequency.

    Attributes
    ----------
    at, response : str
        Condition and response with the least R2.
    r2, r2_ceiling : float
        What the model explains, and what noise allows; nan where that is not known.
    low_hz, high_hz, over_noise, share : float
        As `freqid.core.results.fit.WorstBand`; nan of a model that has no spectrum.
    """

    at: str
    response: str
    r2: float
    r2_ceiling: float
    low_hz: float
    high_hz: float
    over_noise: float
    share: float


@dataclass(frozen=True)
class Trust:
    """How many parameters cannot be trusted as numbers, and why; one may be counted for several reasons.

    Attributes
    ----------
    parameters, doubtful : int
        Of all point models.
    matter : int
        Of the doubtful ones, those whose error can be seen in the response.
    wide, collinear, missing : int
        By reason: a wide interval, regressors that moved together, off the simulation's truth.
    reasons : dict of str to int
        By all the reasons that a parameter has, joined by `` and ``: these add up to `doubtful`.
    off_linear, off_noise_free, off_both : int
        Of `missing`: off the linearisation, off the noise-free estimate, off both (counted in either).
    by_noise : int
        Not doubtful and not in `missing`: off the truth by noise alone, where that many are by chance.
    """

    parameters: int
    doubtful: int
    matter: int
    wide: int
    collinear: int
    missing: int
    reasons: dict[str, int] = field(default_factory=dict)
    off_linear: int = 0
    off_noise_free: int = 0
    off_both: int = 0
    by_noise: int = 0


@dataclass(frozen=True)
class LoopCompared:
    """One phase margin of one axis at one condition, by the aircraft that it was computed for, deg.

    Attributes
    ----------
    at, axis : str
    model, lower, upper : float
        The identified model's, with its interval; nan where it was not computed there.
    simulation, flown : float
        The simulation's, and that of the simulation with the effect of the gap; nan likewise.
    """

    at: str
    axis: str
    model: float
    lower: float
    upper: float
    simulation: float
    flown: float


@dataclass(frozen=True)
class Review:
    """A set of results, and what follows for their use.

    Attributes
    ----------
    vehicle : str
    decisions : tuple of Decision
    envelope : tuple of Limit
    conditions : tuple of str
        Ids of the reference conditions that were identified.
    grounds : tuple of Ground
        All reasons, those that forbid first.
    reversals : tuple of Reversal
        The worst figure of each ground where it is beyond its bound; of the others of each kind the nearest.
    missing : dict of str
        What there is no file of, by section; the command that makes it.
    sources : tuple of Source
        All files that were read: those given, those that a study holds, the scenario, what was compared with.
    quantities : dict of Quantity
        By what they are, as ``u45 M q``.
    against : str
        Name of the older review; empty without one.
    changes : tuple of Change
        Since then, the largest first.
    compared : int
        Numbers that both have.
    worst_fit : WorstFit, optional
    trust : Trust, optional
    loops : tuple of LoopCompared
        Where margins of an identified model and of a simulation are known.
    loops_text : tuple of str
        Why these differ, in sentences; without the full stop.
    uses : tuple of Use
        What the model, the simulation and the margins may be used for.
    rules : tuple of str
        What is an open risk, one phrase for each kind.
    vehicle_text : tuple of str
        What a diagnosis says of the vehicle otherwise than it is described, in sentences.
    """

    vehicle: str
    decisions: tuple[Decision, ...]
    envelope: tuple[Limit, ...]
    conditions: tuple[str, ...]
    grounds: tuple[Ground, ...]
    reversals: tuple[Reversal, ...]
    missing: dict[str, str]
    sources: tuple[Source, ...]
    quantities: dict[str, Quantity]
    against: str = ""
    changes: tuple[Change, ...] = ()
    compared: int = 0
    worst_fit: WorstFit | None = None
    trust: Trust | None = None
    loops: tuple[LoopCompared, ...] = ()
    loops_text: tuple[str, ...] = ()
    uses: tuple[Use, ...] = ()
    rules: tuple[str, ...] = ()
    vehicle_text: tuple[str, ...] = ()

    def __repr__(self) -> str:
        said = ", ".join(f"{d.subject}: {d.answer}" for d in self.decisions)
        return f"<Review of {self.vehicle!r}, {len(self.sources)} files: {said}>"

    @property
    def risks(self) -> tuple[Ground, ...]:
        """What forbids use or is open, those that forbid first."""
        return tuple(g for g in self.grounds if g.weight != "good")

    def to_json(self) -> dict[str, Any]:
        """Return numbers, strings, lists and tables; a number that is not defined is None."""
        return finite_table(asdict(self))

    @classmethod
    def from_json(cls, table: Mapping[str, Any]) -> Review:
        """Return the review that `to_json` made a table of.

        Parameters
        ----------
        table : mapping
            JSON-compatible.

        Raises
        ------
        ValueError
            Where the table is none of a review.
        """
        try:
            there = {name: value for name, value in table.items() if value is not None}
            return msgspec.convert(table_with_nan(there), cls)
        except msgspec.ValidationError as error:
            raise ValueError(str(error)) from None


FILE = ResultFile("freqid-review", Review, {}, table="review")
write_review, read_review = FILE.write, FILE.read
