"""What effects at some settings make of a residual, and how that changes with the settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from freqid.gap.compare import Compared
from freqid.gap.testable import route_of
from freqid.gap.together import together
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Values = Mapping[str, Mapping[str, float]]

CHANGE = "change"
"""Name of the column of what effects make at some settings."""

_STEP = 0.1  # of a parameter's scale, of differences
_AT_ONCE = ("scenario",)
"""Kinds of simulation that answer quickly enough to be asked for each small departure."""


def changes(compared: Compared, effects: Sequence[Effect], settings: Values) -> Complex:
    """Return what effects at some settings make of a residual, shape (row, line).

    Told by the flight as it was, with the motion that a gap itself made; but what sensors or the mass make of
    a measurement they make of its noise too, which is in the residual as well: that is told by what the
    injected signals made.
    """
    simulation = compared.trial.simulation
    of_measured = [e for e in effects if route_of(e, simulation) in ("distort", "load")]
    of_loads = [e for e in effects if e not in of_measured]
    made = together(of_loads, compared.flown, settings) + together(of_measured, compared.trial, settings)
    return compared.lines.transform(made)


def departures(
    compared: Compared,
    effects: Sequence[Effect],
    names: Sequence[tuple[str, str]],
    value: Array,
    scale: Array,
) -> tuple[Complex, dict[str, Complex]]:
    """Return what settings make of a residual, and its derivatives by them, by what injected signals made.

    Parameters
    ----------
    compared : Compared
    effects : sequence of Effect
    names : sequence of tuple of str
        Effect id and parameter.
    value, scale : ndarray, shape (parameter,)
        Settings, and what is expected of them.

    Returns
    -------
    change : ndarray of complex, shape (row, line)
    derivatives : dict of ndarray of complex, shape (row, line)
        By ``effect:parameter``.
    """
    settings, trial = settings_of(names, value), compared.trial
    in_full = trial.simulation.kind in _AT_ONCE
    at, columns = together(effects, trial, settings, in_full=in_full), {}
    for k, (identifier, name) in enumerate(names):
        parameter = next(e for e in effects if e.id == identifier).parameters[name]
        step = _STEP * scale[k]
        up = value[k] + step if value[k] + step <= parameter.high else value[k] - step
        other = {**settings, identifier: {**settings[identifier], name: float(up)}}
        moved = together(effects, trial, other, in_full=in_full) - at
        columns[f"{identifier}:{name}"] = compared.lines.transform(moved) / (up - value[k])
    return compared.lines.transform(at), columns


def sources_of_all(effects: Sequence[Effect], compared: Compared) -> tuple[str, ...]:
    """Return the channels that anything effects make is computed from."""
    ids = {e.id for e in effects}
    each = [s for name, s in compared.sources.items() if name.partition(":")[0] in ids]
    return tuple(dict.fromkeys(n for s in each for n in s))


def settings_of(names: Sequence[tuple[str, str]], value: Array) -> dict[str, dict[str, float]]:
    """Return parameters by effect."""
    found: dict[str, dict[str, float]] = {}
    for (identifier, name), x in zip(names, value, strict=True):
        found.setdefault(identifier, {})[name] = float(x)
    return found
