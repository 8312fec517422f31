"""Columns that lie in one row of a block each: errors of form, before whitening.

There are more of them than of all others. Whitening spreads a column over all rows, of which there are
dozens. So it is the other factor of an inner product that is taken to where these columns are: with W the
whitening matrix of a line, ``(W c)^H x = c^H (W^H x)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array, Complex
from freqid.gap.model.form import FormColumns
from freqid.gap.stack.block import Block
from freqid.gap.stack.lines import Lines
from freqid.gap.stack.noise import whitening_of

_AT_ONCE = 200  # columns that are taken back through the whitening together


@dataclass(frozen=True, eq=False)
class RowColumns:
    """Columns of one row each, seen in the metric of a block's noise.

    Attributes
    ----------
    row : ndarray of int, shape (column,)
    values : ndarray, shape (column, number)
        Real numbers of the spectrum in that row.
    whitening : ndarray of complex, shape (line, row, row)
    lines : Lines
    seen : ndarray of bool, shape (number,)
        Which numbers of a row are in the stack.
    """

    row: NDArray[np.intp]
    values: Array
    whitening: Complex
    lines: Lines
    seen: NDArray[np.bool_]

    @classmethod
    def of(
        cls, block: Block, columns: Sequence[FormColumns], rows: Sequence[int] | None = None
    ) -> RowColumns:
        """Return the columns of terms; of some rows of the block alone, all others left out, where given."""
        number = 2 * block.lines.hz.size - 1
        rows = range(len(block.rows)) if rows is None else rows
        place = {row: k for k, row in enumerate(rows)}
        used = [c for c in columns if c.row in place]
        at = [np.full(len(c.spectra), place[c.row]) for c in used]
        values = [block.lines.real(c.spectra) for c in used]
        whole = len(place) == len(block.rows)
        whitening = (
            block.whitening if whole else whitening_of(block.covariance[:, list(place)][:, :, list(place)])
        )
        return cls(
            np.concatenate([[], *at]).astype(np.intp),
            np.concatenate([np.zeros((0, number)), *values]),
            whitening,
            block.lines,
            np.ones(number, dtype=bool),
        )

    def __len__(self) -> int:
        return len(self.row)

    def some(self, chosen: NDArray[np.bool_]) -> RowColumns:
        """Return some of the columns."""
        return replace(self, row=self.row[chosen], values=self.values[chosen])

    def only(self, numbers: NDArray[np.bool_]) -> RowColumns:
        """Return the columns in a stack of some numbers of each row, shape (number,): of whole lines."""
        return replace(self, values=self.values * numbers, seen=numbers)

    def across(self, white: Array) -> Array:
        """Return inner products with whitened columns, shape (column, other).

        Parameters
        ----------
        white : ndarray, shape (other, row x number that is seen)
        """
        found = np.empty((len(self), len(white)))
        for start in range(0, len(white), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            back = self._back(white[part])
            for i, at in self._by_row():
                found[at, part] = self.values[at] @ back[:, i].T
        return found

    def gram(self) -> Array:
        """Return inner products with each other, shape (column, column)."""
        metric = np.conj(np.swapaxes(self.whitening, 1, 2)) @ self.whitening
        by_row = [(i, at, self.values[at]) for i, at in self._by_row()]
        found = np.empty((len(self),) * 2)
        for k, (i, at, own) in enumerate(by_row):
            spectra = self.lines.complex(own)
            for j, other, values in by_row[k:]:
                moved = self.lines.real(metric[:, j, i] * spectra)
                products = moved @ values.T
                found[np.ix_(at, other)] = products
                found[np.ix_(other, at)] = products.T
        return found

    def white(self) -> Array:
        """Return them whitened, shape (column, row x number that is seen)."""
        spectra = self.lines.complex(self.values)
        moved = np.moveaxis(self.whitening, 0, 2)[:, self.row].transpose(1, 0, 2) * spectra[:, None]
        number = moved.shape[1] * int(self.seen.sum())
        return self.lines.real(moved)[..., self.seen].reshape(len(self), number)

    def _back(self, white: Array) -> Array:
        """Return ``W^H`` times whitened columns, shape (column, row, number)."""
        rows = self.whitening.shape[1]
        whole = np.zeros((len(white), rows, self.seen.size))
        whole[..., self.seen] = white.reshape(len(white), rows, -1)
        back = np.conj(self.whitening).transpose(0, 2, 1) @ self.lines.complex(whole).transpose(2, 1, 0)
        return self.lines.real(back.transpose(2, 1, 0))

    def _by_row(self) -> list[tuple[int, NDArray[np.intp]]]:
        return [(int(i), np.flatnonzero(self.row == i)) for i in np.unique(self.row)]
