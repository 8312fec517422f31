"""From blocks, tolerances and candidates to the system of small matrices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from freqid.core.arrays import Array
from freqid.gap.infer.at_form import Kept
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.columns import Columns, Parts
from freqid.gap.infer.evidence import Estimate
from freqid.gap.infer.forms import common_form, likely_forms, of_all, reach
from freqid.gap.infer.joint_sizes import joint_estimates
from freqid.gap.infer.linearise import Linearised
from freqid.gap.infer.seen_sizes import down_to_seen
from freqid.gap.infer.system import About, System
from freqid.gap.model.candidate import OTHER, Candidate
from freqid.gap.model.candidates import beyond_tolerance, candidates
from freqid.gap.model.form import shared_columns
from freqid.gap.model.refine import refined
from freqid.gap.model.tolerance import one_sigmas, tolerance_columns
from freqid.gap.settings import ALIKE, FORM_ERRORS, MOST_ROUNDS, ROUNDS
from freqid.gap.simulation import side_by_side
from freqid.gap.stack.block import Block
from freqid.simulate.effects.effect import Effect


def build(
    blocks: Sequence[Block],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    known: Mapping[str, list[Candidate]] | None = None,
    last: System | None = None,
) -> tuple[Linearised, dict[str, str]]:
    """Return the model of a stack, and why effects are not tested.

    The blocks come back with the noise of their loads as loud as it was flown, where no repeats told it. The
    likeliest effects are computed at their size before errors of form are looked for: what is missing of a
    large effect looks like a large one. Of these errors those stay that the data leave possible.

    Parameters
    ----------
    blocks : sequence of Block
    library : dict of Effect
    sizes : dict of float
        Tolerances, one sigma by name.
    known : dict of list of Candidate, optional
        By effect, candidates that stay as they are, on blocks whose noise is as loud as it was flown.
    last : System, optional
        Of the same records on other motion: lines are made straight first where its were.
    """
    found, not_tested = candidates(library, blocks, known)
    at, parts, common = _straight(blocks, found, library, sizes, last, quiet=known is None)
    system = replace(at.system, form_errors=(common,), _kept=Kept())
    at = at_their_size(replace(at, system=down_to_seen(system)))
    parts = side_by_side(blocks[0].trial.simulation, Parts.second_order, parts)
    terms = _terms(parts)
    start = of_all(terms, at.columns[0].form_names, common)
    largest = dict(zip(terms, reach(start).tolist(), strict=True))
    columns = [c.with_form(p.fewer(largest), terms) for c, p in zip(at.columns, parts, strict=True)]
    wider = replace(at.system, blocks=[c.matrices for c in columns], _kept=Kept())
    forms = likely_forms(wider, terms, start)
    columns = [c.kept(forms) for c in columns]
    system = replace(at.system, blocks=[c.matrices for c in columns], form_errors=forms, _kept=Kept())
    return replace(at, system=system, columns=columns), not_tested


def at_their_size(at: Linearised) -> Linearised:
    """Return the model with the likeliest effects' columns at sizes near their estimates.

    And tolerances straight about these. Again where estimates move: far from where it was computed, a strong
    effect's columns are wrong by many times the noise, and the estimate stays where they are right.
    """
    for _ in range(MOST_ROUNDS):
        new = list(at.system.candidates)
        for i in at.evidence.likeliest:
            size = float(joint_estimates(at.system, [i])[0].size[0])
            new[i] = refined(new[i], size, at.effects, at.blocks)
        if all(a is b for a, b in zip(new, at.system.candidates, strict=True)):
            break
        at = at.rebuilt(new).likelier(at.evidence.form_error())
    return at


def flown_departures(
    blocks: Sequence[Block], library: Mapping[str, Effect], sizes: Mapping[str, float]
) -> dict[str, float]:
    """Return the likeliest departures of the simulation's own parameters where no effect acts.

    With these it flies closer to the record than with its nominal ones.
    """
    at, _, common = _straight(blocks, [], library, sizes, quiet=True)
    return at.likeliest_departures(common)[0]


def _straight(
    blocks: Sequence[Block],
    found: list[Candidate],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    last: System | None = None,
    *,
    quiet: bool,
) -> tuple[Linearised, list[Parts], Form]:
    """Return a model with errors of form of first order and straight tolerances.

    And the parts of its form, and the likeliest error of form that is common to all terms of a kind. Where
    blocks are `quiet`, the noise of their loads may be louder than it seems.
    """
    simulation = blocks[0].trial.simulation
    stated = side_by_side(simulation, lambda b: tolerance_columns(b, library, sizes), blocks)
    found = [*found, *beyond_tolerance(blocks, stated, sizes)] if found else found
    sigmas = one_sigmas(blocks, library, sizes)
    found = [
        replace(c, spreads={n: sigmas[n] / c.departs.get(n, 1.0) for n in c.tolerances if n in sigmas})
        for c in found
    ]
    names = tuple(dict.fromkeys(n for one in stated for n in one))
    alike = side_by_side(simulation, shared_columns, blocks)
    labels = tuple(dict.fromkeys(n for one in alike for n in one))

    def whitened(i: int) -> tuple[Columns, Parts]:
        """Return the whitened columns of a block, and its form: the others fill most of the memory."""
        tolerances, shared = [stated[i].get(n) for n in names], [alike[i].get(n) for n in labels]
        parts = Parts.of(blocks[i], i, found, tolerances, shared, library, sizes)
        parts = parts.likeliest(found, quiet=quiet)
        return _whitened(parts, labels), parts.form_alone()

    made = side_by_side(simulation, whitened, range(len(blocks)))
    alike.clear()  # they are large, and are not asked again
    parts = [p for _, p in made]
    terms = _terms(parts)
    every = (Form((FORM_ERRORS[-1],) * len(terms), 0.0),)
    columns = [_with_form(c, p, terms, every) for c, p in made]
    system = System(found, names, [c.matrices for c in columns], every)
    system, columns = _told_apart(system, columns)
    common = common_form(system, terms)
    at = Linearised(system, columns, [p.block for p in parts], library, sizes)
    if last and last.about:
        at = at.at(*_as_before(last, last.about, system), common)
    for _ in range(ROUNDS):
        at = at.likelier(common)
    at = at.drawn_anew(leading=bool(found))
    return at, [replace(p, block=b) for p, b in zip(parts, at.blocks, strict=True)], common


def _as_before(last: System, about: About, system: System) -> tuple[Array, list[tuple[int, Estimate]]]:
    """Return the tolerances and effects of one system as those of another, by name."""
    departures = dict(zip(last.tolerances, about.tolerances.tolist(), strict=True))
    at = {c.name: i for i, c in enumerate(system.candidates)}
    acting = [(at[e.candidate.name], e) for _, e in about.acting if e.candidate.name in at]
    return np.array([departures.get(n, 0.0) for n in system.tolerances]), acting


def _told_apart(system: System, columns: Sequence[Columns]) -> tuple[System, list[Columns]]:
    """Return a system without own parameters of the simulation that do what an effect of the library does.

    Beside noise and all other tolerances: such a parameter is left to that effect.
    """
    n, last = system.columns, system.columns + len(system.tolerances)
    gram = np.sum([b.gram for b in system.blocks], axis=0)[:last, :last]
    within = gram - gram[:, n:] @ np.linalg.solve(np.eye(last - n) + gram[n:, n:], gram[n:])
    library = np.array([c.effect != OTHER for c in system.candidates for _ in c.sizes], dtype=bool)
    kept = []
    for i, c in enumerate(system.candidates):
        if c.effect == OTHER and c.kind == "scalar":
            k = n + system.tolerances.index(c.place.label)
            own, across = within[k, k], within[k, :n][library]
            power = np.diag(within)[:n][library] + across**2 / (1 - own)  # without that tolerance itself
            if np.any(across**2 > ALIKE**2 * own * (1 - own) * power):
                continue
        kept.append(i)
    if len(kept) == len(system.candidates):
        return system, list(columns)
    parts = [system.columns_of(i) for i in kept]
    new = [c.with_effects(parts) for c in columns]
    candidates = [system.candidates[i] for i in kept]
    blocks = [c.matrices for c in new]
    return replace(system, candidates=candidates, blocks=blocks, _kept=Kept()), new


def _terms(parts: Sequence[Parts]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(c.term for p in parts for c in p.form))


def columns_of(
    block: Block, index: int, found: Sequence[Candidate], like: Linearised
) -> tuple[Columns, Block]:
    """Return the columns of one more block, and the block with its noise as it was flown.

    Parameters
    ----------
    block : Block
    index : int
        Of the block among those that the candidates have columns for.
    found : sequence of Candidate
    like : Linearised
        With the tolerances and the errors of form that it has too.
    """
    library, sizes, c = like.effects, like.sizes, like.columns[0]
    stated, alike = tolerance_columns(block, library, sizes), shared_columns(block)
    tolerances = [stated.get(n) for n in like.system.tolerances]
    shared = [alike.get(n) for n in c.shared_names]
    parts = Parts.of(block, index, found, tolerances, shared, library, sizes).likeliest(found, quiet=True)
    made = _whitened(parts, c.shared_names)
    return _with_form(made, parts.second_order(), c.form_names, like.system.form_errors), parts.block


def _with_form(columns: Columns, parts: Parts, terms: Sequence[str], forms: Sequence[Form]) -> Columns:
    """Return columns with those of the form that some errors of it need."""
    largest = np.max([f.loads for f in forms], axis=0)
    return columns.with_form(parts.fewer(dict(zip(terms, largest.tolist(), strict=True))), terms)


def _whitened(parts: Parts, labels: Sequence[tuple[str, str]]) -> Columns:
    """Return the whitened columns of one block, those of the form not among them."""
    block = parts.block
    form, row = replace(parts, form=()).row_columns(())
    return Columns(
        effects=block.white(parts.effects),
        tolerances=block.white(parts.tolerances),
        own=block.white(parts.own),
        shared=block.white(parts.shared),
        form=form,
        residual=block.white(block.residual),
        sigmas=parts.tolerances,
        form_names=(),
        form_row=row,
        shared_names=tuple(labels),
        own_names=parts.own_names,
    )
