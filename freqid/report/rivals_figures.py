"""The figure of two simulations compared: misfits by response, regime and band."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import NullLocator

from freqid.core.rivals import Contest, Span
from freqid.report.drawing import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    draw_legend,
    literal,
    name_panel,
    plain,
    stacked_panels,
    styled,
)

_WIDE = 5.0  # misfit from which an axis is logarithmic


@styled
def misfits(
    contests: Mapping[str, Sequence[Contest]],
    regimes: Sequence[str],
    bands: Sequence[tuple[float, float]],
) -> Figure:
    """Draw the misfits of two simulations with their intervals: a panel a response, bands within regimes.

    Parameters
    ----------
    contests : dict of sequence of Contest
        By response, from the top down.
    regimes : sequence of str
    bands : sequence of tuple of 2 floats
    """
    steep = len(regimes) * len(bands) > 6
    figure, panels = stacked_panels(
        [0.95] * len(contests), legend=1, bottom=0.95 if steep else 0.5, top=0.42, left=0.55
    )
    for axes, (response, each) in zip(panels, contests.items(), strict=True):
        for c in each:
            x = regimes.index(c.regime) * len(bands) + list(bands).index(c.band_hz)
            if c.nearer:
                axes.axvspan(x - 0.5, x + 0.5, color=ORANGE if c.nearer == "A" else BLUE, alpha=0.16, lw=0)
            _mark(axes, x - 0.17, c.misfit_a, ORANGE, "o")
            _mark(axes, x + 0.17, c.misfit_b, BLUE, "s")
        axes.axhline(0, color=INK, linewidth=0.8)
        for k in range(1, len(regimes)):
            axes.axvline(k * len(bands) - 0.5, color=GREY, linewidth=0.6)
        ends = [end for c in each for m in (c.misfit_a, c.misfit_b) for end in (m.lo, m.hi)]
        low, top = min(*ends, -0.5), max(*ends, 0.5)
        if top > _WIDE:
            axes.set_yscale("symlog", linthresh=1.0, linscale=0.7)
            axes.set_yticks([0.0, *10.0 ** np.arange(np.ceil(np.log10(top)))])
            top *= 1.5
        axes.set_ylim(1.15 * low, 1.1 * top)
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(plain)
        axes.grid(axis="x", visible=False)
        name_panel(axes, literal(response, 30), "1")
        axes.tick_params(labelbottom=False)
    last, first = panels[-1], panels[0]
    count = len(regimes) * len(bands)
    names = [f"{low:.2g}–{high:.2g}" for _ in regimes for low, high in bands]
    last.set_xticks(range(count), names, rotation=90 if steep else 0)
    last.set_xlim(-0.5, count - 0.5)
    last.tick_params(labelbottom=True)
    last.set_xlabel("Frequency band (Hz), in " + ", ".join(literal(r, 14) for r in regimes))
    for k, regime in enumerate(regimes):
        middle = (k + 0.5) * len(bands) - 0.5
        first.annotate(
            literal(regime, 14),
            (middle, 1.0),
            (0, 15),
            ("data", "axes fraction"),
            textcoords="offset points",
            ha="center",
            color=GREY,
        )
    draw_legend(
        figure,
        [
            *(
                first.plot([], [], m, color=colour, ms=4, label=label)[0]
                for m, colour, label in (("o", ORANGE, "A"), ("s", BLUE, "B"))
            ),
            Patch(color=ORANGE, alpha=0.16, label="A nearer"),
            Patch(color=BLUE, alpha=0.16, label="B nearer"),
        ],
    )
    return figure


def _mark(axes: Axes, x: float, misfit: Span, colour: str, marker: str) -> None:
    """Draw a misfit and its interval."""
    half = np.array([[misfit.value - misfit.lo], [misfit.hi - misfit.value]])
    axes.errorbar([x], [misfit.value], half, fmt=marker, color=colour, ms=3.2, elinewidth=0.9, capsize=1.5)
