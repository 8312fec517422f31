"""The effects of an explanation together: each at its size, and all that they change where they act.

An effect between command and airframe changes what others do there. A lag behind a delay is not the lag
alone, and what a servo's tolerance makes of a position comes late too.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.columns import Columns, rebuilt, redrawn
from freqid.gap.infer.evidence import Estimate, Evidence
from freqid.gap.infer.explain import Explanation
from freqid.gap.infer.joint_sizes import joint_estimates
from freqid.gap.infer.linearise import drawn, drawn_anew, relinearised, straight
from freqid.gap.infer.system import System
from freqid.gap.model.changes import beside
from freqid.gap.model.refine import refined
from freqid.gap.model.testable import in_force_of
from freqid.gap.settings import ROUNDS
from freqid.gap.simulation import Simulation
from freqid.gap.stack.block import Block
from freqid.simulate.effects.effect import Effect


def settings_of(
    estimates: Iterable[Estimate], library: Mapping[str, Effect], simulation: Simulation
) -> list[tuple[str, dict[str, float]]]:
    """Return the effects of one size among some, with their parameters as estimated.

    Parameters
    ----------
    estimates : iterable of Estimate
    library : dict of Effect
        Of the vehicle.
    simulation : Simulation
    """
    found = []
    for e in estimates:
        c = e.candidate
        if c.kind == "scalar" and c.effect in library:
            force = in_force_of(library[c.effect], simulation)
            found.append((c.effect, c.place.settings(force, e.size)))
    return found


def acted_on(
    blocks: Sequence[Block], acting: Sequence[tuple[str, dict[str, float]]], library: Mapping[str, Effect]
) -> list[Block]:
    """Return blocks on whose trials effects are in force; the same where they change nothing for others."""
    effects = [(library[n], x) for n, x in acting]
    trials = [beside(effects, b.trial) for b in blocks]
    each = zip(blocks, trials, strict=True)
    return [b if t is b.trial else replace(b, trial=t, as_moved=None) for b, t in each]


def about_explanation(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    explanation: Explanation,
    others: Sequence[tuple[int, Estimate]],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
    *,
    anew: bool = True,
) -> tuple[System, list[Columns]]:
    """Return a system about an explanation: its effects near their sizes, tolerances beside them.

    Parameters
    ----------
    system : System
    columns : sequence of Columns
        By block.
    blocks : sequence of Block
    explanation : Explanation
    others : sequence of (int, Estimate)
        Candidates that may act beside it, with their sizes there.
    library : dict of Effect
        Of the vehicle.
    sizes : dict of float
        Tolerances, one sigma by name.
    form_error : Form
        At which the tolerances' departures are fitted.
    anew : bool
        Whether lines have the slopes that they have there. Without it, and without others, effects keep
        their columns too.
    """
    acting = settings_of(explanation.estimates, library, blocks[0].trial.simulation)
    acts = list(zip(explanation.places, explanation.estimates, strict=True))
    flown = acted_on(blocks, acting, library)
    if len(acts) == 1 and not others and flown[0] is blocks[0]:
        c = system.candidates[acts[0][0]]
        if refined(c, float(acts[0][1].size[0]), library, blocks) is c:
            return system, list(columns)  # lines are drawn about it already
    system, columns = relinearised(system, columns, flown, library, sizes, form_error, acts)
    if not (anew or others):
        return system, columns
    assert system.about is not None  # where the step ends, shorter where it led astray
    fitted, acts = system.about.tolerances, list(system.about.acting)
    acting = settings_of([e for _, e in acts], library, blocks[0].trial.simulation)
    flown = acted_on(blocks, acting, library)
    there = drawn(system, columns, blocks, fitted, acts, library, sizes, form_error)
    system, columns = redrawn(system, columns, there, library, [i for i, _ in [*acts, *others]])
    new = list(system.candidates)
    for i, e in acts:
        k = next((k for k, (n, _) in enumerate(acting) if n == e.candidate.effect), len(acting))
        before, after = (acting[:k], acting[k + 1 :]) if k < len(acting) else ([], [])
        new[i] = refined(new[i], float(e.size[0]), library, there, before, after)
    for i, e in others:
        new[i] = refined(new[i], float(e.size[0]), library, there, acting)
    system, columns = rebuilt(system, new, columns, blocks)
    if anew:
        return drawn_anew(system, columns, flown, library, sizes)[:2]
    return straight(system, columns, flown, library, sizes, form_error, fitted, acts)


def about_single(
    evidence: Evidence,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    one: Explanation,
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
) -> tuple[System, list[Columns], Explanation]:
    """Return a system about one effect of several by itself, at the size that it has then.

    Parameters
    ----------
    evidence : Evidence
        About them all.
    columns, blocks, library, sizes, form_error
        As in `about_explanation`.
    one : Explanation
        Of that effect.
    """
    system, columns = evidence.system, list(columns)
    for _ in range(ROUNDS):
        system, columns = about_explanation(system, columns, blocks, one, [], library, sizes, form_error)
        one = replace(one, estimates=joint_estimates(system, one.places))
    return system, columns, one
