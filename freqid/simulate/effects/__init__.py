"""Physical effects that a simulation may switch on: one file for each, found here by its name."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from math import isfinite
from typing import Any

from ...core.errors import UsageError, nearest
from .effect import Effect

Settings = dict[str, dict[str, float]]


@cache
def library() -> dict[str, Effect]:
    """Return every effect by its id."""
    modules = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    return {module.EFFECT.id: module.EFFECT for module in modules if hasattr(module, "EFFECT")}


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


def settings(table: dict[str, Any]) -> Settings:
    """Return the parameters of every effect, with the defaults where the table is silent.

    Parameters
    ----------
    table : dict
        By effect id: its size as a number, or its parameters by name; as ``[simulation.effects]`` has it.

    Returns
    -------
    dict of dict of float
        By effect id and parameter name, SI.

    Raises
    ------
    UsageError
        For an unknown effect or parameter, or a value that is no number.
    """
    found = {i: {name: p.default for name, p in e.parameters.items()} for i, e in library().items()}
    for identifier, value in table.items():
        effect = find(identifier)
        for name, number in (value if isinstance(value, dict) else {effect.size: value}).items():
            if name not in effect.parameters:
                raise UsageError(
                    f"effect '{identifier}' has no parameter '{name}'",
                    remedy=nearest(name, effect.parameters),
                )
            if isinstance(number, bool) or not isinstance(number, int | float) or not isfinite(number):
                raise UsageError(
                    f"effect '{identifier}': {name} is {number!r}", remedy="give a finite number"
                )
            found[identifier][name] = float(number)
    return found
