"""The verdict of a diagnosis, in one line."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.core.diagnosis import Closure, Existence, Place, Which
from freqid.core.gap_map import GapMap
from freqid.gap.attribute import NONE, OTHER
from freqid.gap.score import ITSELF

_FEW = 3  # names that are listed


def verdict(
    gap: Existence, where: Sequence[Place], cells: GapMap, which: Which, closures: Sequence[Closure]
) -> str:
    """Return the verdict in one line."""
    if not gap.exists:
        return (
            f"No gap that can be resolved: noise and tolerances make as much in {100 * gap.p:.3g} % of cases."
        )
    words = ["A gap beyond noise"]
    if where:
        place = where[0]
        row = next(iter(cells.share("row").items()))
        words.append(
            f": {100 * row[1]:.0f} % of what is explained is in {row[0]}, mostly {place.band_hz[0]:.2g}-"
            f"{place.band_hz[1]:.2g} Hz"
        )
        if place.regime:
            words.append(f", at {place.regime}")
        if place.input:
            words.append(f", coherent with {place.input}")
    elif cells.energy.sum() > 0:
        row, share = next(iter(cells.share("row").items()))
        words.append(f": no place holds a tenth of what is explained, {row} most with {100 * share:.0f} %")
    words.append("; " + _name(which))
    if closures and np.isfinite(closures[0].wrench.G):
        gone = 100 * min(closures[0].wrench.G, 1.0)
        itself = ITSELF in closures[0].note
        there = "the manoeuvre that it was fitted to" if itself else "manoeuvres that were not used"
        words.append(f"; adding {_it(which, closures[0])} removes {gone:.0f} % on {there}")
    if closures and closures[0].consequence.get("matters"):
        it = "" if _just_named(which, closures[0]) else f"with {_it(which, closures[0])} "
        words.append("; " + it + closures[0].consequence["sentence"])
    how = f" (calibrated by {which.calibrated_by})" if which.calibrated_by else ""
    return "".join(words) + (how if which.calibrated else " (uncalibrated)") + "."


def _just_named(which: Which, closure: Closure) -> bool:
    """Return whether a closure adds what the verdict has just named."""
    return set(which.pair or tuple(which.probabilities)[:1]) == set(closure.effects)


def _it(which: Which, closure: Closure) -> str:
    """Return what a closure adds, in words."""
    if not _just_named(which, closure):
        return " and ".join(closure.effects)
    return "both" if which.pair else "it"


def _name(which: Which) -> str:
    if which.pair:
        return f"most likely {which.pair[0]} and {which.pair[1]} together"
    name, chance = next(iter(which.probabilities.items()))
    group = next((g for g in which.aliases if name in g), ())
    if name == OTHER:
        return f"none of the library's effects explains it ({100 * chance:.0f} %)"
    if name == NONE:
        return "no effect of the library explains it better than chance"
    if not which.named:
        if group:
            return f"most likely one of {', '.join(group)}, which these data cannot separate"
        return f"most likely {name} ({100 * chance:.0f} %), among {', '.join(which.set)}"
    if group:
        return f"one of {', '.join(group)}, which these data cannot separate"
    rest = [n for n in which.set if n not in which.named]
    open_ = f", {_listed(rest)} not ruled out" if rest else ""
    return f"{name} ({100 * chance:.0f} %){open_}"


def _listed(names: Sequence[str]) -> str:
    """Return a few names in words, or how many there are."""
    if len(names) > _FEW:
        return f"{len(names)} others"
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
