"""Parameters along a corridor: estimates at its points, and the global model between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from freqid.blend.corridor_study import same_density
from freqid.blend.global_model import GlobalModel
from freqid.blend.similarity import equivalent
from freqid.core.arrays import Array
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    WIDTH,
    draw_legend,
    few_ticks,
    literal,
    name_panel,
    plain,
    styled,
)
from freqid.report.kit.notation import plain_symbol

LOOKS = ((BLUE, "o"), (ORANGE, "s"), ("#009E73", "D"), ("#CC79A7", "^"))
"""Colour and marker by density, the densest air first."""

SPEED = "Reference u (m/s)"
_LEFT, _RIGHT, _TOP, _BOTTOM, _ACROSS, _DOWN = 0.62, 0.12, 0.26, 0.42, 0.66, 0.36
_PANEL = 0.95  # inches
_CURVE = 49  # points of a blended curve


@dataclass(frozen=True, eq=False)
class Points:
    """A quantity at the conditions of one density, by ascending place along the corridor.

    Attributes
    ----------
    u : ndarray, shape (n,)
        Speed, m/s, or what else the corridor runs along.
    value, half : ndarray, shape (n,)
        Estimate and half length of its bar, in the panel's unit.
    known : ndarray, shape (n,)
        What the estimate should be; nan where that is not known.
    blended : ndarray of bool, shape (n,)
        Whether the global model is made from it.
    """

    u: Array
    value: Array
    half: Array
    known: Array
    blended: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ParameterBand:
    """A quantity of the global model at one density.

    Attributes
    ----------
    u, value, half : ndarray, shape (m,)
        Place, as of the points; blended value and half width of its band, in the panel's unit.
    """

    u: Array
    value: Array
    half: Array


@dataclass(frozen=True, eq=False)
class Panel:
    """One parameter along the corridor.

    Attributes
    ----------
    label, unit : str
        The parameter and its SI unit.
    points : sequence of Points, by density
    bands : sequence of Band or None, by density
    """

    label: str
    unit: str
    points: Sequence[Points]
    bands: Sequence[ParameterBand | None]


@styled
def parameters_along(panels: Sequence[Panel], names: Sequence[str], label: str = SPEED) -> Figure:
    """Draw parameters along the corridor, two panels beside each other.

    Point estimates have 2-sigma bars, the global model a line in a 2-sigma band, and what is known of
    the linearised simulation a cross.

    Parameters
    ----------
    panels : sequence of Panel
    names : sequence of str
        Of the densities.
    label : str
        Of the axis that the corridor runs along.
    """
    known = any(np.isfinite(p.known).any() for panel in panels for p in panel.points)
    blended = any(band is not None for panel in panels for band in panel.bands)
    held = any((~p.blended).any() for panel in panels for p in panel.points)
    figure, drawn = _grid(len(panels), legend=1 + (len(names) > 1))
    speeds = np.concatenate([p.u for panel in panels for p in panel.points])
    margin = 0.05 * float(np.ptp(speeds)) or 1.0
    ends = float(speeds.min()) - margin, float(speeds.max()) + margin
    for axes, panel in zip(drawn, panels, strict=True):
        for (colour, _), band in zip(LOOKS, panel.bands, strict=False):
            if band is not None:
                low, high = band.value - band.half, band.value + band.half
                axes.fill_between(band.u, low, high, color=colour, alpha=0.18, linewidth=0)
                axes.plot(band.u, band.value, color=colour, linewidth=0.9)
        for (colour, marker), points in zip(LOOKS, panel.points, strict=False):
            axes.plot(*_bars(points), color=colour, linewidth=0.8)
            look = {"linestyle": "none", "marker": marker, "markersize": 3.2, "color": colour}
            for used, face in ((points.blended, colour), (~points.blended, "white")):
                axes.plot(points.u[used], points.value[used], markerfacecolor=face, **look)
            if np.isfinite(points.known).any():
                look = {"color": INK, "markersize": 4.0, "markeredgewidth": 0.8, "zorder": 5}
                axes.plot(points.u, points.known, "x", **look)
        axes.set_xlim(*ends)
        _scale(axes, panel)
        name_panel(axes, literal(panel.label, 20), panel.unit)
        few_ticks(axes)
    dot: dict[str, Any] = {"color": INK, "marker": "o", "markersize": 3.2, "linestyle": "none"}
    handles = [Line2D([], [], label="point, ±2σ", **dot)]
    if held:
        handles.append(Line2D([], [], markerfacecolor="white", label="held out", **dot))
    if blended:
        handles.append(Line2D([], [], color=INK, linewidth=0.9, label="global, ±2σ"))
    if known:
        handles.append(
            Line2D([], [], color=INK, marker="x", markersize=4.4, linestyle="none", label="linearised")
        )
    draw_key(figure, handles, names)
    for axes in drawn[-2:]:
        axes.set_xlabel(label)
    return figure


def _bars(points: Points) -> tuple[Array, Array]:
    """Return the 2-sigma bars as one broken line, which is small to write."""
    u = np.repeat(points.u, 3)
    ends = np.array([points.value - points.half, points.value + points.half, np.full(points.u.size, np.nan)])
    return u, ends.T.ravel()


def _scale(axes: Axes, panel: Panel) -> None:
    """Show zero and all values; the few bars that are much longer than that run out of the panel."""
    axes.axhline(0, color=GREY, linewidth=0.6)
    values = np.concatenate([np.concatenate([p.value, p.known]) for p in panel.points])
    bars = np.concatenate([p.half for p in panel.points])
    values = values[np.isfinite(values)]
    low, high = min(0.0, values.min(initial=0)), max(0.0, values.max(initial=0))
    bars = bars[np.isfinite(bars)]
    longest = min(bars.max(initial=0.0), max(1.5 * (high - low), 2 * float(np.median([*bars, 0.0]))))
    room = max(longest, 0.06 * (high - low)) or 1.0
    axes.set_ylim(low - (room if low < 0 else 0.5 * room), high + (room if high > 0 else 0.5 * room))


def _grid(count: int, legend: int) -> tuple[Figure, list[Axes]]:
    """Return a figure of panels in two columns, row by row, and its axes."""
    rows = -(-count // 2)
    above = _TOP + 0.2 * legend
    total = above + rows * _PANEL + (rows - 1) * _DOWN + _BOTTOM
    wide = (WIDTH - _LEFT - _RIGHT - _ACROSS) / 2
    figure, panels = Figure(figsize=(WIDTH, total)), []
    for i in range(count):
        x = _LEFT + (i % 2) * (wide + _ACROSS)
        y = total - above - _PANEL - (i // 2) * (_PANEL + _DOWN)
        place = (x / WIDTH, y / total, wide / WIDTH, _PANEL / total)
        axes = figure.add_axes(place)
        axes.xaxis.set_major_locator(MaxNLocator(6))
        axes.xaxis.set_major_formatter(plain)
        axes.tick_params(labelbottom=i >= count - 2)
        panels.append(axes)
    return figure, panels


def draw_key(figure: Figure, handles: list[Line2D], names: Sequence[str]) -> None:
    """Say above the panels what the marks mean, and below that what the densities look like."""
    if len(names) < 2:
        handles[0].set_color(BLUE)
        draw_legend(figure, handles)
        return
    draw_legend(figure, handles)
    look: dict[str, Any] = {"linestyle": "none", "markersize": 4.2}
    lines = [
        Line2D([], [], color=colour, marker=marker, label=literal(name, 24), **look)
        for (colour, marker), name in zip(LOOKS, names, strict=False)
    ]
    figure.legend(
        handles=lines,
        loc="upper right",
        ncols=len(lines),
        bbox_to_anchor=(1 - 0.04 / WIDTH, 1 - 0.22 / figure.get_figheight()),
        borderaxespad=0.0,
    )


def blended_bands(model: GlobalModel, response: str, rho: float) -> dict[str, ParameterBand]:
    """Return the blended parameters at one density by regressor, as far as the corridor goes there.

    Parameters
    ----------
    model : GlobalModel
    response : str
    rho : float
        kg/m3; nothing is returned where it is unknown.
    """
    if response not in model.names or not np.isfinite(rho):
        return {}
    lines = [line for line in model.lines if same_density(line.rho, rho)] or model.lines
    nearest = float(np.clip(rho, model.lines[0].rho, model.lines[-1].rho))
    scale = [1.0] * len(lines)
    if model.corridor.along == "u":
        scale = [float(equivalent(rho)) * np.sqrt(line.rho / nearest) for line in lines]
    low = max(line.knots[0] / k for line, k in zip(lines, scale, strict=True))
    high = min(line.knots[-1] / k for line, k in zip(lines, scale, strict=True))
    if not low < high:
        return {}
    place = np.linspace(low, high, _CURVE)
    blended = model.parameters(response, model.reference(place, rho))
    return {
        name: ParameterBand(place, value, 2 * error)
        for name, value, error in zip(blended.names, blended.estimate, blended.std_error, strict=True)
    }


def derivative_name(response: str, regressor: str, form: str) -> str:
    """Return what a figure calls a parameter."""
    symbol = plain_symbol(response, form)
    return f"{symbol} at the trim" if regressor == "bias" else f"{symbol} per {regressor}"
