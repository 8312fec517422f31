"""What a quick look at a log says: was the design flown, is it usable, or must it be repeated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from freqid.core.layout import Attribute, Dataset, Nested, Part, ResultFile, Rows, Table
from freqid.core.record import FlightRecord, get_record, put_record
from freqid.core.results.design import SampledInputs
from freqid.core.viewable import Viewable


@dataclass(frozen=True)
class InputLook:
    """One designed input as it was found in a log.

    Attributes
    ----------
    name, unit : str
        Effector and its SI unit.
    source : str
        Channel that the injection was looked for in: the excitation, else the command, else the position.
    coherence : float
        Of that channel with the design on the input's own lines, after the common start is allowed for.
    p_value : float
        Probability of such a coherence were the two unrelated.
    gain : float
        Size of what was found over the design's.
    present : bool
    found_on : str
        Another channel that holds this input's signal; empty where none does.
    periods : float
        How much of the design the log covers, in its periods.
    achieved_of : str
        Channel that the position is held against: the command, else the excitation; empty without a position.
    achieved_gain, achieved_lag_s, achieved_coherence : float
        Of the position, on the input's own lines; nan without a position.
    at_limit, at_rate_limit : float
        Share of the time at a position limit and at the rate limit; nan where no limit is stated.
    """

    name: str
    unit: str
    source: str
    coherence: float
    p_value: float
    gain: float
    present: bool
    found_on: str
    periods: float
    achieved_of: str
    achieved_gain: float
    achieved_lag_s: float
    achieved_coherence: float
    at_limit: float
    at_rate_limit: float


@dataclass(frozen=True)
class RateLook:
    """How fast one channel was logged.

    Attributes
    ----------
    channel : str
    rate_hz : float
        Native rate, or the rate of its updates where it is latched.
    enough : bool
        Whether the design's band ends below its Nyquist frequency.
    """

    channel: str
    rate_hz: float
    enough: bool


@dataclass(frozen=True)
class ParameterLook:
    """One parameter of the scenario's regressors as this log alone tells it.

    Attributes
    ----------
    response, name, unit : str
    estimate, std_error : float
    contribution_error : float
        Standard error times the regressor's rms, over the rms of what the model explains of the response.
    met : bool
        Whether the standard error, or the error of the contribution, is as small as was asked for.
    """

    response: str
    name: str
    unit: str
    estimate: float
    std_error: float
    contribution_error: float
    met: bool


@dataclass(frozen=True)
class Quicklook(Viewable):
    """A log held against its design.

    Attributes
    ----------
    log, design : str
        Files.
    verdict : {"usable", "repeat"}
    reasons : tuple of str
        Why it must be repeated, sentences without a full stop.
    remarks : tuple of str
        What is worth knowing and does not spoil the log.
    start_s : float
        When the design starts, on the record's clock, s; nan where it was not found.
    likeness : float
        Mean correlation of the inputs' channels with the design at that start.
    band_hz : tuple of 2 floats
        Of the design.
    inputs : tuple of InputLook
    rates : tuple of RateLook
    parameters : tuple of ParameterLook
        Empty where the scenario names no regressors.
    accuracy : float
        That was asked of the parameters, relative.
    plausibility : mapping
        Findings, as in the record's provenance.
    record : FlightRecord
    inputs_flown : SampledInputs
        The design's samples, from the start of the design.
    """

    log: str
    design: str
    verdict: Literal["usable", "repeat"]
    reasons: tuple[str, ...]
    remarks: tuple[str, ...]
    start_s: float
    likeness: float
    band_hz: tuple[float, float]
    inputs: tuple[InputLook, ...]
    rates: tuple[RateLook, ...]
    parameters: tuple[ParameterLook, ...]
    accuracy: float
    plausibility: Mapping[str, Any]
    record: FlightRecord = field(repr=False)
    inputs_flown: SampledInputs = field(repr=False)

    def __repr__(self) -> str:
        present = sum(look.present for look in self.inputs)
        met = sum(look.met for look in self.parameters)
        return (
            f"<Quicklook: {self.sentence} {present} of {len(self.inputs)} inputs found, "
            f"{met} of {len(self.parameters)} parameters met {self.accuracy:.0%}>"
        )

    @property
    def usable(self) -> bool:
        """Whether the log can be used."""
        return self.verdict == "usable"

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        return "usable." if self.usable else f"repeat, because {'; '.join(self.reasons)}."


def _columns(group: str, words: tuple[str, ...], numbers: dict[str, str]) -> dict[str, Attribute | Dataset]:
    """Return the layout of small objects: words as lists, numbers with their units."""
    return {name: Attribute(f"{group}@{name}", json=True) for name in words} | {
        name: Dataset(f"{group}/{name}", unit) for name, unit in numbers.items()
    }


_INPUT = _columns(
    "input",
    ("name", "unit", "source", "present", "found_on", "achieved_of"),
    {
        **dict.fromkeys(
            ("coherence", "p_value", "gain", "periods", "achieved_gain", "achieved_coherence"), "1"
        ),
        "achieved_lag_s": "s",
        **dict.fromkeys(("at_limit", "at_rate_limit"), "1"),
    },
)
_PARAMETER = _columns(
    "parameter",
    ("response", "name", "unit", "met"),
    {"estimate": "mixed", "std_error": "mixed", "contribution_error": "1"},
)
_LOOK = {
    **{
        name: Attribute(f"@{name}")
        for name in ("log", "design", "verdict", "start_s", "likeness", "accuracy")
    },
    **{name: Attribute(f"@{name}", json=True) for name in ("reasons", "remarks", "band_hz")},
    "inputs": Rows(InputLook, _INPUT),
    "rates": Rows(RateLook, _columns("rate", ("channel", "enough"), {"rate_hz": "Hz"})),
    "parameters": Rows(ParameterLook, _PARAMETER),
    "plausibility": Table("plausibility"),
    "record": Part("record", put_record, get_record),
    "inputs_flown": Nested(
        SampledInputs,
        {
            **{name: Attribute(f"flown@{name}", json=True) for name in ("names", "units")},
            "time": Dataset("flown/time", "s", ("sample",)),
            "values": Dataset("flown/values", "mixed", ("names", "sample")),
        },
    ),
}
FILE = ResultFile("freqid-quicklook", Quicklook, _LOOK)
