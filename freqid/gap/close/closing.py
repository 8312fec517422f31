"""What a gap is closed on: the explanation's columns, on blocks that were used and on those held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqid.core.results.diagnosis import ScoredOn
from freqid.gap.infer.at_form import Kept
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.build import columns_of
from freqid.gap.infer.columns import Columns
from freqid.gap.infer.explain import Explanation
from freqid.gap.infer.joint_replay import acted_on, settings_of
from freqid.gap.infer.linearise import Linearised
from freqid.gap.infer.system import System
from freqid.gap.model.candidates import recomputed
from freqid.gap.settings import FOLDS
from freqid.gap.stack.block import Block


@dataclass(frozen=True, eq=False)
class Fold:
    """Blocks that are left out together.

    Attributes
    ----------
    scored, rest : tuple of int
        Blocks that are scored, and those that are fitted.
    """

    scored: tuple[int, ...]
    rest: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Closing:
    """A stack divided into what is fitted and what is scored.

    Attributes
    ----------
    system : System
        With the explanation's candidates alone, in the order in which they were found.
    blocks : list of Block
    columns : list of Columns
        By block of `system`.
    source : list of int
        Which of `blocks` each block of `system` is of: one block may be divided by its lines.
    folds : list of Fold
    held_out : tuple of str
        Names of what is scored.
    """

    system: System
    blocks: list[Block]
    columns: list[Columns]
    source: list[int]
    folds: list[Fold]
    held_out: tuple[str, ...]

    @property
    def scored(self) -> ScoredOn:
        """How what is scored was left out of what is fitted."""
        if self.by_lines:
            return "lines"
        return "turns" if len(self.folds) > 1 else "held out"

    @property
    def by_lines(self) -> bool:
        """Whether one manoeuvre is divided by its lines, for lack of another."""
        return len(self.blocks) < len(self.columns)


def closing_of(
    at: Linearised, held_out: Sequence[Block], explanation: Explanation, form_error: Form
) -> Closing:
    """Divide a stack: held-out blocks against the others; else conditions in turns; one block by its lines.

    Parameters
    ----------
    at : Linearised
        The model of the blocks that were used.
    held_out : sequence of Block
    explanation : Explanation
    form_error : Form
        Beside the explanation. What tolerances make beyond first order, at their departures there, is as
        much on what is held out as on what was used.
    """
    system, used, library = at.system, at.blocks, at.effects
    few = [system.candidates[i] for i in explanation.places]
    chosen = system.places(explanation.places)
    parts = [replace(c, effects=c.effects[chosen]) for c in at.columns]
    if held_out:
        own = [replace(c, columns=recomputed(c, library, held_out)) for c in few]
        acting = settings_of(explanation.estimates, library, held_out[0].trial.simulation)
        made = [columns_of(b, i, own, at) for i, b in enumerate(acted_on(held_out, acting, library))]
        new, flown = [c for c, _ in made], [b for _, b in made]
        held_out = [replace(b, trial=one.trial) for b, one in zip(flown, held_out, strict=True)]
        fitted = at.likeliest_departures(form_error, explanation.weights(system))[1]
        there = fitted, list(enumerate(explanation.estimates)), form_error
        left_out = replace(at, system=replace(system, candidates=own), columns=new, blocks=flown)
        left_out = replace(left_out, blocks=left_out.drawn(*there)).at(*there, anew=True)
        parts += left_out.columns
        each = zip(few, own, strict=True)
        few = [replace(c, columns=[*c.columns, *more.columns]) for c, more in each]
    blocks = [*used, *held_out]
    source = list(range(len(blocks)))
    names = tuple(n for b in held_out or used for n in b.names)
    if held_out:
        folds = [Fold(tuple(source[len(used) :]), tuple(source[: len(used)]))]
    elif len(used) > 1:
        groups = np.array_split(np.arange(len(used)), min(len(used), FOLDS))
        folds = [Fold(tuple(g.tolist()), tuple(i for i in source if i not in g)) for g in groups]
    else:
        line = np.concatenate([[0], *(np.arange(1, blocks[0].lines.hz.size),) * 2])
        number = np.tile(line, len(blocks[0].rows))
        parts = [_only(parts[0], number % 2 == k) for k in (0, 1)]
        source, folds = [0, 0], [Fold((0,), (1,)), Fold((1,), (0,))]
        names = (f"every other line of {blocks[0].names[0]}",)
    fewer = replace(system, candidates=few, blocks=[c.matrices for c in parts], _kept=Kept())
    return Closing(fewer, blocks, parts, source, folds, names)


def _only(columns: Columns, numbers: NDArray[np.bool_]) -> Columns:
    c = columns
    return replace(
        c,
        effects=c.effects[:, numbers],
        tolerances=c.tolerances[:, numbers],
        own=c.own[:, numbers],
        shared=c.shared[:, numbers],
        form=c.form.only(numbers[: c.form.seen.size]),
        residual=c.residual[numbers],
    )
