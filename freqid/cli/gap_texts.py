"""A diagnosis of a gap as the terminal shows it: the verdict, then tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import islice
from math import isfinite
from typing import TYPE_CHECKING, Any

from freqid.cli.columns import text_table
from freqid.cli.self_test_text import self_test_text
from freqid.report.kit.notation import percent

if TYPE_CHECKING:
    from freqid.core.results.diagnosis import Change, Closure, GapDiagnosis, Interval, Share
    from freqid.gap.bookkeeping.check import Finding

_LISTED = 0.005  # probability from which an effect has a line
_TESTS = 5
_ROWS = 3  # of which it is said how much an effect is
_FEW_SETTINGS = 12  # more are free changes of terms, which have no names
_SOURCES = {
    "stated": "stated",
    "simulation": "of the simulation",
    "default": "by default",
    "each record": "offsets of each record",
    "clock": "by the log's clock",
}


def bookkeeping_text(verdict: str, findings: Sequence[Finding]) -> str:
    """Return what is said where a diagnosis stops at mistakes of bookkeeping."""
    from freqid.workflows.connect import finding_line

    return "\n".join([verdict, *map(finding_line, findings)])


def diagnosis_text(d: GapDiagnosis) -> str:
    """Return the diagnosis: its verdict in one line first, then where, which, parameters, how far."""
    blocks = [d.verdict, _gap(d), _tolerances(d), _where(d), _sensors(d), _which(d), _parameters(d)]
    blocks += [_reach(d), *map(_closure, d.how_far)]
    if d.self_test:
        blocks.append(self_test_text(d.self_test))
    return "\n\n".join(block for block in (*blocks, next_text(d.next_flight), _remarks(d)) if block)


def next_text(table: Mapping[str, Any]) -> str:
    """Return what splits what is left, then the tests, the best first; nothing where nothing is left."""
    if not table:
        return ""
    lines = ["Next:"]
    lines += [f"  {group['sentence']}" for group in table.get("groups", ())]
    for test in table.get("tests", ())[:_TESTS]:
        each = [f"{' / '.join(p['rivals'])} {p['now']:.2g} to {p['after']:.3g}" for p in test["pairs"]]
        listing = ", ".join(each)
        lines.append(f"  {test['kind']}: {test['how']} (expected separation {listing}; 10.8 tells apart)")
    if table.get("design"):
        lines.append(f"  designed in {table['design']}")
    return "\n".join(lines)


def _gap(d: GapDiagnosis) -> str:
    return (
        f"Gap: p = {d.gap.p:.2g}; one is called up to {d.gap.level:g}. "
        f"A chi-square test, which knows of no tolerances, would say {d.gap.naive_p:.2g}."
    )


def _tolerances(d: GapDiagnosis) -> str:
    lines = ["Tolerances that were allowed for, one sigma:"]
    for source, words in _SOURCES.items():
        each = [f"{t.name} {_with_unit(t.sigma, t.unit)}" for t in d.tolerances if t.source == source]
        lines += [f"  {words}: {', '.join(each)}"] if each else []
    return "\n".join(lines) if d.tolerances else ""


def _where(d: GapDiagnosis) -> str:
    if not d.where:
        return ""
    rows = [
        (
            p.response,
            f"{p.band_hz[0]:.2g}-{p.band_hz[1]:.2g} Hz",
            f"{100 * p.share:.0f} %",
            p.regime,
            p.input or "no single signal",
            p.phase,
        )
        for p in d.where
    ]
    return "Where:\n" + text_table(("response", "band", "share", "regime", "on the lines of", "phase"), rows)


def _sensors(d: GapDiagnosis) -> str:
    rows = [
        (s.fault, s.channel, f"{_with_unit(s.estimate, s.unit)} ({s.lo:.3g} to {s.hi:.3g})")
        for s in d.sensors
    ]
    return "Your sensors:\n" + text_table(("fault", "channel", "estimate (90 %)"), rows) if rows else ""


def _which(d: GapDiagnosis) -> str:
    w = d.which
    rows = [
        (name, f"{100 * p:.0f} %", "*" if name in w.set else "", w.places.get(name, ""))
        for name, p in w.probabilities.items()
        if p >= _LISTED
    ]
    alone = ", each weighed as the only one" if w.pair else ""
    lines = [f"Which{alone} (* in the set that holds the truth in 90 of 100 cases):"]
    lines.append(text_table(("effect", "probability", "set", "place"), rows))
    if w.pair:
        lines.append(f"  both together are likelier than either: {' and '.join(w.pair)}")
    lines += [f"  withdrawn: {name}, {why}" for name, why in w.withdrawn.items()]
    lines += [f"  not to be told apart here: {', '.join(group)}" for group in w.aliases]
    by_reason: dict[str, list[str]] = {}
    for name, why in w.not_tested.items():
        by_reason.setdefault(why, []).append(name)
    lines += [f"  not tested: {', '.join(names)} ({why})" for why, names in by_reason.items()]
    return "\n".join(lines)


def _parameters(d: GapDiagnosis) -> str:
    rows = [
        (effect, name, _interval(x))
        for effect, values in d.which.parameters.items()
        for name, x in values.items()
    ]
    if not rows:
        return ""
    head = ("effect", "parameter", "estimate (90 %)")
    lines = ["Parameters, as changes of the simulation:", text_table(head, rows)]
    for effect, shares in d.which.moves.items():
        each = ", ".join(f"{row} {percent(x)}" for row, x in islice(shares.items(), _ROWS))
        lines += [f"  {effect} is, of the changes in each: {each}"] if each else []
    return "\n".join(lines)


def _reach(d: GapDiagnosis) -> str:
    sizes = d.gap.smallest_detectable if d.gap.exists else d.gap.largest_undetected
    if not sizes:
        return ""
    each = ", ".join(f"{name} {_with_unit(size, d.gap.unit.get(name, '1'))}" for name, size in sizes.items())
    words = "Smallest size found" if d.gap.exists else "No gap larger than this would have been missed"
    return f"{words}, in 95 of 100 cases (the whole effect, or where it is least visible):\n  {each}"


def _closure(c: Closure) -> str:
    lines = [f"With {' and '.join(c.effects)}, scored on {', '.join(c.held_out)}:"]
    for effect, settings in c.settings.items():
        if len(settings) <= _FEW_SETTINGS:
            lines += [f"  {effect} {name} = {_interval(x)}" for name, x in settings.items()]
    rows = [
        ("effect alone", _share(c.effect_only)),
        ("tolerances alone", _share(c.tolerances_only)),
        ("both", _share(c.wrench)),
    ]
    lines.append(text_table(("fitted", "G: share of the gap that is closed (90 %)"), rows))
    if c.strained:
        off = ", ".join(f"{name} {x:+.1f}" for name, x in c.strained.items())
        lines.append(f"  tolerances alone would be off by, in sigmas: {off}")
    if isfinite(c.log_score):
        lines.append(f"  log score against tolerances alone: {c.log_score:+.1f} nats")
    if isfinite(c.response.G):
        lines.append(f"  G of the simulation's flight: {_share(c.response)}")
    rows = [
        (name, *_ends(c.rmse[name]), *_ends(c.theil.get(name))[:2], *_ends(c.J.get(name))[:2])
        for name in c.listed
    ]
    if rows:
        head = ("response", "RMSE", "after", "no change", "Theil", "after", "J", "after")
        lines.append(text_table(head if c.J else head[:-2], rows if c.J else [row[:-2] for row in rows]))
    if c.consequence.get("sentence"):
        lines.append(f"  {c.consequence['sentence']}")
    if c.note:
        lines.append(f"  note: {c.note}")
    return "\n".join(lines)


def _remarks(d: GapDiagnosis) -> str:
    return "\n".join(f"remark: {remark}" for remark in d.remarks)


def _interval(x: Interval) -> str:
    if x.lo == x.hi:
        return f"{_with_unit(x.estimate, x.unit)} (given)"
    return f"{_with_unit(x.estimate, x.unit)} ({x.lo:.3g} to {x.hi:.3g})"


def _with_unit(value: float, unit: str) -> str:
    return f"{value:.3g}" + (f" {unit}" if unit not in ("", "1") else "")


def _share(s: Share) -> str:
    if not isfinite(s.G):
        return f"undefined ({s.why_undefined})" if s.why_undefined else "undefined"
    return f"{s.G:.2f} ({s.lo:.2f} to {s.hi:.2f})"


def _ends(change: Change | None) -> tuple[str, str, str]:
    if change is None:
        return "-", "-", "-"
    first, second, third = (
        f"{v:.3g}" if isfinite(v) else "-" for v in (change.before, change.after, change.zero)
    )
    return first, second, third
