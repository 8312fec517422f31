"""Figures of a gap: shares, increments, probabilities and sizes; responses over time and frequency."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.results.gap import BeforeAfter, Increment, ResidualSpectra
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    INK,
    ON_COLOUR,
    ORANGE,
    PALE,
    WIDTH,
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

_HEAT = LinearSegmentedColormap.from_list("white-orange", ["#ffffff", "#f7c9a8", ORANGE, "#7a3300"])
_DIGIT = 0.08  # inches, of a digit in a cell with its share of the room about it
_REST = 0.5  # of the lowest frequency above zero: where the mean is drawn on a logarithmic axis
_RIGHT = 0.15  # inches, of the margin of a map
_CELL = 0.24  # inches, of a row
_STRETCH = 12.0  # s of a manoeuvre that are drawn


@styled
def heat_panels(
    titles: Sequence[str],
    rows: Sequence[str],
    columns: Sequence[str],
    values: Array,
    highest: float,
    label: str,
    width: float = WIDTH,
) -> Figure:
    """Draw tables of numbers as coloured cells, one below the other, with the numbers in them.

    Parameters
    ----------
    titles : sequence of str, length k
    rows, columns : sequence of str, lengths m and n
    values : ndarray, shape (k, m, n)
        From 0 to `highest`; what is below half a unit of the last place is left blank.
    highest : float
    label : str
        Of the columns' axis.
    width : float
        Inches, of the whole figure.
    """
    longest = max(len(literal(c, 14)) for c in columns)
    left = 0.3 + 0.075 * max(len(literal(r, 18)) for r in rows)
    digits = max((len(f"{100 * x:.0f}") for x in values.ravel().tolist()), default=1)
    width = max(width, left + _RIGHT + _DIGIT * (digits + 0.3) * len(columns))  # a number fits its cell
    steep = longest * len(columns) > 46 * width / WIDTH  # labels side by side would touch
    bottom = 0.42 + (0.07 * longest if steep else 0.1)
    figure, panels = stacked_panels(
        [_CELL * len(rows)] * len(titles), left=left, bottom=bottom, right=_RIGHT, width=width
    )
    for axes, title, table in zip(panels, titles, values, strict=True):
        axes.pcolormesh(
            np.arange(len(columns) + 1) - 0.5,
            np.arange(len(rows) + 1) - 0.5,
            table,
            cmap=_HEAT,
            vmin=0,
            vmax=max(highest, 1e-12),
            edgecolors="#e6e6e6",
            linewidth=0.5,
        )
        for i, j in zip(*np.nonzero(table >= 0.005), strict=True):
            dark = table[i, j] > 0.55 * highest
            text = f"{100 * table[i, j]:.0f}"
            axes.text(
                j,
                i,
                text,
                ha="center",
                va="center",
                color="white" if dark else ON_COLOUR,
            )
        axes.set_title(literal(title, 60))
        axes.set_yticks(range(len(rows)), [literal(r, 18) for r in rows])
        axes.set_xticks(range(len(columns)), [literal(c, 14) for c in columns], rotation=90 if steep else 0)
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.set_xlim(-0.5, len(columns) - 0.5)
        axes.tick_params(length=0)
        axes.grid(visible=False)
        axes.spines[:].set_visible(False)
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
    panels[-1].set_xlabel(label)
    return figure


@styled
def increment_bars(increments: Sequence[Increment]) -> Figure:
    """Draw derivative increments with their intervals, clear ones in colour.

    Parameters
    ----------
    increments : sequence of Increment
        From the top down.
    """
    names = [f"{i.response} by {i.input}" for i in increments]
    left = 0.3 + 0.072 * max(len(literal(n, 26)) for n in names)
    figure, (axes,) = stacked_panels([0.21 * len(names) + 0.1], top=0.1, left=left)
    row = np.arange(len(names))
    value = np.array([i.percent for i in increments])
    low, high = (np.array([getattr(i, end) for i in increments]) for end in ("lo", "hi"))
    clear = [i.clear for i in increments]
    axes.barh(row, value, height=0.6, color=[BLUE if c else PALE for c in clear])
    half = np.stack([value - low, high - value])
    axes.errorbar(value, row, xerr=half, linestyle="none", ecolor=INK, elinewidth=0.9, capsize=2.0)
    axes.axvline(0, color=INK, linewidth=0.8)
    seen = np.concatenate([low[clear], high[clear]]) if any(clear) else np.concatenate([low, high])
    reach = 1.15 * max(float(np.abs(seen).max()), float(np.abs(value).max()), 1.0)
    axes.set_xlim(-reach, reach)
    _rows(axes, names, 26)
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.xaxis.set_major_formatter(plain)
    axes.set_xlabel("Increment (% of the simulation's derivative)")
    return figure


@styled
def probability_bars(names: Sequence[str], chances: Array, chosen: Sequence[bool]) -> Figure:
    """Draw the probability of each explanation, those of the set in colour.

    Parameters
    ----------
    names : sequence of str
    chances : ndarray, shape (name,)
    chosen : sequence of bool
    """
    left = 0.3 + 0.075 * max(map(len, names))
    figure, (axes,) = stacked_panels([0.22 * len(names) + 0.1], left=left, right=0.5, legend=1, top=0.1)
    row = np.arange(len(names))
    axes.barh(row, 100 * chances, height=0.62, color=[BLUE if c else PALE for c in chosen])
    for i, p in enumerate(chances):
        axes.annotate(f"{100 * p:.0f} %", (100 * p, i), (4, 0), textcoords="offset points", va="center")
    _rows(axes, names, 26)
    axes.set_xlim(0, 100)
    axes.set_xlabel("Probability (%)")
    draw_legend(figure, [Patch(color=BLUE, label="in the set"), Patch(color=PALE, label="not in it")])
    return figure


@styled
def draw_detectable_sizes(names: Sequence[str], ratio: Array, notes: Sequence[str]) -> Figure:
    """Draw the smallest size that is found, over the size that is expected, on a logarithmic axis.

    Parameters
    ----------
    names : sequence of str
    ratio : ndarray, shape (name,)
    notes : sequence of str
        The size with its unit, at the right.
    """
    left = 0.3 + 0.075 * max(map(len, names))
    figure, (axes,) = stacked_panels([0.2 * len(names) + 0.1], left=left, right=1.0, top=0.1)
    row = np.arange(len(names))
    seen = ratio < 1
    axes.axvline(1, color=INK, linewidth=0.8)
    axes.hlines(row, ratio.min() / 2, ratio, color=PALE, linewidth=0.8)
    axes.scatter(ratio, row, s=18, c=[BLUE if s else ORANGE for s in seen], zorder=3)
    for i, note in enumerate(notes):
        axes.annotate(
            note, (1.0, i), (6, 0), ("axes fraction", "data"), textcoords="offset points", va="center"
        )
    _rows(axes, names, 26)
    axes.set_xscale("log")
    axes.set_xlim(ratio.min() / 2, 2 * max(ratio.max(), 1.0))
    axes.xaxis.set_major_locator(LogLocator(numticks=5))
    axes.xaxis.set_major_formatter(plain)
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel("Smallest size found, over the size expected")
    return figure


def _rows(axes: Axes, names: Sequence[str], longest: int) -> None:
    """Name rows from the top down."""
    axes.set_yticks(range(len(names)), [literal(name, longest) for name in names])
    axes.set_ylim(len(names) - 0.45, -0.55)
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", visible=False)
    axes.spines["left"].set_visible(False)


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
    moving, driven = one.hz > 0, one.owner >= 0
    hz = _places(one.hz)
    lines: list[Any] = []
    for axes, i in zip(panels, rows, strict=True):
        size, noise, explained = (np.abs(x[i]) for x in (one.residual, one.noise, one.explained))
        floor = _noise_floor(axes, hz, noise, moving)
        (left,) = axes.plot(hz[driven], size[driven], ".", color=ORANGE, ms=4, label="on driven lines")
        (rest,) = axes.plot(hz[~driven], size[~driven], ".", color=GREY, ms=2.5, label="on others")
        lines = [floor, left, rest]
        if explained.any():
            marks = {"marker": "_", "markersize": 5, "markeredgewidth": 1.2, "linestyle": "none"}
            lines += axes.plot(hz, explained, color=BLUE, label="explained", **marks)
        _log_level(axes, noise, max(size.max(), noise.max()))
        name_panel(axes, literal(one.rows[i], 30), _density(one.units[i]))
    draw_legend(figure, _once(lines))
    _log_frequency(panels, hz, moving)
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
    at = _largest_change(one, rows)
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
    moving = one.hz > 0
    hz = _places(one.hz)
    for axes, i in zip(panels, rows, strict=True):
        z, noise = one.measured_hz[i], one.noise[i]
        before, after = one.before_hz[i], one.after_hz[i]
        pairs = (before, ORANGE, "left before"), (after, BLUE, "left after")
        floor = _noise_floor(axes, hz, noise, moving)
        lines = [floor, *axes.plot(hz, np.abs(z), ".", color=GREY, ms=2.5, label="measured")]
        for y, colour, label in pairs:
            size = 4 if colour == ORANGE else 2.8
            lines += axes.plot(hz, np.abs(z - y), ".", color=colour, ms=size, label=label)
        _log_level(axes, noise, max(np.abs(z).max(), np.abs(z - before).max()))
        name_panel(axes, literal(one.responses[i], 30), _density(one.units[i]))
    draw_legend(figure, lines)
    _log_frequency(panels, hz, moving)
    return figure


def _largest_change(one: BeforeAfter, rows: Sequence[int]) -> slice:
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
    high = 2 * max(float(highest), 10 * low)
    axes.set_ylim(low, high)
    if high < 100 * low:  # one power of ten alone would be no scale
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
        axes.yaxis.set_major_formatter(plain)
    else:
        axes.yaxis.set_major_locator(LogLocator(numticks=4))
    axes.yaxis.set_minor_locator(NullLocator())


def _density(unit: str) -> str:
    return f"{unit if unit != '1' else ''}/√Hz"


def _once(lines: Sequence[Any]) -> list[Any]:
    return list({line.get_label(): line for line in lines}.values())


def _places(hz: Array) -> Array:
    """Return where lines are drawn on a logarithmic axis: the mean, which has no place there, at its left."""
    return np.where(hz > 0, hz, _REST * hz[hz > 0].min())


def _noise_floor(axes: Axes, hz: Array, noise: Array, moving: NDArray[np.bool_]) -> Any:
    """Draw the noise below the lines, and below the mean by itself."""
    for place, level in zip(hz[~moving].tolist(), noise[~moving].tolist(), strict=True):
        axes.fill_between([place / 1.15, 1.15 * place], 0, level, color=PALE, linewidth=0)
    return axes.fill_between(hz[moving], 0, noise[moving], color=PALE, linewidth=0, label="noise")


def _log_frequency(panels: Sequence[Axes], hz: Array, moving: NDArray[np.bool_]) -> None:
    """Give panels one logarithmic frequency axis, labelled below the last, with a place for the mean."""
    last = panels[-1]
    last.set_xscale("log")
    if not moving.all():
        low, high = float(hz[moving][0]), float(hz[-1])
        rest = float(hz[~moving][0])
        for axes in panels:  # the axis is broken between the mean and the lowest frequency
            axes.axvline((low * rest) ** 0.5, color=PALE, linewidth=0.8, linestyle=(0, (2, 2)))
        last.set_xlim(0.75 * rest, 1.05 * high)
        last.set_xlabel("Frequency (Hz); 0 is the mean")
        marks = [m * 10.0**k for k in range(-4, 4) for m in (1, 2, 5) if low <= m * 10.0**k <= high]
        last.xaxis.set_major_locator(FixedLocator([rest, *marks]))
        last.xaxis.set_major_formatter(lambda x, _: "0" if abs(x - rest) < 0.01 * rest else f"{x:g}")
        last.xaxis.set_minor_locator(NullLocator())
        for axes in panels[:-1]:
            axes.tick_params(labelbottom=False)
        return
    last.set_xlim(0.95 * float(hz[0]), 1.05 * float(hz[-1]))
    last.set_xlabel("Frequency (Hz)")
    last.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    last.xaxis.set_major_formatter(plain)
    last.xaxis.set_minor_locator(NullLocator())
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
