"""Where two simulations are compared, and their residuals there as white numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.gap.beside import Beside
from freqid.gap.rivals_said import ALL

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Cell:
    """One response in a band and a regime; an edge between bands belongs to the lower one."""

    response: str
    band_hz: tuple[float, float]
    regime: str
    lowest: bool

    def of(self, one: Beside) -> tuple[int, NDArray[np.bool_]] | None:
        """Return the row and the lines of a manoeuvre that are in the cell; None without any."""
        names, hz, (low, high) = one.names, one.lines.hz, self.band_hz
        if self.regime not in (one.regime, ALL) or self.response not in names:
            return None
        at = ((hz > low) | (self.lowest & (hz == low))) & (hz <= high)
        return (names.index(self.response), at) if at.any() else None


@dataclass(frozen=True, eq=False)
class White:
    """Residuals, tolerances and noise as white numbers.

    Attributes
    ----------
    a, b : ndarray, shape (number,)
    allowed : ndarray, shape (tolerance, number)
        Half of the power is the tolerances' of A, half those of B.
    noise : tuple of 2 ndarray, shape (draw, number)
    floor : ndarray, shape (draw, number)
    shared : tuple of 2 ndarray, shape (tolerance,)
    maneuvers : int
        That hold them.
    """

    a: Array
    b: Array
    allowed: Array
    noise: tuple[Array, Array]
    floor: Array
    shared: tuple[Array, Array]
    maneuvers: int


def white_of(compared: Sequence[Beside], cell: Cell | None = None) -> White:
    """Return white numbers of all that is compared, or of one cell."""
    found = [(one, white) for one in compared if (white := _whitening(one, cell))]
    names = list(dict.fromkeys(name for one, _ in found for name in one.tolerances))
    alone = np.cumsum([len(names), *(len(one.own) for one, _ in found)])
    parts: list[list[Array]] = [[] for _ in range(6)]
    shared = np.zeros((2, alone[-1]))
    for (one, white), start in zip(found, alone, strict=False):
        a, b, *noise = (white(z) for z in (*one.left, *one.noise))
        allowed = np.zeros((alone[-1], a.size))
        at = [*map(names.index, one.tolerances), *range(start, start + len(one.own))]
        allowed[at] = white(np.concatenate([one.common, one.own]))
        shared[:, at] += _shared(one, cell)
        floor = white((one.noise[0] + one.noise[1]) / 2 * one.louder)
        for part, values in zip(parts, (a, b, allowed, *noise, floor), strict=True):
            part.append(values)
    a, b, allowed, noise_a, noise_b, floor = (np.concatenate(part, axis=-1) for part in parts)
    moved = allowed.any(axis=1)
    mine = shared[0, moved], shared[1, moved]
    return White(a, b, allowed[moved], (noise_a, noise_b), floor, mine, len(found))


def _shared(one: Beside, cell: Cell | None) -> Array:
    """Return what shared noise adds to products of tolerances with residuals, shape (2, tolerance)."""
    if cell is None:
        metric = np.linalg.inv(one.covariance)
    else:
        i, at = cell.of(one) or (0, np.zeros(one.lines.hz.size, dtype=bool))
        metric = np.zeros_like(one.covariance)
        metric[at, i, i] = 1 / one.covariance[at, i, i].real
    strength = [2 * np.einsum("lir,jrl->ji", metric, cross, optimize=True).real for cross in one.shared]
    return np.einsum("jti,aji->at", one.slopes, np.array(strength), optimize=True)


def _whitening(one: Beside, cell: Cell | None) -> Callable[[Complex], Array] | None:
    """Return what makes white numbers, shape (..., number), of rows on lines; None where none are there."""
    if cell is None:
        turn = np.sqrt(2) * np.linalg.inv(np.linalg.cholesky(one.covariance))
        return lambda z: _flat(np.einsum("lij,...jl->...il", turn, z), 2)
    found = cell.of(one)
    if found is None:
        return None
    i, at = found
    size = np.sqrt(2 / one.covariance[at, i, i].real)
    return lambda z: _flat(z[..., i, at] * size, 1)


def _flat(z: Complex, axes: int) -> Array:
    """Return the real and imaginary parts of the last axes in one."""
    flat = z.reshape(*z.shape[: z.ndim - axes], int(np.prod(z.shape[z.ndim - axes :])))
    return np.concatenate([flat.real, flat.imag], axis=-1)
