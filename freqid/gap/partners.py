"""Which effects explain what a large one leaves: to first order about where it fits best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from freqid.gap.attribute import Judged, variants
from freqid.gap.changes import Values, departures, settings_of
from freqid.gap.compare import Compared
from freqid.gap.descent import Sought
from freqid.gap.evidence import Evidence, Hypothesis
from freqid.gap.gather import evidence_of
from freqid.gap.refit import starting
from freqid.gap.testable import in_force_of
from freqid.simulate.effects.effect import Effect

Complex = NDArray[np.complex128]

_PARTNERS = 3
_MORE = 4.0  # logarithm of odds that a second effect must add beside the first


def beside(
    leading: Judged, evidence: Evidence, library: Mapping[str, Effect], compared: Sequence[Compared]
) -> dict[str, Values]:
    """Return the effects that say most of what the leading one leaves, and where a fit of both begins.

    About nothing, the curve of a large effect is told by effects that have no part in it.

    Parameters
    ----------
    leading : Judged
        Weighed in full.
    evidence : Evidence
        Of the manoeuvres as they are.
    library : dict of Effect
        As on the vehicle.
    compared : sequence of Compared

    Returns
    -------
    dict of dict of dict of float
        By partner, likeliest first: settings of both, by effect.
    """
    effect, trial = library[leading.name], compared[0].trial
    known = leading.settings.get(effect.id) or starting(
        effect, evidence, leading.best, leading.estimate.value, trial
    )
    sought = Sought.of([effect], {effect.id: known}, trial.simulation)
    chained = [library[i] for i in library if i != effect.id and _follows(library[i], effect)]
    taken = []
    for c in compared:
        made, columns = departures(c, [effect], sought.names, sought.start, sought.scale)
        for other in chained:
            columns |= _behind(effect, sought, other, c)
        taken.append((made, {**c.signatures, **columns}))
    left = evidence_of(compared, changes=taken, null=False)
    own = Hypothesis(effect.id, tuple(left.column(f"{i}:{n}") for i, n in sought.names), tuple(sought.scale))
    alone = float(left.evidences(own)[0])
    ways = {
        other.id: [
            Hypothesis(other.id, (*own.columns, *way.columns), (*own.scale, *way.scale))
            for way in variants(other, left)
        ]
        for other in library.values()
        if other.id != effect.id
    }
    best = {i: max(of, key=lambda h: left.evidences(h)[0]) for i, of in ways.items() if of}
    gain = {i: float(left.evidences(h)[0]) - alone for i, h in best.items()}
    likely = sorted((i for i in gain if gain[i] > _MORE), key=lambda i: -gain[i])[:_PARTNERS]
    return {
        i: {
            effect.id: dict(known),
            i: starting(library[i], left, best[i], left.estimate(best[i]).value, trial),
        }
        for i in likely
    }


def _follows(one: Effect, other: Effect) -> bool:
    """Return whether two effects follow one another between command and airframe, and so do not add up."""
    return all(e.act is not None or e.feel is not None for e in (one, other))


def _behind(effect: Effect, sought: Sought, other: Effect, compared: Compared) -> dict[str, Complex]:
    """Return signatures of an effect beside another that is there at its settings."""
    force = in_force_of(other, compared.trial.simulation)
    free = {n: force[n] for n in other.parameters if f"{other.id}:{n}" in compared.signatures}
    start = {effect.id: settings_of(sought.names, sought.start)[effect.id], other.id: free}
    both = Sought.of([effect, other], start, compared.trial.simulation)
    made = departures(compared, [effect, other], both.names, both.start, both.scale)[1]
    return {n: z for n, z in made.items() if n.startswith(f"{other.id}:")}
