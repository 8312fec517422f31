"""From blocks, tolerances and candidates to the system of small matrices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqid.gap.infer.forms import likely_forms
from freqid.gap.infer.parts import Parts
from freqid.gap.infer.system import BlockMatrices, Form, System
from freqid.gap.model.candidates import Candidate, candidates
from freqid.gap.model.form import actuator_columns
from freqid.gap.model.tolerance import tolerance_columns
from freqid.gap.settings import FORM_ERRORS
from freqid.gap.stack.block import Block
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Columns:
    """Whitened columns of one block, each of shape (column, number).

    Attributes
    ----------
    effects, tolerances, own, form, actuators : ndarray
        The last two are errors of form of size one: of loads and relations between sensors, of actuators.
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
    actuators: Array
    residual: Array
    sigmas: Complex
    form_names: tuple[str, ...]
    form_row: NDArray[np.intp]

    @property
    def matrices(self) -> BlockMatrices:
        """Their inner products."""
        return BlockMatrices.of(
            self.effects, self.tolerances, self.residual, self.own, self.form, self.actuators, self.form_row
        )

    def form_at(self, form_error: Form) -> Array:
        """Return the columns of the form at an error of it."""
        sizes = np.array(form_error.loads)[self.form_row]
        return sizes[sizes > 0, None] * self.form[sizes > 0]

    def kept(self, forms: Sequence[Form]) -> Columns:
        """Return these columns with those of the form alone that some errors of it need."""
        needed = np.any([f.loads for f in forms], axis=0)[self.form_row]
        return replace(self, form=self.form[needed], form_row=self.form_row[needed])


def build(
    blocks: Sequence[Block], library: Mapping[str, Effect], sizes: Mapping[str, float]
) -> tuple[System, dict[str, str], list[Columns], list[Block]]:
    """Return the system of a stack, why effects are not tested, the columns by block, and the blocks.

    The blocks come back with the noise of their loads as loud as it was flown, where no repeats told it. Of
    the errors of form those stay that the data leave possible.
    """
    found, not_tested = candidates(library, blocks)
    shared = [tolerance_columns(b, library, sizes) for b in blocks]
    names = tuple(dict.fromkeys(n for one in shared for n in one))
    start = np.concatenate([[0], np.cumsum([len(c.sizes) for c in found])]).astype(int)
    servos = actuators_of(blocks)
    parts = [
        Parts.of(b, i, found, [shared[i].get(n) for n in names], library, sizes) for i, b in enumerate(blocks)
    ]
    rows = tuple(dict.fromkeys(p.block.rows[i].name for p in parts for i in np.unique(p.form_row).tolist()))
    every = (Form((FORM_ERRORS[-1],) * len(rows), 0.0),)
    columns = [_columns(p, rows, every, servos) for p in parts]
    system = System(found, start, names, [c.matrices for c in columns], every)
    forms = likely_forms(system, rows)
    columns = [c.kept(forms) for c in columns]
    system = replace(system, blocks=[c.matrices for c in columns], form_errors=forms, _at_loads={})
    return system, not_tested, columns, [p.block for p in parts]


def actuators_of(blocks: Sequence[Block]) -> tuple[str, ...]:
    """Return the effectors whose positions the simulation predicts in any block."""
    return tuple(dict.fromkeys(n for b in blocks for n in b.trial.positions))


def columns_of(
    block: Block,
    index: int,
    found: Sequence[Candidate],
    names: Sequence[str],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    servos: Sequence[str],
    like: Columns,
    forms: Sequence[Form],
) -> tuple[Columns, Block]:
    """Return the columns of one more block, and the block with its noise as it was flown.

    Parameters
    ----------
    block : Block
    index : int
        Of the block among those that the candidates have columns for.
    found : sequence of Candidate
    names : sequence of str
        Tolerances, in their order.
    library : dict of Effect
    sizes : dict of float
    servos : sequence of str
        Actuators of the stack, `actuators_of`.
    like : Columns
        Of a block of the stack.
    forms : sequence of Form
        Errors of form of the stack.
    """
    shared = tolerance_columns(block, library, sizes)
    parts = Parts.of(block, index, found, [shared.get(n) for n in names], library, sizes)
    return _columns(parts, like.form_names, forms, servos), parts.block


def _columns(parts: Parts, rows: Sequence[str], forms: Sequence[Form], servos: Sequence[str]) -> Columns:
    """Return the whitened columns of one block."""
    largest = np.max([f.loads for f in forms], axis=0)
    parts = parts.fewer(dict(zip(rows, largest.tolist(), strict=True)))
    block = parts.block
    here = np.array([rows.index(row.name) if row.name in rows else -1 for row in block.rows], dtype=int)
    return Columns(
        effects=block.white(parts.effects),
        tolerances=block.white(parts.tolerances),
        own=block.white(parts.own),
        form=block.white(parts.form),
        actuators=block.white(actuator_columns(block, servos)),
        residual=block.white(block.residual),
        sigmas=parts.tolerances,
        form_names=tuple(rows),
        form_row=here[parts.form_row],
    )


def relinearised(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    fitted: Array,
    sizes: Mapping[str, float],
) -> tuple[System, list[Columns]]:
    """Return a system whose tolerances are straight about where they came out, not about nominal.

    What the simulation's own parameters make together at their fitted departures, less what their columns
    say, is taken off the residual: a scatter of five per cent in many parameters is not straight to the
    sensors' noise.

    Parameters
    ----------
    system : System
    columns : sequence of Columns
        By block.
    blocks : sequence of Block
    fitted : ndarray, shape (tolerance,)
        Departures in sigmas.
    sizes : dict of float
        One sigma by name.
    """
    own = blocks[0].trial.simulation.tolerances
    at = [k for k, name in enumerate(system.tolerances) if name in own]
    departures = {
        system.tolerances[k]: float(fitted[k])
        * sizes.get(system.tolerances[k], own[system.tolerances[k]].sigma)
        for k in at
    }
    if not departures:
        return system, list(columns)
    new = []
    for block, c in zip(blocks, columns, strict=True):
        whole = block.transform(block.trial.departed(departures))
        straight = np.tensordot(fitted[at], c.sigmas[at], 1)
        new.append(replace(c, residual=block.white(block.residual - (whole - straight))))
    return replace(system, blocks=[c.matrices for c in new], _reduced={}, _at_loads={}), new


def rebuilt(
    system: System, candidates: list[Candidate], columns: Sequence[Columns], blocks: Sequence[Block]
) -> tuple[System, list[Columns]]:
    """Return a system in which some candidates have other columns; all else is as it was."""
    start = np.concatenate([[0], np.cumsum([len(c.sizes) for c in candidates])]).astype(int)
    new = []
    for b, (old, block) in enumerate(zip(columns, blocks, strict=True)):
        parts = [
            old.effects[system.columns_of(i)] if c is system.candidates[i] else block.white(c.columns[b])
            for i, c in enumerate(candidates)
        ]
        new.append(replace(old, effects=np.concatenate(parts)))
    return System(candidates, start, system.tolerances, [c.matrices for c in new], system.form_errors), new
