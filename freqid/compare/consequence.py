"""Margins, modes and trim authority of a vehicle under its control law, and how much a change costs of them.

Both vehicles fly under one law, the one that was designed for the simulation (docs/theory/consequence.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from freqid.dynamics.linear_loop import LinearLoop, Margins
from freqid.dynamics.modes import MOTION, Mode, named_modes

Limits = tuple[float, float]

MARGIN_FIGURES = ("gain_up_db", "gain_down_db", "phase_deg", "delay_s", "crossover_hz", "modulus", "disk")

_FEWEST = 0.5  # share of the draws that must have a figure for it to be given an interval


@dataclass(frozen=True, eq=False)
class Condition:
    """One vehicle under its control law at one trim.

    Attributes
    ----------
    loop : LinearLoop
    trim : dict of float
        Positions of the effectors, SI; empty if not known.
    limits : dict of 2 floats
        Lower and upper limits of these.
    """

    loop: LinearLoop
    trim: dict[str, float] = field(default_factory=dict)
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Assessment:
    """Stability, margins, modes and trim authority of one condition.

    Attributes
    ----------
    stable : bool
        Of the closed loop; if it is not, the margins have no meaning.
    axes : tuple of str
        Of the control law.
    margins : dict of Margins
        By effector (its command cut) and by axis of the law; all other loops closed.
    modes : tuple of Mode
        Of the vehicle alone, fastest first.
    closed_modes : tuple of Mode
        Of the closed loop, those in which the vehicle's motion takes most part.
    authority : dict of float
        By effector, as `trim_authority` has it.
    """

    stable: bool
    axes: tuple[str, ...]
    margins: dict[str, Margins]
    modes: tuple[Mode, ...]
    closed_modes: tuple[Mode, ...]
    authority: dict[str, float]

    def figures(self) -> dict[str, float]:
        """Return every number by its path, ``margins/M/phase_deg`` or ``modes/short period/damping``.

        Margins are nan if the loop is unstable.
        """
        table: dict[str, float] = {}
        for place, margins in self.margins.items():
            for name in MARGIN_FIGURES:
                value = getattr(margins, name) if self.stable else float("nan")
                table[f"margins/{place}/{name}"] = value
        for kind, modes in (("modes", self.modes), ("closed_modes", self.closed_modes)):
            for mode in modes:
                table[f"{kind}/{mode.name}/frequency"] = mode.frequency
                table[f"{kind}/{mode.name}/damping"] = mode.damping
        return table | {f"authority/{name}": value for name, value in self.authority.items()}

    def least_phase_margin(self) -> tuple[str, float]:
        """Return the axis of the law with the least phase margin, and that margin, deg.

        An empty name and nan if the loop is unstable or no axis has margins.
        """
        margins = {n: m.phase_deg for n, m in self.margins.items() if n in self.axes}
        if not margins or not self.stable:
            return "", float("nan")
        axis = min(margins, key=lambda n: margins[n])
        return axis, margins[axis]


@dataclass(frozen=True, eq=False)
class Consequence:
    """The same figures of a condition before and after a change of the vehicle.

    Attributes
    ----------
    before, after : Assessment
    change : dict of float
        After minus before, by the path of `Assessment.figures`; nan if only one of them has the figure.
    after_intervals, change_intervals : dict of 2 floats
        Quantiles of the draws at `level`, by path; empty without draws.
    level : float
    unstable_share : float
        Share of the draws with an unstable closed loop; these are left out of the margins' intervals.
    """

    before: Assessment
    after: Assessment
    change: dict[str, float]
    after_intervals: dict[str, Limits]
    change_intervals: dict[str, Limits]
    level: float
    unstable_share: float

    @property
    def lost_phase_deg(self) -> float:
        """Phase margin lost at the axis that has the least of it after the change, deg; nan if undefined."""
        axis, _ = self.after.least_phase_margin()
        return -self.change.get(f"margins/{axis}/phase_deg", float("nan"))

    def sentence(self) -> str:
        """Say how much phase margin is lost at the axis that has the least of it after the change."""
        if not self.before.margins or not self.after.margins:
            return "there is no control law, so there are no margins"
        if not self.before.stable:
            return "the closed loop is unstable already as simulated, so there are no margins to compare"
        if not self.after.stable:
            return "as flown the closed loop is unstable, which the simulation says it is not"
        axis, margin = self.after.least_phase_margin()
        lost = self.lost_phase_deg
        if not np.isfinite(lost):
            return "no axis has a loop gain of one in both, so no phase margin can be compared"
        sign, verb = (1, "costs") if lost > 0 else (-1, "adds")
        size = f"{abs(lost):.1f} deg"
        path = f"margins/{axis}/phase_deg"
        if path in self.change_intervals:
            low, high = sorted(-sign * x for x in self.change_intervals[path])
            size += f" ({low:.1f} to {high:.1f})"
        return f"as flown it {verb} {size} of phase margin at {axis}, which leaves {margin:.1f} deg"


def assess(condition: Condition, *, exact: bool = True) -> Assessment:
    """Return the margins, modes and trim authority of a condition; `exact` as in `stability_margins`."""
    loop = condition.loop
    motion = [loop.states.index(n) for n in MOTION if n in loop.states]
    names = tuple(loop.states[i] for i in motion)
    return Assessment(
        stable=loop.stable,
        axes=loop.axes,
        margins=loop.margins(exact=exact),
        modes=named_modes(loop.A[np.ix_(motion, motion)], names),
        closed_modes=loop.modes(),
        authority=trim_authority(condition.trim, condition.limits),
    )


def trim_authority(trim: Mapping[str, float], limits: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """Return how much of each effector's range, from the middle to the nearer limit, a trim uses.

    Parameters
    ----------
    trim : mapping of float
        Positions by effector.
    limits : mapping of 2 floats
        Lower and upper limit by effector; effectors without limits are left out.

    Returns
    -------
    dict of float
        0 in the middle of the range, 1 at a limit.
    """
    return {
        name: abs(2 * position - sum(limits[name])) / (limits[name][1] - limits[name][0])
        for name, position in trim.items()
        if name in limits
    }


def compare_conditions(
    before: Condition,
    after: Condition,
    draws: Sequence[tuple[Condition, Condition]] = (),
    *,
    level: float = 0.9,
) -> Consequence:
    """Compare two conditions.

    Parameters
    ----------
    before, after : Condition
    draws : sequence of (Condition, Condition)
        Both conditions with their uncertain parameters drawn at random, for the intervals.
    level : float
        Of the intervals.

    Returns
    -------
    Consequence
    """
    first, second = assess(before), assess(after)
    start, end = first.figures(), second.figures()
    drawn_before, drawn_after, stable = [], [], []
    for a, b in draws:
        drawn_before.append(start if a is before else assess(a, exact=False).figures())
        state = assess(b, exact=False)
        drawn_after.append(state.figures())
        stable.append(state.stable)
    change = _difference(start, end)
    changes = [_difference(a, b) for a, b in zip(drawn_before, drawn_after, strict=True)]
    return Consequence(
        before=first,
        after=second,
        change=change,
        after_intervals=_intervals(drawn_after, end, level),
        change_intervals=_intervals(changes, change, level),
        level=level,
        unstable_share=1 - float(np.mean(stable)) if stable else 0.0,
    )


def _difference(before: Mapping[str, float], after: Mapping[str, float]) -> dict[str, float]:
    def subtract(path: str) -> float:
        a, b = before.get(path, np.nan), after.get(path, np.nan)
        return 0.0 if a == b else float(b - a)  # two infinite margins differ by zero, not by nan

    return {path: subtract(path) for path in {**before, **after}}


def _intervals(
    draws: Sequence[Mapping[str, float]], paths: Mapping[str, float], level: float
) -> dict[str, Limits]:
    """Return quantiles of the draws for each figure that enough draws have."""
    intervals = {}
    for path in paths:
        values = np.array([one.get(path, np.nan) for one in draws])
        values = values[~np.isnan(values)]
        if values.size and values.size >= _FEWEST * len(draws):
            # an infinite margin is a value too, but nothing can be interpolated next to it
            low, high = np.quantile(values, [(1 - level) / 2, (1 + level) / 2], method="closest_observation")
            intervals[path] = (float(low), float(high))
    return intervals
