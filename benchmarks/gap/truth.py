"""A truth: one effect by one formula, at a size, that the diagnosis never sees."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from freqid.core.record import FlightRecord
from freqid.core.scenario import Scenario

Settings = dict[str, dict[str, float]]


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
    """

    id: str
    form: str
    one: float
    most: float
    places: tuple[str, ...] = ("",)
    settings: Callable[[float, str], Settings] = _no_settings
    scenario: Callable[[Scenario, float, str], Scenario] = _same
    record: Callable[[FlightRecord, float, str], FlightRecord] = _same


@dataclass(frozen=True)
class Part:
    """A truth of a case at a size."""

    truth: Truth
    place: str
    size: float
