"""The effects of an explanation together: each at its size, and all that they change where they act.

An effect between command and airframe changes what others do there. A lag behind a delay is not the lag
alone, and what a servo's tolerance makes of a position comes late too.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.evidence import Estimate
from freqid.gap.infer.explain import Explanation
from freqid.gap.infer.joint_sizes import joint_estimates
from freqid.gap.infer.linearise import Linearised
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
    at: Linearised,
    explanation: Explanation,
    others: Sequence[tuple[int, Estimate]],
    form_error: Form,
    *,
    anew: bool = True,
) -> Linearised:
    """Return the model about an explanation: its effects near their sizes, tolerances beside them.

    Parameters
    ----------
    at : Linearised
    explanation : Explanation
    others : sequence of (int, Estimate)
        Candidates that may act beside it, with their sizes there.
    form_error : Form
        At which the tolerances' departures are fitted.
    anew : bool
        Whether lines have the slopes that they have there. Without it, and without others, effects keep
        their columns too.
    """
    library, blocks, simulation = at.effects, at.blocks, at.blocks[0].trial.simulation
    acting = settings_of(explanation.estimates, library, simulation)
    acts = list(zip(explanation.places, explanation.estimates, strict=True))
    flown = acted_on(blocks, acting, library)
    about = at.system.about
    drawn_so = about is not None and about.form_error == form_error
    if drawn_so and len(acts) == 1 and not others and flown[0] is blocks[0]:
        c = at.system.candidates[acts[0][0]]
        if refined(c, float(acts[0][1].size[0]), library, blocks) is c:
            return at  # lines are drawn about it already
    at = replace(replace(at, blocks=flown).likelier(form_error, acts), blocks=blocks)
    if not (anew or others):
        return at
    assert at.system.about is not None  # where the step ends, shorter where it led astray
    fitted, acts = at.system.about.tolerances, list(at.system.about.acting)
    acting = settings_of([e for _, e in acts], library, simulation)
    there = replace(at, blocks=at.drawn(fitted, acts, form_error))
    there = there.redrawn([i for i, _ in [*acts, *others]])
    new = list(there.system.candidates)
    for i, e in acts:
        k = next((k for k, (n, _) in enumerate(acting) if n == e.candidate.effect), len(acting))
        before, after = (acting[:k], acting[k + 1 :]) if k < len(acting) else ([], [])
        new[i] = refined(new[i], float(e.size[0]), library, there.blocks, before, after)
    for i, e in others:
        new[i] = refined(new[i], float(e.size[0]), library, there.blocks, acting)
    there = replace(there.rebuilt(new), blocks=acted_on(blocks, acting, library))
    there = there.drawn_anew() if anew else there.at(fitted, acts, form_error)
    return replace(there, blocks=blocks)


def about_single(at: Linearised, one: Explanation, form_error: Form) -> tuple[Linearised, Explanation]:
    """Return a model about one effect of several by itself, at the size that it has then.

    Parameters
    ----------
    at : Linearised
        About them all.
    one : Explanation
        Of that effect.
    form_error : Form
    """
    for _ in range(ROUNDS):
        at = about_explanation(at, one, [], form_error)
        one = replace(one, estimates=joint_estimates(at.system, one.places))
    return at, one
