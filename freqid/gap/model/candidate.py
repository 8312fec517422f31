"""A candidate: one effect at one place, with what it makes of the stack at several sizes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.special import ndtr

from freqid.core.arrays import Array, Complex

OTHER = "other"
"""What no effect of the library explains: free changes of the simulation's terms, and its own parameters
beyond their tolerances."""

_TAIL, _POINTS = 4.0, 33  # sigmas up to which a tolerance is followed, and at how many sizes
_ABOUT = (0.75, 1.3)  # shares of an estimated size: those that `refined` computes lie between


@dataclass(frozen=True)
class Place:
    """Where an effect may act, or what else is given about it.

    Attributes
    ----------
    label : str
        ``de1``, ``group v_tail``, ``onset=0.2``, ``n4 time_constant=0.055``; empty where there is one place
        only.
    parameters : tuple of str
        That are moved: all by the same size, or each by its own in a vector.
    fixed : tuple of (str, float)
        Other parameters that are not at their default.
    effectors : tuple of str
        That it is at; empty where it is not at effectors.
    """

    label: str
    parameters: tuple[str, ...]
    fixed: tuple[tuple[str, float], ...] = ()
    effectors: tuple[str, ...] = ()

    @property
    def at(self) -> str:
        """The label without what else is given."""
        return " ".join(word for word in self.label.split() if "=" not in word)

    def settings(self, in_force: Mapping[str, float], size: float | Array) -> dict[str, float]:
        """Return the effect's parameters at a size, or at one each, added to their values in force."""
        sizes = np.broadcast_to(size, len(self.parameters)).tolist()
        return {n: in_force[n] + s for n, s in zip(self.parameters, sizes, strict=True)} | dict(self.fixed)


class Curve(NamedTuple):
    """Changes at many sizes as sums of those at a few.

    Attributes
    ----------
    sizes : ndarray, shape (size,)
        Ascending, zero not among them.
    mix : ndarray, shape (size, column)
        What the change at each size is made of.
    """

    sizes: Array
    mix: Array


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect at one place.

    Attributes
    ----------
    effect : str
    place : Place
    kind : {"scalar", "vector"}
    sizes : ndarray, shape (column,)
        Of a scalar: the sizes of its columns, ascending, zero not among them; of a vector: one sigma each.
    prior : ndarray
        Of a scalar: sizes that are equally likely; of a vector: multiples of `sizes` that are.
    columns : list of ndarray of complex, shape (column, row, line)
        By block: of a scalar, the change at each size; of a vector, by one sigma of each parameter.
    unit : str
        Of sizes.
    units : tuple of str
        Of a vector, by parameter.
    bounds : tuple of 2 floats
        Physical range of the size.
    curve : Curve, optional
        Of a scalar whose change was computed at more sizes than it has columns: the columns are those of
        which all others are sums.
    beside : tuple of (str, dict of float)
        Effects that were in force where it was computed, with their parameters, in order.
    after : tuple of (str, dict of float)
        Effects that act on what it makes: sizes near `about` change by as much as they do with these.
    about : float
        Its size in an explanation.
    departs : dict of float
        Departures of a simulation's own parameters that a size of one is, by name.
    spreads : dict of float
        One sigma of those of its `tolerances` that are stated, in the units of its sizes; negative where
        these are of the other sign.
    """

    effect: str
    place: Place
    kind: Literal["scalar", "vector"]
    sizes: Array
    prior: Array
    columns: list[Complex]
    unit: str = "1"
    bounds: tuple[float, float] = (-inf, inf)
    curve: Curve | None = None
    units: tuple[str, ...] = ()
    beside: tuple[tuple[str, dict[str, float]], ...] = ()
    after: tuple[tuple[str, dict[str, float]], ...] = ()
    about: float = 0.0
    departs: Mapping[str, float] = field(default_factory=dict)
    spreads: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """``effect`` or ``effect@place``."""
        return f"{self.effect}@{self.place.label}" if self.place.label else self.effect

    @property
    def tolerances(self) -> tuple[str, ...]:
        """Names of the tolerances of the same parameters, where each has a size of its own."""
        if len(self.departs) == 1:
            return tuple(self.departs)
        own = self.place.parameters
        if self.kind == "scalar" and len(own) != 1:
            return ()
        return own if self.effect == OTHER else tuple(f"{self.effect}.{n}" for n in own)

    @property
    def tolerance(self) -> str:
        """The tolerance of a scalar's parameter; empty where it has none of its own."""
        return self.tolerances[0] if self.kind == "scalar" and self.tolerances else ""

    @property
    def spread(self) -> float:
        """One sigma of `tolerance`."""
        return self.spreads.get(self.tolerance, 0.0)

    @cached_property
    def at_prior(self) -> Array:
        """Weights of a scalar's columns at each size of its prior, shape (size, column)."""
        return self.weights(self.prior)

    @cached_property
    def at_sums(self) -> Array:
        """The same at sizes between which the sum of effect and tolerance is equally likely, ascending."""
        if not self.spread:
            return self.at_prior
        spread = abs(self.spread)
        grid = np.unique(self.prior[:, None] + spread * np.linspace(-_TAIL, _TAIL, _POINTS))
        below = ndtr((grid[:, None] - self.prior) / spread).mean(axis=1)
        return self.weights(np.interp((np.arange(self.prior.size) + 0.5) / self.prior.size, below, grid))

    def weights(self, size: float | Array) -> Array:
        """Return the weights of a scalar's columns at a size: smooth between sizes, and to zero.

        Shape (column,), or (size, column) at several sizes.
        """
        weights = self._between_sizes(np.atleast_1d(size))
        weights = weights if self.curve is None else weights @ self.curve.mix
        return weights if np.ndim(size) else weights[0]

    @cached_property
    def _between_sizes(self) -> Callable[[Array], Array]:
        """Interpolation between the sizes, made once: its weights are asked for at thousands of sizes."""
        return _interpolated(self.sizes if self.curve is None else self.curve.sizes)

    def settings(self, column: int, in_force: Mapping[str, float], share: float = 1.0) -> dict[str, float]:
        """Return the effect's parameters at which a column is computed, at a share of its size."""
        place = self.place
        if self.kind == "vector":
            place = replace(place, parameters=place.parameters[column : column + 1])
        return place.settings(in_force, share * self.sizes[column])


def near(sizes: Array, about: float) -> NDArray[np.bool_]:
    """Return which sizes are among those that are computed about another one."""
    share = sizes / about
    return (share > _ABOUT[0]) & (share < _ABOUT[1])


def _interpolated(sizes: Array) -> Callable[[Array], Array]:
    """Return the interpolation between changes at some sizes, as a function of the sizes that are wanted.

    It gives the weights of the changes that are known in each one that is wanted, shape (wanted, size).

    By cubic Hermite polynomials through the sizes and zero, whose slopes are those of parabolas through three
    neighbours: weights are the same whatever the changes are, and a delay turns the phase, which straight
    lines between sizes cut short. Beyond the outermost sizes, and on a side where there is none, a change is
    taken as proportional.
    """
    nodes = np.union1d(sizes, 0.0)
    known = np.zeros((nodes.size, sizes.size))
    known[np.searchsorted(nodes, sizes), np.arange(sizes.size)] = 1.0
    slopes = np.gradient(known, nodes, axis=0, edge_order=2 if nodes.size > 2 else 1)
    inner = CubicHermiteSpline(nodes, known, slopes)

    def at(wanted: Array) -> Array:
        inside = np.clip(wanted, nodes[0], nodes[-1])
        weights = inner(inside)
        beyond = np.flatnonzero(wanted != inside)
        if beyond.size:
            outermost = nodes[np.where(wanted[beyond] > 0, -1, 0)]
            outermost = np.where(outermost, outermost, sizes[0])  # nothing is known on that side
            weights[beyond] = known[np.searchsorted(nodes, outermost)] * (wanted[beyond] / outermost)[:, None]
        return weights

    return at
