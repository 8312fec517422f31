"""What every figure shares: the style, panels placed in inches, thinned histories, plain labels."""

from __future__ import annotations

from collections.abc import Sequence
from functools import wraps
from typing import Any, TypeVar

import matplotlib.style
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.container import Container
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from freqid.core.arrays import Array
from freqid.core.record import Channel
from freqid.core.results.fit import Fit
from freqid.report.kit.notation import shown_unit, with_unit

Drawing = TypeVar("Drawing", bound=Any)

# Okabe & Ito, told apart by readers of any colour vision and in grey print.
INK, GREY, PALE, BLUE, ORANGE = "#222222", "#8c8c8c", "#c9c9c9", "#0072B2", "#D55E00"
ON_COLOUR = "#111111"
"""Of letters on a light colour that means a value: they stay dark where the page is dark."""
STYLE = {
    "font.size": 8.5,
    "font.sans-serif": ["DejaVu Sans"],  # comes with matplotlib, wider than the page's fonts: labels fit
    "axes.titlesize": 8.5,
    "axes.titlepad": 4.0,
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # stays there: to move it, every label would be measured
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.titlecolor": INK,
    "text.color": INK,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "lines.linewidth": 1.0,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "legend.borderpad": 0.0,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.2,
    "mathtext.fontset": "dejavusans",
    "svg.fonttype": "none",  # text stays text: small, selectable, in the page's font
    "path.simplify": False,
}
# Inches. A phone of 390 px gives a figure 382 px, in which 8.5 points are 11.1 px high; on a desk and on A4
# two figures stand side by side.
WIDTH = 4.05
TIME_PANEL = "time"
"""Group id of a panel whose horizontal axis is time: readers can zoom it."""
_LEFT, _RIGHT, _TOP, _BOTTOM, _GAP = 0.62, 0.12, 0.26, 0.44, 0.33
_LEGEND_MARK, _LEGEND_LETTER = 31.0, 4.9  # points, of a mark with its space, and of a letter
_COLUMNS = 700  # a drawn history has this many columns, each from its lowest to its highest sample


def styled(draw: Drawing) -> Drawing:
    """Draw a figure in the report's style, whatever matplotlib is set to."""

    @wraps(draw)
    def drawn(*args: Any, **kwargs: Any) -> Figure:
        with matplotlib.style.context(["default", STYLE]):
            return draw(*args, **kwargs)

    return drawn  # type: ignore[return-value]


def stacked_panels(
    heights: Sequence[float],
    *,
    width: float = WIDTH,
    legend: int = 0,
    top: float = _TOP,
    left: float = _LEFT,
    right: float = _RIGHT,
    bottom: float = _BOTTOM,
    gap: float = _GAP,
) -> tuple[Figure, list[Axes]]:
    """Return a figure of stacked axes of given heights in inches, and the axes from the top down.

    `legend` rows of a legend find room above; the other lengths are margins, in inches.
    """
    above = top + 0.2 * legend
    total = above + sum(heights) + gap * (len(heights) - 1) + bottom
    figure, panels = Figure(figsize=(width, total)), []
    y = total - above
    for height in heights:
        y -= height
        place = (left / width, y / total, (width - left - right) / width, height / total)
        panels.append(figure.add_axes(place, sharex=panels[0] if panels else None))
        y -= gap
    return figure, panels


def draw_history(axes: Axes, time: Array, values: Array, colour: str, **line: Any) -> Line2D:
    """Draw a time history, thinned where it is longer than a screen can show."""
    axes.yaxis.set_major_formatter(plain)
    return axes.plot(*envelope(time, values), color=colour, **line)[0]


def draw_noise(axes: Axes, fit: Fit) -> list[Line2D]:
    """Draw what noise alone would leave of a fit on its lines, where that is known."""
    if fit.noise is None:
        return []
    return axes.plot(fit.axis, fit.noise, color=INK, linewidth=0.8, linestyle=(0, (2, 1.5)), label="noise")


def envelope(time: Array, values: Array, columns: int = _COLUMNS) -> tuple[Array, Array]:
    """Return a history thinned for drawing: of every column its lowest and highest sample, as they came.

    Parameters
    ----------
    time, values : ndarray, shape (sample,)
    columns : int
        A history of fewer than four samples a column is returned as it is.

    Returns
    -------
    time, values : ndarray, shape (drawn,)
        Samples of the history, its first and last among them.
    """
    size = time.size // columns
    if size < 4:
        return time, values
    whole = values[: size * columns].reshape(columns, size)
    first = size * np.arange(columns)
    kept = np.concatenate([first + whole.argmin(axis=1), first + whole.argmax(axis=1)])
    rest = size * columns + np.arange(values.size - size * columns)
    kept = np.unique(np.concatenate([kept, rest, [0, values.size - 1]]))
    return time[kept], values[kept]


def shown_values(channel: Channel) -> Array:
    """Return a channel's values in the unit that it is drawn in."""
    return channel.values * shown_unit(channel.name, channel.unit)[1]


def name_panel(axes: Axes, label: str, unit: str) -> None:
    """Say above a panel what it shows; the label may hold a formula, the unit is literal."""
    axes.set_title(with_unit(label, literal(unit, 30)))


def literal(text: str, longest: int) -> str:
    """Return a text from outside that matplotlib shows as it is: no formula, one line, not too long."""
    text = " ".join(text.split())
    text = text if len(text) <= longest else text[: longest - 1] + "…"
    return text.replace("$", r"\$")


def name_rows(axes: Axes, names: Sequence[str]) -> None:
    """Make a panel of rows, from the top down at 0, 1, 2, with their names at its left."""
    axes.set_yticks(range(len(names)), [literal(name, 10) for name in names])
    axes.set_ylim(len(names) - 0.45, -0.55)
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", visible=False)
    axes.spines["left"].set_visible(False)


def frame_rows(axes: Axes, names: Sequence[str], notes: Sequence[str], heading: str) -> None:
    """Make a panel of rows about zero lines, with a note at the right of each, below a heading."""
    name_rows(axes, names)
    for i, note in enumerate(notes):
        axes.axhline(i, color=PALE, linewidth=0.5, zorder=1.9)
        axes.annotate(
            note, (1.0, i), (5, 0), ("axes fraction", "data"), textcoords="offset points", va="center"
        )
    axes.annotate(heading, (1.0, 1.0), (5, 4), "axes fraction", textcoords="offset points", color=INK)


def draw_legend(figure: Figure, lines: Sequence[Artist | Container], columns: int | None = None) -> None:
    """Name the lines above the panels, in one row unless `columns` says how many stand side by side.

    Where they need more rows than that, the figure grows.
    """
    wide = 72 * figure.get_figwidth() - 6
    asked = columns or len(lines)
    ncols = legend_columns([str(line.get_label()) for line in lines], wide, asked)
    grow(figure, 0.2 * (-(-len(lines) // ncols) - -(-len(lines) // asked)))
    place = (1 - 0.04 / figure.get_figwidth(), 1 - 0.02 / figure.get_figheight())
    figure.legend(handles=lines, loc="upper right", ncols=ncols, bbox_to_anchor=place, borderaxespad=0.0)


def legend_columns(labels: Sequence[str], wide: float, asked: int) -> int:
    """Return how many entries of a legend fit beside each other in a width in points, as asked at most."""
    needed = [_LEGEND_MARK + _LEGEND_LETTER * len(label) for label in labels]
    return next((n for n in range(asked, 1, -1) if _legend_width(needed, n) <= wide), 1)


def _legend_width(needed: Sequence[float], columns: int) -> float:
    """Return the width of a legend in points; matplotlib fills its columns as evenly as it can, in order."""
    return sum(float(part.max()) for part in np.array_split(np.array(needed), columns))


def grow(figure: Figure, inches: float) -> None:
    """Make room above all panels, whose sizes stay."""
    if inches <= 0:
        return
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + inches)
    for axes in figure.axes:
        box = axes.get_position()
        share = height / (height + inches)
        axes.set_position((box.x0, box.y0 * share, box.width, box.height * share))


def few_ticks(axes: Axes) -> None:
    """Label a low panel at no more than four values."""
    axes.yaxis.set_major_locator(MaxNLocator(3, min_n_ticks=2))
    axes.yaxis.set_major_formatter(plain)


def share_time(panels: Sequence[Axes], time: Array) -> None:
    """Give panels one time axis, labelled below the last."""
    panels[-1].xaxis.set_major_formatter(plain)
    for axes in panels:
        axes.set_gid(TIME_PANEL)
    _label_last(panels, "Time (s)", float(time[0]), float(time[-1]))


def share_frequency(panels: Sequence[Axes], f: Array) -> None:
    """Give panels one frequency axis, labelled below the last."""
    margin = 0.02 * float(f[-1] - f[0]) or 0.1 * float(f[0])
    _label_last(panels, "Frequency (Hz)", float(f[0]) - margin, float(f[-1]) + margin)
    for axes in panels:
        axes.yaxis.set_major_formatter(plain)


def _label_last(panels: Sequence[Axes], label: str, low: float, high: float) -> None:
    panels[-1].set_xlim(low, high)
    panels[-1].set_xlabel(label)
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)


def plain(value: float, _: float = 0.0) -> str:
    """Write a tick's value in full, with a true minus sign: no offset stands in a corner."""
    return f"{value:.10g}".replace("-", "−")
