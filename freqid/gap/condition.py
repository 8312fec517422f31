"""What a control engineer would say of a vehicle under its control law: margins, modes, trim authority."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from freqid.gap.closed_loop import LinearLoop
from freqid.gap.margins import Margins
from freqid.gap.modes import MOTION, Mode, named_modes

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
