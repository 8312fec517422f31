"""One self-contained page about a Monte Carlo campaign."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from freqid import __version__
from freqid.core.results.judged.monte_carlo import MEASURES, SHARES, Measured, MonteCarlo
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    PALE,
    draw_legend,
    few_ticks,
    literal,
    plain,
    stacked_panels,
    styled,
)
from freqid.report.kit.findings import Finding, finding
from freqid.report.kit.notation import NONE, percent
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import render

NOMINAL = {"coverage": 0.95, "bias": 0.0, "scatter": 1.0}
"""What a measure is where estimates and their standard errors are right; a grey line in the figures."""
GAP_LEVEL = 0.05
"""False alarms that are called many: beyond it for certain, a page says so."""
_MANY_FAILED = 0.05
_COLOURS = (BLUE, ORANGE, "#009E73", "#CC79A7", "#56B4E9", INK, GREY)
_MARKERS = "osD^vPX"
_MOST_CURVES = 7
_MOST_QUANTITIES = 30
_GROUPS = {
    "estimates": ("coverage", "bias", "scatter"),
    "gaps": ("detection", "alarm", "right"),
    "cases": ("failed",),
}


def build_monte_carlo_page(found: MonteCarlo) -> str:
    """Return the page of a Monte Carlo campaign: one HTML text that fetches nothing."""
    return render(
        "monte_carlo.html",
        title=f"Campaign of {found.cases:,} cases".replace(",", " "),
        what=f"Stage {found.stage}, against {found.axis}." if found.axis else f"Stage {found.stage}.",
        version=__version__,
        findings=_findings(found),
        facts=[
            ("Cases", f"{found.cases}, {found.failed} without a result"),
            ("Rows", str(found.rows)),
            ("Axis", found.axis or "none"),
            ("Curves", found.by or "none"),
        ],
        axis=found.axis or "all",
        by=found.by,
        measures=[(name, MEASURES[name]) for name in _shown(found)],
        rows=_table(found),
        quantities=_quantities(found),
        drawn=_pictures(found),
        failures=sorted(found.failures.items(), key=lambda item: -item[1]),
        settings=found.settings,
        provenance=found.provenance,
    )


def _shown(found: MonteCarlo) -> list[str]:
    """Return measures over all quantities; that of failures only where there are any."""
    return [m for m in found.measures if found.of(m) and (m != "failed" or found.failed)]


def _findings(found: MonteCarlo) -> list[Finding]:
    findings = []
    if found.of("coverage"):
        findings.append(_off(found, "coverage", "95 % intervals hold the reference in {} of cases", percent))
        findings.append(
            _off(
                found, "bias", "The mean error is {} standard errors", lambda x: f"{x:.2g}".replace("-", "−")
            )
        )
    alarms = found.of("alarm")
    if alarms:
        worst = max(alarms, key=lambda m: m.lo)
        findings.append(
            finding(
                "bad" if worst.lo > GAP_LEVEL else "good",
                "Of flights without an effect, at most {} are called a gap ({}; {}).",
                percent(worst.mean),
                _where(found, worst),
                _of(worst),
            )
        )
    detections = found.of("detection")
    if detections:
        least, most = (pick(detections, key=lambda m: m.mean) for pick in (min, max))
        findings.append(
            finding(
                "note",
                "Of flights with an effect, {} ({}) to {} ({}) are called a gap.",
                percent(least.mean),
                _where(found, least),
                percent(most.mean),
                _where(found, most),
            )
        )
    if found.failed:
        share = found.failed / found.cases
        findings.append(
            finding(
                "bad" if share > _MANY_FAILED else "note",
                "{} of {} cases have no result; the commonest reason: {}",
                found.failed,
                found.cases,
                max(found.failures, key=lambda text: found.failures[text], default="not stated"),
            )
        )
    return findings or [finding("note", "The rows have no column that a measure is made of.")]


def _off(found: MonteCarlo, measure: str, text: str, told: Any) -> Finding:
    """Return whether a measure is its nominal value within its intervals, everywhere on the axis."""
    every, nominal = found.of(measure), NOMINAL[measure]
    off = [m for m in every if not m.lo <= nominal <= m.hi and m.lo == m.lo]
    least, most = (pick(every, key=lambda m: m.mean) for pick in (min, max))
    places = f"{told(least.mean)} to {told(most.mean)}" if len(every) > 1 else told(most.mean)
    tail = f"; {told(nominal)} is outside the interval at {len(off)} of {len(every)} places" if off else ""
    # one place of twenty is outside by chance
    return finding("note" if len(off) > 0.1 * len(every) else "good", text + "{}.", places, tail)


def _where(found: MonteCarlo, m: Measured) -> str:
    place = f"{found.axis} = {_value(m.at)}" if found.axis else "all"
    return f"{place}, {found.by} = {m.curve}" if m.curve else place


def _of(m: Measured) -> str:
    return f"{percent(m.lo)} to {percent(m.hi)}, {m.cases} cases"


def _value(at: float | str) -> str:
    return f"{at:.4g}" if isinstance(at, float) else f"{at}"


def _told(m: Measured | None) -> str:
    if m is None:
        return NONE
    if m.measure in SHARES:
        return f"{100 * m.mean:.1f} % ({100 * m.lo:.1f} to {100 * m.hi:.1f})"
    text = f"{m.mean:.3g}" + (f" ({m.lo:.3g} to {m.hi:.3g})" if m.lo == m.lo else "")
    return text.replace("-", "−")


def _table(found: MonteCarlo) -> list[dict[str, Any]]:
    """Return one row for each place and curve, with the measures over all quantities as texts."""
    rows = []
    for curve in found.curves:
        for at in found.axis_values:
            cells = {m.measure: m for m in found.measured if (m.at, m.curve, m.quantity) == (at, curve, "")}
            if cells:
                rows.append(
                    {
                        "curve": curve,
                        "at": _value(at) if found.axis else "all",
                        "cases": max(m.cases for m in cells.values()),
                        "cells": [_told(cells.get(name)) for name in _shown(found)],
                    }
                )
    return rows


def _quantities(found: MonteCarlo) -> dict[str, Any] | None:
    """Return the quantities that depart farthest, over the whole axis, with their measures."""
    names = list(dict.fromkeys(m.quantity for m in found.measured if m.quantity))
    if not names or (len(names) < 2 and not found.of("value", names[0])):
        return None
    kinds = [k for k in ("coverage", "bias", "scatter", "value") if any(found.of(k, n) for n in names)]
    by: dict[str, dict[str, list[Measured]]] = {}
    for m in found.measured:
        if m.quantity and m.measure in kinds:
            by.setdefault(m.quantity, {}).setdefault(m.measure, []).append(m)

    def far(name: str) -> float:
        covered = by[name].get("coverage", [])
        return max((abs(m.mean - NOMINAL["coverage"]) for m in covered), default=0.0)

    chosen = sorted(names, key=far, reverse=True)[:_MOST_QUANTITIES]
    rows = [{"name": name, "cells": [_range(by[name].get(kind, [])) for kind in kinds]} for name in chosen]
    return {"kinds": [(k, MEASURES[k]) for k in kinds], "rows": rows, "of": len(names)}


def _range(every: Sequence[Measured]) -> str:
    """Return the least and the largest of a measure along the axis and over curves."""
    if not every:
        return NONE
    low, high = min(m.mean for m in every), max(m.mean for m in every)
    if every[0].measure in SHARES:
        texts = [f"{100 * x:.1f} %" for x in (low, high)]
    else:
        texts = [f"{x:.3g}".replace("-", "−") for x in (low, high)]
    return texts[0] if texts[0] == texts[1] else " to ".join(texts)


def _pictures(found: MonteCarlo) -> list[Picture]:
    drawn = []
    shown = _shown(found)
    for group, names in _GROUPS.items():
        own = [name for name in names if name in shown]
        if own:
            nominal = {
                n: percent(NOMINAL[n]) if n in SHARES else f"{NOMINAL[n]:g}" for n in own if n in NOMINAL
            }
            lines = [f"{value} for {n}" for n, value in nominal.items()]
            caption = f"{'; '.join(f'{MEASURES[n]} ({n})' for n in own)}. Bars: 95 % intervals."
            caption += f" Grey line: {', '.join(lines)}." if lines else ""
            drawn.append(
                picture(
                    measures_along(found, own),
                    f"campaign-{group}",
                    f"{', '.join(own)} along the axis",
                    caption,
                )
            )
    return drawn


@styled
def measures_along(found: MonteCarlo, measures: Sequence[str]) -> Figure:
    """Draw measures over all quantities against the axis, one panel each, one line for each curve.

    Parameters
    ----------
    found : MonteCarlo
    measures : sequence of str
    """
    curves = found.curves[:_MOST_CURVES]
    several = curves != [""]
    frame, panels = stacked_panels([1.0] * len(measures), legend=1 + len(curves) // 4 if several else 0)
    values = found.axis_values
    numeric = all(isinstance(v, int | float) for v in values)
    place = {v: float(v) if numeric else float(i) for i, v in enumerate(values)}
    lines: dict[str, Any] = {}
    for panel, measure in zip(panels, measures, strict=True):
        scale = 100.0 if measure in SHARES else 1.0
        for colour, marker, curve in zip(_COLOURS, _MARKERS, curves, strict=False):
            every = found.of(measure, curve=curve)
            if not every:
                continue
            bars = [
                [max(scale * d, 0.0) if math.isfinite(d) else 0.0 for d in side] for side in _sides(every)
            ]
            lines[curve] = panel.errorbar(
                [place[m.at] for m in every],
                [scale * m.mean for m in every],
                bars,
                color=colour,
                marker=marker,
                markersize=3,
                linewidth=0.8,
                elinewidth=0.9,
                label=literal(curve, 24),
            )
        if measure in NOMINAL:
            panel.axhline(scale * NOMINAL[measure], color=PALE, linewidth=1.0, zorder=0)
        panel.set_title(f"{measure.capitalize()} (%)" if measure in SHARES else measure.capitalize())
        few_ticks(panel)
        panel.tick_params(labelbottom=panel is panels[-1])
    low, high = min(place.values()), max(place.values())
    margin = 0.04 * (high - low) or 0.5
    panels[-1].set_xlim(low - margin, high + margin)
    panels[-1].set_xlabel(literal(found.axis or "all cases", 60))
    if numeric and found.axis:
        panels[-1].xaxis.set_major_formatter(plain)
    else:
        panels[-1].set_xticks(
            list(place.values()), [literal(str(v), 14) if found.axis else "" for v in values]
        )
    if several:
        draw_legend(frame, list(lines.values()), columns=min(4, len(lines)))
    return frame


def _sides(every: Sequence[Measured]) -> tuple[list[float], list[float]]:
    return [m.mean - m.lo for m in every], [m.hi - m.mean for m in every]
