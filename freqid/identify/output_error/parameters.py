"""Which numbers are estimated: shared and own parameters, initial states; fixed, tied, bounded, scaled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.identify.output_error.model import DynamicModel, Signals

Initial = Literal["estimated", "measured", "zero"]
Tie = str | tuple[str, float]


@dataclass(frozen=True)
class Choices:
    """What the user says of the parameters.

    Attributes
    ----------
    start : mapping of str to float
        Where the iteration begins; equation error says for parameters that are not named.
    fixed : mapping of str to float
        Parameters that are not estimated.
    tied : mapping of str to str or (str, float)
        Parameters that follow another: its value, or a factor times it.
    bounds : mapping of str to (float, float)
    initial : {"estimated", "measured", "zero"}
        Initial states: estimated for each manoeuvre, or held at the first sample or at zero.
    """

    start: Mapping[str, float] | None = None
    fixed: Mapping[str, float] | None = None
    tied: Mapping[str, Tie] | None = None
    bounds: Mapping[str, tuple[float, float]] | None = None
    initial: Initial = "estimated"


@dataclass(frozen=True, eq=False)
class ParameterSet:
    """All numbers of a problem, ``full = offset + spread @ free``.

    Attributes
    ----------
    names : tuple of str, length P
        Shared parameters, then by manoeuvre its own and its initial states, as ``bias_p@2`` and
        ``x0_p@2``; with one manoeuvre without the number.
    free_names : tuple of str, length f
    offset : ndarray, shape (P,)
    spread : ndarray, shape (P, f)
        A free number is in units of its start, where that is not zero.
    start, lower, upper : ndarray, shape (f,)
        Of the free numbers, in their units.
    scale : ndarray, shape (f,)
        Unit of each free number.
    columns : ndarray of int, shape (manoeuvre, parameters + states)
        Where a manoeuvre's vector, in the model's order and then the initial states, is in the full one.
    """

    names: tuple[str, ...]
    free_names: tuple[str, ...]
    offset: Array
    spread: Array
    start: Array
    lower: Array
    upper: Array
    scale: Array
    columns: np.ndarray

    def full(self, free: Array) -> Array:
        """Return all numbers, shape (P,)."""
        return self.offset + self.spread @ free

    def vectors(self, free: Array) -> Array:
        """Return the model's vectors by manoeuvre, shape (manoeuvre, parameters + states)."""
        return self.full(free)[self.columns]

    def spreads(self) -> Array:
        """Return the derivatives of `vectors` by the free numbers, shape (manoeuvre, vector, f)."""
        return self.spread[self.columns]

    def held(self, names: Sequence[str], free: Array) -> ParameterSet:
        """Return the set with some free numbers held where `free` has them, the rest starting there."""
        keep = np.array([n not in names for n in self.free_names])
        return ParameterSet(
            self.names,
            tuple(n for n in self.free_names if n not in names),
            self.offset + self.spread[:, ~keep] @ free[~keep],
            self.spread[:, keep],
            free[keep],
            self.lower[keep],
            self.upper[keep],
            self.scale[keep],
            self.columns,
        )


def numbered(name: str, maneuver: int, count: int) -> str:
    """Return the name of an own parameter of one of several manoeuvres."""
    return name if count == 1 else f"{name}@{maneuver + 1}"


def all_names(model: DynamicModel, count: int) -> tuple[str, ...]:
    """Return the names of all numbers of a problem of some manoeuvres."""
    own = [*(p for p in model.parameters if p in model.own), *(f"x0_{s}" for s in model.states)]
    return (*model.shared, *(numbered(n, i, count) for i in range(count) for n in own))


def choose_parameters(
    model: DynamicModel, signals: Sequence[Signals], values: Mapping[str, float], choices: Choices
) -> ParameterSet:
    """Build the parameters of a problem.

    Parameters
    ----------
    model : DynamicModel
    signals : sequence of Signals
    values : mapping of str to float
        Starts of all numbers, by full name.
    choices : Choices
        An own parameter's name without its number means that of every manoeuvre.

    Raises
    ------
    UsageError
        For an unknown name, a tie to something that is not estimated, or bounds in the wrong order.
    """
    count = len(signals)
    names = all_names(model, count)
    fixed = spelled_out(model, count, "fixed", choices.fixed or {})
    tied = {
        n: (t, 1.0) if isinstance(t, str) else (t[0], float(t[1]))
        for n, t in spelled_out(model, count, "tied", choices.tied or {}).items()
    }
    bounds = spelled_out(model, count, "bounds", choices.bounds or {})
    full = np.array([float(values[n]) for n in names])
    for name, value in fixed.items():
        full[names.index(name)] = value
    held = set(fixed)
    if choices.initial != "estimated":
        held |= {n for n in names if n.startswith("x0_")}
    free = [n for n in names if n not in held and n not in tied]
    for name, (leader, _) in tied.items():
        if leader not in free:
            raise UsageError(
                f"'{name}' is tied to '{leader}', which is not estimated itself",
                remedy=nearest(leader, free),
            )
    if not free:
        raise UsageError("no parameter is left to estimate", remedy="fix fewer of them")
    start = np.array([full[names.index(n)] for n in free])
    lower, upper = np.full(len(free), -np.inf), np.full(len(free), np.inf)
    for name, (low, high) in bounds.items():
        if not low < high:
            raise UsageError(f"bounds of '{name}' are {low:g} and {high:g}, expected the lower one first")
        if name in free:
            lower[free.index(name)], upper[free.index(name)] = low, high
    start = np.clip(start, lower, upper)
    scale = np.where(start == 0, 1.0, np.abs(start))
    spread = np.zeros((len(names), len(free)))
    offset = full.copy()
    for j, name in enumerate(free):
        spread[names.index(name), j] = scale[j]
        offset[names.index(name)] = 0.0
    for name, (leader, factor) in tied.items():
        spread[names.index(name), free.index(leader)] = factor * scale[free.index(leader)]
        offset[names.index(name)] = 0.0
    vector = [*model.parameters, *(f"x0_{s}" for s in model.states)]
    columns = np.array(
        [
            [names.index(n if n in model.shared else numbered(n, i, count)) for n in vector]
            for i in range(count)
        ]
    )
    return ParameterSet(
        names, tuple(free), offset, spread, start / scale, lower / scale, upper / scale, scale, columns
    )


def spelled_out(model: DynamicModel, count: int, kind: str, given: Mapping) -> dict:
    """Return choices by full name."""
    names, found = all_names(model, count), {}
    for name, value in given.items():
        each = [numbered(name, i, count) for i in range(count)]
        if name in names:
            found[name] = value
        elif all(n in names for n in each):
            found |= dict.fromkeys(each, value)
        else:
            raise UsageError(
                f"{kind} names '{name}', which model '{model.name}' does not have",
                remedy=nearest(name, (*model.parameters, *names)),
            )
    return found
