"""The stack and the model in small matrices: every question after this costs milliseconds.

Noise is white after each block's whitening. Offsets of the records and errors of form belong to one block
each and are integrated out there; tolerances are shared by all blocks and come last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, cholesky
from scipy.linalg.lapack import dtrtri

from freqid.gap.model.candidates import Candidate
from freqid.gap.settings import ACTUATOR_FORM_ERRORS, FORM_ERRORS

Array = NDArray[np.float64]

SEEN = 0.1  # standard deviations of the noise: directions of a form below it are left out
_FREE = 1e-9  # of a free column's energy: what is left of it
_EMPTY = 1e-10  # of the largest eigenvalue of the form's columns: directions below it are none


class Form(NamedTuple):
    """Relative sizes of the errors of form.

    Attributes
    ----------
    loads : float or tuple of float
        Share of each term of all rows, or of each row that has a form.
    actuators : float
        Share of each actuator's movement.
    log_prior : float
        Logarithm of how likely it is before the data.
    """

    loads: float | tuple[float, ...]
    actuators: float
    log_prior: float = 0.0


FORMS = tuple(Form(a, b) for a in FORM_ERRORS for b in ACTUATOR_FORM_ERRORS)
"""Where one share holds for all rows."""


@dataclass(frozen=True, eq=False)
class BlockMatrices:
    """Inner products of one block in the metric of its noise and its own unknowns.

    ``[X, T, r, A]`` are the candidates' columns, the tolerances', the residual and the errors of actuators'
    form, which all blocks share: a servo is the same in every condition.

    Attributes
    ----------
    gram : ndarray, shape (n, n)
    form : ndarray, shape (direction, n)
        Inner products with the columns of the form.
    form_gram : ndarray, shape (direction, direction)
        Of these columns with each other; diagonal where they are of no row.
    form_row : ndarray of int, shape (direction,)
        Row of each, among those that have a form; -1 where one share holds for all.
    actuators : int
        Number of columns of the actuators' form, the last ones.
    number : int
        Real numbers in the stack.
    """

    gram: Array
    form: Array
    form_gram: Array
    form_row: NDArray[np.intp]
    actuators: int
    number: int

    @classmethod
    def of(
        cls,
        columns: Array,
        tolerances: Array,
        residual: Array,
        own: Array,
        form: Array,
        actuators: Array,
        *,
        form_row: NDArray[np.intp] | None = None,
    ) -> BlockMatrices:
        """Return the matrices of whitened rows, each of shape (column, number)."""
        z = np.concatenate([columns, tolerances, residual[None], actuators])
        inner, across = z @ z.T, form @ z.T
        power = form @ form.T
        if len(own):
            own_z, own_form = own @ z.T, own @ form.T
            factor = cho_factor(np.eye(len(own)) + own @ own.T)
            solved = cho_solve(factor, own_z)
            inner = inner - own_z.T @ solved
            across = across - own_form.T @ solved
            power = power - own_form.T @ cho_solve(factor, own_form)
        if form_row is None:
            values, vectors = np.linalg.eigh(power) if len(power) else (np.zeros(0), np.zeros((0, 0)))
            keep = values > _EMPTY * max(values.max(initial=0.0), 1e-300)
            across, power = vectors[:, keep].T @ across, np.diag(values[keep])
            form_row = np.full(len(power), -1)
        return cls(inner, across, power, form_row, len(actuators), residual.size)

    @property
    def form_power(self) -> Array:
        """Energy of each of the form's columns."""
        return np.diag(self.form_gram)

    def sizes(self, error: float | tuple[float, ...]) -> Array:
        """Return the size of each of the form's columns at an error of form, shape (direction,)."""
        if isinstance(error, tuple):
            return np.array([*error, 0.0])[self.form_row]
        return np.full(len(self.form_row), error)

    @property
    def count(self) -> int:
        """Columns of candidates, tolerances and the residual."""
        return len(self.gram) - self.actuators

    def at_loads(self, error: float | tuple[float, ...]) -> tuple[Array, float]:
        """Return all inner products less the loads' error of form, and half its log determinant."""
        root, at, determinant = self.form_root(error)
        if not at.size:
            return self.gram, 0.0
        across = root @ self.form[at]
        taken = across.T @ across
        return np.subtract(self.gram, taken, out=taken), determinant

    def form_root(self, error: float | tuple[float, ...]) -> tuple[Array, NDArray[np.intp], float]:
        """Return what integrating out an error of form takes, S the sizes of its columns and P their Gram.

        Returns
        -------
        root : ndarray, shape (kept, kept)
            ``L^-1 S`` with ``L L' = 1 + S P S``.
        at : ndarray of int, shape (kept,)
            Columns of the form that stand out of the noise at their size.
        determinant : float
            Half the log determinant of ``1 + S P S``.
        """
        size = self.sizes(error)
        seen = size**2 * self.form_power > SEEN**2 if isinstance(error, tuple) else size > 0
        at = np.flatnonzero(seen)
        size = size[at]
        if not at.size:
            return np.zeros((0, 0)), at, 0.0
        inside = np.eye(at.size) + size[:, None] * self.form_gram[np.ix_(at, at)] * size
        lower = cholesky(inside, lower=True, check_finite=False)
        inverse = dtrtri(lower, lower=1)[0]
        return inverse * size, at, float(np.log(np.diag(lower)).sum())


@dataclass(frozen=True, eq=False)
class Reduced:
    """Candidates in the metric of noise, unknowns, form and tolerances, at one error of form.

    Attributes
    ----------
    G : ndarray, shape (column, column)
    g : ndarray, shape (column,)
        Of the residual.
    log_evidence : float
        Of no effect, less what all sizes of form have in common.
    """

    G: Array
    g: Array
    log_evidence: float

    def freed(self, directions: Array) -> Reduced:
        """Return what is left once weights of columns are free, shape (freed, column).

        The log evidence is that at their likeliest size.
        """
        across, projected = directions @ self.G, directions @ self.g
        own = across @ directions.T
        size = np.sqrt(np.maximum(np.diag(own), np.finfo(float).tiny))  # each counts alike, however small
        across, projected = across / size[:, None], projected / size
        own = own / size[:, None] / size + _FREE * np.eye(len(own))
        solved = np.linalg.solve(own, np.concatenate([across, projected[:, None]], axis=1))
        return Reduced(
            self.G - across.T @ solved[:, :-1],
            self.g - across.T @ solved[:, -1],
            self.log_evidence + 0.5 * float(projected @ solved[:, -1]),
        )


@dataclass(frozen=True, eq=False)
class System:
    """The whole stack.

    Attributes
    ----------
    candidates : list of Candidate
    start : ndarray of int, shape (candidate + 1,)
        Where each candidate's columns begin.
    tolerances : tuple of str
    blocks : list of BlockMatrices
    form_errors : tuple of Form
    """

    candidates: list[Candidate]
    start: NDArray[np.intp]
    tolerances: tuple[str, ...]
    blocks: list[BlockMatrices]
    form_errors: tuple[Form, ...] = FORMS
    _reduced: dict[Form, Reduced] = field(default_factory=dict, repr=False)

    @property
    def columns(self) -> int:
        """Of all candidates."""
        return int(self.start[-1])

    @property
    def number(self) -> int:
        """Real numbers in the stack."""
        return sum(b.number for b in self.blocks)

    def columns_of(self, candidate: int) -> slice:
        """Return where a candidate's columns are."""
        return slice(int(self.start[candidate]), int(self.start[candidate + 1]))

    def without(self, blocks: Sequence[int]) -> System:
        """Return the stack without some blocks."""
        kept = [b for i, b in enumerate(self.blocks) if i not in blocks]
        return System(self.candidates, self.start, self.tolerances, kept, self.form_errors)

    def only(self, blocks: Sequence[int]) -> System:
        """Return the stack of some blocks."""
        return self.without([i for i in range(len(self.blocks)) if i not in blocks])

    def gram(self, form_error: Form) -> tuple[Array, float]:
        """Return the inner products of all blocks before tolerances, and the log determinant of the form.

        Of ``[X, T, r]``; errors of the actuators' form stand behind the tolerances, as one more kind of
        these.
        """
        first, *others = [b.at_loads(form_error.loads) for b in self.blocks]
        gram, determinant = first
        for more, part in others:
            gram, determinant = gram + more, determinant + part
        determinant -= form_error.log_prior
        count = self.blocks[0].count
        if form_error.actuators == 0:
            return gram[:count, :count], determinant
        order = np.concatenate([np.arange(count - 1), np.arange(count, len(gram)), [count - 1]])
        scale = np.ones(len(gram))
        scale[count - 1 : -1] = form_error.actuators
        return gram[np.ix_(order, order)] * scale[:, None] * scale, determinant

    def reduced(self, form_error: Form) -> Reduced:
        """Return the small matrices at one error of form, made once."""
        if form_error not in self._reduced:
            self._reduced[form_error] = self.reduced_once(form_error)
        return self._reduced[form_error]

    def reduced_once(self, form_error: Form) -> Reduced:
        """Return the small matrices at an error of form that is not asked for again: they fill megabytes."""
        gram, determinant = self.gram(form_error)
        return _reduce(gram, determinant, self.columns)


def _reduce(gram: Array, determinant: float, n: int) -> Reduced:
    """Return what is left of inner products once tolerances of one sigma each are integrated out."""
    t = slice(n, len(gram) - 1)
    lower = cholesky(np.eye(t.stop - t.start) + gram[t, t], lower=True, check_finite=False)
    inverse = dtrtri(lower, lower=1)[0]
    across, own = inverse @ gram[t, :n], inverse @ gram[t, -1]
    G = gram[:n, :n] - across.T @ across
    g = gram[:n, -1] - across.T @ own
    energy = float(gram[-1, -1] - own @ own)
    half = float(np.log(np.diag(lower)).sum())
    return Reduced(G, g, -0.5 * energy - determinant - half)
