"""The shape of a described aircraft, and its three-view with the names of its effectors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import cos, degrees, pi, sin
from typing import Any

import msgspec
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MultipleLocator
from scipy.spatial import ConvexHull

from freqid.core.arrays import Array
from freqid.core.scenario import Scenario
from freqid.core.vehicle import Rotor, Surface, Vector, Vehicle, Wing
from freqid.dynamics.frames import shaft_axis, turn_about_y
from freqid.dynamics.mass import centre_of_gravity
from freqid.report.kit.drawing import BLUE, INK, ORANGE, WIDTH, literal, plain, styled

_THICKNESS = 0.12  # of the chord, as drawn
_POINTS = 48  # of a circle


class _Wing(msgspec.Struct):
    name: str
    span_m: float
    chord_m: tuple[float, float]
    quarter_chord_m: tuple[float, float]


class _Surface(msgspec.Struct):
    name: str
    on: str
    chord_fraction: float
    span_m: tuple[float, float] = (0.0, 0.0)


class _Tail(msgspec.Struct):
    centre_m: Vector
    span_m: float
    chord_m: float
    dihedral_rad: float


class _Fuselage(msgspec.Struct):
    centre_m: Vector
    volume_m3: float


class _Shape(msgspec.Struct):
    """What can be drawn of ``[simulation.airframe]``; the simulation checks the section."""

    wing: tuple[_Wing, ...] = ()
    surface: tuple[_Surface, ...] = ()
    tail: _Tail | None = None
    fuselage: _Fuselage | None = None


@dataclass(frozen=True, eq=False)
class Solid:
    """One convex piece of the aircraft.

    Attributes
    ----------
    kind : {"fuselage", "wing", "tail", "surface", "shaft", "rotor"}
    name : str
        Of the effector or wing; empty for a piece without one.
    points : ndarray, shape (3, point)
        It is their convex hull; vehicle axes, m.
    group : str
        Wing that carries it; empty on the body.
    """

    kind: str
    name: str
    points: Array
    group: str = ""


def outline(scenario: Scenario, tilt: Mapping[str, float]) -> list[Solid]:
    """Return the parts of an aircraft at given wing tilts.

    Parameters
    ----------
    scenario : Scenario
        Without ``[simulation.airframe]`` only rotors are known, and surfaces that ``[[surface]]`` places.
    tilt : mapping of str to float
        rad, by the effector that tilts a wing; zero where absent.

    Returns
    -------
    list of Solid
        The fuselage is a spheroid of its volume that reaches from the rotors in front to the last part: the
        description has no shape of it.
    """
    vehicle = scenario.aircraft()
    shape = msgspec.convert(scenario.simulation.airframe, _Shape)
    lifting = [part for wing in shape.wing for part in _wing(wing, shape.surface)]
    parts = [*lifting, *(_tail(shape.tail, shape.surface) if shape.tail else [])]
    drawn = {part.name for part in parts}
    parts += [_hinged(surface) for surface in scenario.surface if surface.name not in drawn]
    for rotor in vehicle.rotors:
        parts += _rotor(rotor, lifting)
    if shape.fuselage and parts:
        parts.append(_fuselage(shape.fuselage, parts))
    return [_tilted(part, vehicle, tilt) for part in parts]


def silhouette(part: Solid, axes: Array) -> Array:
    """Return the outline of a part in a view.

    Parameters
    ----------
    part : Solid
    axes : ndarray, shape (2, 3)
        Directions to the right and upwards on paper, vehicle axes.

    Returns
    -------
    ndarray, shape (2, corner)
        m; a line, seen from the side, is its two ends.
    """
    flat = axes @ part.points
    middle = flat.mean(axis=1, keepdims=True)
    directions, sizes, _ = np.linalg.svd(flat - middle, full_matrices=False)
    if sizes[1] > 1e-6 * max(sizes[0], 1e-9):
        return flat[:, ConvexHull(flat.T).vertices]
    along = directions[:, 0] @ flat
    return flat[:, [int(along.argmin()), int(along.argmax())]]


def tilted_shaft(vehicle: Vehicle, rotor: Rotor, tilt: Mapping[str, float]) -> tuple[Array, Array]:
    """Return hub and shaft direction of a rotor with wings tilted, vehicle axes, m and 1, shape (3,) each."""
    hub = np.array(rotor.position_m)
    wing = next((w for w in vehicle.wings if w.name == rotor.wing), None)
    if wing is None:
        return hub, shaft_axis(rotor.axis, 0.0)
    angle, pivot = tilt.get(wing.tilt, 0.0), np.array(wing.pivot_m)
    return pivot + turn_about_y(hub - pivot, angle), shaft_axis(rotor.axis, angle)


def _tilted(part: Solid, vehicle: Vehicle, tilt: Mapping[str, float]) -> Solid:
    for wing in vehicle.wings:
        if wing.name == part.group:
            pivot = np.array(wing.pivot_m)[:, None]
            points = pivot + turn_about_y(part.points - pivot, tilt.get(wing.tilt, 0.0))
            return Solid(part.kind, part.name, points, part.group)
    return part


def _wing(wing: _Wing, surfaces: tuple[_Surface, ...]) -> list[Solid]:
    x, z = wing.quarter_chord_m
    half = wing.span_m / 2

    def chord(y: float) -> float:
        return float(np.interp(abs(y), [0, half], wing.chord_m))

    def at(y: float, first: float = 0.0) -> Array:
        """Return the section at `y`, from a share of its chord to the trailing edge."""
        behind, height = _section(first)
        c = chord(y)
        return np.stack([x + c * (0.25 - behind), np.full(behind.size, y), z + c * height])

    parts = [Solid("wing", wing.name, np.hstack([at(-half), at(0.0), at(half)]), wing.name)]
    for surface in surfaces:
        if surface.on == wing.name:
            ends = [at(y, 1 - surface.chord_fraction) for y in surface.span_m]
            parts.append(Solid("surface", surface.name, np.hstack(ends), wing.name))
    return parts


def _tail(tail: _Tail, surfaces: tuple[_Surface, ...]) -> list[Solid]:
    parts = []
    for side, panel in ((-1.0, "tail-left"), (1.0, "tail-right")):
        middle = np.array(tail.centre_m) * [1.0, side, 1.0]
        out = np.array([0.0, side * cos(tail.dihedral_rad), -sin(tail.dihedral_rad)])
        up = np.array([0.0, -side * sin(tail.dihedral_rad), -cos(tail.dihedral_rad)])

        def at(share: float, first: float, middle=middle, out=out, up=up) -> Array:
            behind, height = _section(first)
            place = middle + share * tail.span_m * out
            return place[:, None] + tail.chord_m * (
                np.outer([1.0, 0.0, 0.0], 0.25 - behind) - np.outer(up, height)
            )

        parts.append(Solid("tail", panel, np.hstack([at(-0.5, 0.0), at(0.5, 0.0)])))
        for surface in surfaces:
            if surface.on == panel:
                first = 1 - surface.chord_fraction
                parts.append(Solid("surface", surface.name, np.hstack([at(-0.5, first), at(0.5, first)])))
    return parts


def _hinged(surface: Surface) -> Solid:
    """Return a surface as a flat panel from its hinge backwards."""
    hinge = np.array(surface.hinge_m).T
    behind = np.array([[-surface.chord_m], [0.0], [0.0]])
    return Solid("surface", surface.name, np.hstack([hinge, hinge + behind]), surface.wing or "")


def _section(first: float) -> tuple[Array, Array]:
    """Return a symmetric section from a share of its chord on: shares behind the nose, and heights."""
    behind = first + (1 - first) * 0.5 * (1 - np.cos(np.linspace(0, pi, 12)))
    height = _THICKNESS * 1.3 * np.sqrt(behind) * (1 - behind)
    return np.concatenate([behind, behind]), np.concatenate([height, -height])


def _rotor(rotor: Rotor, lifting: list[Solid]) -> list[Solid]:
    """Return the disc, at zero tilt, and the shaft back to the wing that carries it."""
    hub, ahead = np.array(rotor.position_m), shaft_axis(rotor.axis, 0.0)
    group = rotor.wing or ""
    parts = []
    if rotor.diameter_m:
        across = np.linalg.svd(ahead[None])[2][1:]
        angle = np.linspace(0, 2 * pi, _POINTS, endpoint=False)
        rim = rotor.diameter_m / 2 * across.T @ np.stack([np.cos(angle), np.sin(angle)])
        parts.append(Solid("rotor", rotor.name, hub[:, None] + rim, group))
    carrier = next((p for p in lifting if p.kind == "wing" and p.group == group), None)
    if carrier is not None:
        back = max(float(ahead @ hub) - float((ahead @ carrier.points).max()), 0.0) + 0.02
        parts.append(Solid("shaft", "", np.stack([hub, hub - back * ahead], axis=1), group))
    return parts


def _fuselage(fuselage: _Fuselage, parts: list[Solid]) -> Solid:
    low = min(float(part.points[0].min()) for part in parts)
    high = max(float(part.points[0].max()) for part in parts)
    radius = np.sqrt(6 * fuselage.volume_m3 / (pi * (high - low))) / 2
    along, around = np.meshgrid(np.linspace(0, pi, 25), np.linspace(0, 2 * pi, 12, endpoint=False))
    ring = radius * np.sin(along)
    _, y, z = fuselage.centre_m
    x = 0.5 * (low + high) + 0.5 * (high - low) * np.cos(along)
    points = np.stack([x, y + ring * np.cos(around), z + ring * np.sin(around)]).reshape(3, -1)
    return Solid("fuselage", "", points)


# Right and up on paper, vehicle axes.
TOP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
REAR = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
SIDE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_ORDER = ("fuselage", "tail", "wing", "surface", "shaft", "rotor")
_FILL = {"fuselage": "#f1f1f1", "tail": "#e4e4e4", "wing": "#e4e4e4", "surface": "#9cc7e3", "rotor": ORANGE}
_SIZE = 8.5  # of names
_LEFT, _RIGHT, _BETWEEN, _BOTTOM, _ABOVE = 0.62, 0.06, 0.66, 0.42, 0.24  # inches
_NEAR = 3.5  # points between a part and its name
_ROOM = 0.23  # inches around the aircraft, for a name and what keeps it off the part and the frame


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
    centre = centre_of_gravity(vehicle, {w.tilt: tilt.get(w.tilt, 0.0) for w in vehicle.wings})
    marked = np.array([centre, *(w.pivot_m for w in vehicle.wings)]).T
    extents = [_extent(parts, marked, axes) for axes in (TOP, REAR, SIDE)]
    # The side view is widest: it sets the scale.
    scale = (WIDTH - _LEFT - _RIGHT - 2 * _ROOM) / max(extent[1] - extent[0] for extent in extents)
    room = np.array([-1.0, 1.0, -1.0, 1.0]) * _ROOM / scale
    extents = [tuple((np.array(extent) + room).tolist()) for extent in extents]
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
        _mark_centre(panel, axes @ centre)
        panel.set_title(words)
        panel.set_xlabel(names[0], labelpad=1.5)
        panel.set_ylabel(names[1])
        panel.yaxis.set_label_coords(-0.47 / (scale * np.ptp(panel.get_xlim())), 0.5)
    _name_from_above(top, parts)
    for rotor in vehicle.rotors:
        upright = abs(tilted_shaft(vehicle, rotor, tilt)[1][2]) > 0.5**0.5
        _show_spin(top if upright else rear, TOP if upright else REAR, vehicle, rotor, tilt)
    _name_tilts(side, vehicle, tilt, parts)
    return figure


def draw_parts(panel: Axes, parts: Sequence[Solid], axes: Array, linewidth: float = 0.6) -> None:
    """Draw the parts of an aircraft in a view, the body first."""
    for part in sorted(parts, key=lambda part: _ORDER.index(part.kind)):
        shape, disc = silhouette(part, axes), part.kind == "rotor"
        colour = ORANGE if disc else INK
        if shape.shape[1] == 2:  # seen from its edge
            panel.add_line(Line2D(*shape, color=colour, linewidth=2.2 * linewidth if disc else linewidth))
            continue
        fill = to_rgba(_FILL[part.kind], 0.13 if disc else 1.0)
        panel.add_patch(Polygon(shape.T, facecolor=fill, edgecolor=colour, linewidth=linewidth))


def _extent(parts: Sequence[Solid], marked: Array, axes: Array) -> tuple[float, float, float, float]:
    """Return left, right, low and high of parts and marked points, shape (3, point)."""
    flat = np.hstack([axes @ marked, *(axes @ part.points for part in parts)])
    (left, low), (right, high) = flat.min(axis=1), flat.max(axis=1)
    return float(left), float(right), float(low), float(high)


def _write(panel: Axes, x: float, y: float, text: str, side: tuple[int, int] = (0, 0), **look: Any) -> None:
    """Write a name that stays readable where it crosses a line.

    Parameters
    ----------
    panel : Axes
    x, y : float
    text : str
    side : tuple of 2 int
        Where the name stands beside the point: -1 left of it or below, 1 right or above, 0 centred on it.
    """
    style: dict[str, Any] = {
        "ha": ("right", "center", "left")[1 + side[0]],
        "va": ("top", "center", "bottom")[1 + side[1]],
        "size": _SIZE,
        "path_effects": [withStroke(linewidth=2.2, foreground="white")],
    } | look
    offset = (_NEAR * side[0], _NEAR * side[1])
    panel.annotate(literal(text, 16), (x, y), offset, textcoords="offset points", **style)


def _mark_centre(panel: Axes, at: Array) -> None:
    panel.plot(*at, "o", color="white", markeredgecolor=INK, markersize=6.5, markeredgewidth=0.8, zorder=4)
    panel.plot(*at, "+", color=INK, markersize=6.5, markeredgewidth=0.8, zorder=4)


def _name_from_above(panel: Axes, parts: Sequence[Solid]) -> None:
    """Name rotors in front of everything on their wing, surfaces behind it, those of the tail beside it."""
    flat = {id(part): TOP @ part.points for part in parts}
    for part in parts:
        if part.kind not in ("rotor", "surface"):
            continue
        (y, _), own = flat[id(part)].mean(axis=1), flat[id(part)]
        alike = [flat[id(p)][1] for p in parts if p.group == part.group and p.kind in ("rotor", "surface")]
        row = np.concatenate(alike) if part.group else own[1]
        if part.kind == "rotor":
            _write(panel, y, row.max(), part.name, (0, 1), color=ORANGE)
        elif part.group or own[0].min() < 0 < own[0].max():  # across the body there is no side beside it
            _write(panel, y, row.min(), part.name, (0, -1), color=BLUE)
        else:
            side = 1 if y >= 0 else -1
            outer = side * (side * own[0]).max()
            _write(panel, outer, own[1].mean(), part.name, (side, 0), color=BLUE)


def _show_spin(panel: Axes, axes: Array, vehicle: Vehicle, rotor: Rotor, tilt: Mapping[str, float]) -> None:
    """Draw which way a rotor turns, on the half of its disc that rotors of other wings leave free."""
    if not rotor.diameter_m:
        return
    hub, ahead = tilted_shaft(vehicle, rotor, tilt)
    others = [tilted_shaft(vehicle, r, tilt)[0] for r in vehicle.rotors]
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


def _name_tilts(panel: Axes, vehicle: Vehicle, tilt: Mapping[str, float], parts: Sequence[Solid]) -> None:
    """Mark the tilt axes and say how far each wing is tilted; wings that look alike from here once."""
    alike: dict[tuple[float, float, str], list[Wing]] = {}
    for wing in vehicle.wings:
        angle = f"{degrees(tilt.get(wing.tilt, 0.0)):.1f}°".replace("-", "−")
        alike.setdefault((wing.pivot_m[0], wing.pivot_m[2], angle), []).append(wing)
    for (x, z, angle), wings in alike.items():
        panel.plot(x, -z, "o", color=INK, markersize=2.6, zorder=5)
        names = {wing.name for wing in wings}
        own = np.hstack([SIDE @ part.points for part in parts if part.group in names] or [[[x], [-z]]])
        text = f"{', '.join(dict.fromkeys(w.tilt for w in wings))} {angle}"
        _write(panel, x, own[1].max(), text, (0, 1))
