"""What taking a mistake back does to a residual, and whether it is by exactly the mistake's size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.gap.bookkeeping.comparison import Comparison, Parts, difference, energy

SHARP = 0.15  # departure of the fitted size from the mistake's own
_SCATTERS = 2.0  # standard deviations of the noise's energy within which there is nothing but noise
LEAST = 0.003  # residual over the response's own energy that is worth a word
# Of a change, its share in motion or in level, and of a response's energy: what has to be right by itself.
# Levels are judged less, because sensors' offsets are among them.
_MOTION, _LEVEL, _ROW = 0.02, 0.2, 0.005
_NUMBERS = 1.5  # that a change has to be spread over: one alone fits one of a hundred mistakes by chance


@dataclass(frozen=True, eq=False)
class Correction:
    """What taking a mistake back does to the residual; energies by response, summed over records.

    Attributes
    ----------
    before, after : ndarray, shape (response,)
    touched : ndarray of int
        Responses that it is judged by.
    fitted : float
        How much of the change fits best; one for a mistake that is exactly what it is called.
    apart, by_row : tuple of float
        The same of fluctuations and levels, and of each response, by themselves, where they change enough.
    numbers : float
        Over how many independent numbers the change is spread: the level of each response in each record is
        one, its fluctuation as many as there are degrees of freedom.
    """

    before: Array
    after: Array
    touched: NDArray[np.intp]
    fitted: float
    apart: tuple[float, ...]
    by_row: tuple[float, ...]
    numbers: float

    @classmethod
    def of(
        cls, comparisons: Sequence[Comparison], predicted: Sequence[Array], rows: Sequence[int]
    ) -> Correction:
        """Return the correction that predictions without a mistake of these responses make."""
        now = [t.residual(t.predicted) for t in comparisons]
        then = [t.residual(p) for t, p in zip(comparisons, predicted, strict=True)]
        changes = [difference(a, b) for a, b in zip(now, then, strict=True)]
        before, after, size = (
            np.sum([energy(part) for part in parts], axis=0) for parts in (now, then, changes)
        )
        touched = np.array(rows, dtype=int) if len(rows) else np.flatnonzero(size > 0.1 * before)
        products, sizes = [], []  # of fluctuations and levels, by response
        for part in (0, 1):
            now_part, by_part = ([np.reshape(x[part], (len(size), -1)) for x in xs] for xs in (now, changes))
            pairs = list(zip(now_part, by_part, strict=True))
            products.append(np.sum([(r * c).sum(axis=1) for r, c in pairs], axis=0)[touched])
            sizes.append(np.sum([(c**2).sum(axis=1) for _, c in pairs], axis=0)[touched])
        by_row, of_row = np.sum(products, axis=0), np.sum(sizes, axis=0)
        whole = max(float(of_row.sum()), 1e-300)
        apart = [
            float(p.sum() / size.sum())
            for p, size, least in zip(products, sizes, (_MOTION, _LEVEL), strict=True)
            if size.sum() > least * whole
        ]
        each = [float(p / s) for p, s in zip(by_row, of_row, strict=True) if s > _ROW * len(comparisons)]
        fitted = float(by_row.sum()) / whole
        numbers = _spread(changes, [t.degrees_of_freedom for t in comparisons])
        return cls(before, after, touched, fitted, tuple(apart), tuple(each), numbers)

    @property
    def sharp(self) -> bool:
        """Whether it is by exactly the mistake's size that the change fits, and not by chance."""
        return (
            self.numbers > _NUMBERS
            and abs(self.fitted - 1) < SHARP
            and all(abs(part - 1) < 2 * SHARP for part in self.apart)
            and all(abs(row - 1) < 4 * SHARP for row in self.by_row)
        )

    @property
    def gain(self) -> float:
        """Energy that goes, of all responses."""
        return float((self.before - self.after).sum())

    def explained(self, noise: Array | float, freedom: int = 1) -> float:
        """Return the share that goes of what is not noise; zero where there is hardly anything.

        Parameters
        ----------
        noise : ndarray, shape (response,)
            Its energy.
        freedom : int
            Independent numbers that each energy is the sum of: noise scatters by the root of 2 over these.
        """
        noise = np.broadcast_to(noise, self.before.shape)
        before, after = (np.maximum(e - noise, 0.0)[self.touched].sum() for e in (self.before, self.after))
        scatter = float(np.linalg.norm(noise[self.touched])) * np.sqrt(2 / freedom)
        least = max(LEAST * max(1, self.touched.size), _SCATTERS * scatter)
        return float(1 - after / before) if before > least else 0.0


def _spread(changes: Sequence[Parts], freedom: Sequence[int]) -> float:
    """Return the participation ratio of a change: its energy squared over its numbers' squared energies."""
    energies = [
        np.concatenate([(f**2).sum(axis=1), level**2]) / np.repeat([n, 1], len(level))
        for (f, level), n in zip(changes, freedom, strict=True)
    ]
    counts = [np.repeat([n, 1], len(level)) for (_, level), n in zip(changes, freedom, strict=True)]
    e, n = np.concatenate(energies), np.concatenate(counts)
    return float((n * e).sum() ** 2 / max((n * e**2).sum(), 1e-300))


def gain_of(comparisons: Sequence[Comparison], predicted: Sequence[Array]) -> float:
    """Return how much residual a change removes where it may be somewhat smaller or larger."""
    gain = 0.0
    for comparison, there in zip(comparisons, predicted, strict=True):
        now, then = comparison.residual(comparison.predicted), comparison.residual(there)
        change = difference(now, then)
        product = float((now[0] * change[0]).sum() + (now[1] * change[1]).sum())
        size = float(energy(change).sum())
        fitted = np.clip(product / size, 0.0, 2.0) if size > 0 else 0.0
        gain += 2 * fitted * product - fitted**2 * size
    return gain
