"""Where on the corridor's lines states are, and whether that is near enough."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.blend.line import Line, Position
from freqid.blend.similarity import ALIKE, equivalent, goes_with_velocity, not_similar
from freqid.core.arrays import Array
from freqid.core.errors import DataError, UsageError
from freqid.core.results.corridor import Corridor

Outside = Literal["refuse", "hold"]


@dataclass(frozen=True)
class CorridorTolerance:
    """How far from a line its models may be used.

    Attributes
    ----------
    tilt : float
        Of each scheduled angle, rad; of another variable, as `freqid.blend.line.turns` makes it.
    speed : float
        Equivalent, m/s.
    """

    tilt: float = float(np.deg2rad(5))
    speed: float = 4.0

    def exceeded(self, at: Position) -> NDArray[np.bool_]:
        """Say where a line is too far away, shape (n,)."""
        return (np.abs(at.schedule_off) > self.tilt).any(axis=0) | (np.abs(at.speed_off) > self.speed)


@dataclass(frozen=True)
class Located:
    """States in equivalent quantities, and their places on all lines.

    Attributes
    ----------
    x : ndarray, shape (regressor, n)
        Equivalent regressors, in the order of ``Corridor.units``.
    scale : ndarray, shape (regressor, n)
        Equivalent over true regressors.
    u, rho, k : ndarray, shape (n,)
        True speed, density, and equivalent over true velocity.
    positions : list of Position
        By line.
    weights, slopes : ndarray, shape (line, n)
        How much each line counts, and the derivative of that with respect to density.
    outside : ndarray of bool, shape (n,)
        Where a line that counts is farther away than the tolerance.
    """

    x: Array
    scale: Array
    u: Array
    rho: Array
    k: Array
    positions: list[Position]
    weights: Array
    slopes: Array
    outside: NDArray[np.bool_]


def locate(
    corridor: Corridor,
    lines: Sequence[Line],
    inputs: Mapping[str, ArrayLike],
    needed: Sequence[str],
    tolerance: CorridorTolerance,
    outside: Outside,
) -> Located:
    """Place states on the lines of a corridor.

    Parameters
    ----------
    corridor : Corridor
    lines : sequence of Line
    inputs : mapping of str to array_like, shape (n,)
        True values, SI.
    needed : sequence of str
        Inputs that must be there; a tilt that is not among them stays where the corridor has it.
    tolerance : Tolerance
    outside : {"refuse", "hold"}

    Raises
    ------
    UsageError
        Where an input is missing.
    DataError
        Where one is not finite, or a state is outside and that is refused.
    """
    given = _checked(corridor, inputs, needed)
    rho, u = given["rho"], given["u"]
    schedule = np.array([given[name] for name in corridor.scheduled]).reshape(-1, rho.size)
    k = equivalent(rho)
    scale = k ** goes_with_velocity(corridor.units)[:, None]
    x = np.array([given[name] for name in corridor.units]) * scale
    positions = [line.position(u * k, schedule) for line in lines]
    weights, slopes = between(lines, rho)
    far = [(w > 0) & tolerance.exceeded(p) for p, w in zip(positions, weights, strict=True)]
    bound = not_similar(corridor.units)
    if bound:
        far.append(np.abs(rho / lines[0].rho - 1) > ALIKE)
    at = Located(x, scale, u, rho, k, positions, weights, slopes, np.any(far, axis=0))
    if outside == "refuse" and at.outside.any():
        first = int(at.outside.argmax())
        if bound and far[-1][first]:
            found = f"rho = {rho[first]:.4g} kg/m3, the points {lines[0].rho:.4g}, and no law carries "
            found += f"'{bound[0]}' from one density to another"
        else:
            found = _distance(corridor, lines, at, schedule, first, tolerance)
        raise DataError(
            f"{np.count_nonzero(at.outside)} of {rho.size} samples are off the corridor; sample {first} has "
            + found,
            remedy="add points there, cut the samples, or hold the nearest parameters (outside 'hold')",
        )
    return at


def between(lines: Sequence[Line], rho: Array) -> tuple[Array, Array]:
    """Return how much each line counts at a density, and the derivative of that, shape (line, n) each.

    Linear in density between lines; beyond the outermost ones they alone count.
    """
    at = np.array([line.rho for line in lines])
    if at.size == 1:
        return np.ones((1, rho.size)), np.zeros((1, rho.size))
    i = np.clip(np.searchsorted(at, rho) - 1, 0, at.size - 2)
    rise = 1 / (at[i + 1] - at[i])
    share = np.clip((rho - at[i]) * rise, 0.0, 1.0)
    rise = np.where((rho > at[0]) & (rho < at[-1]), rise, 0.0)
    weights, slopes = np.zeros((2, at.size, rho.size))
    n = np.arange(rho.size)
    weights[i, n], weights[i + 1, n] = 1 - share, share
    slopes[i, n], slopes[i + 1, n] = -rise, rise
    return weights, slopes


def _checked(corridor: Corridor, inputs: Mapping[str, ArrayLike], needed: Sequence[str]) -> dict[str, Array]:
    """Return all inputs in one shape (n,), finite."""
    missing = [name for name in needed if name not in inputs]
    if missing:
        raise UsageError(f"input '{missing[0]}' is missing", remedy=f"the model needs {', '.join(needed)}")
    still: dict[str, ArrayLike] = dict(zip(corridor.scheduled, corridor.schedule[:, 0], strict=True))
    names = (*corridor.scheduled, *needed)
    given = {name: np.asarray(inputs.get(name, still.get(name)), float) for name in names}
    size = np.broadcast_shapes((1,), *(v.shape for v in given.values()))
    for name, v in given.items():
        wrong = ~np.isfinite(v) if name != "rho" else ~((v > 0) & np.isfinite(v))
        if wrong.any():
            expected = "a positive number" if name == "rho" else "a finite number"
            at = int(np.atleast_1d(wrong).argmax())
            raise DataError(
                f"input '{name}' is {np.atleast_1d(v)[at]} at sample {at}, expected {expected}",
                remedy="repair it or cut the sample",
            )
    return {name: np.broadcast_to(v, size) for name, v in given.items()}


def _distance(
    corridor: Corridor,
    lines: Sequence[Line],
    at: Located,
    schedule: Array,
    i: int,
    tolerance: CorridorTolerance,
) -> str:
    """Return in words how far one sample is from the line that counts most."""
    most = int(at.weights[:, i].argmax())
    p = at.positions[most]
    if abs(p.speed_off[i]) > tolerance.speed:
        nearest = at.u[i] - p.speed_off[i] / at.k[i]
        return f"u = {at.u[i]:.4g} m/s, the corridor nearby {nearest:.4g} m/s"
    row = int(np.abs(p.schedule_off[:, i]).argmax())
    unit, name = corridor.scheduled_units[row], corridor.scheduled[row]
    flown, off = np.array([schedule[row, i], p.schedule_off[row, i] / lines[most].turn[row]])
    shown, factor = ("deg", np.rad2deg(1.0)) if unit == "rad" else (unit, 1.0)
    return f"{name} = {factor * flown:.4g} {shown}, the corridor nearby {factor * (flown - off):.4g} {shown}"
