"""A truth: one effect by one formula, at a size, that the diagnosis never sees."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from freqid.core.record import FlightRecord
from freqid.core.scenario import Scenario

Settings = dict[str, dict[str, float]]

_COUNTS = 3.0  # sigma of a tolerance


def _no_settings(size: float, place: str) -> Settings:
    del size, place
    return {}


def _same(thing: Any, size: float, place: str) -> Any:
    del size, place
    return thing


@dataclass(frozen=True)
class Truth:
    """One effect by one formula, at a size.

    Attributes
    ----------
    id : str
        Of the library, or ``outside_...``.
    form : str
    one : float
        A plausible size, to start from.
    most : float
        Beyond which it is no such effect any more, or does not fly.
    places : tuple of str
        Where it can be: one is drawn for a case.
    settings : callable
        ``settings(size, place)`` of effects, added to what the scenario has.
    scenario : callable
        ``scenario(scenario, size, place)``: the aircraft described otherwise.
    record : callable
        ``record(record, size, place)``: the log.
    rises : bool
        Whether it comes up before the record, so that at a size of zero a flight is not yet one without it.
    """

    id: str
    form: str
    one: float
    most: float
    places: tuple[str, ...] = ("",)
    settings: Callable[[float, str], Settings] = _no_settings
    scenario: Callable[[Scenario, float, str], Scenario] = _same
    record: Callable[[FlightRecord, float, str], FlightRecord] = _same
    rises: bool = False

    @property
    def logged(self) -> bool:
        """Whether nothing but the log is another, so that the flight is the same."""
        return self.settings is _no_settings and self.scenario is _same

    def least(self, place: str, tolerances: Mapping[str, float]) -> float:
        """Return the size from which it counts as an effect: three sigma of what is no effect; 0 without."""
        own = sorted(name for name in tolerances if name.partition(".")[0] == self.id)
        names = [f"{self.id}.{place.lstrip('-')}", self.id, *(own if len(own) == 1 else ())]
        return _COUNTS * next((tolerances[n] for n in names if n in tolerances), 0.0)


@dataclass(frozen=True)
class Part:
    """A truth of a case at a size."""

    truth: Truth
    place: str
    size: float
