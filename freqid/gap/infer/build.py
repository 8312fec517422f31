"""From blocks, tolerances and candidates to the system of small matrices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from freqid.gap.infer.evidence import Evidence, weigh
from freqid.gap.infer.system import SCALED_FORMS, BlockMatrices, Form, System
from freqid.gap.model.candidates import Candidate, candidates
from freqid.gap.model.form import actuator_columns, form_columns, kinematic_terms, load_terms
from freqid.gap.model.tolerance import record_columns, tolerance_columns
from freqid.gap.settings import FORM_ERRORS, NOISE_SCALES
from freqid.gap.stack.block import REPEATS, Block
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Columns:
    """Whitened columns of one block, each of shape (column, number).

    Attributes
    ----------
    effects, tolerances, own, form, actuators : ndarray
        The last two are errors of form: of loads at the rows' own sizes, of actuators of size one.
    residual : ndarray, shape (number,)
    sigmas : ndarray of complex, shape (tolerance, row, line)
        One sigma of each tolerance, as it is before whitening.
    form_sizes : dict of float
        Error of form of each row of loads, a share of each of its terms.
    kinematic_errors : ndarray, shape (row,)
        Error of form of each relation between sensors, a share; zero in other rows.
    """

    effects: Array
    tolerances: Array
    own: Array
    form: Array
    actuators: Array
    residual: Array
    sigmas: Complex
    form_sizes: dict[str, float]
    kinematic_errors: Array

    @property
    def matrices(self) -> BlockMatrices:
        """Their inner products."""
        return BlockMatrices.of(
            self.effects, self.tolerances, self.residual, self.own, self.form, self.actuators
        )


def build(
    blocks: Sequence[Block], library: Mapping[str, Effect], sizes: Mapping[str, float]
) -> tuple[System, dict[str, str], list[Columns], list[Block]]:
    """Return the system of a stack, why effects are not tested, the columns by block, and the blocks.

    The blocks come back with the noise of their loads as loud as it was flown, where no repeats told it.
    """
    found, not_tested = candidates(library, blocks)
    shared = [tolerance_columns(b, library, sizes) for b in blocks]
    names = tuple(dict.fromkeys(n for one in shared for n in one))
    start = np.concatenate([[0], np.cumsum([len(c.sizes) for c in found])]).astype(int)
    servos = actuators_of(blocks)
    parts = [
        _parts(b, i, found, [shared[i].get(n) for n in names], library, sizes) for i, b in enumerate(blocks)
    ]
    errors = _errors_of_loads(parts, found)
    columns = [p.columns(errors, servos) for p in parts]
    system = System(found, start, names, [c.matrices for c in columns], SCALED_FORMS)
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
    errors: Mapping[str, float],
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
    errors : dict of float
        Error of form of each row of loads, as the stack has it.
    """
    shared = tolerance_columns(block, library, sizes)
    parts = _parts(block, index, found, [shared.get(n) for n in names], library, sizes)
    return parts.columns(errors, servos), parts.block


@dataclass(frozen=True, eq=False)
class _Parts:
    """Columns of one block before whitening, each of shape (column, row, line)."""

    block: Block
    effects: Complex
    tolerances: Complex
    own: Complex
    form: Complex
    kinematic_errors: Array = field(default_factory=lambda: np.zeros(0))

    def columns(self, errors: Mapping[str, float], servos: Sequence[str]) -> Columns:
        """Return the whitened columns at an error of form of each row of loads."""
        block = self.block
        share = np.array([errors.get(row.name, 0.0) for row in block.rows])
        form = self.form * share[:, None]
        form = form[np.any(form, axis=(1, 2))]
        return Columns(
            effects=block.white(self.effects),
            tolerances=block.white(self.tolerances),
            own=block.white(self.own),
            form=block.white(form),
            actuators=block.white(actuator_columns(block, servos)),
            residual=block.white(block.residual),
            sigmas=self.tolerances,
            form_sizes={row.name: errors.get(row.name, 0.0) for row in block.rows if row.kind == "response"},
            kinematic_errors=self.kinematic_errors,
        )


def _parts(
    block: Block,
    index: int,
    found: Sequence[Candidate],
    shared: Sequence[Complex | None],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
) -> _Parts:
    own = record_columns(block, library, sizes)
    effects = np.concatenate([c.columns[index] for c in found]) if found else _zeros(block, 0)
    tolerances = _stacked(block, shared)
    unknown = _stacked(block, list(own.values()))
    sensors = form_columns(block, kinematic_terms(block))
    errors = _errors_of_relations(_Parts(block, effects, tolerances, unknown, sensors), found)
    unknown = np.concatenate([unknown, sensors * errors[:, None]])
    unknown = unknown[np.any(unknown, axis=(1, 2))]
    loads = form_columns(block, load_terms(block))
    if block.noise_from != REPEATS:
        block = _louder(block, effects, found, tolerances, unknown, loads)
    return _Parts(block, effects, tolerances, unknown, loads, errors)


def _errors_of_loads(parts: Sequence[_Parts], found: Sequence[Candidate]) -> dict[str, float]:
    """Return the error of form of each row of loads, from that row alone in all blocks.

    A simulation may be good in lift and poor in drag: one share for all rows would make the good ones poor,
    or leave the error of the poor ones to an effect. Every effect is allowed for while it is chosen.
    """
    errors: dict[str, float] = {}
    for row in dict.fromkeys(r.name for p in parts for r in p.block.rows if r.kind == "response"):
        at = [(p, i) for p in parts for i, r in enumerate(p.block.rows) if r.name == row]
        if not any(np.any(p.form[:, i]) for p, i in at):
            continue
        errors[row] = _average(weigh(_rows_alone([(p, [i]) for p, i in at], found)))
    return errors


def _errors_of_relations(parts: _Parts, found: Sequence[Candidate]) -> Array:
    """Return the error of form of each kinematic relation, from its row alone, shape (row,).

    Relations between sensors need no simulation, so how well they hold says nothing of the loads' form. Every
    effect is allowed for while it is chosen.
    """
    errors = np.zeros(len(parts.block.rows))
    for i, row in enumerate(parts.block.rows):
        if row.kind == "kinematic" and np.any(parts.form[:, i]):
            errors[i] = _average(weigh(_rows_alone([(parts, [i])], found)))
    return errors


def _average(evidence: Evidence) -> float:
    """Return the root mean square of the error of form over its posterior.

    Its covariance is then that of all sizes together. The likeliest alone would be a bet: where no error
    and an effect explain a row as well as an error and none, it would decide for one of them.
    """
    sizes = np.array([f.loads for f in evidence.system.form_errors])
    return float(np.sqrt(evidence.form_weights() @ sizes**2))


def _louder(
    block: Block,
    effects: Complex,
    found: Sequence[Candidate],
    tolerances: Complex,
    own: Complex,
    form: Complex,
) -> Block:
    """Return a block whose loads are as noisy as is likeliest: sensors tell nothing of gusts and buffet.

    Every effect and every error of form is allowed for while the scale is chosen.
    """
    rows = [i for i, row in enumerate(block.rows) if row.kind == "response"]
    if not rows:
        return block
    best, chosen = -np.inf, block
    for scale in NOISE_SCALES:
        root = np.ones(len(block.rows))
        root[rows] = scale
        one = replace(block, covariance=block.covariance * root[:, None] * root)
        parts = _Parts(one, effects, tolerances, own, form)
        evidence = weigh(_rows_alone([(parts, rows)], found))
        number = len(rows) * (2 * block.lines.hz.size - 1)
        total = evidence.log_none + np.logaddexp(0.0, evidence.statistic) - number * np.log(scale)
        if total > best:
            best, chosen = total, one
    return chosen


def _rows_alone(parts: Sequence[tuple[_Parts, Sequence[int]]], found: Sequence[Candidate]) -> System:
    """Return the system of some rows of some blocks, with the candidates that change them."""
    start = np.concatenate([[0], np.cumsum([len(c.sizes) for c in found])]).astype(int)
    moved = np.any([np.any(p.effects[:, list(rows)], axis=(1, 2)) for p, rows in parts], axis=0)
    few = [i for i in range(len(found)) if moved[start[i] : start[i + 1]].any()]
    keep = np.concatenate([np.zeros(0, int), *(np.arange(start[i], start[i + 1]) for i in few)]).astype(int)
    shared = np.any([np.any(p.tolerances[:, list(rows)], axis=(1, 2)) for p, rows in parts], axis=0)
    matrices = []
    for p, rows in parts:
        form = p.form[np.any(p.form[:, list(rows)], axis=(1, 2))]
        own = p.own[np.any(p.own[:, list(rows)], axis=(1, 2))]
        columns = (p.effects[keep], p.tolerances[shared], p.block.residual, own, form, form[:0])
        matrices.append(BlockMatrices.of(*(p.block.white(z, rows) for z in columns)))
    begin = np.concatenate([[0], np.cumsum([len(found[i].sizes) for i in few])]).astype(int)
    names = tuple(map(str, range(int(shared.sum()))))
    return System([found[i] for i in few], begin, names, matrices, tuple(Form(f, 0.0) for f in FORM_ERRORS))


def _zeros(block: Block, count: int) -> Complex:
    return np.zeros((count, len(block.rows), block.lines.hz.size), dtype=complex)


def _stacked(block: Block, columns: Sequence[Complex | None]) -> Complex:
    """Return columns, shape (column, row, line); zero where a block has none of a name."""
    full = [_zeros(block, 1)[0] if z is None else z for z in columns]
    return np.array(full) if full else _zeros(block, 0)


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
