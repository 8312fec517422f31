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
from freqid.gap.infer.at_form import AtForm, BesideTolerances, DataAt, Kept, OwnProducts, Reduced
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
    _kept: Kept = field(default_factory=Kept, repr=False)

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
        return replace(self, blocks=kept, _kept=Kept())

    def of(self, candidates: Sequence[int]) -> System:
        """Return the stack with some of the candidates."""
        own = self.places(candidates) if len(candidates) else np.zeros(0, dtype=np.intp)
        kept = np.concatenate([own, np.arange(self.columns, len(self.blocks[0].gram))])
        few = [self.candidates[i] for i in candidates]
        return replace(
            self,
            candidates=few,
            blocks=[b.some(kept) for b in self.blocks],
            about=self._about_only(candidates),
            _kept=self._kept_of(kept, len(own), len(self.tolerances)),
        )

    def with_data(self, blocks: list[BlockMatrices]) -> System:
        """Return the stack of the same columns with other data."""
        return replace(self, blocks=blocks, _kept=Kept(self._kept.metric))

    def _kept_of(
        self,
        kept: NDArray[np.intp],
        candidates: int,
        tolerances: int,
        at: NDArray[np.intp] | None = None,
        weights: Array | None = None,
    ) -> Kept:
        """Return what was made so far of some columns, by place; others taken off the data at weights."""
        metric, data = {}, {}
        for f, one in self._kept.metric.items():
            chosen = kept[kept < len(one.gram)]
            metric[f] = one.some(chosen, candidates, tolerances)
            seen = self._data(f)
            if at is not None and weights is not None:
                seen = seen.less(one.gram, at, weights)
            data[f] = DataAt(seen.columns[chosen], seen.energy)
        return Kept(metric, data)

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
        gone = self.columns + np.array(list(departures), dtype=np.intp)
        at, sigmas = gone, np.array(list(departures.values()))
        if weights is not None:
            at, sigmas = np.concatenate([np.arange(self.columns), at]), np.concatenate([-weights, sigmas])
        names = tuple(n for k, n in enumerate(self.tolerances) if k not in departures)
        kept = np.delete(np.arange(len(self.blocks[0].gram)), gone)
        blocks = []
        for b in self.blocks:
            less = DataAt(b.data.columns, b.data.energy).less(b.gram, at, sigmas)
            data = b.data._replace(
                columns=less.columns, form=b.data.form - b.form[:, at] @ sigmas, energy=less.energy
            )
            blocks.append(b.with_data(data).some(kept))
        known = self._kept_of(kept, self.columns, len(names), at, sigmas)
        about = self.about
        if about is not None:
            about = about._replace(tolerances=np.delete(about.tolerances, list(departures)))
        return replace(self, tolerances=names, blocks=blocks, about=about, _kept=known)

    def inside(self, form_error: Form) -> tuple[NDArray[np.intp], Array]:
        """Return which of ``[X, T, A]`` an error of form needs, and how large each column is.

        Shared errors of form are one more kind of tolerances.
        """
        block = self.blocks[0]
        if not form_error.shared:
            return np.arange(block.count), np.ones(block.count)
        size = np.ones(len(block.gram))
        size[block.count :] = block.shared_sizes(form_error)
        return np.arange(len(size)), size

    def metric(self, form_error: Form) -> AtForm:
        """Return the stack at one error of form, whatever the data are; made once."""
        made = self._kept.metric
        if form_error not in made:
            gram, half = self._rows(form_error, 0)
            made[form_error] = AtForm(gram, self.columns, len(self.tolerances), half)
        return made[form_error]

    def gram(self, form_error: Form) -> Array:
        """Return the inner products of all blocks before tolerances are integrated out.

        Of ``[X, T, A, r]``, shared errors at their size; without A where they have none.
        """
        inner, data = self.metric(form_error).gram, self._data(form_error)
        return np.block([[inner, data.columns[:, None]], [data.columns[None], np.array([[data.energy]])]])

    def likeliest_tolerances(
        self, form_error: Form, weights: Array | None = None, without: Sequence[int] = ()
    ) -> Array:
        """Return the likeliest departures of the tolerances, in sigmas, shape (tolerance,).

        Parameters
        ----------
        form_error : Form
        weights : ndarray, shape (column,), optional
            Of the candidates' columns, of what is in the data besides.
        without : sequence of int
            Tolerances, by place, that do not depart.
        """
        n, metric, left = self.columns, self.metric(form_error), self._data(form_error).columns
        rows = metric.gram[n:]
        left = left[n:] if weights is None else left[n:] - rows[:, :n] @ weights
        if not len(without):
            inverse, _ = metric.beside.root
            return (inverse.T @ (inverse @ left))[: len(self.tolerances)]
        free = np.delete(np.arange(len(rows)), list(without))
        found = np.zeros(len(rows))
        inside = np.eye(free.size) + rows[:, n:][np.ix_(free, free)]
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
        metric, gone = self.metric(form_error), np.concatenate([weights, tolerances])
        left = self._data(form_error).less(metric.gram, slice(gone.size), gone)
        alike, energy = left.columns[gone.size :], left.energy
        if alike.size:
            energy -= float(alike @ cho_solve(metric.alike, alike))
        return 0.5 * float(energy + tolerances @ tolerances)

    def reduced(self, form_error: Form) -> Reduced:
        """Return the small matrices at one error of form, made once."""
        made = self._kept.reduced
        if form_error not in made:
            made[form_error] = self.metric(form_error).with_data(self._data(form_error))
        return made[form_error]

    def own_products(self, form_error: Form, layout: Sequence[NDArray[np.intp]]) -> OwnProducts:
        """Return each candidate's own inner products at an error of form.

        Those between candidates, which fill megabytes, are not made.

        Parameters
        ----------
        form_error : Form
        layout : sequence of ndarray of int, shape (candidate, column)
            Columns of the candidates, those of the same number of columns together.
        """
        if form_error in self._kept.reduced or form_error in self._kept.metric:
            reduced = self.reduced(form_error)
            return OwnProducts(reduced.own(layout), reduced.g, reduced.log_evidence, reduced.posterior)
        rows, half = self._rows(form_error, self.columns)
        beside = BesideTolerances(rows, self.columns, len(self.tolerances), half)
        own = []
        for c in layout:
            products = self._before_form[c[:, :, None], c[:, None, :]]
            taken = sum(_squared(b.taken(form_error.loads)[0], c) for b in self.blocks)
            own.append(products - taken - _squared(beside.across, c))
        return OwnProducts(own, *beside.told(self._data_of_blocks(form_error)))

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
        gram, parts, determinant = np.zeros((len(kept) + 1,) * 2), [], 0.0
        for b in self.blocks:
            form = np.concatenate([b.form[:, kept] * scale, b.data.form[:, None]], axis=1)
            lower, own_size, at = b.factor(form_error.loads, once=True)
            taken = forward(lower, own_size[:, None] * form[at])
            gram[:-1, :-1] += b.gram[np.ix_(kept, kept)] * scale[:, None] * scale
            gram[:-1, -1] += b.data.columns[kept] * scale
            gram[-1, -1] += b.data.energy
            gram -= taken.T @ taken
            determinant += b.own_half + half_determinant(lower)
            parts.append((b, form, lower, at, taken))
        gram[-1, :-1] = gram[:-1, -1]
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
            alike, row = slice(len(self.tolerances), len(kept)), self.blocks[0].shared_row
            power = 1 - (inverse[:, alike] ** 2).sum(axis=0)
            np.add.at(slope, row, fitted[alike] ** 2 - power)
            np.add.at(information, row, 2 * power**2)
        energy = float(gram[-1, -1] - own @ own)
        return -0.5 * energy - determinant - half, slope[:-1], information[:-1]

    @cached_property
    def _before_form(self) -> Array:
        """Inner products of all blocks before any error of form is integrated out."""
        return np.sum([b.gram for b in self.blocks], axis=0)

    def _data(self, form_error: Form) -> DataAt:
        """Return the data at one error of form, made once."""
        made = self._kept.data
        if form_error not in made:
            made[form_error] = self._data_of_blocks(form_error)
        return made[form_error]

    def _data_of_blocks(self, form_error: Form) -> DataAt:
        at, size = self.inside(form_error)
        each = [b.data_at_loads(form_error.loads) for b in self.blocks]
        columns = np.sum([columns[at] for columns, _ in each], axis=0)
        return DataAt(columns * size, float(sum(energy for _, energy in each)))

    def _rows(self, form_error: Form, first: int) -> tuple[Array, float]:
        """Return inner products of ``[X, T, A]``, rows from a first one on, and half a log determinant."""
        at, size = self.inside(form_error)
        whole, half = self._before_form[np.ix_(at[first:], at)], -form_error.log_prior
        for b in self.blocks:
            across, determinant = b.taken(form_error.loads)
            picked = across[:, at]
            whole -= picked[:, first:].T @ picked  # of all rows it is symmetric, and numpy makes half of it
            half += determinant
        whole *= size[first:, None] * size
        return whole, half


def _moved(block: BlockMatrices, directions: Array, n: int) -> BlockMatrices:
    """Return inner products where directions of the first n columns stand in place of these."""
    gram, form, few = block.gram, block.form, len(directions)
    across = directions @ gram[:n]
    inner = np.empty((few + len(gram) - n,) * 2)
    inner[few:, few:] = gram[n:, n:]
    inner[:few, :few] = across[:, :n] @ directions.T
    inner[:few, few:] = across[:, n:]
    inner[few:, :few] = across[:, n:].T
    data = block.data._replace(
        columns=np.concatenate([directions @ block.data.columns[:n], block.data.columns[n:]])
    )
    form = np.concatenate([form[:, :n] @ directions.T, form[:, n:]], axis=1)
    return replace(block, gram=inner, form=form, data=data)


def _squared(rows: Array, columns: NDArray[np.intp]) -> Array:
    """Return inner products of some columns of rows, shape (candidate, column, column)."""
    each = rows.T[columns]  # (candidate, column, row)
    return each @ each.transpose(0, 2, 1)
