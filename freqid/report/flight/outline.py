"""The shape of a described aircraft, for drawing: convex parts, whose outlines in any view are hulls."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, pi, sin

import msgspec
import numpy as np
from scipy.spatial import ConvexHull

from freqid.core.arrays import Array
from freqid.core.frames import shaft_axis, turn_about_y
from freqid.core.scenario import Scenario
from freqid.core.vehicle import Rotor, Vector, Vehicle

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
class Part:
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


def outline(scenario: Scenario, tilt: Mapping[str, float]) -> list[Part]:
    """Return the parts of an aircraft at given wing tilts.

    Parameters
    ----------
    scenario : Scenario
        Without ``[simulation.airframe]`` only rotors are known.
    tilt : mapping of str to float
        rad, by the effector that tilts a wing; zero where absent.

    Returns
    -------
    list of Part
        The fuselage is a spheroid of its volume that reaches from the rotors in front to the last part: the
        description has no shape of it.
    """
    vehicle = scenario.aircraft()
    shape = msgspec.convert(scenario.simulation.airframe, _Shape)
    lifting = [part for wing in shape.wing for part in _wing(wing, shape.surface)]
    parts = [*lifting, *(_tail(shape.tail, shape.surface) if shape.tail else [])]
    for rotor in vehicle.rotors:
        parts += _rotor(rotor, lifting)
    if shape.fuselage and parts:
        parts.append(_fuselage(shape.fuselage, parts))
    return [_tilted(part, vehicle, tilt) for part in parts]


def silhouette(part: Part, axes: Array) -> Array:
    """Return the outline of a part in a view.

    Parameters
    ----------
    part : Part
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


def centre_of_gravity(vehicle: Vehicle, tilt: Mapping[str, float]) -> Array:
    """Return the centre of gravity with wings tilted, vehicle axes, m, shape (3,)."""
    centre = np.array(vehicle.mass_properties.cg_m)
    for wing in vehicle.wings:
        if wing.cg_m is not None:
            arm = np.subtract(wing.cg_m, wing.pivot_m)
            known, now = vehicle.tilt_rad.get(wing.name, 0.0), tilt.get(wing.tilt, 0.0)
            share = wing.mass_kg / vehicle.mass_properties.mass_kg
            centre = centre + share * (turn_about_y(arm, now) - turn_about_y(arm, known))
    return centre


def shaft(vehicle: Vehicle, rotor: Rotor, tilt: Mapping[str, float]) -> tuple[Array, Array]:
    """Return hub and shaft direction of a rotor with wings tilted, vehicle axes, m and 1, shape (3,) each."""
    hub = np.array(rotor.position_m)
    wing = next((w for w in vehicle.wings if w.name == rotor.wing), None)
    if wing is None:
        return hub, shaft_axis(rotor.axis, 0.0)
    angle, pivot = tilt.get(wing.tilt, 0.0), np.array(wing.pivot_m)
    return pivot + turn_about_y(hub - pivot, angle), shaft_axis(rotor.axis, angle)


def _tilted(part: Part, vehicle: Vehicle, tilt: Mapping[str, float]) -> Part:
    for wing in vehicle.wings:
        if wing.name == part.group:
            pivot = np.array(wing.pivot_m)[:, None]
            points = pivot + turn_about_y(part.points - pivot, tilt.get(wing.tilt, 0.0))
            return Part(part.kind, part.name, points, part.group)
    return part


def _wing(wing: _Wing, surfaces: tuple[_Surface, ...]) -> list[Part]:
    x, z = wing.quarter_chord_m
    half = wing.span_m / 2

    def chord(y: float) -> float:
        return float(np.interp(abs(y), [0, half], wing.chord_m))

    def at(y: float, first: float = 0.0) -> Array:
        """Return the section at `y`, from a share of its chord to the trailing edge."""
        behind, height = _section(first)
        c = chord(y)
        return np.stack([x + c * (0.25 - behind), np.full(behind.size, y), z + c * height])

    parts = [Part("wing", wing.name, np.hstack([at(-half), at(0.0), at(half)]), wing.name)]
    for surface in surfaces:
        if surface.on == wing.name:
            ends = [at(y, 1 - surface.chord_fraction) for y in surface.span_m]
            parts.append(Part("surface", surface.name, np.hstack(ends), wing.name))
    return parts


def _tail(tail: _Tail, surfaces: tuple[_Surface, ...]) -> list[Part]:
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

        parts.append(Part("tail", panel, np.hstack([at(-0.5, 0.0), at(0.5, 0.0)])))
        for surface in surfaces:
            if surface.on == panel:
                first = 1 - surface.chord_fraction
                parts.append(Part("surface", surface.name, np.hstack([at(-0.5, first), at(0.5, first)])))
    return parts


def _section(first: float) -> tuple[Array, Array]:
    """Return a symmetric section from a share of its chord on: shares behind the nose, and heights."""
    behind = first + (1 - first) * 0.5 * (1 - np.cos(np.linspace(0, pi, 12)))
    height = _THICKNESS * 1.3 * np.sqrt(behind) * (1 - behind)
    return np.concatenate([behind, behind]), np.concatenate([height, -height])


def _rotor(rotor: Rotor, lifting: list[Part]) -> list[Part]:
    """Return the disc, at zero tilt, and the shaft back to the wing that carries it."""
    hub, ahead = np.array(rotor.position_m), shaft_axis(rotor.axis, 0.0)
    group = rotor.wing or ""
    parts = []
    if rotor.diameter_m:
        across = np.linalg.svd(ahead[None])[2][1:]
        angle = np.linspace(0, 2 * pi, _POINTS, endpoint=False)
        rim = rotor.diameter_m / 2 * across.T @ np.stack([np.cos(angle), np.sin(angle)])
        parts.append(Part("rotor", rotor.name, hub[:, None] + rim, group))
    carrier = next((p for p in lifting if p.kind == "wing" and p.group == group), None)
    if carrier is not None:
        back = max(float(ahead @ hub) - float((ahead @ carrier.points).max()), 0.0) + 0.02
        parts.append(Part("shaft", "", np.stack([hub, hub - back * ahead], axis=1), group))
    return parts


def _fuselage(fuselage: _Fuselage, parts: list[Part]) -> Part:
    low = min(float(part.points[0].min()) for part in parts)
    high = max(float(part.points[0].max()) for part in parts)
    radius = np.sqrt(6 * fuselage.volume_m3 / (pi * (high - low))) / 2
    along, around = np.meshgrid(np.linspace(0, pi, 25), np.linspace(0, 2 * pi, 12, endpoint=False))
    ring = radius * np.sin(along)
    _, y, z = fuselage.centre_m
    x = 0.5 * (low + high) + 0.5 * (high - low) * np.cos(along)
    points = np.stack([x, y + ring * np.cos(around), z + ring * np.sin(around)]).reshape(3, -1)
    return Part("fuselage", "", points)
