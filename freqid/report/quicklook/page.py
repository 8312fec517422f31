"""One self-contained page about a log held against its design."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from freqid import __version__
from freqid.core.results.quicklook import InputLook, ParameterLook, Quicklook
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    ORANGE,
    draw_history,
    draw_legend,
    few_ticks,
    literal,
    name_panel,
    share_time,
    stacked_panels,
    styled,
)
from freqid.report.kit.findings import Finding, finding
from freqid.report.kit.notation import NONE, number, percent, short, shown_unit
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import render

_STRIPS = 6  # inputs in one figure
_MOST_PICTURES = 4
_MOST_PARAMETERS = 40
_SHOWN_S = 20.0  # of the inputs: more hides whether position follows command
_OK = {"limit": 0.02, "gain": 0.5**0.5}  # as in the verdict; marks in the table


@styled
def input_strips(look: Quicklook, names: Sequence[str]) -> Figure:
    """Draw the first seconds of inputs: designed, commanded and achieved, about their means.

    Parameters
    ----------
    look : Quicklook
    names : sequence of str
        Effectors.
    """
    record = look.record
    start = look.start_s if math.isfinite(look.start_s) else float(record.time[0])
    first = max(start, float(record.time[0]))
    shown = (record.time >= first) & (record.time <= first + _SHOWN_S)
    time = record.time[shown] - start
    figure, panels = stacked_panels([0.62] * len(names), legend=1)
    lines: dict[str, Any] = {}
    for axes, name in zip(panels, names, strict=True):
        row = look.inputs_flown.names.index(name)
        unit = look.inputs_flown.units[row]
        label, factor = shown_unit(f"excitation/{name}", unit)
        planned = np.interp(time, look.inputs_flown.time, look.inputs_flown.values[row], left=0, right=0)
        lines["designed"] = draw_history(axes, time, factor * planned, GREY, linewidth=2.2, alpha=0.5)
        for group, meaning, colour in (("command", "commanded", ORANGE), ("effector", "achieved", BLUE)):
            if f"{group}/{name}" in record:
                values = record[f"{group}/{name}"]
                moved = factor * (values[shown] - values[shown].mean())
                lines[meaning] = draw_history(axes, time, moved, colour, linewidth=0.9)
        name_panel(axes, literal(name, 40), label)
        few_ticks(axes)
    for meaning, line in lines.items():
        line.set_label(meaning)
    draw_legend(figure, list(lines.values()))
    share_time(panels, time)
    return figure


def build_quicklook_page(look: Quicklook) -> str:
    """Return the page of a quick look: one HTML text that fetches nothing."""
    missed = [p for p in look.parameters if not p.met]
    rates: dict[float, list[str]] = {}
    for rate in look.rates:
        rates.setdefault(round(rate.rate_hz, 3), []).append(rate.channel)
    enough = {round(r.rate_hz, 3): r.enough for r in look.rates}
    return render(
        "quicklook.html",
        title=Path(look.log).name,
        what=f"Held against {Path(look.design).name}.",
        version=__version__,
        findings=_findings(look),
        facts=_facts(look, len(missed)),
        inputs=[_input_row(each) for each in look.inputs],
        parameters=[_parameter_row(p) for p in _ordered(look.parameters)],
        accuracy=percent(look.accuracy),
        highest=short(look.band_hz[1]),
        rates=[
            {"rate": short(rate), "channels": ", ".join(names), "enough": enough[rate]}
            for rate, names in sorted(rates.items())
        ],
        drawn=_pictures(look),
        provenance={"log": look.log, "design": look.design, "record": dict(look.record.provenance)},
    )


def _findings(look: Quicklook) -> list[Finding]:
    if look.usable:
        findings = [finding("good", "Usable.")]
    else:
        findings = [finding("bad", "Repeat, because {}.", look.reasons[0])]
        findings += [finding("bad", "{}.", _sentence(reason)) for reason in look.reasons[1:]]
    return findings + [finding("note", "{}.", _sentence(remark)) for remark in look.remarks]


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _facts(look: Quicklook, missed: int) -> list[tuple[str, str]]:
    present = sum(each.present for each in look.inputs)
    facts = [
        ("Inputs found", f"{present} of {len(look.inputs_flown.names)}"),
        (
            "Design starts",
            f"{look.start_s:.3f} s on the log's clock" if math.isfinite(look.start_s) else NONE,
        ),
        ("Log", f"{short(look.record.duration)} s at {short(1 / look.record.dt)} Hz"),
        ("Band", f"{short(look.band_hz[0])} to {short(look.band_hz[1])} Hz"),
    ]
    if look.inputs:
        facts.append(("Periods in the log", number(max(i.periods for i in look.inputs), 3)))
    if look.parameters:
        met = len(look.parameters) - missed
        facts.append((f"Parameters that met {percent(look.accuracy)}", f"{met} of {len(look.parameters)}"))
    return facts


def _input_row(look: InputLook) -> dict[str, Any]:
    return {
        "name": look.name,
        "source": look.source or NONE,
        "coherence": f"{look.coherence:.3f}",
        "missing": not look.present,
        "gain": f"{look.gain:.2f}" if look.present else NONE,
        "achieved": f"{look.achieved_gain:.2f}" if math.isfinite(look.achieved_gain) else NONE,
        "weak": look.achieved_gain < _OK["gain"],
        "lag": number(1e3 * look.achieved_lag_s, 2),
        "at_limit": percent(look.at_limit),
        "limited": look.at_limit > _OK["limit"],
        "at_rate_limit": percent(look.at_rate_limit),
        "fast": look.at_rate_limit > _OK["limit"],
    }


def _ordered(parameters: Sequence[ParameterLook]) -> list[ParameterLook]:
    return sorted(parameters, key=lambda p: (p.met, -p.contribution_error))[:_MOST_PARAMETERS]


def _parameter_row(look: ParameterLook) -> dict[str, Any]:
    relative = look.std_error / abs(look.estimate) if look.estimate else float("inf")
    return {
        "response": look.response,
        "name": look.name,
        "estimate": number(look.estimate, 4),
        "std_error": number(look.std_error, 2),
        "relative": percent(relative),
        "contribution": percent(look.contribution_error),
        "met": look.met,
    }


def _pictures(look: Quicklook) -> list[Picture]:
    """Draw the inputs, those with a fault first."""
    order = sorted(
        look.inputs,
        key=lambda i: (i.present, not i.at_limit > _OK["limit"], not i.achieved_gain < _OK["gain"]),
    )
    names = [i.name for i in order]
    count = 1 if len(names) <= _STRIPS else 2 * -(-len(names) // (2 * _STRIPS))  # pairs stand side by side
    bounds = np.linspace(0, len(names), count + 1).round().astype(int)
    parts = [names[low:high] for low, high in pairwise(bounds) if high > low][:_MOST_PICTURES]
    return [
        picture(
            input_strips(look, part),
            f"inputs{k}",
            f"Inputs over the first {_SHOWN_S:g} s: {', '.join(part)}",
            f"{', '.join(part)}: first {_SHOWN_S:g} s of the design, about the mean."
            + ("" if k else " Commands hold the feedback too."),
        )
        for k, part in enumerate(parts)
    ]
