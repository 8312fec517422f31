"""Trim curves: what every effector does in level flight along the transition corridor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from freqid.core.arrays import Array
from freqid.core.vehicle import Vehicle
from freqid.report.design.figures import GROUP_COLOURS
from freqid.report.kit.drawing import (
    ORANGE,
    few_ticks,
    legend_columns,
    literal,
    name_panel,
    plain,
    stacked_panels,
    styled,
)
from freqid.report.kit.effectors import engineering

_KINDS = (("tilt", "Wing tilt"), ("rotor", "Rotor speed"), ("surface", "Surfaces"))
_ALIKE = 0.005  # of the range between limits: effectors that differ less are one line
_BESIDE = 2  # names of lines that find room beside a panel's title
_ROW_ABOVE = 0.16  # inches, of a row of names above it
_DASHES = ("-", (0, (4, 2)), (0, (1.5, 1.5)))  # by density


@dataclass(frozen=True, eq=False)
class TrimCurve:
    """Level flight along the corridor of one density.

    Attributes
    ----------
    rho : float
        kg/m3.
    u : ndarray, shape (condition,)
        Forward speed, increasing, m/s.
    pitch : ndarray, shape (condition,)
        rad.
    positions : mapping of str to ndarray, shape (condition,)
        Of every effector, rad; rotors rad/s.
    power : ndarray, shape (condition,)
        That the battery gives, W.
    """

    rho: float
    u: Array
    pitch: Array
    positions: Mapping[str, Array]
    power: Array


@styled
def trim_curves(vehicle: Vehicle, curves: Sequence[TrimCurve]) -> Figure:
    """Draw trims over forward speed, one line for effectors that move alike, dashes by density.

    Parameters
    ----------
    vehicle : Vehicle
    curves : sequence of TrimCurve
        One a density, at most three.
    """
    kinds = [pair for pair in _KINDS if pair[0] in vehicle.effector_kinds.values()]
    heights = [1.0] * len(kinds) + [0.7, 0.9, 0.9]
    most = max(len(effectors_with_equal_trims(vehicle, kind, curves)) for kind, _ in kinds) if kinds else 0
    room = _ROW_ABOVE * -(-most // _BESIDE) if most > _BESIDE else 0.0  # for names above their panel's title
    figure, panels = stacked_panels(heights, top=0.26 + room, gap=0.33 + room)
    *by_kind, pitch, power, margin = panels
    for panel, (kind, words) in zip(by_kind, kinds, strict=True):
        _draw_kind(panel, vehicle, kind, words, curves)
    for curve, dash in zip(curves, _DASHES, strict=False):
        look = {"linestyle": dash, "marker": ".", "markersize": 3.5}
        pitch.plot(curve.u, np.degrees(curve.pitch), color=GROUP_COLOURS[0], **look)
        power.plot(curve.u, curve.power / 1000, color=GROUP_COLOURS[0], **look)
        for (kind, _), colour in zip(kinds, GROUP_COLOURS, strict=False):
            margin.plot(curve.u, 100 * _margin(vehicle, kind, curve), color=colour, label=kind, **look)
    name_panel(pitch, "Pitch angle", "deg")
    name_panel(power, "Electrical power", "kW")
    name_panel(margin, "Smallest margin to a limit", "% of the range")
    name_lines(margin)
    power.set_ylim(bottom=0)
    margin.set_ylim(0, 52)
    _open(pitch, 2.0)
    for panel in panels:
        few_ticks(panel)
        panel.tick_params(labelbottom=panel is panels[-1])
    fastest = max(float(curve.u[-1]) for curve in curves)
    panels[-1].set_xlim(-0.02 * fastest, 1.02 * fastest)
    panels[-1].xaxis.set_major_locator(MaxNLocator(7))
    panels[-1].xaxis.set_major_formatter(plain)
    panels[-1].set_xlabel("Forward speed u (m/s)")
    return figure


def _draw_kind(panel: Axes, vehicle: Vehicle, kind: str, words: str, curves: Sequence[TrimCurve]) -> None:
    unit, factor = engineering(next(e.unit for e in vehicle.effectors if e.kind == kind))
    for names, colour in zip(effectors_with_equal_trims(vehicle, kind, curves), GROUP_COLOURS, strict=False):
        for curve, dash in zip(curves, _DASHES, strict=False):
            values = factor * curve.positions[names[0]]
            panel.plot(
                curve.u,
                values,
                color=colour,
                linestyle=dash,
                marker=".",
                markersize=3.5,
                label=literal(_span(names), 20),
            )
    own = [e for e in vehicle.effectors if e.kind == kind]
    low, high = panel.get_ylim()
    for limit in sorted({factor * side for e in own for side in e.limits}):
        if low - 0.6 * (high - low) < limit < high + 0.6 * (high - low):
            panel.axhline(limit, color=ORANGE, linewidth=0.8, linestyle=(0, (6, 2, 1, 2)))
    if kind == "rotor":
        panel.set_ylim(bottom=0)
    else:
        _open(panel, 4.0)
    name_panel(panel, words, unit)
    name_lines(panel)


def effectors_with_equal_trims(vehicle: Vehicle, kind: str, curves: Sequence[TrimCurve]) -> list[list[str]]:
    """Return effectors of a kind in lists whose members have the same trims, in the vehicle's order.

    Parameters
    ----------
    vehicle : Vehicle
    kind : str
    curves : sequence of TrimCurve
    """
    groups: list[list[str]] = []
    for effector in (e for e in vehicle.effectors if e.kind == kind):
        near = _ALIKE * (effector.limits[1] - effector.limits[0])
        for group in groups:
            apart = [np.abs(c.positions[group[0]] - c.positions[effector.name]).max() for c in curves]
            if group[0].rstrip("0123456789") == effector.name.rstrip("0123456789") and max(apart) < near:
                group.append(effector.name)
                break
        else:
            groups.append([effector.name])
    return groups


def _margin(vehicle: Vehicle, kind: str, curve: TrimCurve) -> Array:
    """Return the smallest distance to a limit over the range between limits, shape (condition,)."""
    own = [e for e in vehicle.effectors if e.kind == kind]
    ranges = [(curve.positions[e.name], *e.limits) for e in own]
    return np.min([np.minimum(x - low, high - x) / (high - low) for x, low, high in ranges], axis=0)


def _span(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) < 3 else f"{names[0]} to {names[-1]}"


def _open(panel: Axes, least: float) -> None:
    """Give a panel at least this span, so that what hardly moves looks so."""
    low, high = panel.get_ylim()
    short = max(least - (high - low), 0.0) / 2
    panel.set_ylim(low - short, high + short)


def name_lines(panel: Axes) -> None:
    """Name the colours beside the panel's title, or above it; every density repeats them."""
    known = {str(line.get_label()): line for line in reversed(panel.lines) if str(line.get_label())[0] != "_"}
    names = list(reversed(known))
    figure = panel.get_figure(root=True)
    assert figure is not None
    width, height = 72 * figure.get_size_inches() * panel.get_position().size
    beside = width - 5.2 * len(panel.get_title(loc="left"))
    columns, lifted = legend_columns(names, beside, len(names)), 0.0
    if columns < len(names):
        columns, lifted = legend_columns(names, width + 20, len(names)), 13.0
    panel.legend(
        [known[name] for name in names],
        names,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0 + lifted / height),
        ncols=columns,
        borderaxespad=0.2,
        handlelength=0.9,
        handletextpad=0.4,
        columnspacing=0.8,
        labelspacing=0.2,
    )
