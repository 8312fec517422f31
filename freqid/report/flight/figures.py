"""Figures of a simulated flight: histories beside limits, and what each effector used of its range."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from freqid.core.arrays import Array
from freqid.core.record import Channel, FlightRecord
from freqid.core.vehicle import Effector
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    PALE,
    draw_history,
    envelope,
    few_ticks,
    frame_rows,
    literal,
    name_panel,
    name_rows,
    plain,
    share_time,
    shown_values,
    stacked_panels,
    styled,
)
from freqid.report.kit.notation import shown_unit

# A panel shows at least this much, in the unit that it is drawn in, or rounding errors look like motion.
_LEAST = {"m/s": 0.2, "deg/s": 1.0, "deg": 0.5, "m": 1.0, "rpm": 50.0, "V": 0.5, "A": 1.0}
_LIMIT = {"color": ORANGE, "linewidth": 0.9, "linestyle": (0, (6, 2, 1, 2))}


@styled
def history_strips(
    record: FlightRecord, names: Sequence[str], limits: dict[str, tuple[float, float]]
) -> Figure:
    """Draw channels over time, one strip each.

    Parameters
    ----------
    record : FlightRecord
    names : sequence of str
        Channels as ``group/name``.
    limits : dict of str to (low, high)
        SI; drawn where the channel comes half way to them.
    """
    figure, panels = stacked_panels([0.5] * len(names))
    for axes, name in zip(panels, names, strict=True):
        channel = record.channel(name)
        draw_wide_enough(axes, channel, BLUE, linewidth=0.9, time=record.time)
        unit, factor = shown_unit(name, channel.unit)
        start = float(channel.values[0])
        for limit in limits.get(name, ()):
            reached = (channel.values - start) / (limit - start) if limit != start else np.ones(1)
            if reached.max() > 0.5:
                axes.axhline(factor * limit, **_LIMIT)
        name_panel(axes, literal(name.partition("/")[2], 40), unit)
        few_ticks(axes)
    share_time(panels, record.time)
    return figure


def draw_wide_enough(axes: Axes, channel: Channel, colour: str, *, time: Array, **line) -> None:
    """Draw a channel in its engineering unit, on an axis that does not blow rounding errors up."""
    unit, _ = shown_unit(channel.name, channel.unit)
    values = shown_values(channel)
    draw_history(axes, time, values, colour, **line)
    low, high = axes.dataLim.y0, axes.dataLim.y1
    short = max(_LEAST.get(unit, 0.0) - (high - low), 0.0) / 2
    edge = 0.06 * (high - low + 2 * short)
    axes.set_ylim(low - short - edge, high + short + edge)


@styled
def draw_effector_rows(
    effectors: Sequence[Effector],
    time: Array,
    moved: Array,
    commanded: Array,
    scale: Sequence[float],
    notes: Sequence[str],
    colours: Sequence[str],
) -> Figure:
    """Draw how effectors moved from the start, one row each, their commands in grey behind.

    Parameters
    ----------
    effectors : sequence of Effector, length row
    time : ndarray, shape (sample,)
        s.
    moved, commanded : ndarray, shape (row, sample)
        Less the position at the start, SI.
    scale : sequence of float, length row
        What fills half a row: alike for effectors that are to be compared.
    notes, colours : sequence of str, length row
        What stands beside each row, and its colour.
    """
    figure, (axes,) = stacked_panels([0.36 * len(effectors)], right=0.92)
    for i, (row, wanted) in enumerate(zip(moved, commanded, strict=True)):
        looks: tuple[tuple[Array, dict[str, Any]], ...] = (
            (wanted, {"color": GREY, "linewidth": 1.6, "alpha": 0.5}),
            (row, {"color": colours[i], "linewidth": 0.8}),
        )
        for values, look in looks:
            drawn, shown = envelope(time, values)
            axes.plot(drawn, i - 0.46 * np.clip(shown / scale[i], -1.05, 1.05), **look)
    frame_rows(axes, [e.name for e in effectors], notes, "largest")
    axes.set_title("Deviation from the start")
    share_time([axes], time)
    return figure


@styled
def range_bars(effectors: Sequence[Effector], flown: Array, start: Array) -> Figure:
    """Draw what part of its range between limits each effector used.

    Parameters
    ----------
    effectors : sequence of Effector, length row
    flown : ndarray, shape (row, 4)
        Lowest, 5th percentile, 95th percentile and highest position, SI.
    start : ndarray, shape (row,)
        Position at the start, SI.
    """
    count = len(effectors)
    figure, (axes,) = stacked_panels([0.235 * count + 0.1])
    low, high = np.array([e.limits for e in effectors]).T
    share = 100 * (flown - low[:, None]) / (high - low)[:, None]
    row = np.arange(count)
    axes.barh(row, np.full(count, 100.0), height=0.62, color="#f1f1f1")
    axes.barh(row, share[:, 3] - share[:, 0], left=share[:, 0], height=0.3, color=PALE)
    axes.barh(row, share[:, 2] - share[:, 1], left=share[:, 1], height=0.62, color=BLUE)
    axes.plot(100 * (start - low) / (high - low), row, "|", color=INK, markersize=9, markeredgewidth=1.4)
    for side in (0, 100):
        axes.axvline(side, **_LIMIT)
    name_rows(axes, [e.name for e in effectors])
    axes.set_xlim(-4, 104)
    axes.xaxis.set_major_formatter(plain)
    axes.set_xlabel("Position between the lower and the upper limit (%)")
    return figure
