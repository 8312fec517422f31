"""Effects inserted into a simulation along its flights, at sizes of given detectability.

An insertion is the change that the effect's full formula makes at that size, never an interpolation between
sizes that the diagnosis itself uses. For a candidate that is proportional to its size the two are the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.errors import ImpossibleSettings
from freqid.gap.infer.at_form import Kept
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.columns import Columns
from freqid.gap.infer.evidence import Evidence
from freqid.gap.infer.seen_sizes import size_at
from freqid.gap.infer.system import System
from freqid.gap.model.candidate import OTHER, Candidate, Place
from freqid.gap.model.changes import change
from freqid.gap.model.testable import in_force_of
from freqid.gap.stack.block import Block
from freqid.simulate.effects.effect import Effect

_MOST_PLACES = 8  # of one effect; of more, as many from the most to the least visible one
_ROUNDS = 2  # of computing an effect at a size and correcting the size by what came out
_CLOSE = 0.1  # relative error of a detectability that is left as it is
_NEAR = (0.5, 2.0)  # of the detectability wanted: beyond it the size is taken for none


@dataclass(frozen=True, eq=False)
class Insertion:
    """One effect at one place and one size.

    Attributes
    ----------
    candidate : int
        Index in the system.
    goal : float
        Detectability that was wanted.
    detectability : float
        That it has: ``s' S^-1 s`` at the likeliest error of form.
    size : ndarray
        Of a scalar, shape (1,); of a vector by parameter.
    weights : ndarray, shape (column,)
        Of the columns of `Inserted.system`.
    """

    candidate: int
    goal: float
    detectability: float
    size: Array
    weights: Array


@dataclass(frozen=True, eq=False)
class Inserted:
    """Insertions, and the stack with their columns behind those of the candidates.

    Attributes
    ----------
    system : System
        Its last candidate stands for all columns that were computed for insertions.
    form_error : Form
        At which detectabilities are stated.
    insertions : list of Insertion
    not_inserted : dict of str
        Reason by effect id, of effects without any insertion.
    """

    system: System
    form_error: Form
    insertions: list[Insertion]
    not_inserted: dict[str, str]


@dataclass(frozen=True, eq=False)
class _Wanted:
    candidate: int
    goal: float
    size: Array


def insert(
    evidence: Evidence,
    blocks: Sequence[Block],
    columns: Sequence[Columns],
    library: Mapping[str, Effect],
    goals: Sequence[float],
    seed: int,
) -> Inserted:
    """Insert every effect at its places and at sizes of given detectability.

    Parameters
    ----------
    evidence : Evidence
    blocks : sequence of Block
        Of the evidence, in its order.
    columns : sequence of Columns
        Of these blocks.
    library : dict of Effect
    goals : sequence of float
        Detectabilities.
    seed : int
        Of the directions of vectors.
    """
    rng = np.random.default_rng([seed, 78])
    form_error = evidence.form_error()
    wanted = list(_wanted(evidence, form_error, goals, rng))
    exact = [w for w in wanted if _proportional(evidence.system.candidates[w.candidate])]
    computed = [w for w in wanted if not _proportional(evidence.system.candidates[w.candidate])]
    system = evidence.system
    for k in range(_ROUNDS):
        pairs = [(w, z) for w in computed if (z := _change(w, evidence.system, library, blocks)) is not None]
        computed, made = [w for w, _ in pairs], [z for _, z in pairs]
        system = _extended(evidence.system, columns, blocks, made)
        power = np.diag(system.reduced(form_error).G)[evidence.system.columns :]
        if k == _ROUNDS - 1 or np.all(np.abs(power / [w.goal for w in computed] - 1) < _CLOSE):
            break
        computed = [_corrected(w, p, evidence.system) for w, p in zip(computed, power, strict=True)]
    found = []
    for k, w in enumerate(computed):
        weights = np.zeros(system.columns)
        weights[evidence.system.columns + k] = 1.0
        found.append(_insertion(w, weights, system, form_error))
    for w in exact:
        weights = np.zeros(system.columns)
        c = evidence.system.candidates[w.candidate]
        weights[evidence.system.columns_of(w.candidate)] = c.weights(float(w.size[0]))
        found.append(_insertion(w, weights, system, form_error))
    found = [i for i in found if _NEAR[0] <= i.detectability / i.goal <= _NEAR[1]]
    found.sort(key=lambda i: (i.candidate, i.goal))
    there = {evidence.system.candidates[i.candidate].effect for i in found}
    why = "no size within its physical range is as detectable as that"
    missing = {e: why for e in evidence.weighing.effects if e not in there and e != OTHER}
    return Inserted(system, form_error, found, missing)


def _proportional(candidate: Candidate) -> bool:
    return candidate.kind == "scalar" and candidate.sizes.size == 1


def _insertion(wanted: _Wanted, weights: Array, system: System, form_error: Form) -> Insertion:
    power = float(weights @ system.reduced(form_error).G @ weights)
    return Insertion(wanted.candidate, wanted.goal, power, wanted.size, weights)


def _wanted(evidence: Evidence, form_error: Form, goals: Sequence[float], rng: np.random.Generator):
    """Yield what is to be inserted, its size still by the columns that there are."""
    G = evidence.system.reduced(form_error).G
    for effect in evidence.weighing.effects:
        if effect == OTHER:
            continue
        for k, i in enumerate(_places(evidence, effect, G)):
            c, at = evidence.system.candidates[i], evidence.system.columns_of(i)
            for m, goal in enumerate(goals):
                if c.kind == "vector":
                    direction = rng.standard_normal(c.sizes.size)
                    power = float(direction @ G[at, at] @ direction)
                    factor = np.sqrt(goal / power) if power > 0 else np.inf
                    if factor <= c.prior.max():
                        yield _Wanted(i, goal, factor * direction * c.sizes)
                else:
                    signs = np.unique(np.sign(c.prior))
                    size = size_at(c, G[at, at], goal, float(signs[(k + m) % signs.size]))
                    if np.isfinite(size):
                        yield _Wanted(i, goal, np.array([size]))


def _places(evidence: Evidence, effect: str, G: Array) -> list[int]:
    """Return the candidates of an effect, most visible first; an even choice where there are many."""
    system = evidence.system
    visible = {}
    for i in evidence.weighing.places_of(effect):
        c, at = system.candidates[i], system.columns_of(i)
        w = np.ones(c.sizes.size) if c.kind == "vector" else c.weights(float(c.prior[-1]))
        visible[i] = float(w @ G[at, at] @ w)
    ranked = sorted(visible, key=lambda i: -visible[i])
    if len(ranked) <= _MOST_PLACES:
        return ranked
    return [ranked[k] for k in np.linspace(0, len(ranked) - 1, _MOST_PLACES).round().astype(int)]


def _corrected(wanted: _Wanted, power: float, system: System) -> _Wanted:
    """Return an insertion with a size that comes nearer to its detectability, within the prior's range."""
    c = system.candidates[wanted.candidate]
    if not power > 0 or abs(power / wanted.goal - 1) < _CLOSE:
        return wanted
    size = wanted.size * np.clip(np.sqrt(wanted.goal / power), 0.5, 2.0)
    if c.kind == "scalar":
        low, high = min(c.prior.min(), 0.0), max(c.prior.max(), 0.0)
        size = np.clip(size, low, high)
    return replace(wanted, size=size)


def _change(
    wanted: _Wanted, system: System, library: Mapping[str, Effect], blocks: Sequence[Block]
) -> list[Complex] | None:
    """Return what the full formula makes of each block, shape (row, line); None where nothing can be so."""
    c = system.candidates[wanted.candidate]
    effect = library[c.effect].of(blocks[0].trial.maneuver.vehicle)
    force = in_force_of(effect, blocks[0].trial.simulation)
    settings = c.place.settings(force, wanted.size)
    for name in c.place.parameters:
        parameter = effect.parameters[name]
        if not parameter.low <= settings[name] <= parameter.high:
            return None
    try:
        return [b.transform(change(effect, b.trial, settings)) for b in blocks]
    except ImpossibleSettings:
        return None


def _extended(
    system: System, columns: Sequence[Columns], blocks: Sequence[Block], made: Sequence[Sequence[Complex]]
) -> System:
    """Return a stack with more columns behind those of its candidates."""
    if not made:
        return system
    each = [np.array([z[b] for z in made]) for b in range(len(blocks))]
    more = [
        replace(c, effects=np.concatenate([c.effects, block.white(z)])).matrices
        for c, block, z in zip(columns, blocks, each, strict=True)
    ]
    one = np.ones(len(made))
    last = Candidate("inserted", Place("", ()), "vector", one, one, each)
    return replace(system, candidates=[*system.candidates, last], blocks=more, _kept=Kept())
