"""Bode plots with coherence: a frequency response, what it may be off by, and how far to believe it."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from freqid.core.results.frequency_response import FrequencyResponse
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

LEVEL = 0.95
_HEIGHTS = (1.1, 0.9, 0.6)
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
        axes.plot(f, middle, color=BLUE, marker=".", markersize=3, linewidth=0.9)
        span = float(np.ptp(middle)) or 1.0
        axes.set_ylim(middle.min() - 0.6 * span - 1, middle.max() + 0.6 * span + 1)
        few_ticks(axes)
    unit = f"{one.output_units[0]} per {one.input_units[0]}"
    name_panel(panels[0], f"{literal(output, 20)} to {literal(input_, 20)}, gain", f"dB of {unit}")
    name_panel(panels[1], "Phase", "deg")
    panels[2].set_title("Coherence")
    panels[2].axhline(BELIEVED, color=PALE, linewidth=0.8)
    lines = [
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
    draw_legend(figure, lines)
    panels[-1].set_xscale("log")
    panels[-1].set_xlabel("Frequency (Hz)")
    panels[-1].xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panels[-1].xaxis.set_major_formatter(plain)
    panels[-1].xaxis.set_minor_formatter(NullFormatter())
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
    return figure
