"""Columns of one block, before whitening and after; single rows of it as systems of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve

from freqid.core.arrays import Array, Complex
from freqid.gap.infer.at_form import Kept
from freqid.gap.infer.block_matrices import BlockMatrices, Form, Products, backward, forward
from freqid.gap.infer.evidence import weigh
from freqid.gap.infer.system import System
from freqid.gap.model.candidate import Candidate
from freqid.gap.model.form import FormColumns, form_columns, form_terms, product_columns
from freqid.gap.model.row_columns import RowColumns
from freqid.gap.model.tolerance import record_columns
from freqid.gap.model.varying_parameters import NAME as VARYING
from freqid.gap.model.varying_parameters import varying_columns
from freqid.gap.settings import FORM_ERRORS, NOISE_SCALES, SEEN, VARIATIONS
from freqid.gap.stack.block import REPEATS, Block
from freqid.simulate.effects.effect import Effect


@dataclass(frozen=True, eq=False)
class Parts:
    """Columns of one block before whitening.

    Attributes
    ----------
    block : Block
    effects, tolerances, own : ndarray of complex, shape (column, row, line)
    shared : ndarray of complex, shape (column, row, line)
        Errors of form of size one that are the same in all blocks.
    form : tuple of FormColumns
        Errors of form of loads, actuators and relations between sensors.
    own_names : tuple of str
        Of what is unknown in the record by itself.
    """

    block: Block
    effects: Complex
    tolerances: Complex
    own: Complex
    shared: Complex
    form: tuple[FormColumns, ...]
    own_names: tuple[str, ...]

    @classmethod
    def of(
        cls,
        block: Block,
        index: int,
        found: Sequence[Candidate],
        tolerances: Sequence[Complex | None],
        shared: Sequence[Complex | None],
        library: Mapping[str, Effect],
        sizes: Mapping[str, float],
    ) -> Parts:
        """Return the columns of a block.

        Parameters
        ----------
        block : Block
        index : int
            Of the block among those that the candidates have columns for.
        found : sequence of Candidate
        tolerances, shared : sequence of ndarray of complex, shape (row, line), optional
            And errors of form of size one that are the same in all blocks; None where the block has none of
            a name.
        library : dict of Effect
        sizes : dict of float
            One sigma by name.
        """
        effects = np.concatenate([c.columns[index] for c in found]) if found else _zeros(block, 0)
        own = record_columns(block, library, sizes) | varying_columns(block, sizes)
        form = tuple(form_columns(block, form_terms(block)))
        return cls(
            block,
            effects,
            _stacked(block, tolerances),
            _stacked(block, list(own.values())),
            _stacked(block, shared),
            form,
            tuple(own),
        )

    def fewer(self, largest: Mapping[str, float]) -> Parts:
        """Return the same form in fewer columns.

        Parameters
        ----------
        largest : dict of float
            By term, the largest error of form that is weighed: what it makes below the noise is left out.
        """
        block = self.block
        form = []
        for term, i, spectra in self.form:
            size, root = largest.get(term, 0.0), np.sqrt(block.power_alone[i])
            if not size:
                continue
            _, seen, basis = np.linalg.svd(block.lines.real(spectra / root), full_matrices=False)
            kept = size * seen > SEEN
            form.append(FormColumns(term, i, block.lines.complex(seen[kept, None] * basis[kept]) * root))
        return replace(self, form=tuple(form))

    def form_alone(self) -> Parts:
        """Return the parts without all other columns."""
        none = self.effects[:0].copy()
        return replace(self, effects=none, tolerances=none, own=none, shared=none)

    def second_order(self) -> Parts:
        """Return the parts with errors of form to second order."""
        return replace(self, form=(*self.form, *product_columns(self.block)))

    def row_columns(self, terms: Sequence[str]) -> tuple[RowColumns, NDArray[np.intp]]:
        """Return the columns of the form, and which of some terms each is of."""
        row = [np.full(len(c.spectra), terms.index(c.term)) for c in self.form]
        return RowColumns.of(self.block, self.form), np.concatenate([[], *row]).astype(int)

    def likeliest(self, found: Sequence[Candidate], *, quiet: bool) -> Parts:
        """Return the parts with parameters that vary as much, and loads that are as noisy, as is likeliest.

        Sensors tell nothing of gusts and buffet, so where it is `quiet` the noise of loads may be louder;
        where repeats of a manoeuvre told it, it stays. Every effect and every error of form is allowed for
        while the two are chosen, one after the other.
        """
        block, quiet = self.block, quiet and self.block.noise_from != REPEATS
        rows = [i for i, row in enumerate(block.rows) if row.kind == "response"]
        varying = np.array([n.startswith(VARYING) for n in self.own_names], dtype=bool)
        if not rows or not (quiet or varying.any()):
            return self
        system, products, own = self._alone(rows, found)

        def of(products: Products, scale: float = 1.0) -> float:
            """Return the log evidence with no effect or any, at noise of so many times what was shown."""
            evidence = weigh(replace(system, blocks=[products.matrices(scale)], _kept=Kept()), once=True)
            total = evidence.log_none + float(np.logaddexp(0.0, evidence.statistic))
            return total - products.number * float(np.log(scale))

        share = np.ones(len(varying))

        def varied(size: float) -> Products:
            share[varying] = size / VARIATIONS[-1]
            return products.with_own_sizes(share[own])

        parts = self
        if varying.any():
            share[varying] = _first_best(lambda size: of(varied(size)), VARIATIONS) / VARIATIONS[-1]
            products = products.with_own_sizes(share[own])
            parts = self._seen(share)
        scale = _first_best(lambda scale: of(products, scale), NOISE_SCALES if quiet else NOISE_SCALES[:1])
        root = np.ones(len(block.rows))
        root[rows] = scale
        return replace(parts, block=replace(block, covariance=block.covariance * root[:, None] * root))

    def _seen(self, sizes: Array) -> Parts:
        """Return the parts with own unknowns of so many times their sizes, those that are seen at that."""
        block = self.block
        white = block.lines.real(self.own / np.sqrt(block.power_alone))
        stays = sizes == 1.0
        seen = stays | (sizes * np.sqrt((white**2).sum(axis=(1, 2))) > SEEN)
        names = tuple(n for n, kept in zip(self.own_names, seen, strict=True) if kept)
        return replace(self, own=(sizes[:, None, None] * self.own)[seen], own_names=names)

    def _alone(
        self, rows: Sequence[int], found: Sequence[Candidate]
    ) -> tuple[System, Products, NDArray[np.intp]]:
        """Return a system of some rows of the block, and the products that its matrices are made of.

        With the candidates that change these rows, and the places of the own unknowns that do.
        """
        start = np.concatenate([[0], np.cumsum([len(c.sizes) for c in found])]).astype(int)
        moved = _in(self.effects, rows)
        few = [i for i in range(len(found)) if moved[start[i] : start[i + 1]].any()]
        effects = np.concatenate([self.effects[:0], *(self.effects[start[i] : start[i + 1]] for i in few)])
        shared, own = self.tolerances[_in(self.tolerances, rows)], np.flatnonzero(_in(self.own, rows))
        each = effects, shared, self.block.residual, self.own[own]
        x, t, r, o = (self.block.white(z, rows) for z in each)
        products = Products.of(x, t, r, o, RowColumns.of(self.block, self.form, rows), x[:0])
        names = tuple(map(str, range(len(shared))))
        forms = tuple(Form(f, 0.0) for f in FORM_ERRORS)
        return System([found[i] for i in few], names, [], forms), products, own


def _first_best(of: Callable[[float], float], sizes: Sequence[float]) -> float:
    """Return the size up to which something rises, from the first one on."""
    best, chosen = -np.inf, sizes[0]
    for size in sizes if len(sizes) > 1 else ():
        here = of(size)
        if here < best:
            break
        best, chosen = here, size
    return chosen


def _in(columns: Complex, rows: Sequence[int]) -> NDArray[np.bool_]:
    """Return which columns, shape (column, row, line), are not zero in some rows."""
    return np.any(columns[:, list(rows)], axis=(1, 2))


def _zeros(block: Block, count: int) -> Complex:
    return np.zeros((count, len(block.rows), block.lines.hz.size), dtype=complex)


def _stacked(block: Block, columns: Sequence[Complex | None]) -> Complex:
    """Return columns, shape (column, row, line); zero where a block has none of a name."""
    full = [_zeros(block, 1)[0] if z is None else z for z in columns]
    return np.array(full) if full else _zeros(block, 0)


@dataclass(frozen=True, eq=False)
class Columns:
    """Whitened columns of one block, each of shape (column, number).

    Attributes
    ----------
    effects, tolerances, own, shared : ndarray
        The last are errors of form of size one that are the same in all blocks.
    form : RowColumns
        Those that each block has of its own, of loads, actuators and relations between sensors.
    residual : ndarray, shape (number,)
    sigmas : ndarray of complex, shape (tolerance, row, line)
        One sigma of each tolerance, as it is before whitening.
    form_names : tuple of str
        Terms of the errors of form anywhere in the stack.
    form_row : ndarray of int, shape (column,)
        Which of these each column of the form is of.
    shared_names : tuple of (str, str)
        Of the shared errors of form, see `shared_columns`.
    own_names : tuple of str
        Of what is unknown in the record by itself.
    """

    effects: Array
    tolerances: Array
    own: Array
    shared: Array
    form: RowColumns
    residual: Array
    sigmas: Complex
    form_names: tuple[str, ...]
    form_row: NDArray[np.intp]
    shared_names: tuple[tuple[str, str], ...]
    own_names: tuple[str, ...]

    @property
    def _parts(self) -> tuple[Array, ...]:
        """All columns of which products are needed, in the order of the matrices."""
        return self.effects, self.tolerances, self.shared

    @property
    def _count(self) -> int:
        return sum(map(len, self._parts))

    @cached_property
    def products(self) -> Products:
        """Their inner products as they are whitened."""
        return Products.of(self.effects, self.tolerances, self.residual, self.own, self.form, self.shared)

    @cached_property
    def matrices(self) -> BlockMatrices:
        """Their inner products beside the record's own unknowns."""
        return self.products.matrices(
            form_row=self.form_row,
            shared_row=np.array(
                [self.form_names.index(term) for term, _ in self.shared_names], dtype=np.intp
            ),
        )

    def form_at(self, form_error: Form) -> tuple[Array, Array]:
        """Return the whitened columns of the form at an error of it: the block's own, and those all share."""
        sizes = np.array(form_error.loads)[self.form_row]
        used, alike = sizes > 0, self.matrices.shared_sizes(form_error)
        own = sizes[used, None] * self.form.some(used).white()
        return own, alike[alike > 0, None] * self.shared[alike > 0]

    def with_form(self, parts: Parts, terms: Sequence[str]) -> Columns:
        """Return these columns with another form, that of some parts."""
        form, row = parts.row_columns(terms)
        return replace(self, form=form, form_names=tuple(terms), form_row=row)

    def kept(self, forms: Sequence[Form]) -> Columns:
        """Return these columns with those of the form alone that some errors of it need."""
        largest = np.max([f.loads for f in forms], axis=0)[self.form_row]
        needed = largest**2 * self.matrices.form_power > SEEN**2
        new = replace(self, form=self.form.some(needed), form_row=self.form_row[needed])
        new.__dict__["products"] = self.products.with_form(needed)
        return new

    def with_effects(self, parts: Sequence[Array | slice]) -> Columns:
        """Return these columns with other effects; inner products of those that stay are not made again.

        Parameters
        ----------
        parts : sequence of ndarray, shape (column, number), or slice
            What the columns of effects are made of, in order: new ones, or places of those that are there.
        """
        count = len(self.effects)
        effects = np.concatenate([self.effects[p] if isinstance(p, slice) else p for p in parts])
        kept = [np.arange(count)[p] if isinstance(p, slice) else np.full(len(p), -1) for p in parts]
        rest = np.arange(count, self._count)
        return self._after(replace(self, effects=effects), np.concatenate([*kept, rest]).astype(np.intp))

    def with_residual(self, residual: Array) -> Columns:
        """Return these columns beside another residual, shape (number,)."""
        new = replace(self, residual=residual)
        products = self.products.with_residual(residual, self._parts, self.own, self.form)
        new.__dict__["products"] = products
        new.__dict__["matrices"] = self.matrices.with_data(products.data_beside_own)
        return new

    def with_slopes(self, sigmas: Complex, tolerances: Array, own: Array) -> Columns:
        """Return these columns with other ones of tolerances and of the record's own unknowns.

        Parameters
        ----------
        sigmas : ndarray of complex, shape (tolerance, row, line)
            As they are before whitening.
        tolerances, own : ndarray, shape (column, number)
        """
        kept = np.arange(self._count)
        kept[len(self.effects) : len(self.effects) + len(self.tolerances)] = -1
        return self._after(replace(self, sigmas=sigmas, tolerances=tolerances, own=own), kept)

    def _after(self, new: Columns, kept: NDArray[np.intp]) -> Columns:
        """Return other columns, with these' inner products of those that are kept; -1 for each new one."""
        parts, residual = new._parts, new.residual
        products = self.products.with_columns(kept, parts, residual, self.own, new.form)
        if new.own is not self.own:
            products = products.beside(new.own, parts, residual, new.form)
        new.__dict__["products"] = products
        return new

    def likeliest_own(self, left: Array, form_error: Form) -> Array:
        """Return what is likeliest of the record's own unknowns, in sigmas, beside errors of form.

        Parameters
        ----------
        left : ndarray, shape (number,)
            Residual less what is known to be in it.
        form_error : Form
        """
        if not len(self.own):
            return np.zeros(0)
        unknowns, projected = self.products.unknowns, self.own @ left
        alone = cho_solve(unknowns.factor, projected)
        across = self.form.across(left[None])[:, 0] - unknowns.own_form.T @ alone
        lower, size, at = self.matrices.factor(form_error.loads)
        form = size * backward(lower, forward(lower, (size * across[at])[:, None]))[:, 0]
        return cho_solve(unknowns.factor, projected - unknowns.own_form[:, at] @ form)
