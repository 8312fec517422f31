"""Figures of a design: who has which harmonic, what is flown, what it adds up to, and how long it takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from freqid.core.arrays import Array
from freqid.core.results.design import MultisineDesign
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    PALE,
    draw_history,
    draw_legend,
    envelope,
    few_ticks,
    frame_rows,
    literal,
    name_panel,
    plain,
    share_frequency,
    share_time,
    stacked_panels,
    styled,
)

# Okabe & Ito again, as many as there are groups at most.
GROUP_COLOURS = (BLUE, ORANGE, "#009E73", "#CC79A7", "#B8860B", "#56B4E9", GREY)
WORST_CONDITION = 1e3  # drawn; the first moments, when nothing is told apart yet, are far above
_ROW, _TALLEST = 0.135, 6.0  # inches of a row of the map of harmonics, and of the whole map


@styled
def harmonic_map(
    design: MultisineDesign, groups: Mapping[str, Sequence[int]], forbidden_hz: Sequence[tuple[float, float]]
) -> Figure:
    """Draw the spectra of all effectors in one panel, and below it who has which harmonic.

    Parameters
    ----------
    design : MultisineDesign
    groups : mapping of str to sequence of int
        Places of the effectors by label; a group has one colour.
    forbidden_hz : sequence of (low, high)
        Bands that must stay empty, shaded.
    """
    count = len(design.signals)
    rows = min(_ROW * count + 0.1, _TALLEST)
    columns = 4
    figure, (power, owner) = stacked_panels([1.45, rows], legend=-(-len(groups) // columns), left=0.72)
    # Of a thousand lines each would be thinner than a screen shows.
    width = max(0.8 / design.period_s, (design.band_hz[1] - design.band_hz[0]) / 500)
    filled: dict[int, float] = {}
    for colour, places in zip(GROUP_COLOURS, groups.values(), strict=False):
        for i in places:
            signal = design.signals[i]
            share = 100 * signal.amplitude**2 / np.sum(signal.amplitude**2)
            f = signal.index / design.period_s
            bottom = [filled.get(k, 0.0) for k in signal.index.tolist()]
            filled |= {k: b + s for k, b, s in zip(signal.index.tolist(), bottom, share, strict=True)}
            power.bar(f, share, width, bottom, color=colour, linewidth=0)
            owner.bar(f, np.full(f.size, 0.76), width, i - 0.38, color=colour, linewidth=0)
    for low, high in forbidden_hz:
        for axes in (power, owner):
            axes.axvspan(low, high, facecolor=PALE, alpha=0.6, linewidth=0, zorder=0.5)
    draw_legend(
        figure,
        [Patch(color=c, label=literal(g, 24)) for c, g in zip(GROUP_COLOURS, groups, strict=False)],
        min(columns, len(groups)),
    )
    name_panel(power, "Power of each harmonic, share of its signal", "%")
    name_panel(owner, "Whose it is", "1")
    power.set_ylim(bottom=0)
    share_frequency([power, owner], np.array(design.band_hz))
    few_ticks(power)
    step = max(1, round(_ROW * count / _TALLEST + 0.49))
    owner.set_yticks(range(0, count, step), [literal(s.name, 10) for s in design.signals[::step]])
    owner.set_ylim(count - 0.4, -0.6)
    owner.tick_params(axis="y", length=0)
    owner.grid(axis="y", visible=False)
    return figure


@styled
def signal_rows(
    names: Sequence[str],
    time: Array,
    values: Array,
    scale: Sequence[float],
    notes: Sequence[str],
    colours: Sequence[str],
) -> Figure:
    """Draw signals one below the other over one period, and beside each its largest deviation.

    Parameters
    ----------
    names : sequence of str, length row
        Effectors.
    time : ndarray, shape (sample,)
        s.
    values : ndarray, shape (row, sample)
        In the signals' units.
    scale : sequence of float, length row
        What fills half a row: alike for signals that are to be compared.
    notes, colours : sequence of str, length row
        What stands beside each row, and its colour.
    """
    figure, (axes,) = stacked_panels([0.31 * len(names)], right=0.86)
    for i, row in enumerate(values):
        drawn, shown = envelope(time, row)
        axes.plot(drawn, i - 0.47 * shown / scale[i], color=colours[i], linewidth=0.8)
    frame_rows(axes, names, notes, "largest")
    axes.set_title("Deviation from the trim")
    share_time([axes], time)
    return figure


@styled
def waveform_spectrum(
    f: Array, power: Array, band_hz: tuple[float, float], forbidden_hz: Sequence[tuple[float, float]]
) -> Figure:
    """Draw where over frequency one classic input has its power.

    Parameters
    ----------
    f : ndarray, shape (frequency,)
        Hz, ascending from zero.
    power : ndarray, shape (frequency,)
        Relative to its highest value.
    band_hz : tuple of (low, high)
        What is identified, between lines.
    forbidden_hz : sequence of (low, high)
        Bands that should stay empty, shaded.
    """
    figure, (axes,) = stacked_panels([1.9])
    for low, high in forbidden_hz:
        axes.axvspan(low, high, facecolor=PALE, alpha=0.6, linewidth=0, zorder=0.5)
    for edge in band_hz:
        axes.axvline(edge, color=GREY, linewidth=0.8, linestyle=(0, (4, 3)))
    axes.plot(f, 10 * np.log10(np.maximum(power, 1e-9)), color=BLUE)
    name_panel(axes, "Power of one input, relative to its highest", "dB")
    axes.set_ylim(-50, 3)
    share_frequency([axes], f)
    few_ticks(axes)
    return figure


@styled
def net_load_strips(axes_names: Sequence[str], time: Array, loads: Array, before: Array) -> Figure:
    """Draw what all effectors together do to each axis, as chosen and as it was before.

    Parameters
    ----------
    axes_names : sequence of str
        Among X Y Z L M N.
    time : ndarray, shape (sample,)
        s.
    loads, before : ndarray, shape (axis, sample)
        N and N m.
    """
    figure, panels = stacked_panels([0.56] * len(axes_names), legend=1)
    lines: list[Line2D] = []
    for panel, name, after, old in zip(panels, axes_names, loads, before, strict=True):
        grey = draw_history(panel, time, old, GREY, linewidth=0.8, alpha=0.8, label="before the choice")
        blue = draw_history(panel, time, after, BLUE, linewidth=0.9, label="as chosen")
        lines = [grey, blue]
        for peak, colour in ((np.abs(old).max(), GREY), (np.abs(after).max(), BLUE)):
            for side in (-peak, peak):
                panel.axhline(side, color=colour, linewidth=0.6, linestyle=(0, (4, 3)))
        name_panel(panel, name, "N" if name in "XYZ" else "N m")
        few_ticks(panel)
    draw_legend(figure, lines)
    share_time(panels, time)
    return figure


@styled
def while_flying(curves: Mapping[float, tuple[Array, Array, Array]], chosen: float) -> Figure:
    """Draw correlation and condition number against the length flown, one line for each period.

    Parameters
    ----------
    curves : mapping of float to (time, correlation, condition)
        By period T, s; arrays of shape (time,), the first in s.
    chosen : float
        The period of the design, drawn on top.
    """
    rows = -(-len(curves) // 5)
    columns = -(-len(curves) // rows)
    figure, (correlation, condition) = stacked_panels([1.6, 1.6], legend=rows)
    lines = []
    for (period, (time, largest, number)), colour in zip(
        sorted(curves.items()), _ramp(len(curves)), strict=True
    ):
        top = period == chosen
        look = {"color": INK if top else colour, "linewidth": 1.8 if top else 1.0, "zorder": 3 if top else 2}
        lines += correlation.plot(time, largest, label=f"T = {period:g} s", **look)
        condition.semilogy(time, np.minimum(number, 10 * WORST_CONDITION), **look)
        condition.plot(time[-1], number[-1], marker="o", markersize=3.5, clip_on=False, **look)
        correlation.plot(time[-1], largest[-1], marker="o", markersize=3.5, clip_on=False, **look)
    correlation.set_ylim(0, 1)
    condition.set_ylim(1, WORST_CONDITION)
    # A legend is filled column by column, but periods are read row by row.
    draw_legend(figure, [line for column in range(columns) for line in lines[column::columns]], columns)
    name_panel(correlation, "Largest correlation between two signals", "1")
    name_panel(condition, "Condition number of all signals", "1")
    _label_length([correlation, condition], "Length flown (s)", 0, max(curves))
    for axes in (correlation, condition):
        axes.yaxis.set_major_formatter(plain)
    return figure


@styled
def factors_over_period(factors: Mapping[float, Array], chosen: float) -> Figure:
    """Draw the relative peak factors of all signals for each period, and their median.

    Parameters
    ----------
    factors : mapping of float to ndarray, shape (effector,)
        By period T, s.
    chosen : float
        The period of the design.
    """
    figure, (axes,) = stacked_panels([1.9])
    periods = sorted(factors)
    for period in periods:
        colour = INK if period == chosen else BLUE
        values = factors[period]
        axes.plot([period, period], [values.min(), values.max()], color=colour, linewidth=1.4, alpha=0.5)
        axes.plot(np.full(values.size, period), values, ".", color=colour, markersize=4, alpha=0.5)
        axes.plot(period, np.median(values), "D", color=colour, markersize=5)
    axes.plot(periods, [np.median(factors[p]) for p in periods], color=BLUE, linewidth=0.8, zorder=1)
    name_panel(axes, "Relative peak factor: every signal, and the median", "1")
    axes.yaxis.set_major_formatter(plain)
    margin = 0.06 * (periods[-1] - periods[0]) or 1.0
    _label_length([axes], "Period T (s)", periods[0] - margin, periods[-1] + margin)
    if len(periods) <= 10:
        axes.set_xticks(periods)
    return figure


def _label_length(panels: Sequence[Axes], label: str, low: float, high: float) -> None:
    for axes in panels:
        axes.set_xlim(low, high)
        axes.tick_params(labelbottom=axes is panels[-1])
    panels[-1].xaxis.set_major_locator(MaxNLocator(8))
    panels[-1].xaxis.set_major_formatter(plain)
    panels[-1].set_xlabel(label)


def _ramp(count: int) -> list[tuple[float, ...]]:
    """Return colours from orange over grey to blue, in order of the period."""
    ends = np.array([[0.835, 0.369, 0.0], [0.62, 0.62, 0.62], [0.0, 0.447, 0.698]])
    at = np.linspace(0, 2, count) if count > 1 else np.array([2.0])
    return [tuple(np.interp(a, [0, 1, 2], ends[:, c]) for c in range(3)) for a in at]
