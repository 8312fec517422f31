"""What a gap costs, as a control engineer would say it: margins, modes, trim authority, before and after.

The control law is that of the simulation before; what changes is the vehicle under it
(docs/theory/consequence.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.record import FlightRecord
from freqid.gap.condition import Condition, State, state_of

Array = NDArray[np.float64]
Interval = tuple[float, float]

DRAWS = 200  # for intervals


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
