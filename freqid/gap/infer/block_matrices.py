"""Inner products of one block: all that is asked of its columns once they are made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, cholesky
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dtrtri

from freqid.core.arrays import Array
from freqid.gap.model.row_columns import RowColumns
from freqid.gap.settings import SEEN

_EMPTY = 1e-10  # of the largest eigenvalue of the form's columns: directions below it are none
_FACTORS = 32  # that are kept: all blocks of a usual stack at all errors of form that are weighed


class Form(NamedTuple):
    """Relative sizes of the errors of form.

    Attributes
    ----------
    loads : float or tuple of float
        Of every term, or of each term that has a form: share of the load or movement.
    shared : float
        Size of the errors that are the same in all blocks, see `BlockMatrices`: over that of their term's
        own errors in each, where they are of a term.
    log_prior : float
        Logarithm of how likely it is before the data.
    """

    loads: float | tuple[float, ...]
    shared: float
    log_prior: float = 0.0


@dataclass(frozen=True, eq=False)
class FormGram:
    """Inner products of a form's columns with each other; the same object as long as these stay.

    Attributes
    ----------
    gram : ndarray, shape (direction, direction)
    """

    gram: Array

    def lower(self, sizes: Array) -> Array:
        """Return L with ``L L' = 1 + S P S`` of the columns whose size is not zero, P their Gram."""
        at = np.flatnonzero(sizes)
        size = sizes[at]
        return lower_of(size[:, None] * self.gram[np.ix_(at, at)] * size)


@lru_cache(maxsize=_FACTORS)
def _kept_lower(form: FormGram, sizes: bytes) -> Array:
    """Return `FormGram.lower`, made once for all columns that are asked for beside the form."""
    return form.lower(np.frombuffer(sizes))


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Inner products of what is integrated out in a block: they stay where only other columns change.

    Attributes
    ----------
    own : ndarray, shape (own, own)
        Of the record's own unknowns.
    own_form : ndarray, shape (own, direction)
        Of these with the columns of the form.
    form : ndarray, shape (direction, direction)
        Of these columns.
    """

    own: Array
    own_form: Array
    form: Array

    @cached_property
    def factor(self) -> tuple[Array, bool]:
        """Cholesky factor of ``1 + own``."""
        return cho_factor(np.eye(len(self.own)) + self.own)

    @cached_property
    def form_beside_own(self) -> FormGram:
        """The form's products once the own unknowns are integrated out."""
        if not len(self.own):
            return FormGram(self.form)
        return FormGram(self.form - self.own_form.T @ cho_solve(self.factor, self.own_form))


class Data(NamedTuple):
    """Inner products of a block's residual.

    Attributes
    ----------
    columns : ndarray, shape (n,)
        With ``[X, T, A]``, as in `BlockMatrices`.
    form : ndarray, shape (direction,)
        With the columns of the form.
    energy : float
        With itself.
    """

    columns: Array
    form: Array
    energy: float


@dataclass(frozen=True, eq=False)
class Products:
    """Inner products of one block in the metric of its noise, before its own unknowns are integrated out.

    Attributes
    ----------
    gram : ndarray, shape (n, n)
        Of ``[X, T, A]``, as in `BlockMatrices`.
    form : ndarray, shape (direction, n)
    own : ndarray, shape (own, n)
    unknowns : Unknowns
    data : Data
    own_data : ndarray, shape (own,)
        Of the residual with the own unknowns.
    shared, number : int
        As in `BlockMatrices`.
    """

    gram: Array
    form: Array
    own: Array
    unknowns: Unknowns
    data: Data
    own_data: Array
    shared: int
    number: int

    @classmethod
    def of(
        cls,
        columns: Array,
        tolerances: Array,
        residual: Array,
        own: Array,
        form: Array | RowColumns,
        shared: Array,
    ) -> Products:
        """Return the products of whitened rows, each of shape (column, number)."""
        z = np.concatenate([columns, tolerances, shared])
        if isinstance(form, RowColumns):
            across, power = form.across(np.concatenate([z, residual[None], own])), form.gram()
        else:
            across, power = form @ np.concatenate([z, residual[None], own]).T, form @ form.T
        n = len(z)
        return cls(
            z @ z.T,
            across[:, :n],
            own @ z.T,
            Unknowns(own @ own.T, across[:, n + 1 :].T, power),
            Data(z @ residual, across[:, n], float(residual @ residual)),
            own @ residual,
            len(shared),
            residual.size,
        )

    def with_form(self, kept: NDArray[np.bool_]) -> Products:
        """Return them with some of the form's columns alone."""
        u = self.unknowns
        fewer = Unknowns(u.own, u.own_form[:, kept], u.form[np.ix_(kept, kept)])
        data = self.data._replace(form=self.data.form[kept])
        return replace(self, form=self.form[kept], unknowns=fewer, data=data)

    def with_own_sizes(self, sizes: Array) -> Products:
        """Return them where each of the record's own unknowns is so many times as large, shape (own,)."""
        u, each = self.unknowns, sizes[:, None]
        unknowns = Unknowns(each * u.own * sizes, each * u.own_form, u.form)
        return replace(self, own=each * self.own, own_data=sizes * self.own_data, unknowns=unknowns)

    def with_columns(
        self,
        kept: NDArray[np.intp],
        columns: Sequence[Array],
        residual: Array,
        own: Array,
        form: RowColumns,
    ) -> Products:
        """Return them of other columns, not all of them new.

        Parameters
        ----------
        kept : ndarray of int, shape (n,)
            The place that each had; -1 where it is new.
        columns : sequence of ndarray, shape (column, number)
            X, T and A.
        residual : ndarray, shape (number,)
        own : ndarray, shape (own, number)
            The same as before.
        form : RowColumns
        """
        at, first = np.flatnonzero(kept < 0), np.cumsum([0, *(len(c) for c in columns)])
        inside = np.split(at, np.searchsorted(at, first[1:]))
        new = np.concatenate([c[k - i] for c, k, i in zip(columns, inside[:-1], first[:-1], strict=True)])
        gram, across, known = self.gram[np.ix_(kept, kept)], self.form[:, kept], self.own[:, kept]
        gram[at] = _across(new, columns)
        gram[:, at] = gram[at].T
        across[:, at], known[:, at] = form.across(new), own @ new.T
        with_data = self.data.columns[kept]
        with_data[at] = new @ residual
        data = self.data._replace(columns=with_data)
        return replace(self, gram=gram, form=across, own=known, data=data)

    def with_residual(
        self, residual: Array, columns: Sequence[Array], own: Array, form: RowColumns
    ) -> Products:
        """Return them of another residual; all else as in `with_columns`."""
        products = np.concatenate([c @ residual for c in columns])
        data = Data(products, form.across(residual[None])[:, 0], float(residual @ residual))
        return replace(self, data=data, own_data=own @ residual)

    def beside(self, own: Array, columns: Sequence[Array], residual: Array, form: RowColumns) -> Products:
        """Return them beside other unknowns of the record; columns as in `with_columns`."""
        unknowns = Unknowns(own @ own.T, form.across(own).T, self.unknowns.form)
        return replace(self, own=_across(own, columns), unknowns=unknowns, own_data=own @ residual)

    def matrices(
        self,
        noise: float = 1.0,
        form_row: NDArray[np.intp] | None = None,
        shared_row: NDArray[np.intp] | None = None,
    ) -> BlockMatrices:
        """Return the matrices for noise of so many times the standard deviation of the metric.

        Parameters
        ----------
        noise : float
        form_row, shared_row : ndarray of int, optional
            As in `BlockMatrices`; where they are absent one size holds for all columns.
        """
        if noise != 1.0:
            return self._over(noise**2).matrices(form_row=form_row, shared_row=shared_row)
        inner, across, form, data = self.gram, self.form, self.unknowns.form_beside_own, self.data_beside_own
        if len(self.own):
            solved = cho_solve(self.unknowns.factor, self.own)
            inner = inner - self.own.T @ solved
            across = across - self.unknowns.own_form.T @ solved
        if form_row is None:
            power = form.gram
            values, vectors = np.linalg.eigh(power) if len(power) else (np.zeros(0), np.zeros((0, 0)))
            keep = values > _EMPTY * max(values.max(initial=0.0), 1e-300)
            across, form = vectors[:, keep].T @ across, FormGram(np.diag(values[keep]))
            data = data._replace(form=vectors[:, keep].T @ data.form)
            form_row = np.full(len(form.gram), -1)
        if shared_row is None:
            shared_row = np.full(self.shared, -1)
        half = half_determinant(self.unknowns.factor[0])
        return BlockMatrices(inner, across, form, form_row, shared_row, data, self.number, half)

    @property
    def data_beside_own(self) -> Data:
        """The residual's products once the own unknowns are integrated out."""
        if not len(self.own):
            return self.data
        columns, form, energy = self.data
        solved = cho_solve(self.unknowns.factor, self.own_data)
        return Data(
            columns - solved @ self.own,
            form - solved @ self.unknowns.own_form,
            energy - float(solved @ self.own_data),
        )

    def _over(self, variance: float) -> Products:
        """Return the products in the metric of noise of so many times the variance."""
        u = self.unknowns
        gram, form, own, own_data = (
            part / variance for part in (self.gram, self.form, self.own, self.own_data)
        )
        unknowns = Unknowns(*(part / variance for part in (u.own, u.own_form, u.form)))
        columns, in_form, energy = self.data
        data = Data(columns / variance, in_form / variance, energy / variance)
        return replace(self, gram=gram, form=form, own=own, unknowns=unknowns, data=data, own_data=own_data)


def _across(rows: Array, columns: Sequence[Array]) -> Array:
    """Return the inner products of rows with columns in parts."""
    return np.concatenate([rows @ c.T for c in columns], axis=1)


@dataclass(frozen=True, eq=False)
class BlockMatrices:
    """Inner products of one block in the metric of its noise and its own unknowns.

    ``[X, T, A]`` are the candidates' columns, the tolerances' and errors of form that all blocks share: what
    a simulation leaves out in one condition it leaves out in the next. The residual's products stand apart:
    where it alone is new, all else is the same object.

    Attributes
    ----------
    gram : ndarray, shape (n, n)
    form : ndarray, shape (direction, n)
        Inner products with the columns of the form.
    of_form : FormGram
        Of these columns with each other; diagonal where one size holds for all.
    form_row : ndarray of int, shape (direction,)
        Place in `Form.loads` of each column's term; -1 where one size holds for all.
    shared_row : ndarray of int, shape (shared,)
        Term of each column of the shared errors of form, the last ones; -1 where it is of none.
    data : Data
        Of the residual.
    number : int
        Real numbers in the stack.
    own_half : float
        Half the log determinant of the own unknowns.
    """

    gram: Array
    form: Array
    of_form: FormGram
    form_row: NDArray[np.intp]
    shared_row: NDArray[np.intp]
    data: Data
    number: int
    own_half: float = 0.0
    _taken: dict[float | tuple[float, ...], tuple[Array, float]] = field(
        init=False, default_factory=dict, repr=False
    )

    def with_data(self, data: Data) -> BlockMatrices:
        """Return the matrices of another residual."""
        new = replace(self, data=data)
        new._taken.update(self._taken)
        return new

    def some(self, columns: NDArray[np.intp]) -> BlockMatrices:
        """Return the matrices of some columns of ``[X, T, A]``, in this order."""
        data = self.data._replace(columns=self.data.columns[columns])
        return replace(self, gram=self.gram[np.ix_(columns, columns)], form=self.form[:, columns], data=data)

    @property
    def form_power(self) -> Array:
        """Energy of each of the form's columns."""
        return np.diag(self.of_form.gram)

    def sizes(self, error: float | tuple[float, ...]) -> Array:
        """Return the size of each of the form's columns at an error of form, shape (direction,)."""
        if isinstance(error, tuple):
            return np.array([*error, 0.0])[self.form_row]
        return np.full(len(self.form_row), error)

    def shared_sizes(self, form_error: Form) -> Array:
        """Return the size of each of the shared errors' columns, shape (shared,)."""
        if not isinstance(form_error.loads, tuple):
            return np.full(len(self.shared_row), form_error.shared)
        each = np.where(self.shared_row >= 0, np.array([*form_error.loads, 0.0])[self.shared_row], 1.0)
        return form_error.shared * each

    @property
    def count(self) -> int:
        """Columns of candidates and tolerances."""
        return len(self.gram) - len(self.shared_row)

    def at_loads(self, error: float | tuple[float, ...]) -> Array:
        """Return all inner products less what an error of form takes, shape (n, n)."""
        across, _ = self.taken(error)
        return self.gram - across.T @ across

    def data_at_loads(self, error: float | tuple[float, ...]) -> tuple[Array, float]:
        """Return the residual's products with ``[X, T, A]`` and itself, less what an error of form takes."""
        lower, size, at = self.factor(error)
        own = size * backward(lower, forward(lower, (size * self.data.form[at])[:, None]))[:, 0]
        spread = np.zeros(len(self.form))
        spread[at] = own
        return self.data.columns - spread @ self.form, self.data.energy - float(spread @ self.data.form)

    def taken(self, error: float | tuple[float, ...]) -> tuple[Array, float]:
        """Return what an error of form takes off all products, as a root; the last one is kept.

        Returns
        -------
        across : ndarray, shape (kept, n)
            Its square is taken off.
        determinant : float
            Half its log determinant, that of the own unknowns in it.
        """
        found = self._taken.get(error)
        if found is None:
            found = self._take(error)
            self._taken.clear()  # another thread may do so too: what is returned is not read back
            self._taken[error] = found
        return found

    def _take(self, error: float | tuple[float, ...]) -> tuple[Array, float]:
        if error and not isinstance(error, tuple):  # one size: directions at right angles to each other
            left = 1 + error**2 * self.form_power
            half = 0.5 * float(np.log(left).sum())
            return (error / np.sqrt(left))[:, None] * self.form, self.own_half + half
        lower, size, at = self.factor(error)
        return forward(lower, size[:, None] * self.form[at]), self.own_half + half_determinant(lower)

    def factor(
        self, error: float | tuple[float, ...], *, once: bool = False
    ) -> tuple[Array, Array, NDArray[np.intp]]:
        """Return what integrating out an error of form needs, S the sizes of its columns and P their Gram.

        Parameters
        ----------
        error : float or tuple of float
        once : bool
            Nothing else will be asked at this error of form: it is not kept.

        Returns
        -------
        lower : ndarray, shape (kept, kept)
            L with ``L L' = 1 + S P S``.
        size : ndarray, shape (kept,)
            S.
        at : ndarray of int, shape (kept,)
            Columns of the form that stand out of the noise at their size.
        """
        size = self.sizes(error)
        seen = size**2 * self.form_power > SEEN**2 if isinstance(error, tuple) else size > 0
        sizes, at = np.where(seen, size, 0.0), np.flatnonzero(seen)
        lower = self.of_form.lower(sizes) if once else _kept_lower(self.of_form, sizes.tobytes())
        return lower, size[at], at


def lower_of(gram: Array) -> Array:
    """Return L with ``L L' = 1 + gram``."""
    if not len(gram):
        return gram
    return cholesky(np.eye(len(gram)) + gram, lower=True, check_finite=False)


def inverse_of(lower: Array) -> Array:
    """Return the inverse of a lower triangular matrix."""
    return dtrtri(lower, lower=1)[0] if len(lower) else lower


def half_determinant(lower: Array) -> float:
    """Return half the log determinant of ``L L'``."""
    return float(np.log(np.diag(lower)).sum())


def forward(lower: Array, columns: Array) -> Array:
    """Return ``L^-1 B``, B of shape (row, column)."""
    return _solved(lower, columns, transposed=1)


def backward(lower: Array, columns: Array) -> Array:
    """Return ``L'^-1 B``, B of shape (row, column)."""
    return _solved(lower, columns, transposed=0)


def _solved(lower: Array, columns: Array, transposed: int) -> Array:
    """Solve for the transposes: numpy's rows are the columns of BLAS, so nothing is copied into its order."""
    return dtrsm(1.0, lower, columns.T, side=1, lower=1, trans_a=transposed).T if columns.size else columns


def rooted(gram: Array) -> tuple[Array, float]:
    """Return ``L^-1`` with ``L L' = 1 + gram``, and half the log determinant of that."""
    lower = lower_of(gram)
    return inverse_of(lower), half_determinant(lower)
