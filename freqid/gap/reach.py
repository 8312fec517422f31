"""How small an effect the diagnosis finds: draws of the null with the effect added, as it grows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from freqid.core.gap_self_test import Reach
from freqid.gap.attribute import OTHER, averaged, free, statistic, variants
from freqid.gap.evidence import Evidence, Hypothesis
from freqid.gap.inserted import Insertion, Place
from freqid.gap.signature import GIVEN
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]

POWER = 0.95
_GRID = np.geomspace(2.0, 800.0, 31)  # detectabilities


@dataclass(frozen=True, eq=False)
class Grown:
    """What null draws say of every explanation once an insertion is added to them some times over.

    Attributes
    ----------
    names : tuple of str
        Effects and *other*.
    parts : list of tuple of ndarray
        For each name constant, linear and square terms of its variants, shapes (variant, draw),
        (variant, insertion, draw) and (variant, insertion).
    """

    names: tuple[str, ...]
    parts: list[tuple[Array, Array, Array]]

    @classmethod
    def of(cls, evidence: Evidence, library: Mapping[str, Effect], columns: Sequence[int]) -> Grown:
        """Prepare the draws of an evidence for columns of it."""
        parts = {}
        for name, hypotheses in explanations(evidence, library).items():
            terms = [evidence.grown(h, columns) for h in hypotheses]
            parts[name] = tuple(np.array([t[k] for t in terms]) for k in range(3))
        return cls(tuple(parts), list(parts.values()))

    def statistic(self, insertion: int, factor: float) -> Array:
        """Return the statistic of a gap's existence with an insertion `factor` times, shape (draw,)."""
        each = [
            averaged(constant + factor * linear[:, insertion] + factor**2 * square[:, insertion, None])
            for constant, linear, square in self.parts
        ]
        return statistic(self.names, np.array(each).T)


def explanations(evidence: Evidence, library: Mapping[str, Effect]) -> dict[str, tuple[Hypothesis, ...]]:
    """Return the variants of every effect that can be judged, and of *other*."""
    found = {effect.id: variants(effect, evidence) for effect in library.values()}
    found[OTHER] = free(evidence)
    return {name: hypotheses for name, hypotheses in found.items() if hypotheses}


def first_order_size(
    evidence: Evidence, hypothesis: Hypothesis, threshold: float, names: int, options: int
) -> float:
    """Return the size of a hypothesis's first parameter that is found in 95 of 100 cases, by a formula.

    Parameters
    ----------
    evidence : Evidence
    hypothesis : Hypothesis
    threshold : float
        Of the statistic of a gap's existence.
    names : int
        Explanations that share the prior.
    options : int
        Variants of the effect.

    Notes
    -----
    To first order, and as if no other explanation added anything: an effect of detectability ``lambda``
    gives ``z^2 / 2`` with ``z`` normal about ``sqrt(lambda)``, less what prior, variants and Occam's factor
    take.
    """
    column, scale = hypothesis.columns[0], hypothesis.scale[0]
    gain = float(evidence.metric[column, column])
    width = gain * scale**2
    asked = 2 * (threshold + np.log(names) + np.log(options)) + np.log1p(width)
    need = np.sqrt(max(asked * (1 + width) / max(width, 1e-300), 0.0)) + norm.ppf(POWER)
    return float(need / np.sqrt(max(gain, 1e-300)))


def reach(
    evidence: Evidence,
    library: Mapping[str, Effect],
    insertions: Sequence[Insertion],
    threshold: float,
    first_order: Mapping[str, float],
) -> list[Reach]:
    """Return the size of each effect, place by place, that is found in 95 of 100 draws.

    Parameters
    ----------
    evidence : Evidence
        With the insertions among its columns.
    library : dict of Effect
    insertions : sequence of Insertion
        By place, sizes ascending. Between sizes that were replayed the shape of the nearer one is taken.
    threshold : float
        Of the statistic, above which a gap is called.
    first_order : dict of float
        The size that a formula states, by column of the signature.
    """
    grown = Grown.of(evidence, library, [evidence.column(one.column) for one in insertions])
    by_place: dict[Place, list[int]] = {}
    for i, one in enumerate(insertions):
        by_place.setdefault(one.place, []).append(i)
    found = []
    for place, at in by_place.items():
        shapes = [insertions[i] for i in at]
        power = np.array([power_at(grown, at, shapes, goal, threshold) for goal in _GRID])
        least = _crossing(power)
        size = _size(shapes, least)
        parameter = place.name.partition(GIVEN)[0]
        found.append(
            Reach(
                effect=place.effect,
                parameter=place.name,
                unit=library[place.effect].parameters[parameter].unit,
                size=size if size <= place.largest * (1 + 1e-9) else float("nan"),
                detectability=least,
                linear=first_order[place.column],
                largest=max(one.size for one in shapes),
            )
        )
    return found


def power_at(
    grown: Grown, at: Sequence[int], shapes: Sequence[Insertion], goal: float, threshold: float
) -> float:
    """Return the share of draws in which an effect is found.

    Parameters
    ----------
    grown : Grown
    at : sequence of int
        Of the effect's insertions at one place, in `grown`.
    shapes : sequence of Insertion
        These.
    goal : float
        Detectability at which the effect is.
    threshold : float
    """
    near = int(np.argmin([abs(np.log(one.detectability / goal)) for one in shapes]))
    factor = float(np.sqrt(goal / shapes[near].detectability))
    return float((grown.statistic(at[near], factor) >= threshold).mean())


def _crossing(power: Array) -> float:
    """Return the detectability from which the power stays at `POWER`, between grid points by its probit."""
    below = np.flatnonzero(power < POWER)
    if not below.size:
        return float(_GRID[0])
    first = int(below[-1]) + 1
    if first == len(_GRID):
        return float("nan")
    a, b = norm.ppf(np.clip(power[[first - 1, first]], 0.001, 0.999))
    share = np.clip((norm.ppf(POWER) - a) / max(b - a, 1e-9), 0.0, 1.0)
    low, high = np.log(_GRID[first - 1 : first + 1])
    return float(np.exp(low + share * (high - low)))


def _size(shapes: Sequence[Insertion], detectability: float) -> float:
    """Return the size of a detectability: straight between replayed ones in logarithms, linear beyond."""
    x = np.log([one.detectability for one in shapes])
    y = np.log([one.size for one in shapes])
    order = np.argsort(x)
    x, y, goal = x[order], y[order], np.log(detectability)
    outside = 0.5 * (min(goal - x[0], 0.0) + max(goal - x[-1], 0.0))
    return float(np.exp(np.interp(goal, x, y) + outside))
