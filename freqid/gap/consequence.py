"""What a gap costs, as a control engineer would say it: margins, modes, trim authority, before and after.

The control law is that of the simulation before; what changes is the vehicle under it
(docs/theory/consequence.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from freqid.core.record import FlightRecord
from freqid.gap.closed_loop import LinearLoop
from freqid.gap.margins import Margins
from freqid.gap.modes import MOTION, Mode, named_modes

Array = NDArray[np.float64]
Interval = tuple[float, float]

DRAWS = 200  # for intervals
FIGURES = ("gain_up_db", "gain_down_db", "phase_deg", "delay_s", "crossover_hz", "modulus")


@dataclass(frozen=True, eq=False)
class Condition:
    """One vehicle under its control law at one trim.

    Attributes
    ----------
    loop : LinearLoop
    trim : dict of float
        Positions of the effectors, SI; empty where not known.
    limits : dict of 2 floats
        Lower and upper limits of the same.
    """

    loop: LinearLoop
    trim: dict[str, float] = field(default_factory=dict)
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class State:
    """What a control engineer would say of one condition.

    Attributes
    ----------
    stable : bool
        Of the closed loop; margins say nothing where it is not.
    axes : tuple of str
        Of the law.
    margins : dict of Margins
        By effector, its command cut, and by axis of the law; all else closed.
    modes : tuple of Mode
        Of the vehicle alone, fastest first.
    closed_modes : tuple of Mode
        Of the closed loop, those that are mostly of the vehicle.
    authority : dict of float
        By effector, share of the way from the middle of its range to its nearer limit that the trim uses.
    """

    stable: bool
    axes: tuple[str, ...]
    margins: dict[str, Margins]
    modes: tuple[Mode, ...]
    closed_modes: tuple[Mode, ...]
    authority: dict[str, float]

    def figures(self) -> dict[str, float]:
        """Return every number by its path, ``margins/M/phase_deg`` or ``modes/short period/damping``.

        Margins are nan where the loop is unstable.
        """
        found: dict[str, float] = {}
        for place, margins in self.margins.items():
            for name in FIGURES:
                value = getattr(margins, name) if self.stable else float("nan")
                found[f"margins/{place}/{name}"] = value
        for kind, modes in (("modes", self.modes), ("closed_modes", self.closed_modes)):
            for mode in modes:
                found[f"{kind}/{mode.name}/frequency"] = mode.frequency
                found[f"{kind}/{mode.name}/damping"] = mode.damping
        return found | {f"authority/{name}": value for name, value in self.authority.items()}

    def worst(self, figure: str, places: Sequence[str] | None = None) -> tuple[str, float]:
        """Return the place with the least of a figure of `Margins`, and that figure; nan where unstable."""
        among = {n: m for n, m in self.margins.items() if places is None or n in places}
        if not among or not self.stable:
            return "", float("nan")
        place = min(among, key=lambda n: getattr(among[n], figure))
        return place, float(getattr(among[place], figure))


@dataclass(frozen=True, eq=False)
class Consequence:
    """A gap's cost: the same figures without and with what was found.

    Attributes
    ----------
    before, after : State
    change : dict of float
        After less before, by the path of `State.figures`; nan where only one of them has it.
    after_intervals, change_intervals : dict of 2 floats
        From the quantiles of draws, at `level`; empty without draws.
    level : float
    unstable_share : float
        Of the draws, how many have an unstable closed loop; these are left out of the margins' intervals.
    """

    before: State
    after: State
    change: dict[str, float]
    after_intervals: dict[str, Interval]
    change_intervals: dict[str, Interval]
    level: float
    unstable_share: float

    def sentence(self) -> str:
        """Say what the phase margin loses at the axis that has the least of it in the end."""
        if not self.before.margins or not self.after.margins:
            return "there is no control law, so there are no margins"
        if not self.before.stable:
            return "the closed loop is unstable already as simulated, so there are no margins to compare"
        if not self.after.stable:
            return "as flown the closed loop is unstable, which the simulation says it is not"
        place, now = self.after.worst("phase_deg", self.after.axes)
        path = f"margins/{place}/phase_deg"
        lost = -self.change.get(path, float("nan"))
        if not np.isfinite(lost):
            return "no axis has a loop gain of one in both, so no phase margin can be compared"
        verb = "costs" if lost > 0 else "adds"
        said = f"{abs(lost):.1f} deg"
        if path in self.change_intervals:
            ends = sorted(-x if lost > 0 else x for x in self.change_intervals[path])
            said += f" ({ends[0]:.1f} to {ends[1]:.1f})"
        return f"as flown it {verb} {said} of phase margin at {place}, which leaves {now:.1f} deg"


def state_of(condition: Condition, *, exact: bool = True) -> State:
    """Return what is to be said of one condition; `exact` as in `margins.loop_margins`."""
    loop = condition.loop
    motion = [loop.states.index(n) for n in MOTION if n in loop.states]
    names = tuple(loop.states[i] for i in motion)
    return State(
        stable=loop.stable,
        axes=loop.axes,
        margins=loop.margins(exact=exact),
        modes=named_modes(loop.A[np.ix_(motion, motion)], names),
        closed_modes=loop.modes(),
        authority=trim_authority(condition.trim, condition.limits),
    )


def compare(
    before: Condition,
    after: Condition,
    draws: Sequence[tuple[Condition, Condition]] = (),
    *,
    level: float = 0.9,
) -> Consequence:
    """Compare two conditions under one law.

    Parameters
    ----------
    before, after : Condition
    draws : sequence of (Condition, Condition)
        Both as they may be too, drawn from what is not known of them.
    level : float
        Of the intervals.

    Returns
    -------
    Consequence
    """
    first, second = state_of(before), state_of(after)
    known: dict[int, dict[str, float]] = {}

    def drawn(condition: Condition) -> dict[str, float]:
        if condition is before:
            return first.figures()
        if id(condition) not in known:
            state = state_of(condition, exact=False)
            known[id(condition)] = {**state.figures(), "": float(state.stable)}
        return known[id(condition)]

    pairs = [(drawn(a), drawn(b)) for a, b in draws]
    figures = first.figures(), second.figures()
    change = _difference(*figures)
    changes = [_difference(a, b) for a, b in pairs]
    return Consequence(
        before=first,
        after=second,
        change=change,
        after_intervals=_quantiles([b for _, b in pairs], figures[1], level),
        change_intervals=_quantiles(changes, change, level),
        level=level,
        unstable_share=float(np.mean([b.get("", 1.0) == 0 for _, b in pairs])) if pairs else 0.0,
    )


def trim_authority(trim: Mapping[str, float], limits: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """Return the share of each effector's range, from its middle to the nearer limit, that a trim uses.

    Parameters
    ----------
    trim : mapping of float
        Positions by effector.
    limits : mapping of 2 floats
        Of those that have them.

    Returns
    -------
    dict of float
        0 in the middle, 1 at a limit.
    """
    return {
        name: abs(2 * position - sum(limits[name])) / (limits[name][1] - limits[name][0])
        for name, position in trim.items()
        if name in limits
    }


def peak_excursions(record: FlightRecord, names: Sequence[str]) -> dict[str, float]:
    """Return the largest departure of channels from their first samples over a recorded flight, SI.

    Parameters
    ----------
    record : FlightRecord
    names : sequence of str
        Channels by ``group/name``.

    Raises
    ------
    DataError
        Where one is missing.
    """
    return {name: float(np.max(np.abs(record[name] - record[name][0]))) for name in names}


def _difference(before: Mapping[str, float], after: Mapping[str, float]) -> dict[str, float]:
    def less(path: str) -> float:
        a, b = before.get(path, np.nan), after.get(path, np.nan)
        return 0.0 if a == b else float(b - a)  # infinite margins that stay so have not changed

    return {path: less(path) for path in {**before, **after} if path}


def _quantiles(
    drawn: Sequence[Mapping[str, float]], about: Mapping[str, float], level: float
) -> dict[str, Interval]:
    """Return intervals of those figures that most draws have."""
    found = {}
    for path in about:
        values = np.array([one.get(path, np.nan) for one in drawn])
        values = values[~np.isnan(values)]
        if values.size and values.size >= 0.5 * len(drawn):
            # infinite margins are numbers here, only not ones to interpolate between
            low, high = np.quantile(values, [(1 - level) / 2, (1 + level) / 2], method="closest_observation")
            found[path] = (float(low), float(high))
    return found
