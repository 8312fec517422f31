"""Tolerances made straight about where they came out, not about nominal."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.errors import ImpossibleSettings
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.columns import Columns
from freqid.gap.infer.evidence import estimate, weigh
from freqid.gap.infer.system import System
from freqid.gap.model.changes import change_together
from freqid.gap.model.testable import in_force_of
from freqid.gap.model.tolerance import of_effects
from freqid.gap.settings import FARTHEST, INTERVAL, ROUNDS
from freqid.gap.stack.block import Block
from freqid.simulate.effects.effect import Effect


def relinearised(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
    weights: Array | None = None,
) -> tuple[System, list[Columns]]:
    """Return a system whose tolerances are straight about their likeliest departures.

    What the simulation's own parameters make together there, and what sensors and mass properties make
    together, less what their columns say, is taken off the residual: a scatter of five per cent in many
    parameters is not straight to the sensors' noise, and a channel that is late by 4 ms is off by more than
    its slope.

    Parameters
    ----------
    system : System
    columns : sequence of Columns
        By block.
    blocks : sequence of Block
    library : dict of Effect
    sizes : dict of float
        One sigma by name.
    form_error : Form
        At which departures are fitted.
    weights : ndarray, shape (column,), optional
        Of what acts beside them; the likeliest effect where absent, if one is likely.
    """
    departures, fitted = likeliest_departures(system, blocks, sizes, form_error, weights)
    new = [
        straightened(c, block, system.tolerances, departures, fitted, library, sizes)
        for block, c in zip(blocks, columns, strict=True)
    ]
    return replace(system, blocks=[c.matrices for c in new], _reduced={}), new


def likelier_without(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
) -> float:
    """Return the nats by which no effect is likelier than a system says; see `relinearised`.

    The system's tolerances are made straight about where they are likeliest *beside* its likeliest effect.
    Where that effect and a tolerance do the same, as a late channel does, they are elsewhere without it: the
    case of no effect would be judged with the errors of lines drawn far from it. So it is judged with lines
    of its own too.
    """
    parts = [replace(c, effects=c.effects[:0]) for c in columns]
    few = [c.matrices for c in parts]
    alone = System([], system.tolerances, few, system.form_errors)
    before = weigh(alone).log_none
    for _ in range(ROUNDS):
        alone, parts = relinearised(alone, parts, blocks, library, sizes, form_error)
    return max(weigh(alone).log_none - before, 0.0)


def straightened(
    columns: Columns,
    block: Block,
    names: Sequence[str],
    departures: Mapping[str, float],
    fitted: Array,
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
) -> Columns:
    """Return the columns of a block, its residual less what departures together make beyond their columns.

    Parameters
    ----------
    columns : Columns
    block : Block
    names : sequence of str
        Tolerances.
    departures : dict of float
        Of the simulation's own parameters.
    fitted : ndarray, shape (tolerance,)
        Of all tolerances, in sigmas.
    library : dict of Effect
    sizes : dict of float
        One sigma by name.
    """
    sigmas = dict(zip(names, fitted.tolist(), strict=True))
    beyond = np.zeros_like(block.residual)
    if departures:
        whole = block.transform(block.trial.undeparted.departed(departures))
        beyond += whole - _straight(columns, sigmas, departures)
    acting: dict[str, tuple[Effect, dict[str, float]]] = {}
    moved = []
    for key, effect, name, size in of_effects(block.trial, library, sizes):
        at = in_force_of(effect, block.trial.simulation)[name]
        acting.setdefault(effect.id, (effect, {}))[1][name] = at + size * sigmas.get(key, 0.0)
        moved.append(key)
    with suppress(ImpossibleSettings):  # a fit may ask for a body that cannot be: then straight has to do
        whole = block.transform(change_together(list(acting.values()), block.trial))
        beyond += whole - _straight(columns, sigmas, moved)
    return columns.with_residual(block.white(block.residual - beyond))


def _straight(columns: Columns, sigmas: Mapping[str, float], names: Collection[str]) -> Complex:
    """Return what the columns of some tolerances say of their departures, in sigmas, shape (row, line)."""
    at = [k for k, name in enumerate(sigmas) if name in names]
    return np.tensordot(np.array(list(sigmas.values()))[at], columns.sigmas[at], 1)


def likeliest_departures(
    system: System,
    blocks: Sequence[Block],
    sizes: Mapping[str, float],
    form_error: Form,
    weights: Array | None = None,
) -> tuple[dict[str, float], Array]:
    """Return the likeliest departures of the simulation's own parameters, and of all tolerances in sigmas.

    None beyond `FARTHEST`: where a large effect is not allowed for, tolerances are asked for what no
    simulation can do.
    """
    own = blocks[0].trial.simulation.tolerances
    system = replace(system, form_errors=(form_error,), _reduced={})
    beside = _best_alone(system) if weights is None else weights
    fitted = system.likeliest_tolerances(system.tolerance_rows(form_error), beside)
    fitted = np.clip(fitted, -FARTHEST, FARTHEST)
    each = zip(system.tolerances, fitted.tolist(), strict=True)
    return {name: x * sizes.get(name, own[name].sigma) for name, x in each if name in own}, fitted


def _best_alone(system: System) -> Array:
    """Return the weights of the likeliest effect, shape (column,); zero where none is likely."""
    evidence = weigh(system)
    best = int(np.argmax(evidence.candidate)) if len(evidence.candidate) else -1
    weights = np.zeros(system.columns)
    if best >= 0 and evidence.candidate[best] > 0:
        weights[system.columns_of(best)] = estimate(evidence, best, INTERVAL).weights
    return weights
