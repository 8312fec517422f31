"""Figures of a study against time and frequency: convergence, and the fit of several responses at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from freqid.core.arrays import Array
from freqid.core.results.fit import Fit
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    TIME_PANEL,
    WIDTH,
    draw_history,
    draw_legend,
    draw_noise,
    few_ticks,
    literal,
    name_panel,
    plain,
    share_frequency,
    stacked_panels,
    styled,
)

CONDITION_COLOURS = (BLUE, ORANGE, "#009E73")
"""Of the conditions that are followed, slowest first."""

_STRIP = 0.62  # inches
_SHOWN_FROM = 0.35  # of the manoeuvre: what is before does not set the scale


@dataclass(frozen=True, eq=False)
class Course:
    """One quantity against time.

    Attributes
    ----------
    label, unit : str
        What it is, and its SI unit.
    time, value : ndarray, shape (k,)
        s, and in `unit`.
    std_error : ndarray, shape (k,)
    """

    label: str
    unit: str
    time: Array
    value: Array
    std_error: Array


@styled
def parameters_over_time(courses: Sequence[Course], marked_s: float | None) -> Figure:
    """Draw parameters against the length of the manoeuvre, each with its 2-sigma band.

    Parameters
    ----------
    courses : sequence of Course
    marked_s : float, optional
        A time to mark.
    """
    figure, panels = stacked_panels([_STRIP] * len(courses), legend=1)
    for axes, course in zip(panels, courses, strict=True):
        half = 2 * course.std_error
        axes.fill_between(course.time, course.value - half, course.value + half, color=BLUE, alpha=0.2, lw=0)
        axes.plot(course.time, course.value, color=BLUE)
        last = course.value[-1]
        for edge in (last - half[-1], last + half[-1]):
            axes.axhline(edge, color=GREY, linewidth=0.6, linestyle=(0, (4, 3)))
        seen = course.time >= _SHOWN_FROM * course.time[-1]
        reach = float(np.max(np.abs(course.value - last)[seen] + half[seen]))
        if reach > 0:
            axes.set_ylim(last - 1.1 * reach, last + 1.1 * reach)
        name_panel(axes, literal(course.label, 40), course.unit)
        _mark(axes, marked_s)
        few_ticks(axes)
    draw_legend(
        figure,
        [
            Line2D([], [], color=BLUE, label="estimate"),
            Patch(color=BLUE, alpha=0.2, linewidth=0, label="±2σ"),
            Line2D([], [], color=GREY, linewidth=0.6, linestyle=(0, (4, 3)), label="±2σ at the end"),
        ],
    )
    _share_length(panels, courses[0].time)
    return figure


@styled
def settled_over_time(curves: Mapping[str, tuple[Array, Array]], marked_s: float | None) -> Figure:
    """Draw the share of parameters that have settled against the length of the manoeuvre.

    Parameters
    ----------
    curves : mapping of str to (time, share)
        By condition; s, and shares of one.
    marked_s : float, optional
        A time to mark.
    """
    figure, (axes,) = stacked_panels([1.75], legend=1)
    lines = []
    for colour, (name, (time, share)) in zip(CONDITION_COLOURS, curves.items(), strict=False):
        lines += axes.step(time, 100 * share, where="post", color=colour, label=literal(name, 20))
    axes.axhline(95, color=GREY, linewidth=0.8, linestyle=(0, (4, 3)))
    axes.annotate(
        "95 %", (0, 95), (4, -3), ("axes fraction", "data"), textcoords="offset points", va="top", color=INK
    )
    _mark(axes, marked_s)
    axes.set_ylim(0, 103)
    few_ticks(axes)
    name_panel(axes, "Parameters that have settled", "%")
    draw_legend(figure, lines)
    _share_length([axes], next(iter(curves.values()))[0])
    return figure


@styled
def errors_over_time(
    panels: Mapping[str, tuple[str, Mapping[str, tuple[Array, Array]]]], marked_s: float | None
) -> Figure:
    """Draw the error of prediction against the length of the manoeuvre that the model was made from.

    Parameters
    ----------
    panels : mapping of str to (unit, curves)
        By response as matplotlib writes it; curves are (time, rmse) by condition.
    marked_s : float, optional
        A time to mark.
    """
    figure, drawn = stacked_panels([0.8] * len(panels), legend=1)
    lines: list[Line2D] = []
    longest = np.zeros(1)
    for axes, (label, (unit, curves)) in zip(drawn, panels.items(), strict=True):
        top, lines = 0.0, []
        for colour, (name, (time, rmse)) in zip(CONDITION_COLOURS, curves.items(), strict=False):
            lines += axes.plot(time, rmse, color=colour, label=literal(name, 20))
            seen = time >= _SHOWN_FROM * time[-1]
            top = max(top, float(np.max(rmse[seen])))
            longest = time if time[-1] > longest[-1] else longest
        axes.set_ylim(0, 1.25 * top or 1.0)
        name_panel(axes, label, unit)
        _mark(axes, marked_s)
        few_ticks(axes)
    draw_legend(figure, lines)
    _share_length(drawn, longest)
    return figure


@styled
def fits_by_condition(
    fits: Mapping[str, Mapping[str, Fit]], units: Mapping[str, str], span: tuple[float, float]
) -> Figure:
    """Draw predictions of all responses at some conditions over a stretch of time, each about its mean.

    Parameters
    ----------
    fits : mapping of str to mapping of str to Fit
        By condition, then by response as matplotlib writes it; a response has one scale.
    units : mapping of str to str
        By response.
    span : tuple of (start, end)
        s.
    """
    top, bottom, left, right, across, down = 0.64, 0.42, 0.62, 0.12, 0.12, 0.33
    total = top + len(units) * _STRIP + (len(units) - 1) * down + bottom
    wide = (WIDTH - left - right - across * (len(fits) - 1)) / len(fits)
    figure, drawn = Figure(figsize=(WIDTH, total)), []
    for row, (label, unit) in enumerate(units.items()):
        y = total - top - _STRIP - row * (_STRIP + down)
        reach = 0.0
        panels = []
        for column, (condition, of) in enumerate(fits.items()):
            place = ((left + column * (wide + across)) / WIDTH, y / total, wide / WIDTH, _STRIP / total)
            axes = figure.add_axes(place)
            fit, look = of[label], {"linewidth": 0.9, "label": "prediction"}
            inside = (fit.axis >= span[0]) & (fit.axis <= span[1])
            measured, modelled = (x[inside] - fit.measured.mean() for x in (fit.measured, fit.modelled))
            drawn = [
                draw_history(axes, fit.axis[inside], measured, GREY, linewidth=2.0, label="measured"),
                draw_history(axes, fit.axis[inside], modelled, BLUE, **look),
            ]
            reach = max(reach, float(np.abs([measured, modelled]).max()))
            panels.append(axes)
            if not row:
                axes.annotate(
                    literal(condition, 16), (0.5, 1), (0, 14), "axes fraction", "offset points", ha="center"
                )
        for axes in panels:
            axes.set_gid(TIME_PANEL)
            axes.set(xlim=span, ylim=(-1.1 * reach or -1, 1.1 * reach or 1))
            few_ticks(axes)
            axes.xaxis.set_major_locator(MaxNLocator(4, prune="upper"))
            axes.xaxis.set_major_formatter(plain)
            axes.tick_params(labelbottom=row == len(units) - 1, labelleft=axes is panels[0])
        name_panel(panels[0], label, unit)
    for axes in figure.axes[-len(fits) :]:
        axes.set_xlabel("Time (s)")
    draw_legend(figure, drawn)
    return figure


@styled
def fits_over_frequency(fits: Mapping[str, tuple[str, Fit]]) -> Figure:
    """Draw the magnitudes of several responses, measured, modelled, residual and noise where it is known.

    Parameters
    ----------
    fits : mapping of str to (unit, Fit)
        By response as matplotlib writes it; complex, on lines.
    """
    figure, panels = stacked_panels([_STRIP] * len(fits), legend=1)
    drawn: list[Line2D] = []
    dots = {"linestyle": "none", "marker": "o", "markeredgewidth": 0, "markersize": 2.4}
    f = np.zeros(2)
    for axes, (label, (unit, fit)) in zip(panels, fits.items(), strict=True):
        f = fit.axis
        (left,) = axes.plot(f, np.abs(fit.residual), color=ORANGE, linewidth=0.8, label="residual")
        (model,) = axes.plot(f, np.abs(fit.modelled), color=BLUE, linewidth=1.0, label="model")
        (flown,) = axes.plot(f, np.abs(fit.measured), color=INK, label="measured", **dots)
        drawn = [flown, model, left, *draw_noise(axes, fit)]
        axes.set_ylim(bottom=0)
        name_panel(axes, f"Magnitude of {label}, R² {fit.r2:.3f}", "s" if unit == "1" else f"{unit} s")
        few_ticks(axes)
    draw_legend(figure, drawn)
    share_frequency(panels, f)
    for axes in panels:
        few_ticks(axes)
    return figure


def _mark(axes: Axes, time: float | None) -> None:
    if time is not None:
        axes.axvline(time, color=INK, linewidth=0.8, linestyle=(0, (1, 2)))


def _share_length(panels: Sequence[Axes], time: Array) -> None:
    """Give panels one axis of the manoeuvre's length, from its start."""
    panels[-1].xaxis.set_major_formatter(plain)
    panels[-1].set_xlim(0, time[-1])
    panels[-1].set_xlabel("Length of the manoeuvre (s)")
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
