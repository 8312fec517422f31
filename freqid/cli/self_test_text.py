"""A self-test as the terminal shows it."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from freqid.cli.columns import text_table
from freqid.core.results.gap_self_test import ENDS

if TYPE_CHECKING:
    from freqid.core.results.gap_self_test import Rate, SelfTest, SmallestSize, Stratum

_LISTED = 0.05  # share of draws from which a wrong answer is listed


def self_test_text(test: SelfTest) -> str:
    """Return what was found of effects inserted into the simulation along the flights."""
    lines = [
        f"Self-test: each effect inserted into this simulation along these flights, {test.draws} draws of "
        "noise and tolerances each:",
        text_table(
            ("detectability", "found", "one name given", "the right one", "set holds it", "p of the truth"),
            [
                (
                    f"{s.detectability:g}",
                    *(_percent(r) for r in (s.detected, s.named, s.right, s.covered)),
                    f"{s.truth_probability:.2f}" if isfinite(s.truth_probability) else "-",
                )
                for s in test.strata
            ],
            indent=4,
        ),
        f"  of draws with nothing inserted {_percent(test.false_alarm)} were called a gap (level "
        f"{test.level:g}), {_percent(test.false_name)} were given a name",
        f"  effects taken out of the library: {_percent(test.outside['named'])} wrongly named, "
        f"{_percent(test.outside['other'])} called other",
        f"  {test.reliability.sentence()}",
        "  smallest size found in 95 of 100 draws, and what is answered at a detectability of "
        f"{test.strata[len(test.strata) // 2].detectability:g}:",
        text_table(
            ("effect", "smallest found", "right", "answered instead"),
            _effects(test),
            indent=4,
        ),
    ]
    lines += [f"  not inserted: {name} ({why})" for name, why in test.not_inserted.items()]
    return "\n".join(lines)


def _effects(test: SelfTest) -> list[tuple[str, ...]]:
    middle = test.strata[len(test.strata) // 2]
    rows: list[tuple[str, ...]] = []
    for effect in dict.fromkeys(s.effect for s in test.smallest):
        each = sorted((s for s in test.smallest if s.effect == effect), key=_rank)
        right, instead = _answers(middle, effect)
        for k, one in enumerate(each if len(each) < 3 else (each[0], each[-1])):
            size = f"{one.size:.2g} {one.unit}".removesuffix(" 1") if isfinite(one.size) else "none in range"
            rows.append((f"{effect} {one.place}".rstrip(), size, *((right, instead) if k == 0 else ("", ""))))
    return rows


def _rank(one: SmallestSize) -> float:
    return one.detectability if isfinite(one.detectability) else float("inf")


def _answers(stratum: Stratum, effect: str) -> tuple[str, str]:
    """Return how often an effect is named, and what is answered instead."""
    counts = stratum.answers.get(effect)
    if not counts:
        return "-", "-"
    total = max(sum(counts.values()), 1)
    others = sorted(((n, k) for n, k in counts.items() if n != effect), key=lambda item: -item[1])
    words = {"none": "no gap", "other": "other", "several": "several names"}
    listed = [
        f"{words[n] if n in ENDS else n} {100 * k / total:.0f} %" for n, k in others if k / total >= _LISTED
    ]
    return f"{100 * counts.get(effect, 0) / total:.0f} %", ", ".join(listed)


def _percent(rate: Rate) -> str:
    if not rate.of:
        return "-"
    return f"{100 * rate.share:.0f} % ({100 * rate.lo:.0f}-{100 * rate.hi:.0f})"
