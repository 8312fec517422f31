"""Which effects a diagnosis closes a gap with, and where their refits begin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from freqid.core.diagnosis import Closure, Which
from freqid.gap import score
from freqid.gap.attribute import NONE, OTHER, Judged
from freqid.gap.compare import Compared
from freqid.gap.evidence import Evidence, Hypothesis
from freqid.gap.refit import Refit, starting
from freqid.simulate.effects.effect import Effect

_TOLD = 3  # effects that are closed without being asked for


def closures_of(
    used: list[Compared],
    kept: list[Compared],
    names: Sequence[str],
    evidence: Evidence,
    judged: Sequence[Judged],
    library: Mapping[str, Effect],
    which: Which,
    exists: bool,
    named: Sequence[str],
    interval: float,
) -> tuple[list[Closure], dict[str, Refit]]:
    """Return the closures asked for, or those of what was found."""
    groups: list[tuple[str, ...]] = []
    if named:
        groups = [tuple(named), *((n,) for n in named if len(named) > 1)]
    elif exists:
        if which.pair:
            groups.append(which.pair)
        likely = sorted(which.probabilities.items(), key=lambda item: -item[1])
        groups += [(n,) for n, p in likely if n not in (NONE, OTHER) and p > 0.02][:_TOLD]
    closures, refits = [], {}
    for group in groups:
        closure, fitted = score.closure(
            used,
            kept,
            names,
            [library[n] for n in group],
            start_of(group, evidence, judged, library, used),
            interval,
        )
        closures.append(closure)
        refits["+".join(group)] = fitted
    return closures, refits


def start_of(
    group: Sequence[str],
    evidence: Evidence,
    judged: Sequence[Judged],
    library: Mapping[str, Effect],
    used: Sequence[Compared],
) -> dict[str, dict[str, float]]:
    """Return where the refit of effects begins: where they fit best, or their linear estimates, jointly."""
    known = next((j.settings for j in judged if set(j.name.split("+")) == set(group)), {})
    if known:
        return {n: dict(known[n]) for n in group}
    best = [next(j for j in judged if j.name == n).best for n in group]
    joint = Hypothesis(
        "+".join(group),
        tuple(dict.fromkeys(c for b in best for c in b.columns)),
        tuple({c: s for b in best for c, s in zip(b.columns, b.scale, strict=True)}.values()),
    )
    value = evidence.estimate(joint).value
    return {n: starting(library[n], evidence, joint, value, used[0].trial) for n in group}
