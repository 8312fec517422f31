"""One self-contained page about margins along the corridor: the least, where, and how well it is known."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf, isinf, isnan
from typing import Any

import numpy as np
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure

from freqid import __version__
from freqid.core.results.judged.review import Ground
from freqid.core.results.loop_margins import LoopMargins, least_of
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    PALE,
    draw_legend,
    few_ticks,
    literal,
    name_panel,
    plain,
    stacked_panels,
    styled,
)
from freqid.report.kit.findings import Finding, finding
from freqid.report.kit.notation import NONE, percent, sentence, short, with_unit
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import render

WANTED = {"gain_up_db": 6.0, "phase_deg": 45.0}
"""Margins that piloted aircraft are asked for at their rigid-body modes: MIL-DTL-9490E and SAE AS94900, table
of gain and phase margins. Grey lines of the figures."""

_KINDS = {
    "gain_up_db": ("Gain margin", "dB"),
    "phase_deg": ("Phase margin", "deg"),
    "disk": ("Disk margin", ""),
}
_DIGITS = {"gain_up_db": 1, "phase_deg": 1, "disk": 2}  # after the point, wherever a margin is written
_LOOKS = ((BLUE, "o"), (ORANGE, "s"), ("#009E73", "D"), ("#CC79A7", "^"))  # by density, the densest air first
_MOST_MODES = 7  # drawn: those that most conditions have
_MOST_AXES = 8  # drawn: those with the least margins
_LONGEST_TABLE = 12  # conditions whose modes are listed
_HEIGHT = 0.85


def build_margins_page(
    found: LoopMargins, grounds: Sequence[Ground] = (), identified: Sequence[str] = ()
) -> str:
    """Return the page of margins: one HTML text that fetches nothing.

    Parameters
    ----------
    found : LoopMargins
    grounds : sequence of Ground
        What other files of the same report say against the next flight: as part of a report the page must
        not look better than the answer on page one, which it points to.
    identified : sequence of str
        Conditions that the model was identified at, where that is known; at others it is interpolated.
    """
    return render(
        "margins.html",
        title=f"{found.model} under {found.law}",
        what=f"Stability margins, modes and trim at {len(found.ids)} conditions, with what is known of them.",
        version=__version__,
        findings=_findings(found, grounds),
        facts=_facts(found),
        level=percent(found.level),
        draws=found.draws,
        rows=[
            row | {"interpolated": bool(identified) and row["id"] not in identified}
            for row in conditions_table(found)
        ],
        identified=", ".join(identified),
        modes=_modes_table(found) if len(found.ids) <= _LONGEST_TABLE else [],
        drawn=_pictures(found),
        beside=list(found.beside),
        provenance=found.provenance,
    )


def conditions_table(found: LoopMargins) -> list[dict[str, Any]]:
    """Return by condition the least margins over the axes of the law, and the least travel left, as texts."""
    rows = []
    for k, name in enumerate(found.ids):
        row: dict[str, Any] = {"id": name, "u": short(float(found.u[k])), "stable": bool(found.stable[k])}
        for key, figure in (("gain", "gain_up_db"), ("phase", "phase_deg"), ("disk", "disk")):
            path = least_of(found, k, figure, found.axes)
            row[key] = NONE if not path else f"{_told(found, path, k, _DIGITS[figure])} {path.split('/')[1]}"
        if f"{_ALL}/disk" in found.figures and not isnan(found.row(f"{_ALL}/disk")[0, k]):
            row["all"] = _told(found, f"{_ALL}/disk", k, 2)
        travel = [
            (float(found.row(path)[0, k]), path)
            for path in found.figures
            if path.startswith("trim/") and not isnan(found.row(path)[0, k])
        ]
        left, path = min(travel, default=(inf, ""))
        row["travel"] = f"{percent(max(left, 0.0))} {path.split('/')[1]}" if path else NONE
        rows.append({"all": NONE, **row})
    return rows


_ALL = "margins/all axes"


def _told(found: LoopMargins, path: str, k: int, digits: int) -> str:
    """Return an estimate with its interval, infinite ones as the sign."""
    estimate, low, high = (
        "∞" if isinf(x) and x > 0 else "−∞" if isinf(x) else f"{x:.{digits}f}".replace("-", "−")
        for x in found.row(path)[:, k].tolist()
    )
    return estimate if "nan" in (low, high) else f"{estimate} ({low} to {high})"


def _damping(found: LoopMargins, path: str, k: int) -> str:
    """Return a damping ratio as text; of a real eigenvalue, whether it decays."""
    value = float(found.row(path)[0, k])
    if isnan(value):
        return NONE
    return _told(found, path, k, 2) if abs(value) < 1 else ("real, decays" if value > 0 else "real, grows")


def _findings(found: LoopMargins, grounds: Sequence[Ground]) -> list[Finding]:
    findings = [
        finding(
            "bad" if g.weight == "stop" else "note",
            '{}. It stands among the <a href="#risks">open risks</a>.',
            sentence(g.text.rstrip(".")),
        )
        for g in sorted(grounds, key=lambda g: g.weight != "stop")
    ]
    findings += [finding("bad", "{}.", text[:1].upper() + text[1:]) for text in found.warnings]
    beside = list(_low_beside(found))
    failed = bool(beside) or any(g.weight == "stop" for g in grounds)
    low = []
    for k, name in enumerate(found.ids):
        for figure, wanted in WANTED.items():
            path = least_of(found, k, figure, found.axes)
            if path:
                estimate, lower, _ = found.row(path)[:, k].tolist()
                if min(estimate, lower if not isnan(lower) else inf) < wanted:
                    low.append(f"{path.split('/')[1]} at {name}")
    if low:
        names = list(dict.fromkeys(low))
        findings.append(
            finding(
                "note",
                "{} Below the {} dB of gain margin or the {} deg of phase margin that are asked for, or "
                "maybe so within the interval: {}.",
                _least(found),
                f"{WANTED['gain_up_db']:g}",
                f"{WANTED['phase_deg']:g}",
                ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else ""),
            )
        )
    elif found.stable.all():
        findings.append(
            finding(
                "note" if failed else "good",
                "{} is stable at every condition. {} Intervals included, every axis has the {} dB of gain "
                "margin and the {} deg of phase margin that are asked for.",
                "The identified model alone" if failed else "The identified model",
                _least(found),
                f"{WANTED['gain_up_db']:g}",
                f"{WANTED['phase_deg']:g}",
            )
        )
    findings += beside
    return findings + [finding("note", "{}.", remark) for remark in found.remarks]


def _low_beside(found: LoopMargins) -> Iterator[Finding]:
    """Yield the margins of what stands beside the model that are less than what is asked for."""
    for name, other in found.beside.items():
        for figure, wanted in WANTED.items():
            paths = [p for a in found.axes if (p := f"margins/{a}/{figure}") in found.figures]
            least = min(
                (
                    (float(value), path.split("/")[1], at)
                    for path in paths
                    for value, at in zip(other.estimate[found.figures.index(path)], found.ids, strict=True)
                    if not isnan(value)
                ),
                default=(inf, "", ""),
            )
            if least[0] < wanted:
                label, unit = _KINDS[figure]
                yield finding(
                    "note",
                    "Not so the {}: its least {} is {} {} ({} at {}), less than the {} {} asked for.",
                    name,
                    label.lower(),
                    f"{least[0]:.{_DIGITS[figure]}f}",
                    unit,
                    *least[1:],
                    f"{wanted:g}",
                    unit,
                )


def _least(found: LoopMargins) -> str:
    """Return the least margins and where they are, as a sentence."""
    texts = [f"least {label.lower()} is {text}" for label, text in _least_texts(found) if text != NONE][:2]
    return f"The {' and the '.join(texts)}." if texts else ""


def _least_texts(found: LoopMargins) -> list[tuple[str, str]]:
    """Return each kind of margin with its least value, and where that is."""
    rows = []
    for figure, (label, unit) in _KINDS.items():
        where, value = found.least(figure)
        size = "∞" if isinf(value) else f"{value:.{_DIGITS[figure]}f}"
        rows.append((label, f"{size} {unit}".strip() + f", {where}" if where else NONE))
    return rows


def _facts(found: LoopMargins) -> list[tuple[str, str]]:
    facts = [(f"Least {label.lower()}", text) for label, text in _least_texts(found)]
    facts.append(("Conditions", f"{len(found.ids)}, {int(found.stable.sum())} stable"))
    facts.append(("Axes of the law", ", ".join(found.axes)))
    facts.append(("Intervals", f"{percent(found.level)}, {found.draws} draws" if found.draws else "none"))
    return facts


def _modes_table(found: LoopMargins) -> list[dict[str, Any]]:
    """Return by condition the modes of the closed loop and of the aircraft alone, as texts."""
    rows = []
    for k, name in enumerate(found.ids):
        for kind, label in (("closed_modes", "under the law"), ("modes", "aircraft alone")):
            for path in found.figures:
                if path.startswith(f"{kind}/") and path.endswith("/frequency"):
                    damping = path.replace("/frequency", "/damping")
                    if not isnan(found.row(path)[0, k]):
                        rows.append(
                            {
                                "id": name,
                                "kind": label,
                                "mode": path.split("/")[1],
                                "frequency": _told(found, path, k, 2),
                                "damping": _damping(found, damping, k),
                            }
                        )
    return rows


def _pictures(found: LoopMargins) -> list[Picture]:
    order = sorted(range(len(found.axes)), key=lambda i: _lowest(found, found.axes[i]))[:_MOST_AXES]
    axes = [found.axes[i] for i in sorted(order)]
    with_others = ", ".join(f"dashes: {name}" for name in found.beside)
    drawn = []
    for figure, (label, unit) in _KINDS.items():
        if any(
            np.isfinite(found.row(f"margins/{a}/{figure}")[0]).any() for a in axes if _has(found, a, figure)
        ):
            caption = (
                f"{label}{f', {unit}' if unit else ''}, by axis of the law. Bars: {percent(found.level)} "
            )
            caption += "intervals; an infinite margin is not drawn."
            if figure in WANTED:
                caption += f" Grey line: {WANTED[figure]:g} {unit}."
            drawn.append(
                picture(
                    margins_along(found, figure, axes),
                    f"margins-{figure}",
                    f"{label} along the corridor",
                    caption + (f" {with_others[:1].upper()}{with_others[1:]}." if with_others else ""),
                )
            )
    if any(path.startswith("closed_modes/") for path in found.figures):
        drawn.append(
            picture(
                modes_along(found),
                "modes",
                "Modes of the closed loop along the corridor",
                "Modes under the law in which the aircraft's motion takes most part, with "
                f"{percent(found.level)} intervals. Below zero damping a mode grows.",
            )
        )
    return drawn


def _has(found: LoopMargins, axis: str, figure: str) -> bool:
    return f"margins/{axis}/{figure}" in found.figures


def _lowest(found: LoopMargins, axis: str) -> float:
    values = found.row(f"margins/{axis}/disk")[0] if _has(found, axis, "disk") else np.array([np.nan])
    return float(np.nanmin(values)) if not np.isnan(values).all() else inf


@styled
def margins_along(found: LoopMargins, figure: str, axes: list[str]) -> Figure:
    """Draw one kind of margin of each axis along the corridor, with its interval.

    Parameters
    ----------
    found : LoopMargins
    figure : str
        ``gain_up_db``, ``phase_deg`` or ``disk``.
    axes : list of str
    """
    shown = [a for a in axes if _has(found, a, figure)]
    frame, panels = stacked_panels([_HEIGHT] * len(shown), legend=1)
    levels = sorted({round(float(rho), 2) for rho in found.rho}, reverse=True)
    lines: dict[str, Any] = {}
    for panel, axis in zip(panels, shown, strict=True):
        path = f"margins/{axis}/{figure}"
        estimate, low, high = (np.where(np.isfinite(x), x, np.nan) for x in found.row(path))
        for (colour, marker), level in zip(_LOOKS * 3, levels, strict=False):
            here = np.flatnonzero(np.abs(found.rho - level) < 0.006)
            here = here[np.argsort(found.u[here])]
            bars = np.abs(np.nan_to_num(np.array([estimate - low, high - estimate])[:, here]))
            label = f"{level:g} kg/m³"
            lines[label] = panel.errorbar(
                found.u[here],
                estimate[here],
                bars,
                color=colour,
                marker=marker,
                markersize=2.6,
                linewidth=0.8,
                elinewidth=0.9,
                label=label,
            )
            for name, other in found.beside.items():
                row = other.estimate[found.figures.index(path)]
                values = np.where(np.isfinite(row), row, np.nan)[here]
                dashes = panel.plot(
                    found.u[here],
                    values,
                    color=INK,
                    linewidth=0.8,
                    linestyle=(0, (3, 1.5)),
                    label=literal(name, 24),
                )
                lines[name] = dashes[0]
        if figure in WANTED:
            panel.axhline(WANTED[figure], color=PALE, linewidth=0.8, zorder=0)
        unit = _KINDS[figure][1]
        panel.set_title(with_unit(literal(axis, 20), unit) if unit else literal(axis, 20))
        few_ticks(panel)
    _by_speed(panels, found)
    draw_legend(frame, list(lines.values()))
    return frame


@styled
def modes_along(found: LoopMargins) -> Figure:
    """Draw frequency and damping of the closed loop's modes along the corridor."""
    names = [
        p.split("/")[1] for p in found.figures if p.startswith("closed_modes/") and p.endswith("frequency")
    ]
    known = {n: np.isfinite(found.row(f"closed_modes/{n}/frequency")[0]).sum() for n in names}
    shown = sorted(names, key=lambda n: -known[n])[:_MOST_MODES]
    colours = (BLUE, ORANGE, "#009E73", "#CC79A7", "#56B4E9", INK, GREY)
    frame, panels = stacked_panels([1.5, 1.2], legend=2)
    order = np.argsort(found.u)
    lines: dict[str, ErrorbarContainer] = {}
    for colour, marker, name in zip(colours, "osD^vPX", shown, strict=False):
        for panel, what in zip(panels, ("frequency", "damping"), strict=True):
            estimate, low, high = found.row(f"closed_modes/{name}/{what}")[:, order]
            bars = np.abs(np.nan_to_num(np.array([estimate - low, high - estimate])))
            lines[name] = panel.errorbar(
                found.u[order],
                estimate,
                bars,
                color=colour,
                marker=marker,
                markersize=3.2,
                linewidth=0,
                elinewidth=0.9,
                label=literal(name, 18),
            )
    name_panel(panels[0], "Frequency", "rad/s")
    panels[1].set_title("Damping ratio")
    panels[1].axhline(0.0, color=PALE, linewidth=0.8, zorder=0)
    panels[1].margins(y=0.12)  # many modes are at a damping ratio of one
    for panel in panels:
        few_ticks(panel)
    _by_speed(panels, found)
    draw_legend(frame, list(lines.values()), columns=4)
    return frame


def _by_speed(panels: Any, found: LoopMargins) -> None:
    """Give panels one axis of speed, labelled below the last."""
    span = float(np.ptp(found.u)) or 1.0
    panels[-1].set_xlim(float(found.u.min()) - 0.03 * span, float(found.u.max()) + 0.03 * span)
    panels[-1].set_xlabel("Speed u (m/s)")
    panels[-1].xaxis.set_major_formatter(plain)
    for panel in panels[:-1]:
        panel.tick_params(labelbottom=False)
