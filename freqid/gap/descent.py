"""Parameters of effects moved to where they fit best: Gauss-Newton steps, halved where they overshoot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import ImpossibleSettings
from freqid.gap.changes import Values
from freqid.gap.simulation import Simulation
from freqid.gap.testable import in_force_of
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sought:
    """Parameters of effects that are fitted: where they begin, what is expected of them, and their bounds.

    Attributes
    ----------
    names : tuple of tuple of str
        Effect id and parameter of each number.
    start, centre : ndarray, shape (parameter,)
        Where a fit begins, within the bounds; what is in force in the simulation.
    scale, low, high : ndarray, shape (parameter,)
    """

    names: tuple[tuple[str, str], ...]
    start: Array
    centre: Array
    scale: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, effects: Sequence[Effect], start: Values, simulation: Simulation) -> Sought:
        """Return the parameters that a start has, by effect, in the order of effects."""
        names = tuple((e.id, n) for e in effects for n in start[e.id])
        by_id = {e.id: e for e in effects}
        described = [by_id[i].parameters[n] for i, n in names]
        force = {e.id: in_force_of(e, simulation) for e in effects}
        low, high = np.array([p.low for p in described]), np.array([p.high for p in described])
        return cls(
            names=names,
            start=np.clip([start[i][n] for i, n in names], low, high),
            centre=np.clip([force[i][n] for i, n in names], low, high),
            scale=np.array([p.scale for p in described]),
            low=low,
            high=high,
        )


@dataclass(frozen=True, eq=False)
class View:
    """What is seen from some settings.

    Attributes
    ----------
    misfit : float
        That is to be made small.
    step : ndarray, shape (parameter,)
        To where it would be least if all were straight from here.
    covariance : ndarray, shape (parameter, parameter)
    """

    misfit: float
    step: Array
    covariance: Array


def descend(
    sought: Sought, view: Callable[[Array], View], *, rounds: int, settled: float, worse: float
) -> tuple[Array, View]:
    """Return the settings that fit best of those that were looked at, and what was seen from there.

    Parameters
    ----------
    sought : Sought
    view : callable
        What is seen from settings; raises `ImpossibleSettings` where nothing can be so.
    rounds : int
        Settings that are looked at.
    settled : float
        Standard errors: a smaller step is not taken.
    worse : float
        By which the misfit may rise in a step: a part of it is noise.

    Raises
    ------
    ImpossibleSettings
        Where none of the settings looked at is possible.
    """
    value, best, seen = sought.start, sought.centre, None
    impossible: ImpossibleSettings | None = None
    for _ in range(rounds):
        try:
            here = view(value)
        except ImpossibleSettings as error:
            impossible = error
        else:
            # too far: tolerances take up a delay's straight line, and its curve misleads
            if seen is None or here.misfit <= seen.misfit + worse:
                best, seen = value, here
                after = np.clip(value + here.step, sought.low, sought.high)
                if np.all(np.abs(after - value) < settled * np.sqrt(np.diag(here.covariance))):
                    break
                value = after
                continue
        value = (value + best) / 2
    if seen is None:
        raise impossible or ImpossibleSettings("no settings were looked at")
    return best, seen
