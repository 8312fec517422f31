"""One self-contained page about frequency responses: Bode plots with coherence, models beside, mismatch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter
from numpy.typing import NDArray

from freqid import __version__
from freqid.core.arrays import Array, Complex
from freqid.core.results.frequency_response import FittedResponse, FrequencyResponse
from freqid.gap.fidelity import ACCEPTABLE, MUAD_BAND, muad_bounds
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
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
from freqid.report.kit.notation import percent, short
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import render

LEVEL = 0.95
_HEIGHTS = (1.1, 0.9, 0.6)
_STYLES = ((ORANGE, "-"), (GREY, "-"), (ORANGE, (0, (4, 2))), (GREY, (0, (4, 2))), (ORANGE, (0, (1, 1.5))))
BELIEVED = 0.6
"""Coherence below which a response is doubtful: Tischler & Remple, 2nd ed., sec. 2.6."""


@styled
def bode(response: FrequencyResponse, output: str, input_: str) -> Figure:
    """Draw gain, phase and coherences of one output to one input over frequency.

    Parameters
    ----------
    response : FrequencyResponse
    output, input_ : str
    """
    one = response.of((input_,), (output,))
    f, value = one.frequencies_hz, one.value[0, 0]
    known = np.isfinite(value) & (value != 0)
    f, value = f[known], value[known]
    # beyond the size of the response itself the circle holds every phase
    share = np.minimum(one.radius(LEVEL)[0, 0][known] / np.abs(value), 0.999)
    gain, phase = 20 * np.log10(np.abs(value)), np.degrees(np.unwrap(np.angle(value)))
    turn = np.degrees(np.arcsin(share))
    figure, panels = stacked_panels(_HEIGHTS, legend=1)
    for axes, middle, low, high in (
        (panels[0], gain, gain + 20 * np.log10(1 - share), gain + 20 * np.log10(1 + share)),
        (panels[1], phase, phase - turn, phase + turn),
    ):
        axes.fill_between(f, low, high, color=BLUE, alpha=0.18, linewidth=0)
        (measured,) = axes.plot(
            f, middle, color=BLUE, marker=".", markersize=3, linewidth=0.9, label="measured"
        )
        span = float(np.ptp(middle)) or 1.0
        axes.set_ylim(middle.min() - 0.6 * span - 1, middle.max() + 0.6 * span + 1)
        few_ticks(axes)
    unit = f"{one.output_units[0]} per {one.input_units[0]}"
    name_panel(panels[0], f"{literal(output, 20)} to {literal(input_, 20)}, gain", f"dB of {unit}")
    name_panel(panels[1], "Phase", "deg")
    panels[2].set_title("Coherence")
    panels[2].axhline(BELIEVED, color=PALE, linewidth=0.8)
    others = _draw_others(panels, one, known, phase)
    coherences = [
        *panels[2].plot(
            f, one.coherence[0, 0][known], color=ORANGE, linewidth=1.0, label="with the injected signal"
        ),
        *panels[2].plot(
            f,
            one.partial_coherence[0, 0][known],
            color=GREY,
            linewidth=1.0,
            linestyle=(0, (3, 1.5)),
            label="partial, with the input",
        ),
    ]
    panels[2].set_ylim(0, 1.05)
    few_ticks(panels[2])
    if others:
        panels[2].set_title("Coherence: with the injected signal, and (dashed) partial, with the input")
    draw_legend(figure, [measured, *others] if others else coherences)
    _logarithmic(panels)
    return figure


def _logarithmic(panels: Sequence[Axes]) -> None:
    panels[-1].set_xscale("log")
    panels[-1].set_xlabel("Frequency (Hz)")
    panels[-1].xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panels[-1].xaxis.set_major_formatter(plain)
    panels[-1].xaxis.set_minor_formatter(NullFormatter())
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)


def _others(one: FrequencyResponse) -> list[tuple[str, Complex]]:
    """Return what is put beside the measured response of one pair: models, simulations, fits."""
    found = [(c.name, c.value[0, 0]) for c in one.compared]
    found += [(_fit_name(x), x.value[0, 0]) for x in one.fits]
    return [(name, value) for name, value in found if np.isfinite(value).any()]


def _fit_name(x: FittedResponse) -> str:
    return f"fit {x.name.rpartition(', ')[2].removeprefix('order ')}"


def _draw_others(
    panels: Sequence[Axes], one: FrequencyResponse, known: NDArray[np.bool_], phase: Array
) -> list[Line2D]:
    """Draw gain and phase of the others, the phase within half a turn of the measured one at its start."""
    f, lines = one.frequencies_hz[known], []
    for (name, value), (color, style) in zip(_others(one), _STYLES, strict=False):
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = value[known] / one.value[0, 0][known]
        apart = np.degrees(np.unwrap(np.angle(ratio)))
        panels[1].plot(f, phase + apart, color=color, linestyle=style, linewidth=1.1)
        with np.errstate(divide="ignore"):
            gain = 20 * np.log10(np.abs(value[known]))
        lines += panels[0].plot(f, gain, color=color, linestyle=style, linewidth=1.1, label=name)
    return lines


@styled
def mismatch(response: FrequencyResponse, output: str, input_: str) -> Figure:
    """Draw the measured response over those beside it, and the bounds of unnoticeable added dynamics.

    Parameters
    ----------
    response : FrequencyResponse
        With something beside.
    output, input_ : str
    """
    one = response.of((input_,), (output,))
    figure, panels = stacked_panels((1.0, 1.0), legend=1)
    low, high = one.frequencies_hz[[0, -1]]
    at = np.geomspace(max(low, MUAD_BAND[0] / (2 * np.pi)), min(high, MUAD_BAND[1] / (2 * np.pi)), 200)
    lines: list[Line2D] = []
    for axes, bounds in zip(panels, muad_bounds(2 * np.pi * at), strict=True):
        axes.fill_between(at, *bounds, color=PALE, alpha=0.6, linewidth=0)
        axes.axhline(0.0, color=GREY, linewidth=0.6)
    for (name, value), (color, style) in zip(_others(one), _STYLES, strict=False):
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = one.value[0, 0] / value
        known = np.isfinite(ratio) & (ratio != 0) & (one.partial_coherence[0, 0] >= BELIEVED)
        f, ratio = one.frequencies_hz[known], ratio[known]
        gain, phase = 20 * np.log10(np.abs(ratio)), np.degrees(np.unwrap(np.angle(ratio)))
        lines += panels[0].plot(f, gain, color=color, linestyle=style, linewidth=1.1, label=name)
        panels[1].plot(f, phase, color=color, linestyle=style, linewidth=1.1)
    for axes, most in zip(panels, (20.0, 120.0), strict=True):
        bottom, top = axes.get_ylim()
        axes.set_ylim(max(bottom, -most), min(top, most))
        few_ticks(axes)
    name_panel(panels[0], f"{literal(output, 20)} to {literal(input_, 20)}, flight over others", "dB")
    name_panel(panels[1], "Phase of flight over others", "deg")
    draw_legend(figure, lines)
    _logarithmic(panels)
    return figure


MOST_PICTURES = 24  # with the highest coherence: more make a page that nobody reads
SMOOTH = 2.0  # misfit from which a response is not linear, or not smooth across its windows


def build_frequency_response_page(response: FrequencyResponse, title: str) -> str:
    """Return the page of frequency responses: one HTML text that fetches nothing."""
    f = response.frequencies_hz
    rows = summary_rows(response)
    return render(
        "frequency_response.html",
        title=title or "Frequency responses",
        what=f"Responses of {', '.join(response.outputs)} to {', '.join(response.inputs)}.",
        version=__version__,
        findings=_findings(response, rows),
        facts=[
            ("Method", response.method),
            ("Frequencies", f"{f.size}, {short(float(f[0]))} to {short(float(f[-1]))} Hz"),
        ],
        rows=[_written(row) for row in rows],
        compared=_compared_rows(response),
        fits=[_fit_table(x) for x in response.fits],
        drawn=_pictures(response, rows),
        provenance=response.provenance,
    )


def summary_rows(response: FrequencyResponse) -> list[dict[str, Any]]:
    """Return coherence, random error and misfit of each pair over the frequencies at which it is known."""
    rows = []
    for o, output in enumerate(response.outputs):
        for i, input_ in enumerate(response.inputs):
            known = np.isfinite(response.value[o, i])
            coherence = response.coherence[o, i][known]
            if not coherence.size:
                continue
            misfit = response.misfit[o][known]
            rows.append(
                {
                    "output": output,
                    "input": input_,
                    "lines": int(known.sum()),
                    "coherence": float(np.median(coherence)),
                    "lowest": float(coherence.min()),
                    "error": float(np.median(response.random_error[o, i][known])),
                    "misfit": None if np.isnan(misfit).all() else float(np.nanmedian(misfit)),
                }
            )
    return rows


def _findings(response: FrequencyResponse, rows: list[dict[str, Any]]) -> list[Finding]:
    doubtful = [r for r in rows if r["coherence"] < BELIEVED]
    text = "{} of {} responses have a median coherence below {}."
    kind = "note" if doubtful else "good"
    findings = [finding(kind, text, len(doubtful) or "None", len(rows), BELIEVED)]
    rough = sorted({r["output"] for r in rows if (r["misfit"] or 0.0) > SMOOTH})
    if rough:
        findings.append(
            finding(
                "note",
                "More is left on excited lines than noise explains, in {}: not linear, or not smooth across "
                "the windows. Their random errors are too small.",
                ", ".join(rough),
            )
        )
    for c in response.compared:
        costs = c.cost[np.isfinite(c.cost)]
        good = int(np.sum(costs <= ACCEPTABLE))
        kind = "good" if good == costs.size else "bad"
        text = "The {} has a cost J of up to {} in {} of {} responses."
        findings.append(finding(kind, text, c.name, short(ACCEPTABLE), good, costs.size))
    findings += [finding("note", "{}", remark) for remark in response.remarks]
    return findings


def _pictures(response: FrequencyResponse, rows: list[dict[str, Any]]) -> list[Picture]:
    shown = sorted(rows, key=lambda r: -r["coherence"])[:MOST_PICTURES]
    drawn = []
    for row in (r for r in rows if r in shown):
        output, input_ = row["output"], row["input"]
        drawn.append(
            picture(
                bode(response, output, input_),
                f"bode{len(drawn)}",
                f"Bode plot with coherence: {output} to {input_}",
                f"{output} to {input_}. Band: {percent(LEVEL)} of the random error, smoothing not counted. "
                f"Grey line: a coherence of {BELIEVED}, below which a response is doubtful.",
                [output],
            )
        )
        one = response.of((input_,), (output,))
        if one.fits or any(np.isfinite(c.cost).any() for c in one.compared):
            drawn.append(
                picture(
                    mismatch(response, output, input_),
                    f"mismatch{len(drawn)}",
                    f"Mismatch in gain and phase: {output} to {input_}",
                    f"{output} to {input_}: flight over model, where the partial coherence is at least "
                    f"{BELIEVED}. Shaded: dynamics that pilots do not notice (MIL-STD-1797A), from 0.1 to "
                    "30 rad/s.",
                    [output],
                )
            )
    return drawn


def _compared_rows(response: FrequencyResponse) -> list[dict[str, Any]]:
    """Return a row for each pair and what is put beside it."""
    return [
        {
            "output": output,
            "input": input_,
            "name": c.name,
            "source": c.source,
            "cost": short(float(c.cost[o, i])),
            "unnoticed": "–" if np.isnan(c.unnoticed[o, i]) else percent(float(c.unnoticed[o, i])),
            "bad": bool(c.cost[o, i] > ACCEPTABLE),
        }
        for c in response.compared
        for o, output in enumerate(response.outputs)
        for i, input_ in enumerate(response.inputs)
        if np.isfinite(c.cost[o, i])
    ]


def _fit_table(x: FittedResponse) -> dict[str, Any]:
    """Return a fit's table; both bounds in percent of the estimate, as Tischler & Remple list them."""

    def share(values: Array, k: int) -> str:
        size = abs(x.estimate[k])
        return percent(float(values[k] / size)) if size > 0 else "–"

    return {
        "name": x.name,
        "cost": short(x.cost),
        "left": short(x.weighted_error),
        "band": f"{short(x.band_hz[0])} to {short(x.band_hz[1])} Hz",
        "rows": [
            {
                "parameter": name,
                "unit": unit,
                "estimate": short(float(x.estimate[k])),
                "cramer_rao": share(x.cramer_rao, k),
                "insensitivity": share(x.insensitivity, k),
                "weak": bool(x.cramer_rao[k] > 0.2 * abs(x.estimate[k])),
            }
            for k, (name, unit) in enumerate(zip(x.parameters, x.units, strict=True))
        ],
    }


def _written(row: dict[str, Any]) -> dict[str, Any]:
    misfit = row["misfit"]
    return row | {
        "doubtful": row["coherence"] < BELIEVED,
        "coherence": f"{row['coherence']:.2f}",
        "lowest": f"{row['lowest']:.2f}",
        "error": percent(row["error"]),
        "misfit": "–" if misfit is None else f"{misfit:.2f}",
    }
