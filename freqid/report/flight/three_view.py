"""A three-view of a described aircraft, with the names of its effectors; pure: data in, a Figure out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MultipleLocator

from freqid.core.arrays import Array
from freqid.core.scenario import Scenario
from freqid.core.vehicle import Rotor, Vehicle
from freqid.report.flight.outline import Part, centre_of_gravity, outline, shaft, silhouette
from freqid.report.kit.drawing import BLUE, INK, ORANGE, WIDTH, literal, plain, styled

# Right and up on paper, vehicle axes.
TOP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
REAR = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
SIDE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_ORDER = ("fuselage", "tail", "wing", "surface", "shaft", "rotor")
_FILL = {"fuselage": "#f1f1f1", "tail": "#e4e4e4", "wing": "#e4e4e4", "surface": "#9cc7e3", "rotor": ORANGE}
_SIZE = 7.5  # of names
_LEFT, _RIGHT, _BETWEEN, _BOTTOM, _ABOVE = 0.62, 0.06, 0.66, 0.42, 0.24  # inches
_NEAR = 0.045  # m between a part and its name
_ROOM = 0.1  # m around the aircraft, for names


@styled
def three_view(scenario: Scenario, tilt: Mapping[str, float]) -> Figure:
    """Draw an aircraft from above, from behind and from the right, to one scale.

    Parameters
    ----------
    scenario : Scenario
        Its vehicle, and the shapes in ``[simulation.airframe]``.
    tilt : mapping of str to float
        rad, by the effector that tilts a wing; zero where absent.
    """
    vehicle, parts = scenario.aircraft(), outline(scenario, tilt)
    extents = [_extent(parts, axes) for axes in (TOP, REAR, SIDE)]
    # The side view is widest: it sets the scale.
    scale = (WIDTH - _LEFT - _RIGHT) / max(extent[1] - extent[0] for extent in extents)
    heights = [scale * (extent[3] - extent[2]) for extent in extents]
    total = _ABOVE + sum(heights) + 2 * _BETWEEN + _BOTTOM
    figure, panels, y = Figure(figsize=(WIDTH, total)), [], total - _ABOVE
    for (left, right, low, high), height in zip(extents, heights, strict=True):
        y -= height
        width = scale * (right - left)
        panel = figure.add_axes((_LEFT / WIDTH, y / total, width / WIDTH, height / total))
        panel.set(xlim=(left, right), ylim=(low, high))
        for axis in (panel.xaxis, panel.yaxis):
            axis.set_major_locator(MultipleLocator(0.5))
            axis.set_major_formatter(plain)
        panels.append(panel)
        y -= _BETWEEN
    top, rear, side = panels
    # Paper's upwards is -z, so the axis is turned: labels say z.
    for panel in (rear, side):
        panel.yaxis.set_major_locator(MultipleLocator(0.25))
        panel.yaxis.set_major_formatter(lambda value, _: plain(-value if value else 0.0))
    for panel, axes, words, names in (
        (top, TOP, "From above", ("y (m), right", "x (m), forward")),
        (rear, REAR, "From behind", ("y (m), right", "z (m), down")),
        (side, SIDE, "From the right", ("x (m), forward", "z (m), down")),
    ):
        draw_parts(panel, parts, axes)
        _mark_centre(panel, axes @ centre_of_gravity(vehicle, tilt))
        panel.set_title(words)
        panel.set_xlabel(names[0], labelpad=1.5)
        panel.set_ylabel(names[1])
        panel.yaxis.set_label_coords(-0.47 / (scale * np.ptp(panel.get_xlim())), 0.5)
    _name_from_above(top, parts)
    for rotor in vehicle.rotors:
        upright = abs(shaft(vehicle, rotor, tilt)[1][2]) > 0.5**0.5
        _show_spin(top if upright else rear, TOP if upright else REAR, vehicle, rotor, tilt)
    _name_tilts(side, vehicle, tilt, parts)
    return figure


def draw_parts(panel: Axes, parts: Sequence[Part], axes: Array, linewidth: float = 0.6) -> None:
    """Draw the parts of an aircraft in a view, the body first."""
    for part in sorted(parts, key=lambda part: _ORDER.index(part.kind)):
        shape, disc = silhouette(part, axes), part.kind == "rotor"
        colour = ORANGE if disc else INK
        if shape.shape[1] == 2:  # seen from its edge
            panel.add_line(Line2D(*shape, color=colour, linewidth=2.2 * linewidth if disc else linewidth))
            continue
        fill = to_rgba(_FILL[part.kind], 0.13 if disc else 1.0)
        panel.add_patch(Polygon(shape.T, facecolor=fill, edgecolor=colour, linewidth=linewidth))


def _extent(parts: Sequence[Part], axes: Array) -> tuple[float, float, float, float]:
    flat = np.hstack([axes @ part.points for part in parts])
    (left, low), (right, high) = flat.min(axis=1) - _ROOM, flat.max(axis=1) + _ROOM
    return float(left), float(right), float(low), float(high)


def _write(panel: Axes, x: float, y: float, text: str, **look) -> None:
    """Write a name that stays readable where it crosses a line."""
    look = {"ha": "center", "va": "center", "size": _SIZE} | look
    panel.text(x, y, literal(text, 16), path_effects=[withStroke(linewidth=2.2, foreground="white")], **look)


def _mark_centre(panel: Axes, at: Array) -> None:
    panel.plot(*at, "o", color="white", markeredgecolor=INK, markersize=6.5, markeredgewidth=0.8, zorder=4)
    panel.plot(*at, "+", color=INK, markersize=6.5, markeredgewidth=0.8, zorder=4)


def _name_from_above(panel: Axes, parts: Sequence[Part]) -> None:
    """Name rotors in front of everything on their wing, surfaces behind it, those of the tail beside it."""
    flat = {id(part): TOP @ part.points for part in parts}
    for part in parts:
        if part.kind not in ("rotor", "surface"):
            continue
        (y, _), own = flat[id(part)].mean(axis=1), flat[id(part)]
        alike = [flat[id(p)][1] for p in parts if p.group == part.group and p.kind in ("rotor", "surface")]
        row = np.concatenate(alike) if part.group else own[1]
        if part.kind == "rotor":
            _write(panel, y, row.max() + _NEAR, part.name, color=ORANGE)
        elif part.group:
            _write(panel, y, row.min() - _NEAR, part.name, color=BLUE)
        else:
            side = 1 if y >= 0 else -1
            outer = (side * own[0]).max() + 0.6 * _NEAR
            _write(
                panel, side * outer, own[1].mean(), part.name, color=BLUE, ha="left" if side > 0 else "right"
            )


def _show_spin(panel: Axes, axes: Array, vehicle: Vehicle, rotor: Rotor, tilt: Mapping[str, float]) -> None:
    """Draw which way a rotor turns, on the half of its disc that rotors of other wings leave free."""
    if not rotor.diameter_m:
        return
    hub, ahead = shaft(vehicle, rotor, tilt)
    others = [shaft(vehicle, r, tilt)[0] for r in vehicle.rotors]
    middle = np.mean([axes @ other for other in others], axis=0)
    upper = (axes @ hub)[1] >= middle[1]
    turn = np.linspace(-0.9, 0.9, 21) * rotor.spin
    start = axes[1] if upper else -axes[1]
    start = start - (start @ ahead) * ahead
    start /= np.linalg.norm(start)
    arc = np.outer(start, np.cos(turn)) + np.outer(np.cross(ahead, start), np.sin(turn))
    path = axes @ (hub[:, None] + 0.36 * rotor.diameter_m * arc)
    panel.plot(*path[:, :-1], color=ORANGE, linewidth=1.0)
    panel.annotate(
        "",
        tuple(path[:, -1]),
        tuple(path[:, -4]),
        arrowprops={"arrowstyle": "-|>", "color": ORANGE, "linewidth": 1.0},
    )
    if axes is REAR:
        at = axes @ (hub + 0.16 * rotor.diameter_m * start)
        _write(panel, at[0], at[1], rotor.name, color=ORANGE)


def _name_tilts(panel: Axes, vehicle: Vehicle, tilt: Mapping[str, float], parts: Sequence[Part]) -> None:
    """Mark the tilt axes and say how far each wing is tilted."""
    for wing in vehicle.wings:
        x, _, z = wing.pivot_m
        panel.plot(x, -z, "o", color=INK, markersize=2.6, zorder=5)
        own = np.hstack([SIDE @ part.points for part in parts if part.group == wing.name] or [[[x], [-z]]])
        text = f"{wing.tilt} {degrees(tilt.get(wing.tilt, 0.0)):.1f}°".replace("-", "−")
        _write(panel, x, own[1].max() + _NEAR, text)
