"""Tolerances, offsets and effects made straight about where they came out together, not about nominal.

Columns say what each makes alone. What many of them make together is not their sum: a rotor's offset is felt
through a propeller that has five per cent more thrust, and a slipstream that is missing changes what a flap's
size makes. On an aircraft of two hundred uncertain parameters, flown slowly, that is fifty standard
deviations of a mean moment. So the simulation is asked once with all of them at their likeliest sizes, and
what their columns say less than that is taken off the residual (Gauss-Newton with columns that stay: G. A. F.
Seber, C. J. Wild, Nonlinear Regression, 1989, section 2.1). A step to where the data are less likely, asked
there and not by the lines, is shortened to where a parabola through what was found has its least (J. E.
Dennis, R. B. Schnabel, Numerical Methods for Unconstrained Optimization, 1983, section 6.3.2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError, ImpossibleSettings
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.columns import Columns, redrawn
from freqid.gap.infer.evidence import Evidence, weigh, weights_of
from freqid.gap.infer.explain import likeliest
from freqid.gap.infer.joint_sizes import joint_estimates
from freqid.gap.infer.system import About, System
from freqid.gap.infer.together import Acting, Point
from freqid.gap.model.tolerance import record_columns, tolerance_columns
from freqid.gap.settings import FARTHEST, MOST_ROUNDS, SETTLED
from freqid.gap.simulation import side_by_side
from freqid.gap.stack.block import Block
from freqid.simulate.effects.effect import Effect

_TRIES = 3  # of a step, shorter each time where the data are less likely at its end
_SHORTER = (0.1, 0.5)  # least and largest share of such a step that is tried next (the book's bounds)


def relinearised(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
    acting: Acting | None = None,
) -> tuple[System, list[Columns]]:
    """Return a system whose lines are right where all that is unknown is likeliest.

    Where the data are less likely there than where lines were made straight before, another effect that leads
    is not taken, and a step is shortened. Where the slope at its beginning promises less than `SETTLED` nats,
    no step is taken, and lines stay as they are.

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
    acting : sequence of (int, Estimate), optional
        What acts beside them; the likeliest effect where absent, if one is likely.
    """
    free = acting is None

    def fit(acting: Acting) -> Array:
        """Return the likeliest tolerances beside effects, those of their own parameters among the sizes."""
        own = system.own_tolerances(i for i, _ in acting)
        rows = system.tolerance_rows(form_error)
        return system.likeliest_tolerances(rows, weights_of(system, acting), own)

    def asked(fitted: Array, acting: Acting) -> tuple[float, tuple[System, list[Columns]] | None]:
        """Return how unlikely the data are there, and lines that are right there."""
        try:
            found = straight(system, columns, blocks, library, sizes, form_error, fitted, acting)
        except DataError:  # no simulation can be so
            return np.inf, None
        assert found[0].about is not None
        return found[0].about.misfit, found

    known, acted, least, at = np.zeros(len(system.tolerances)), None, np.inf, None
    if system.about is not None:
        known, acted, at = system.about.tolerances, system.about.acting, (system, list(columns))
        if all(e.candidate is system.candidates[i] for i, e in acted):
            least = _misfit(system, form_error, known, acted)
        else:  # columns of what acts were drawn anew since: lines are not right there any more
            least, at = asked(known, acted)
            system, columns = at or (system, columns)
    if acting is None:
        acting = _likeliest_alone(_weighed(system, form_error))
    if acted is None:
        acted = acting
    fitted = fit(acting)
    if not _same(acted, acting):
        misfit, found = asked(fitted, acting)
        if found is not None and not (free and misfit > least + SETTLED):
            return found
        places = [i for i, _ in acted]
        acting = list(zip(places, joint_estimates(system, places), strict=True))
        fitted = fit(acting)
    gain, share = least - _misfit(system, form_error, fitted, acting), 1.0
    for _ in range(_TRIES):
        if 2 * share * gain < SETTLED:
            break
        misfit, found = asked(known + share * (fitted - known), _part_of_the_way(acted, acting, share))
        if misfit < least:
            at = found
            break
        bend = misfit - least + 2 * share * gain
        share *= float(np.clip(share * gain / bend, *_SHORTER)) if np.isfinite(bend) else _SHORTER[0]
    return at or straight(system, columns, blocks, library, sizes, form_error, fitted, acting)


def straight(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
    fitted: Array,
    acting: Acting,
    *,
    anew: bool = False,
) -> tuple[System, list[Columns]]:
    """Return a system whose lines are right where tolerances and effects have some sizes.

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
        At which the records' own unknowns are fitted.
    fitted : ndarray, shape (tolerance,)
        Of all tolerances, in sigmas.
    acting : sequence of (int, Estimate)
    anew : bool
        As in `straightened`.
    """

    def there(pair: tuple[Columns, Block]) -> Columns:
        return straightened(*pair, system, fitted, acting, library, sizes, form_error, anew=anew)

    new = side_by_side(blocks[0].trial.simulation, there, list(zip(columns, blocks, strict=True)))
    made = replace(system, blocks=[c.matrices for c in new], _reduced={})
    acting = [(i, replace(e, candidate=system.candidates[i])) for i, e in acting]  # as it is drawn now
    about = About(fitted, acting, form_error, _misfit(made, form_error, fitted, acting))
    return replace(made, about=about), new


def drawn_anew(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    *,
    leading: bool = False,
) -> tuple[System, list[Columns], list[Block]]:
    """Return a system whose lines also have the slopes that they have where they were made straight.

    And the blocks as they are drawn there. Effects that lead may be drawn there too: one bias as an effect
    and as a tolerance, each on other motion, would leave a change between the two that nothing makes.

    Parameters
    ----------
    system : System
        That was made straight.
    columns : sequence of Columns
        By block.
    blocks : sequence of Block
    library : dict of Effect
    sizes : dict of float
        One sigma by name.
    leading : bool
        Whether those that lead are drawn there.
    """
    assert system.about is not None
    fitted, acting, form_error, _ = system.about
    blocks = drawn(system, columns, blocks, fitted, acting, library, sizes, form_error)
    if leading:
        lead = _leading(_weighed(system, form_error))
        system, columns = redrawn(system, columns, blocks, library, lead)
    found = straight(system, columns, blocks, library, sizes, form_error, fitted, acting, anew=True)
    return *found, blocks


def _weighed(system: System, form_error: Form) -> Evidence:
    """Return what the data say of every candidate at one error of form."""
    return weigh(replace(system, form_errors=(form_error,)))


def _misfit(system: System, form_error: Form, tolerances: Array, acting: Acting) -> float:
    """Return how unlikely data and tolerances are where some effects act."""
    few = system.of([i for i, _ in acting])
    return few.misfit(form_error, tolerances, weights_of(few, [(k, e) for k, (_, e) in enumerate(acting)]))


def _same(before: Acting, after: Acting) -> bool:
    """Return whether the same candidates act, whatever their sizes."""
    return [i for i, _ in before] == [i for i, _ in after]


def _part_of_the_way(before: Acting, after: Acting, share: float) -> Acting:
    """Return effects a share of the way from the sizes that they had."""
    sizes = {i: e.size for i, e in before}
    return [(i, replace(e, size=sizes[i] + share * (e.size - sizes[i]))) for i, e in after]


def drawn(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    fitted: Array,
    acting: Acting,
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
) -> list[Block]:
    """Return blocks on which columns are drawn where tolerances, offsets and effects are likeliest together.

    Parameters
    ----------
    system : System
    columns : sequence of Columns
        By block.
    blocks : sequence of Block
    fitted : ndarray, shape (tolerance,)
        Of all tolerances, in sigmas.
    acting : sequence of (int, Estimate)
    library : dict of Effect
    sizes : dict of float
        One sigma by name.
    form_error : Form
        At which the records' own unknowns are fitted.
    """

    def there(pair: tuple[Columns, Block]) -> Block:
        about = Point.about(*pair, system, fitted, acting, library, sizes, form_error)
        return replace(pair[1], as_moved=about.moved(pair[1]))

    pairs = list(zip(columns, blocks, strict=True))
    return side_by_side(blocks[0].trial.simulation, there, pairs)


def settled(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
    acting: Acting | None = None,
) -> tuple[System, list[Columns], list[Block]]:
    """Return a system whose lines are drawn anew until the data are no likelier by another round.

    And the blocks on which they are drawn; as in `relinearised`. Two explanations are compared where both
    have settled, for each round may gain as much as an effect does. What all make together is asked for first
    with slopes that stay, which is quick; where that changes nothing, slopes of the same place would not
    either (the chord method: J. M. Ortega, W. C. Rheinboldt, Iterative Solution of Nonlinear Equations in
    Several Variables, 1970, section 7.1).
    """

    def log_evidence() -> float:
        return _log_evidence(replace(system, form_errors=(form_error,)), acting)

    free = acting is None
    if free:  # those that lead now may not have led when lines were drawn
        lead = _leading(_weighed(system, form_error))
        system, columns = redrawn(system, columns, blocks, library, lead)
    before = log_evidence()
    for _ in range(MOST_ROUNDS):
        start = before
        for _ in range(MOST_ROUNDS):
            last = system.about
            system, columns = relinearised(system, columns, blocks, library, sizes, form_error, acting)
            here = system.about
            assert here is not None
            if last and _same(last.acting, here.acting) and here.misfit > last.misfit - SETTLED:
                break
        before = log_evidence()
        if abs(before - start) < SETTLED:
            break
        system, columns, blocks = drawn_anew(system, columns, blocks, library, sizes, leading=free)
        before = log_evidence()
    return system, list(columns), list(blocks)


def settled_beside_none(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
) -> tuple[System, list[Columns], list[Block], float]:
    """Return what `settled` returns, and the nats by which no effect is likelier than these lines say.

    They are right where tolerances are likeliest *beside* the likeliest effect. Where that effect and a
    tolerance do the same, as a late channel does, they are elsewhere without it: the case of no effect would
    be judged with the errors of lines drawn far from it. So it is judged with lines of its own. Where the
    data are likelier there than beside the effect, of which no effect is a special case, that one has settled
    elsewhere than where it is likeliest, and begins again from there.
    """
    at = settled(system, columns, blocks, library, sizes, form_error)
    if not _likeliest_alone(_weighed(at[0], form_error)):
        return *at, 0.0
    alone, parts = _without_effects(system, at[1])
    alone, _, _ = settled(alone, parts, at[2], library, sizes, form_error, [])
    assert alone.about is not None
    assert at[0].about is not None
    if alone.about.misfit < at[0].about.misfit - SETTLED:
        begun = straight(*at, library, sizes, form_error, alone.about.tolerances, [])
        at = settled(*begun, at[2], library, sizes, form_error)
    here, _ = _without_effects(system, at[1])
    return *at, max(weigh(alone).log_none - weigh(here).log_none, 0.0)


def _without_effects(system: System, columns: Sequence[Columns]) -> tuple[System, list[Columns]]:
    """Return a system with no candidates, and its columns."""
    parts = [replace(c, effects=c.effects[:0]) for c in columns]
    return System([], system.tolerances, [c.matrices for c in parts], system.form_errors), parts


def _log_evidence(system: System, acting: Acting | None) -> float:
    """Return the log evidence of what acts, at one error of form; of the likeliest effect where absent."""
    acting = _likeliest_alone(weigh(system)) if acting is None else acting
    if not acting:
        return system.of([]).reduced(system.form_errors[0]).log_evidence
    few = system.of([i for i, _ in acting]).reduced(system.form_errors[0])
    w = np.concatenate([weights_of(system, [one])[system.columns_of(one[0])] for one in acting])
    return few.log_evidence + float(w @ few.g - 0.5 * w @ few.G @ w)


def straightened(
    columns: Columns,
    block: Block,
    system: System,
    fitted: Array,
    acting: Acting,
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
    *,
    anew: bool = False,
) -> Columns:
    """Return the columns of a block, its residual less what all make together beyond their columns.

    Parameters
    ----------
    columns : Columns
    block : Block
    system : System
        Of whose candidates the columns are.
    fitted : ndarray, shape (tolerance,)
        Of all tolerances, in sigmas.
    acting : sequence of (int, Estimate)
    library : dict of Effect
    sizes : dict of float
        One sigma by name.
    form_error : Form
        At which the record's own unknowns are fitted.
    anew : bool
        Whether tolerances and the record's own unknowns also have the slopes of the block as it is drawn.
    """
    c, at = columns, (block, system, fitted, acting, library, sizes, form_error)
    about = Point.about(c, *at)
    try:
        whole = about.made(block)
    except ImpossibleSettings:  # a fit may ask for a body that cannot be: its mass properties stay straight
        about = Point.about(c, *at, bodies=False)
        whole = about.made(block)
    if anew:
        c = _sloped(c, block, system.tolerances, library, sizes)
    straight = np.zeros_like(c.residual)
    for names, made in ((system.tolerances, c.tolerances), (c.own_names, c.own)):
        straight += np.array([about.sigmas.get(n, 0.0) for n in names]) @ made
    straight += weights_of(system, about.acting) @ c.effects
    return c.with_residual(block.white(block.residual - whole) + straight)


def _sloped(
    columns: Columns,
    block: Block,
    names: Sequence[str],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
) -> Columns:
    """Return columns of which tolerances and the record's own unknowns have the slopes of a block."""
    z = np.zeros_like(block.residual)
    stated, unknown = (of(block, library, sizes) for of in (tolerance_columns, record_columns))
    sigmas = np.array([stated.get(n, z) for n in names]) if names else columns.sigmas
    own = (
        np.array([unknown.get(n, z) for n in columns.own_names]) if columns.own_names else columns.sigmas[:0]
    )
    return columns.with_slopes(sigmas, block.white(sigmas), block.white(own))


def likeliest_departures(
    system: System,
    blocks: Sequence[Block],
    sizes: Mapping[str, float],
    form_error: Form,
    weights: Array | None = None,
) -> tuple[dict[str, float], Array]:
    """Return the likeliest departures of the simulation's own parameters, and of all tolerances in sigmas.

    Of the first none beyond `FARTHEST`: where a large effect is not allowed for, tolerances are asked for
    what no simulation can do.
    """
    own = blocks[0].trial.simulation.tolerances
    system = replace(system, form_errors=(form_error,))
    beside = weights_of(system, _likeliest_alone(weigh(system))) if weights is None else weights
    fitted = system.likeliest_tolerances(system.tolerance_rows(form_error), beside)
    each = zip(system.tolerances, np.clip(fitted, -FARTHEST, FARTHEST).tolist(), strict=True)
    return {name: x * sizes.get(name, own[name].sigma) for name, x in each if name in own}, fitted


def _leading(evidence: Evidence) -> list[int]:
    """Return the places of the effects that lead where these are likelier than no effect."""
    candidates = evidence.system.candidates
    lead = {candidates[i].effect for i in likeliest(evidence)}
    return [i for i in np.flatnonzero(evidence.candidate > 0).tolist() if candidates[i].effect in lead]


def _likeliest_alone(evidence: Evidence) -> Acting:
    """Return the likeliest effect with its size, that of a tolerance among it; none where none is likely."""
    best = int(np.argmax(evidence.candidate)) if len(evidence.candidate) else -1
    if best < 0 or evidence.candidate[best] <= 0:
        return []
    return [(best, joint_estimates(evidence.system, [best])[0])]
