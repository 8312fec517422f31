"""The stack and the model in small matrices: every question after this costs milliseconds.

Noise is white after each block's whitening. Offsets of the records and errors of form belong to one block
each and are integrated out there; tolerances are shared by all blocks and come last.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from freqid.core.arrays import Array
from freqid.gap.infer.block_matrices import (
    BlockMatrices,
    Form,
    backward,
    forward,
    half_determinant,
    inverse_of,
    rooted,
)
from freqid.gap.model.candidate import Candidate

if TYPE_CHECKING:
    from freqid.gap.infer.evidence import Estimate

_FREE = 1e-9  # of a free column's energy: what is left of it


class Posterior(NamedTuple):
    """What the data say of the tolerances, in sigmas.

    Attributes
    ----------
    mean : ndarray, shape (tolerance, ...)
        Without an effect.
    slopes : ndarray, shape (tolerance, column)
        By which it is less for each column in the data.
    variance : ndarray, shape (tolerance,)
    """

    mean: Array
    slopes: Array
    variance: Array


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
    posterior : Posterior
    tolerance_rows : ndarray, optional
        Of `System.tolerance_rows`, where these were made on the way.
    """

    G: Array
    g: Array
    log_evidence: float
    posterior: Posterior
    tolerance_rows: Array | None = None

    def own(self, layout: Sequence[NDArray[np.intp]]) -> list[Array]:
        """Return each candidate's inner products alone; `layout` as in `OwnProducts`."""
        return [self.G[c[:, :, None], c[:, None, :]] for c in layout]

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
        mean, slopes, variance = self.posterior
        moved = slopes @ (directions / size[:, None]).T
        return Reduced(
            self.G - across.T @ solved[:, :-1],
            self.g - across.T @ solved[:, -1],
            self.log_evidence + 0.5 * float(projected @ solved[:, -1]),
            Posterior(
                mean - moved @ solved[:, -1],
                slopes - moved @ solved[:, :-1],
                variance + (moved * np.linalg.solve(own, moved.T).T).sum(axis=1),
            ),
        )

    def given(self, weights: Array) -> Reduced:
        """Return what is left once some weights of columns are known to be in the data."""
        moved = self.G @ weights
        log = self.log_evidence + float(weights @ self.g - 0.5 * weights @ moved)
        known = self.posterior
        known = known._replace(mean=known.mean - known.slopes @ weights)
        return Reduced(self.G, self.g - moved, log, known)


@dataclass(frozen=True, eq=False)
class OwnProducts:
    """The part of `Reduced` that Bayes factors of single candidates need: a hundredth of it.

    Attributes
    ----------
    products : list of ndarray, shape (candidate, column, column)
        Inner products of each candidate's columns, candidates of the same number of columns together.
    g : ndarray, shape (column,)
        Of the residual, of all candidates.
    log_evidence : float
    posterior : Posterior
        As in `Reduced`.
    """

    products: list[Array]
    g: Array
    log_evidence: float
    posterior: Posterior

    def own(self, layout: Sequence[NDArray[np.intp]]) -> list[Array]:
        """Return `products`; `layout`, columns of shape (candidate, column), is what they were made for."""
        return self.products


class About(NamedTuple):
    """Sizes of all that is unknown at which a simulation was asked.

    Attributes
    ----------
    tolerances : ndarray, shape (tolerance,)
        Sigmas.
    acting : sequence of (int, Estimate)
        Candidates with their sizes.
    form_error : Form
    misfit : float
        Nats by which data and tolerances are unlikely there, but for a constant.
    """

    tolerances: Array
    acting: Sequence[tuple[int, Estimate]]
    form_error: Form
    misfit: float


@dataclass(frozen=True, eq=False)
class System:
    """The whole stack.

    Attributes
    ----------
    candidates : list of Candidate
    tolerances : tuple of str
    blocks : list of BlockMatrices
    form_errors : tuple of Form
    about : About, optional
        Where its lines were made straight.
    """

    candidates: list[Candidate]
    tolerances: tuple[str, ...]
    blocks: list[BlockMatrices]
    form_errors: tuple[Form, ...]
    about: About | None = None
    _reduced: dict[Form, Reduced] = field(default_factory=dict, repr=False)

    @cached_property
    def start(self) -> NDArray[np.intp]:
        """Where each candidate's columns begin and the last one's end, shape (candidate + 1,)."""
        return np.cumsum([0, *(c.sizes.size for c in self.candidates)])

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

    def places(self, candidates: Sequence[int]) -> NDArray[np.intp]:
        """Return where the columns of some candidates are, one candidate after the other."""
        return np.concatenate([np.arange(self.start[i], self.start[i + 1]) for i in candidates])

    def only(self, blocks: Sequence[int]) -> System:
        """Return the stack of some blocks."""
        kept = [b for i, b in enumerate(self.blocks) if i in blocks]
        return replace(self, blocks=kept, _reduced={})

    def of(self, candidates: Sequence[int]) -> System:
        """Return the stack with some of the candidates."""
        own = self.places(candidates) if len(candidates) else np.zeros(0, dtype=np.intp)
        kept = np.concatenate([own, np.arange(self.columns, len(self.blocks[0].gram))])
        blocks = [replace(b, gram=b.gram[np.ix_(kept, kept)], form=b.form[:, kept]) for b in self.blocks]
        few = [self.candidates[i] for i in candidates]
        return replace(self, candidates=few, blocks=blocks, about=self._about_only(candidates), _reduced={})

    def _about_only(self, candidates: Sequence[int]) -> About | None:
        """Return where lines were made straight, effects by their places among some candidates."""
        if self.about is None:
            return None
        at = {i: k for k, i in enumerate(candidates)}
        return self.about._replace(acting=[(at[i], e) for i, e in self.about.acting if i in at])

    def own_tolerances(self, candidates: Iterable[int]) -> list[int]:
        """Return the places of tolerances that are of some candidates' parameters."""
        names = {n for i in candidates for n in self.candidates[i].tolerances}
        return [k for k, name in enumerate(self.tolerances) if name in names]

    @property
    def asked(self) -> Array:
        """Departures of the tolerances, in sigmas, where lines were made straight, shape (tolerance,)."""
        return np.zeros(len(self.tolerances)) if self.about is None else self.about.tolerances

    def asked_together(self, candidate: int) -> Array:
        """Return what was asked of a candidate's parameters for their tolerances, shape (column,).

        As weights of its columns: of a scalar those of all that was asked of it, less those of its own size.
        """
        c = self.candidates[candidate]
        if c.kind == "vector":
            departures = dict(zip(self.tolerances, self.asked.tolist(), strict=True))
            return np.array([departures.get(n, 0.0) * c.spreads.get(n, 0.0) for n in c.tolerances]) / c.sizes
        departure = self.asked[self.tolerances.index(c.tolerance)]
        acting = {} if self.about is None else {i: float(e.size[0]) for i, e in self.about.acting}
        size = acting.get(candidate, 0.0)
        own = c.weights(size) if size else 0.0
        return c.weights(size + departure * c.spread) - own

    def held(self, departures: Mapping[int, float], weights: Array | None = None) -> System:
        """Return the stack with some tolerances, by place, known to depart by so many sigmas.

        And with some weights of candidates' columns added to the data.
        """
        if not departures:
            return self
        at = self.columns + np.array(list(departures), dtype=np.intp)
        sigmas = np.array(list(departures.values()))
        if weights is not None:
            at, sigmas = np.concatenate([np.arange(self.columns), at]), np.concatenate([-weights, sigmas])
        names = tuple(n for k, n in enumerate(self.tolerances) if k not in departures)
        blocks = []
        for b in self.blocks:
            gram, form, last = b.gram.copy(), b.form.copy(), b.count - 1
            form[:, last] -= form[:, at] @ sigmas
            gram[last] -= sigmas @ gram[at]
            gram[:, last] -= gram[:, at] @ sigmas
            kept = np.delete(np.arange(len(gram)), self.columns + np.array(list(departures)))
            blocks.append(replace(b, gram=gram[np.ix_(kept, kept)], form=form[:, kept]))
        about = self.about
        if about is not None:
            about = about._replace(tolerances=np.delete(about.tolerances, list(departures)))
        return replace(self, tolerances=names, blocks=blocks, about=about, _reduced={})

    def inside(self, form_error: Form) -> tuple[NDArray[np.intp], Array]:
        """Return which products an error of form needs, of ``[X, T, A, r]``, and how large each column is.

        Shared errors of form are one more kind of tolerances.
        """
        block = self.blocks[0]
        last = block.count - 1
        if not form_error.shared:
            return np.arange(block.count), np.ones(block.count)
        at = np.concatenate([np.arange(last), np.arange(block.count, len(block.gram)), [last]])
        size = np.ones(len(at))
        size[last:-1] = block.shared_sizes(form_error)
        return at, size

    def gram(self, form_error: Form) -> Array:
        """Return the inner products of all blocks before tolerances are integrated out.

        Of ``[X, T, A, r]``, shared errors at their size; without A where they have none.
        """
        return self._rows(form_error, [b.taken(form_error.loads) for b in self.blocks], 0)[0]

    def tolerance_rows(self, form_error: Form) -> Array:
        """Return inner products of ``[T, A, r]`` with ``[X, T, A, r]``: the last rows of `gram`."""
        made = self._reduced.get(form_error)
        if made is not None and made.tolerance_rows is not None:
            return made.tolerance_rows
        return self._rows(form_error, [b.taken(form_error.loads) for b in self.blocks], self.columns)[0]

    def likeliest_tolerances(
        self, rows: Array, weights: Array | None = None, without: Sequence[int] = ()
    ) -> Array:
        """Return the likeliest departures of the tolerances, in sigmas, shape (tolerance,).

        Parameters
        ----------
        rows : ndarray
            Inner products at an error of form, of `tolerance_rows`.
        weights : ndarray, shape (column,), optional
            Of the candidates' columns, of what is in the data besides.
        without : sequence of int
            Tolerances, by place, that do not depart.
        """
        n, rows = self.columns, rows[:-1]
        left = rows[:, -1] if weights is None else rows[:, -1] - rows[:, :n] @ weights
        free = np.delete(np.arange(len(rows)), list(without))
        found = np.zeros(len(rows))
        inside = np.eye(free.size) + rows[:, n:-1][np.ix_(free, free)]
        found[free] = cho_solve(cho_factor(inside), left[free])
        return found[: len(self.tolerances)]

    def misfit(self, form_error: Form, tolerances: Array, weights: Array) -> float:
        """Return minus the log density of data and tolerances at some sizes, but for a constant.

        Offsets of records and errors of form are as is likeliest there.

        Parameters
        ----------
        form_error : Form
        tolerances : ndarray, shape (tolerance,)
            Sigmas.
        weights : ndarray, shape (column,)
            Of the candidates' columns.
        """
        gram, gone = self.gram(form_error), np.concatenate([weights, tolerances])
        n = gone.size
        left = gram[:, -1] - gram[:, :n] @ gone
        alike = left[n:-1]
        energy = left[-1] - gone @ left[:n]
        energy -= alike @ np.linalg.solve(np.eye(alike.size) + gram[n:-1, n:-1], alike)
        return 0.5 * float(energy + tolerances @ tolerances)

    def reduced(self, form_error: Form) -> Reduced:
        """Return the small matrices at one error of form, made once."""
        if form_error not in self._reduced:
            taken = [b.taken(form_error.loads) for b in self.blocks]
            gram, determinant = self._rows(form_error, taken, 0)
            n = self.columns
            rows = gram[n:].copy()  # a view would keep all of it
            across, g, log_evidence, known = self._without_tolerances(rows, determinant)
            G = gram[:n, :n] - across.T @ across
            self._reduced[form_error] = Reduced(G, g, log_evidence, known, rows)
        return self._reduced[form_error]

    def own_products(self, form_error: Form, layout: Sequence[NDArray[np.intp]]) -> OwnProducts:
        """Return each candidate's own inner products at an error of form.

        Those between candidates, which fill megabytes, are not made.

        Parameters
        ----------
        form_error : Form
        layout : sequence of ndarray of int, shape (candidate, column)
            Columns of the candidates, those of the same number of columns together.
        """
        if form_error in self._reduced:
            reduced = self.reduced(form_error)
            return OwnProducts(reduced.own(layout), reduced.g, reduced.log_evidence, reduced.posterior)
        taken = [b.taken(form_error.loads) for b in self.blocks]
        rows, determinant = self._rows(form_error, taken, self.columns)
        across, g, log_evidence, known = self._without_tolerances(rows, determinant)
        own = []
        for c in layout:
            products = self._before_form[c[:, :, None], c[:, None, :]]
            own.append(products - sum(_squared(t, c) for t, _ in taken) - _squared(across, c))
        return OwnProducts(own, g, log_evidence, known)

    def beside(self, directions: Array) -> System:
        """Return the stack without candidates, some effects one more kind of tolerances.

        Parameters
        ----------
        directions : ndarray, shape (direction, column)
            Weights of the candidates' columns, one sigma of what may be in the data.
        """
        n = self.columns
        names = (*map(str, range(len(directions))), *self.tolerances)
        blocks = [_moved(b, directions, n) for b in self.blocks]
        return System([], names, blocks, self.form_errors)

    def slope(self, form_error: Form) -> tuple[float, Array, Array]:
        """Return the log evidence without an effect, and what it tells of the logarithms of the sizes.

        With c a column of the form of size one and C the covariance of the data y, its derivative by the
        logarithm of the size f is ``f^2 [(c' C^-1 y)^2 - c' C^-1 c]``, and Fisher's information of that
        ``2 (f^2 c' C^-1 c)^2`` (M. E. Tipping, "Sparse Bayesian learning and the relevance vector machine",
        J. Machine Learning Research 1, 2001).

        Parameters
        ----------
        form_error : Form
            With a size for each term, `loads` a tuple.

        Returns
        -------
        log_evidence : float
        slope, information : ndarray, shape (term,)
        """
        n = self.columns
        columns, sizes = self.inside(form_error)
        kept, scale = columns[n:], sizes[n:]
        gram, parts, determinant = np.zeros((len(kept),) * 2), [], 0.0
        for b in self.blocks:
            form = b.form[:, kept] * scale
            lower, own_size, at = b.factor(form_error.loads, once=True)
            taken = forward(lower, own_size[:, None] * form[at])
            gram += b.gram[np.ix_(kept, kept)] * scale[:, None] * scale - taken.T @ taken
            determinant += half_determinant(lower)
            parts.append((b, form, lower, at, taken))
        inverse, half = rooted(gram[:-1, :-1])
        own = inverse @ gram[:-1, -1]
        fitted = inverse.T @ own
        y = np.append(-fitted, 1.0)  # the data less their likeliest tolerances
        slope, information = np.zeros((2, np.size(form_error.loads) + 1))
        for b, form, lower, at, taken in parts:
            size = b.sizes(form_error.loads)
            lifted = backward(lower, taken)  # products in the metric of noise and form, times the sizes
            power = 1 - (inverse_of(lower) ** 2).sum(axis=0) - ((inverse @ lifted[:, :-1].T) ** 2).sum(axis=0)
            # those that are not seen at their size leave the metric as it is
            projected = size * (form @ y - b.of_form.gram[:, at] @ (size[at] * (lifted @ y)))
            each = projected**2 - size**2 * b.form_power
            each[at] = (lifted @ y) ** 2 - power
            np.add.at(slope, b.form_row, each)
            np.add.at(information, b.form_row[at], 2 * power**2)
        if form_error.shared:  # columns beside the tolerances, of which W' C^-1 W = 1 - (1 + W' W)^-1
            alike, row = slice(len(self.tolerances), len(kept) - 1), self.blocks[0].shared_row
            power = 1 - (inverse[:, alike] ** 2).sum(axis=0)
            np.add.at(slope, row, fitted[alike] ** 2 - power)
            np.add.at(information, row, 2 * power**2)
        energy = float(gram[-1, -1] - own @ own)
        return -0.5 * energy - determinant - half, slope[:-1], information[:-1]

    @cached_property
    def _before_form(self) -> Array:
        """Inner products of all blocks before any error of form is integrated out."""
        return np.sum([b.gram for b in self.blocks], axis=0)

    def _rows(
        self, form_error: Form, taken: Sequence[tuple[Array, float]], first: int
    ) -> tuple[Array, float]:
        """Return inner products of ``[X, T, A, r]``, rows from a first one on, and half a log determinant."""
        at, size = self.inside(form_error)
        whole = self._before_form[np.ix_(at[first:], at)]
        for across, _ in taken:
            picked = across[:, at]
            whole -= picked[:, first:].T @ picked  # of all rows it is symmetric, and numpy makes half of it
        whole *= size[first:, None] * size
        return whole, sum(half for _, half in taken) - form_error.log_prior

    def _without_tolerances(self, rows: Array, determinant: float) -> tuple[Array, Array, float, Posterior]:
        """Integrate out tolerances of one sigma each.

        Parameters
        ----------
        rows : ndarray, shape (tolerance + 1, column + tolerance + 1)
            Inner products of the tolerances and the residual, the last, with ``[X, T, r]``; shared errors of
            form are among the tolerances.
        determinant : float
            Of what was integrated out before.

        Returns
        -------
        across : ndarray, shape (tolerance, column)
            Its square is what the candidates' inner products lose.
        g : ndarray, shape (column,)
        log_evidence : float
        posterior : Posterior
        """
        n = self.columns
        inside, last = rows[:-1, n:-1], rows[-1]
        inverse, half = rooted(inside)
        across, own = inverse @ rows[:-1, :n], inverse @ rows[:-1, -1]
        energy = float(last[-1] - own @ own)
        stated = inverse[:, : len(self.tolerances)]
        known = Posterior(stated.T @ own, stated.T @ across, (stated**2).sum(axis=0))
        return across, last[:n] - across.T @ own, -0.5 * energy - determinant - half, known


def _moved(block: BlockMatrices, directions: Array, n: int) -> BlockMatrices:
    """Return inner products where directions of the first n columns stand in place of these."""
    gram, form, few = block.gram, block.form, len(directions)
    across = directions @ gram[:n]
    inner = np.empty((few + len(gram) - n,) * 2)
    inner[few:, few:] = gram[n:, n:]
    inner[:few, :few] = across[:, :n] @ directions.T
    inner[:few, few:] = across[:, n:]
    inner[few:, :few] = across[:, n:].T
    return replace(block, gram=inner, form=np.concatenate([form[:, :n] @ directions.T, form[:, n:]], axis=1))


def _squared(rows: Array, columns: NDArray[np.intp]) -> Array:
    """Return inner products of some columns of rows, shape (candidate, column, column)."""
    each = rows.T[columns]  # (candidate, column, row)
    return each @ each.transpose(0, 2, 1)
