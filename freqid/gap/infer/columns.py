"""Whitened columns of one block: what the small matrices are inner products of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from freqid.gap.infer.system import BlockMatrices, Form

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Columns:
    """Whitened columns of one block, each of shape (column, number).

    Attributes
    ----------
    effects, tolerances, own, form : ndarray
        The last are errors of form of size one: of loads, actuators and relations between sensors.
    residual : ndarray, shape (number,)
    sigmas : ndarray of complex, shape (tolerance, row, line)
        One sigma of each tolerance, as it is before whitening.
    form_names : tuple of str
        Rows that have an error of form anywhere in the stack.
    form_row : ndarray of int, shape (column,)
        Which of these each column of the form is in.
    """

    effects: Array
    tolerances: Array
    own: Array
    form: Array
    residual: Array
    sigmas: Complex
    form_names: tuple[str, ...]
    form_row: NDArray[np.intp]

    @cached_property
    def matrices(self) -> BlockMatrices:
        """Their inner products."""
        return BlockMatrices.of(
            self.effects,
            self.tolerances,
            self.residual,
            self.own,
            self.form,
            self.own[:0],
            form_row=self.form_row,
        )

    def form_at(self, form_error: Form) -> Array:
        """Return the columns of the form at an error of it."""
        sizes = np.array(form_error.loads)[self.form_row]
        return sizes[sizes > 0, None] * self.form[sizes > 0]

    def kept(self, forms: Sequence[Form]) -> Columns:
        """Return these columns with those of the form alone that some errors of it need."""
        needed = np.any([f.loads for f in forms], axis=0)[self.form_row]
        return replace(self, form=self.form[needed], form_row=self.form_row[needed])

    def with_residual(self, residual: Array) -> Columns:
        """Return these columns beside another residual, shape (number,); most of the matrices stay."""
        new, m = replace(self, residual=residual), self.matrices
        z = np.concatenate([self.effects, self.tolerances, residual[None]])
        inner, across = z @ residual, self.form @ residual
        if len(self.own):
            factor = cho_factor(np.eye(len(self.own)) + self.own @ self.own.T)
            solved = cho_solve(factor, self.own @ residual)
            inner, across = inner - z @ (self.own.T @ solved), across - self.form @ (self.own.T @ solved)
        gram, form = m.gram.copy(), m.form.copy()
        gram[-1], gram[:, -1], form[:, -1] = inner, inner, across
        new.__dict__["matrices"] = replace(m, gram=gram, form=form)
        return new
