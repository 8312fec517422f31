"""Physical effects that a simulation may switch on: one file for each, found here by its name."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from math import isfinite
from typing import Any

from freqid.core.errors import UsageError, nearest
from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.simulate.effects.effect import Effect

Settings = dict[str, dict[str, float]]

_added: dict[str, Effect] = {}  # users' own, for this process


@cache
def shipped() -> dict[str, Effect]:
    """Return the effects that freqid brings along, by id."""
    modules = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    return {module.EFFECT.id: module.EFFECT for module in modules if hasattr(module, "EFFECT")}


def library() -> dict[str, Effect]:
    """Return every effect by its id: those of this folder, then users' own as they were registered."""
    return {**shipped(), **_added}


def register(effect: Effect) -> None:
    """Make a user's effect part of the library for this process; again for a newer version of it.

    Raises
    ------
    UsageError
        Where an effect of that id comes with freqid.
    """
    if effect.id in shipped():
        raise UsageError(
            f"effect '{effect.id}' has the id of one that comes with freqid", remedy="give it another id"
        )
    _added[effect.id] = effect


def find(identifier: str) -> Effect:
    """Return one effect.

    Raises
    ------
    UsageError
        Where there is none of that id.
    """
    if identifier not in library():
        raise UsageError(f"effect '{identifier}' is unknown", remedy=nearest(identifier, library()))
    return library()[identifier]


def settings(table: Mapping[str, Any], vehicle: Vehicle | None = None) -> Settings:
    """Return the parameters of every effect, with the defaults where the table is silent.

    Parameters
    ----------
    table : mapping
        By effect id: its size as a number, or its parameters by name; as ``[simulation.effects]`` has it.
    vehicle : Vehicle, optional
        For the parameters that go with its surfaces and rotors; without it only those in common.

    Returns
    -------
    dict of dict of float
        By effect id and parameter name, SI.

    Raises
    ------
    UsageError
        For an unknown effect or parameter, or a value that is no number or out of its range.
    """
    known = {identifier: effect.of(vehicle).parameters for identifier, effect in library().items()}
    found = {i: {name: p.default for name, p in parameters.items()} for i, parameters in known.items()}
    for identifier, value in table.items():
        effect = find(identifier)
        for name, number in (value if isinstance(value, dict) else {effect.size: value}).items():
            if name not in known[identifier]:
                raise UsageError(
                    f"effect '{identifier}' has no parameter '{name}'",
                    remedy=nearest(name, known[identifier]),
                )
            if isinstance(number, bool) or not isinstance(number, int | float) or not isfinite(number):
                raise UsageError(
                    f"effect '{identifier}': {name} is {number!r}", remedy="give a finite number"
                )
            described = known[identifier][name]
            if not described.low <= number <= described.high:
                raise UsageError(
                    f"effect '{identifier}': {name} is {number:g}, "
                    f"expected {described.low:g} to {described.high:g} ({described.unit})"
                )
            found[identifier][name] = float(number)
    return found


def acting(settings: Mapping[str, Mapping[str, float]]) -> Settings:
    """Return the effects that act or were switched off: their sizes, and what else is not zero."""
    found: Settings = {}
    for identifier, values in settings.items():
        effect = find(identifier)
        usual = {name: p.default for name, p in effect.parameters.items()}
        if values[effect.size] or any(v != usual.get(name, 0.0) for name, v in values.items()):
            found[identifier] = {n: v for n, v in values.items() if v or n == effect.size}
    return found


def loaded(vehicle: Vehicle, settings: Mapping[str, Mapping[str, float]]) -> Vehicle:
    """Return the vehicle as the mass effects make it.

    Raises
    ------
    UsageError
        Where they leave no possible mass properties.
    """
    for identifier, effect in library().items():
        if effect.load is not None and any((settings.get(identifier) or {}).values()):
            try:
                vehicle = effect.load(dict(settings[identifier]), vehicle)
            except ValueError as error:
                raise UsageError(f"effect '{identifier}': {error}", remedy="choose a smaller one") from None
    return vehicle


def distorted(record: FlightRecord, settings: Mapping[str, Mapping[str, float]]) -> FlightRecord:
    """Return the log as the sensor and environment effects make it."""
    for identifier, effect in library().items():
        if effect.distort is not None and any((settings.get(identifier) or {}).values()):
            record = effect.distort(dict(settings[identifier]), record)
    return record
