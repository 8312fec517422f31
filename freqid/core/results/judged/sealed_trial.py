"""A trial of the diagnosis: an effect that is sealed before it, and whether the diagnosis named it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from freqid.core.errors import DataError
from freqid.core.layout import Attribute, ResultFile
from freqid.core.results.prediction import digest_of

OpenedAs = Literal["right", "wrong", "undecided"]


@dataclass(frozen=True)
class SealedEffect:
    """The effect that some flights were flown with, under a checksum.

    Attributes
    ----------
    scenario_sha256 : str
        Of the simulation that does not have it.
    seed : int
        That it was drawn by.
    effect, parameter, unit : str
        Id, the parameter that was set, and its unit.
    before, after : float
        The parameter in the simulation, and in the aircraft that was flown.
    records : dict of str to str
        SHA-256 of the flights, by file name.
    checksum : str
        SHA-256 over all of the above.
    """

    scenario_sha256: str
    seed: int
    effect: str
    parameter: str
    unit: str
    before: float
    after: float
    records: dict[str, str]
    checksum: str = ""

    def __repr__(self) -> str:
        return f"<SealedEffect of {len(self.records)} flights, checksum {self.checksum[:12]}>"

    def seal(self) -> SealedEffect:
        """Return it with the checksum of its contents."""
        return replace(self, checksum=digest_of(replace(self, checksum="")))

    def refuse_edited(self) -> None:
        """Raise where the contents are not those that were sealed.

        Raises
        ------
        DataError
        """
        if digest_of(replace(self, checksum="")) != self.checksum:
            raise DataError(
                "was edited after it was sealed", remedy="use the file as it was written, or fly again"
            )


@dataclass(frozen=True)
class TrialOutcome:
    """Whether a diagnosis named the effect that was sealed.

    Attributes
    ----------
    answer : {"right", "wrong", "undecided"}
        Right: the name given, or the group that it cannot be told from, is the effect. Wrong: another name,
        or no gap although the effect is larger than what the diagnosis says it would have found. Undecided:
        no single name, or no gap where the effect is smaller than that.
    sentence : str
    effect, parameter, unit : str
        What was sealed.
    before, after : float
        The parameter in the simulation and in the aircraft.
    named : tuple of str
        What the diagnosis gave as the answer.
    probability : float
        That it gave the effect.
    place : str
        Likeliest place of the effect, where it has several.
    estimate, lower, upper : float
        Of the change of the parameter, with the 90 % interval; nan where it was not estimated.
    verdict : str
        Of the diagnosis.
    checksum : str
        Of the seal, which was known before the diagnosis.
    seed : int
    """

    answer: OpenedAs
    sentence: str
    effect: str
    parameter: str
    unit: str
    before: float
    after: float
    named: tuple[str, ...]
    probability: float
    place: str
    estimate: float
    lower: float
    upper: float
    verdict: str
    checksum: str
    seed: int

    def __repr__(self) -> str:
        return f"<TrialOutcome {self.answer}: {self.sentence}>"

    @property
    def covered(self) -> bool:
        """Whether the interval holds the change that was flown."""
        return self.lower <= self.after - self.before <= self.upper


SEAL_FILE = ResultFile(
    "freqid-seal",
    SealedEffect,
    {
        **{
            name: Attribute(f"@{name}")
            for name in ("seed", "effect", "parameter", "unit", "before", "after", "checksum")
        },
        "scenario_sha256": Attribute("@sealed_scenario_sha256"),
        "records": Attribute("@records", json=True),
    },
    check=SealedEffect.refuse_edited,
)
OUTCOME_FILE = ResultFile(
    "freqid-trial",
    TrialOutcome,
    {
        **{
            name: Attribute(f"@{name}")
            for name in TrialOutcome.__dataclass_fields__
            if name not in ("named",)
        },
        "named": Attribute("@named", json=True),
    },
)
