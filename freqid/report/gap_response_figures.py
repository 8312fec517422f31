"""Figures of a gap in the responses: residuals over noise, and what effects do to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import NDArray

from freqid.core.gap_result import BeforeAfter, ResidualSpectra
from freqid.report.drawing import (
    BLUE,
    GREY,
    ORANGE,
    PALE,
    draw_history,
    draw_legend,
    few_ticks,
    literal,
    name_panel,
    plain,
    share_time,
    stacked_panels,
    styled,
)

Array = NDArray[np.float64]

_STRETCH = 12.0  # s of a manoeuvre that are drawn


@styled
def residual_spectra(one: ResidualSpectra, rows: Sequence[int]) -> Figure:
    """Draw residuals on their lines over the noise floor, with what the likeliest explanation makes of them.

    Parameters
    ----------
    one : ResidualSpectra
    rows : sequence of int
        Of the residual, from the top down.
    """
    figure, panels = stacked_panels([1.05] * len(rows), legend=1)
    driven = one.owner >= 0
    lines: list[Any] = []
    for axes, i in zip(panels, rows, strict=True):
        size = np.abs(one.residual[i])
        floor = axes.fill_between(one.hz, 0, one.noise[i], color=PALE, linewidth=0, label="noise")
        (left,) = axes.plot(one.hz[driven], size[driven], ".", color=ORANGE, ms=4, label="on driven lines")
        (rest,) = axes.plot(one.hz[~driven], size[~driven], ".", color=GREY, ms=2.5, label="on others")
        lines = [floor, left, rest]
        if one.explained[i].any():
            marks = {"marker": "_", "markersize": 5, "markeredgewidth": 1.2, "linestyle": "none"}
            lines += axes.plot(one.hz, np.abs(one.explained[i]), color=BLUE, label="explained", **marks)
        _log_level(axes, one.noise[i], max(size.max(), one.noise[i].max()))
        name_panel(axes, literal(one.rows[i], 30), _density(one.units[i]))
    draw_legend(figure, _once(lines))
    _log_frequency(panels, one.hz)
    return figure


@styled
def before_after_time(one: BeforeAfter, rows: Sequence[int]) -> Figure:
    """Draw histories as measured, as simulated, and as simulated with the effects.

    Parameters
    ----------
    one : BeforeAfter
    rows : sequence of int
    """
    figure, panels = stacked_panels([0.95] * len(rows), legend=1)
    at = _telling(one, rows)
    time = one.time[at]
    lines: list[Any] = []
    for axes, i in zip(panels, rows, strict=True):
        lines = [
            draw_history(axes, time, one.measured[i, at], GREY, linewidth=2.2, alpha=0.7, label="measured"),
            draw_history(axes, time, one.before[i, at], ORANGE, linewidth=0.9, label="before"),
            draw_history(axes, time, one.after[i, at], BLUE, linewidth=0.9, label="after"),
        ]
        name_panel(axes, literal(one.responses[i], 30), one.units[i])
        few_ticks(axes)
    draw_legend(figure, lines)
    share_time(panels, time)
    return figure


@styled
def before_after_frequency(one: BeforeAfter, rows: Sequence[int]) -> Figure:
    """Draw what is left before and after over frequency, above what was measured and over noise.

    Parameters
    ----------
    one : BeforeAfter
    rows : sequence of int
    """
    figure, panels = stacked_panels([0.95] * len(rows), legend=1)
    lines: list[Any] = []
    for axes, i in zip(panels, rows, strict=True):
        z = one.measured_hz[i]
        pairs = (one.before_hz[i], ORANGE, "left before"), (one.after_hz[i], BLUE, "left after")
        floor = axes.fill_between(one.hz, 0, one.noise[i], color=PALE, linewidth=0, label="noise")
        lines = [floor, *axes.plot(one.hz, np.abs(z), ".", color=GREY, ms=2.5, label="measured")]
        for y, colour, label in pairs:
            lines += axes.plot(
                one.hz, np.abs(z - y), ".", color=colour, ms=4 if colour == ORANGE else 2.8, label=label
            )
        _log_level(axes, one.noise[i], np.abs(z).max())
        name_panel(axes, literal(one.responses[i], 30), _density(one.units[i]))
    draw_legend(figure, lines)
    _log_frequency(panels, one.hz)
    return figure


def _telling(one: BeforeAfter, rows: Sequence[int]) -> slice:
    """Return the stretch of a manoeuvre in which the effects change most: what fits on half a page."""
    dt = float(one.time[-1] - one.time[0]) / (one.time.size - 1)
    count = min(one.time.size, max(2, round(_STRETCH / dt)))
    change = (one.after[list(rows)] - one.before[list(rows)]) ** 2
    change /= np.maximum(change.mean(axis=1, keepdims=True), 1e-300)
    whole = np.concatenate([[0.0], np.cumsum(change.sum(axis=0))])
    start = int(np.argmax(whole[count:] - whole[:-count]))
    return slice(start, start + count)


def _log_level(axes: Axes, noise: Array, highest: float) -> None:
    """Give a panel a logarithmic axis from below the noise to above `highest`."""
    axes.set_yscale("log")
    low = max(0.1 * float(np.median(noise)), 1e-300)
    axes.set_ylim(low, 2 * max(float(highest), 10 * low))
    axes.yaxis.set_major_locator(LogLocator(numticks=4))
    axes.yaxis.set_minor_locator(NullLocator())


def _density(unit: str) -> str:
    return f"{unit if unit != '1' else ''}/√Hz"


def _once(lines: Sequence[Any]) -> list[Any]:
    return list({line.get_label(): line for line in lines}.values())


def _log_frequency(panels: Sequence[Axes], hz: Array) -> None:
    """Give panels one logarithmic frequency axis, labelled below the last."""
    last = panels[-1]
    last.set_xscale("log")
    last.set_xlim(0.95 * float(hz[0]), 1.05 * float(hz[-1]))
    last.set_xlabel("Frequency (Hz)")
    last.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    last.xaxis.set_major_formatter(plain)
    last.xaxis.set_minor_locator(NullLocator())
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
