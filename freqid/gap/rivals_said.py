"""The verdict on two simulations, in one line."""

from __future__ import annotations

from collections.abc import Sequence

from freqid.core.rivals import Contest, Rivals

ALL = "all"
_TOLD = 2  # responses that are named
_SHOWN = 4  # regimes that are named


def verdict(found: Rivals) -> str:
    """Return which simulation is nearer, by how much and where, in one line."""
    if found.identical:
        return f"A and B say exactly the same: the flights cannot tell {_names(found)} apart."
    if not found.nearer:
        a, b = (f"{m.value:.2g}" for m in (found.overall.misfit_a, found.overall.misfit_b))
        return (
            f"The flights cannot tell A from B: misfits {a} of A ({found.simulations[0]}) and {b} of B "
            f"({found.simulations[1]}), which noise and tolerances could make of equal simulations."
        )
    parts = []
    for label, name in zip("AB", found.simulations, strict=True):
        where = [c for c in found.contests if c.nearer == label]
        over = found.overall.nearer == label
        if not (where or over):
            parts.append(f"{label} ({name}) is nearer nowhere")
            continue
        said = f"{label} ({name}) is nearer beyond noise: "
        share = found.overall.less if over else _less(where)
        said += f"{_percent(share)} less misfit{'' if over else ' there'}, "
        parts.append(said + (_places(where) if where else "in no one response and band by itself"))
    first = (found.overall.nearer or found.nearer) != "A"
    ordered = parts[::-1] if first else parts
    return "; ".join(ordered) + "."


def _less(where: Sequence[Contest]) -> float:
    """Return the share of the explainable energy that is less where the difference is largest."""
    return max(where, key=lambda c: abs(c.difference.value)).less


def _places(where: Sequence[Contest]) -> str:
    """Return responses with the bands and regimes in which most of the difference is."""
    held: dict[str, float] = {}
    for c in where:
        held[c.response] = held.get(c.response, 0.0) + abs(c.difference.value)
    ranked = sorted(held, key=lambda name: -held[name])
    told = []
    for name in ranked[:_TOLD]:
        every = [c for c in where if c.response == name]
        mine = [c for c in every if c.regime != ALL] or every
        low, high = min(c.band_hz[0] for c in mine), max(c.band_hz[1] for c in mine)
        regimes = list(dict.fromkeys(c.regime for c in mine))
        place = (
            "all regimes"
            if regimes == [ALL]
            else " ".join(regimes[:_SHOWN]) + (" ..." if len(regimes) > _SHOWN else "")
        )
        told.append(f"{name}, {low:.2g}-{high:.2g} Hz, {place}")
    rest = len(ranked) - len(told)
    return "in " + " and ".join(told) + (f", and {rest} more" if rest else "")


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.005 else "under 1 %"


def _names(found: Rivals) -> str:
    a, b = found.simulations
    return "them" if a == b else f"{a} and {b}"
