"""A diagnosis of a gap as the terminal shows it: the verdict, then tables."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING

from freqid.cli.columns import table
from freqid.cli.next_texts import next_text
from freqid.cli.self_test_text import self_test_text

if TYPE_CHECKING:
    from freqid.core.diagnosis import Change, Closure, GapDiagnosis, Interval, Share
    from freqid.gap.bookkeeping.check import Finding

_LISTED = 0.005  # probability from which an effect has a line


def bookkeeping_text(verdict: str, findings: Sequence[Finding]) -> str:
    """Return what is said where a diagnosis stops at mistakes of bookkeeping."""
    lines = [verdict]
    for f in findings:
        share = f" ({100 * f.explained:.0f} % of the residual)" if f.explained else ""
        lines.append(f"  {f.fault}: {f.sentence}{share}; {f.remedy}.")
    return "\n".join(lines)


def diagnosis_text(d: GapDiagnosis) -> str:
    """Return the diagnosis: its verdict in one line first, then where, which, parameters, how far."""
    said = [d.verdict, _gap(d), _where(d), _which(d), _parameters(d), _how_far(d)]
    blocks = [*said, next_text(d.next_flight), _remarks(d)]
    if d.self_test:
        blocks.insert(len(said), self_test_text(d.self_test))
    return "\n\n".join(block for block in blocks if block)


def _gap(d: GapDiagnosis) -> str:
    return (
        f"Gap: p = {d.gap.p:.2g} (level {d.gap.level:g}); a chi-square test that is blind to tolerances: "
        f"{d.gap.naive_p:.2g}."
    )


def _where(d: GapDiagnosis) -> str:
    if not d.where:
        return ""
    rows = [
        (
            p.response,
            f"{p.band_hz[0]:.2g}-{p.band_hz[1]:.2g} Hz",
            f"{100 * p.share:.0f} %",
            p.regime,
            p.input or "-",
            p.phase,
        )
        for p in d.where
    ]
    return "Where:\n" + table(("response", "band", "share", "regime", "coherent with", "phase"), rows)


def _which(d: GapDiagnosis) -> str:
    w = d.which
    rows = []
    for name, p in w.probabilities.items():
        if p >= _LISTED:
            size = d.gap.smallest_detectable.get(name)
            least = "-" if size is None else f"{size:.2g} {d.gap.unit.get(name, '')}".removesuffix(" 1")
            rows.append((name, f"{100 * p:.0f} %", "*" if name in w.set else "", least))
    lines = ["Which (* in the set that holds the truth with the stated confidence):"]
    lines.append(table(("effect", "probability", "set", "smallest found"), rows))
    if w.pair:
        lines.append(f"  together: {' and '.join(w.pair)}")
    lines += [f"  not to be told apart here: {', '.join(group)}" for group in w.aliases]
    by_reason: dict[str, list[str]] = {}
    for name, why in w.not_tested.items():
        by_reason.setdefault(why, []).append(name)
    lines += [f"  not tested: {', '.join(names)} ({why})" for why, names in by_reason.items()]
    return "\n".join(lines)


def _parameters(d: GapDiagnosis) -> str:
    if not d.gap.exists:
        return ""
    rows = [
        (effect, name, _interval(x))
        for effect in d.which.set
        for name, x in d.which.parameters.get(effect, {}).items()
    ]
    if not rows:
        return ""
    return "Parameters, to first order, as changes of the simulation:\n" + table(
        ("effect", "parameter", "estimate (90 %)"), rows
    )


def _how_far(d: GapDiagnosis) -> str:
    return "\n\n".join(_closure(c) for c in d.how_far)


def _closure(c: Closure) -> str:
    lines = [f"With {' and '.join(c.effects)}, scored on {', '.join(c.held_out)}:"]
    for effect, settings in c.settings.items():
        lines += [f"  {effect} {name} = {_interval(x)}" for name, x in settings.items()]
    lines.append(
        f"  G of the replayed residual {_share(c.wrench)}; of the simulation's flight {_share(c.response)}"
    )
    rows = [
        (name, *_ends(rms), *_ends(c.theil.get(name)), *_ends(c.J.get(name))[:2])
        for name, rms in c.rmse.items()
    ]
    if rows:
        head = ("response", "RMSE", "after", "no change", "Theil", "after", "no change", "J", "after")
        lines.append(table(head, rows))
    if c.consequence.get("sentence"):
        lines.append(f"  {c.consequence['sentence']}")
    if c.note:
        lines.append(f"  note: {c.note}")
    return "\n".join(lines)


def _remarks(d: GapDiagnosis) -> str:
    return "\n".join(f"remark: {remark}" for remark in d.remarks)


def _interval(x: Interval) -> str:
    unit = "" if x.unit == "1" else f" {x.unit}"
    return f"{x.estimate:.3g}{unit} ({x.lo:.3g} to {x.hi:.3g})"


def _share(s: Share) -> str:
    if not isfinite(s.G):
        return f"is undefined ({s.why_undefined})" if s.why_undefined else "is undefined"
    return f"{s.G:.2f} ({s.lo:.2f} to {s.hi:.2f})"


def _ends(change: Change | None) -> tuple[str, str, str]:
    if change is None:
        return "-", "-", "-"
    first, second, third = (
        f"{v:.3g}" if isfinite(v) else "-" for v in (change.before, change.after, change.zero)
    )
    return first, second, third
