"""Margins, modes and trim authority of a model under a control law, with their intervals, and their file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.core.layout import Attribute, Dataset, NestedSeries, ResultFile
from freqid.core.viewable import Viewable

UNITS = {
    "gain_up_db": "dB",
    "gain_down_db": "dB",
    "phase_deg": "deg",
    "delay_s": "s",
    "crossover_hz": "Hz",
    "modulus": "1",
    "disk": "1",
    "frequency": "rad/s",
    "damping": "1",
    "travel_left": "1",
}
"""Unit of a figure by the last part of its path."""

COMPARED = ("gain_up_db", "gain_down_db", "phase_deg", "disk")
"""Margins that are compared with those that stand beside."""


@dataclass(frozen=True, eq=False)
class Beside:
    """Another aircraft under the same law.

    Attributes
    ----------
    estimate : ndarray, shape (f, c)
        The same figures at the same conditions; nan where it has none.
    """

    estimate: Array


@dataclass(frozen=True, eq=False)
class LoopMargins(Viewable):
    """Figures of one control loop at c conditions along the corridor.

    Attributes
    ----------
    ids : tuple of str, length c
        Of the conditions.
    u, rho : ndarray, shape (c,)
        True speed, m/s, and density, kg/m3.
    figures : tuple of str, length f
        ``margins/M/phase_deg`` with M an axis of the law or an effector whose command is broken,
        ``margins/all axes/disk``, ``modes/short period/damping`` of the aircraft alone, ``closed_modes/...``
        under the law, ``trim/de1/travel_left``.
    estimate, lower, upper : ndarray, shape (f, c)
        From the model, and the interval at `level` from its covariance; nan where a condition has no such
        figure, margins where the loop is unstable, or without draws.
    stable : ndarray of bool, shape (c,)
        Of the closed loop.
    unstable_share : ndarray, shape (c,)
        Of the draws.
    axes, effectors : tuple of str
        Of the law.
    level : float
    draws, seed : int
    law, model : str
        Names.
    beside : mapping of str to Beside
        Others under the same law, by name: another model, or a simulation that was linearised.
    remarks : tuple of str
        What a reader should know, one sentence each.
    provenance : dict
        JSON-compatible.
    """

    ids: tuple[str, ...]
    u: Array
    rho: Array
    figures: tuple[str, ...]
    estimate: Array
    lower: Array
    upper: Array
    stable: NDArray[np.bool_]
    unstable_share: Array
    axes: tuple[str, ...]
    effectors: tuple[str, ...]
    level: float
    draws: int
    seed: int
    law: str
    model: str
    beside: Mapping[str, Beside] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        where, value = self.least("phase_deg")
        least = f"least phase margin {value:.1f} deg ({where})" if where else "no phase margin"
        return f"<LoopMargins of {self.model} under {self.law}: {len(self.ids)} conditions, {least}>"

    def __getitem__(self, condition: str) -> dict[str, tuple[float, float, float]]:
        """Return estimate, lower and upper limit of the figures that a condition has, by path."""
        if condition not in self.ids:
            raise UsageError(f"'{condition}' is no condition of it", remedy=nearest(condition, self.ids))
        i = self.ids.index(condition)
        rows = zip(self.figures, self.estimate[:, i], self.lower[:, i], self.upper[:, i], strict=True)
        return {f: (float(e), float(lo), float(hi)) for f, e, lo, hi in rows if not np.isnan(e)}

    def row(self, figure: str) -> Array:
        """Return estimate, lower and upper limit of one `figure`, shape (3, c)."""
        if figure not in self.figures:
            raise UsageError(f"there is no figure '{figure}'", remedy=nearest(figure, self.figures))
        i = self.figures.index(figure)
        return np.array([self.estimate[i], self.lower[i], self.upper[i]])

    def least(self, figure: str) -> tuple[str, float]:
        """Return where a margin, `figure`, is least over axes and conditions, and its value there."""
        found = [
            (float(self.row(path)[0, k]), f"{path.split('/')[1]} at {self.ids[k]}")
            for k in range(len(self.ids))
            if (path := least_of(self, k, figure, self.axes))
        ]
        value, where = min(found, default=(float("nan"), ""))
        return where, value

    @property
    def warnings(self) -> list[str]:
        """What must be answered before the loop is flown, one sentence each."""
        unstable = [name for name, stable in zip(self.ids, self.stable, strict=True) if not stable]
        doubtful = [
            f"{name} ({100 * share:.0f} % of the draws)"
            for name, share, stable in zip(self.ids, self.unstable_share, self.stable, strict=True)
            if stable and share > 0
        ]
        texts = []
        if unstable:
            texts.append(f"the closed loop is unstable at {', '.join(unstable)}: there are no margins")
        if doubtful:
            texts.append(
                f"the closed loop may be unstable, as far as the model knows, at {', '.join(doubtful)}"
            )
        return [*texts, *(text for text, _ in self.differing.values())]

    @property
    def differing(self) -> dict[str, tuple[str, float]]:
        """Those beside of whose margins more lie outside the model's interval than chance would put there.

        By name: a sentence, and the share that lies outside.
        """
        found = {}
        for name in self.beside:
            off, count = self.outside(name), int(self._compared(name).sum())
            if len(off) > (1 - self.level) * count:
                conditions = {condition for _, condition in off}
                places = [one for one in self.ids if one in conditions]
                found[name] = (
                    f"{len(off)} of {count} margins of {name} lie outside the model's interval, where chance "
                    f"alone would put {100 * (1 - self.level):.0f} %, at {', '.join(places)}",
                    len(off) / count,
                )
        return found

    def outside(self, name: str) -> list[tuple[str, str]]:
        """Return margins of axes, and conditions, whose interval does not hold that of `name` beside."""
        other = self.beside[name].estimate
        off = self._compared(name) & ((other < self.lower) | (other > self.upper))
        return [(self.figures[i], self.ids[k]) for i, k in np.argwhere(off)]

    def _compared(self, name: str) -> NDArray[np.bool_]:
        """Say which margins of axes both have, shape (f, c)."""
        known = ~np.isnan(self.beside[name].estimate) & ~np.isnan(self.lower)
        of_axes = {f"margins/{axis}/{figure}" for axis in self.axes for figure in COMPARED}
        return known & np.array([path in of_axes for path in self.figures])[:, None]


def least_of(found: LoopMargins, condition: int, figure: str, places: tuple[str, ...]) -> str:
    """Return the path of the least of a margin over places at one condition; empty where there is none."""
    rows = [
        (float(found.estimate[i, condition]), path)
        for place in places
        if (path := f"margins/{place}/{figure}") in found.figures
        for i in [found.figures.index(path)]
        if not np.isnan(found.estimate[i, condition])
    ]
    return min(rows, default=(0.0, ""))[1]


def unit_of(figure: str) -> str:
    """Return the unit of a figure by its path."""
    return UNITS[figure.rpartition("/")[2]]


_TABLE = ("figures", "ids")
_LAYOUT = {
    **{
        name: Attribute(f"@{name}", json=True)
        for name in ("ids", "axes", "effectors", "remarks", "provenance")
    },
    **{name: Attribute(f"@{name}") for name in ("level", "draws", "seed", "law", "model")},
    "figures": Attribute("@figures", json=True),
    "u": Dataset("reference/u", "m/s", ("ids",)),
    "rho": Dataset("reference/rho", "kg/m3", ("ids",)),
    **{name: Dataset(name, "mixed", _TABLE) for name in ("estimate", "lower", "upper")},
    "stable": Dataset("stable", "1", ("ids",)),
    "unstable_share": Dataset("unstable_share", "1", ("ids",)),
    "beside": NestedSeries(Beside, {"estimate": Dataset("beside/{name}", "mixed")}, "name", "@beside"),
}
FILE = ResultFile("freqid-loop-margins", LoopMargins, _LAYOUT)
write_loop_margins, read_loop_margins = FILE.write, FILE.read
