"""What a comparison of two simulations says in words: its verdict in one line, and remarks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from freqid.compare.shared_stack import SharedBlock
from freqid.core.results.rivals import Contest, Rivals
from freqid.gap.settings import FORM_ERRORS
from freqid.gap.simulation import Simulation

ALL = "all"
"""Name of a contest over all responses, or over all regimes."""

_RESPONSES = 2  # that the verdict names
_REGIMES = 4


def verdict_on(found: Rivals) -> str:
    """Return which simulation is nearer, by how much and where, in one line."""
    if found.identical:
        return f"A and B say exactly the same: the flights cannot tell {_titles(found)} apart."
    if not found.nearer:
        a, b = (f"{m.value:.2g}" for m in (found.overall.misfit_a, found.overall.misfit_b))
        clear = found.overall.p_adjusted < found.level
        because = (
            f"they differ by less than {_percent(found.smallest_difference)}"
            if clear
            else "which noise and tolerances could make of equal simulations"
        )
        return (
            f"The flights cannot tell A from B: misfits {a} of A ({found.simulations[0]}) and {b} of B "
            f"({found.simulations[1]}), {because}."
        )
    parts = []
    for label, title in zip("AB", found.simulations, strict=True):
        where = [c for c in found.contests if c.nearer == label]
        over = found.overall.nearer == label
        if not (where or over):
            parts.append(f"{label} ({title}) is nearer nowhere")
            continue
        share = found.overall.less if over else max(where, key=lambda c: abs(c.difference.value)).less
        places = _places(where) if where else "in no one response and band by itself"
        parts.append(
            f"{label} ({title}) is nearer beyond noise and tolerances: {_percent(share)} less misfit"
            f"{'' if over else ' there'}, {places}"
        )
    first = (found.overall.nearer or found.nearer) != "A"
    return "; ".join(parts[::-1] if first else parts) + "."


def remarks_on(
    pair: tuple[Simulation, Simulation],
    blocks: Sequence[SharedBlock],
    form_errors: tuple[float, float],
    identical: bool,
) -> Iterator[str]:
    """Yield what is not compared, how large the errors of form are, and what the noise was learned from."""
    rows = {row for b in blocks for row in b.rows}
    for label, simulation, other in (("A", pair[0], "B"), ("B", pair[1], "A")):
        alone = [n for n in simulation.responses if n not in rows]
        if alone:
            yield f"{label} alone predicts {', '.join(alone)}: not compared, {other} does not"
    if not identical:
        a, b = (_percent(f) + (" or more" if f == FORM_ERRORS[-1] else "") for f in form_errors)
        yield (
            f"error of form of the loads beyond tolerances, as a share of each term: A {a}, B {b}; "
            "the lesser counts for both"
        )
        yield f"noise was learned from {' and '.join(dict.fromkeys(b.noise_from for b in blocks))}"
    rough = [b.names[0] for b in blocks if b.motion == "smoothed record"]
    if rough:
        yield (
            f"tolerances on {', '.join(rough)} were computed on smoothed recorded motion, "
            "for neither a flight of a simulation nor a fitted response was near it"
        )


def _places(where: Sequence[Contest]) -> str:
    """Return responses with the bands and regimes in which most of the difference is."""
    size: dict[str, float] = {}
    for c in where:
        size[c.response] = size.get(c.response, 0.0) + abs(c.difference.value)
    ranked = sorted(size, key=lambda name: -size[name])
    named = []
    for name in ranked[:_RESPONSES]:
        every = [c for c in where if c.response == name]
        own = [c for c in every if c.regime != ALL] or every
        low, high = min(c.band_hz[0] for c in own), max(c.band_hz[1] for c in own)
        regimes = list(dict.fromkeys(c.regime for c in own))
        more = " ..." if len(regimes) > _REGIMES else ""
        place = "all regimes" if regimes == [ALL] else " ".join(regimes[:_REGIMES]) + more
        named.append(f"{name}, {low:.2g}-{high:.2g} Hz, {place}")
    rest = len(ranked) - len(named)
    return "in " + " and ".join(named) + (f", and {rest} more" if rest else "")


def _percent(share: float) -> str:
    if share == 0:
        return "0 %"
    return f"{100 * share:.2g} %" if share < 0.1 else f"{100 * share:.0f} %"


def _titles(found: Rivals) -> str:
    a, b = found.simulations
    return "them" if a == b else f"{a} and {b}"
