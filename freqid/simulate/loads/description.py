"""The airframe's parameters, made from a scenario."""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import UsageError
from freqid.core.scenario import Scenario
from freqid.core.vehicle import Vehicle
from freqid.dynamics.frames import shaft_axis
from freqid.dynamics.precision import doubles
from freqid.simulate import effects
from freqid.simulate.effects import library
from freqid.simulate.effects.needs import unmet
from freqid.simulate.effects.places import order
from freqid.simulate.loads.airframe import Geometry, Parameters
from freqid.simulate.loads.coefficient_section import (
    SECTION,
    Table,
    factors_of,
    points_and_values,
    read_coefficients,
)
from freqid.simulate.loads.coefficients import Coefficients, Grid, Layout, variables_of
from freqid.simulate.loads.frames import Frames
from freqid.simulate.loads.fuselage import Fuselage
from freqid.simulate.loads.propeller import Propellers
from freqid.simulate.loads.sections import (
    PANELS,
    AerofoilSection,
    AirframeSection,
    PropellerSection,
    read_airframe,
)
from freqid.simulate.loads.slipstream import Slipstreams
from freqid.simulate.loads.tail import Tail
from freqid.simulate.loads.wake import Wakes
from freqid.simulate.loads.wing import Section, Wings, flap_effect, induction, strip_centres, strip_edges

Floats = NDArray[np.float64]

_NO_PROPELLER = PropellerSection(thrust=(0.0, 0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.0, 0.0))


def parameters(scenario: Scenario) -> Parameters | Coefficients:
    """Return the airframe's parameters.

    Parameters
    ----------
    scenario : Scenario

    Returns
    -------
    airframe.Parameters or coefficients.Coefficients
        A tree of arrays, by the kind of ``[simulation]``.

    Raises
    ------
    UsageError
        Where the section of that kind is missing, has an unknown key or does not fit the vehicle.
    """
    of_kind = {"airframe": _strips, "coefficients": _coefficients}
    return of_kind[scenario.simulation.kind](scenario)


def absent_effects(scenario: Scenario) -> tuple[str, ...]:
    """Return the effects of strips and slipstreams, which a simulation by coefficients does not have."""
    return {"airframe": (), "coefficients": ("slipstream", "wing_wake")}[scenario.simulation.kind]


def _strips(scenario: Scenario) -> Parameters:
    section, vehicle = read_airframe(scenario), scenario.aircraft()
    body = section.fuselage
    return doubles(
        Parameters,
        frames=_frames(vehicle),
        propellers=_propellers(section.propeller, vehicle),
        slipstreams=_slipstreams(section, vehicle),
        wings=_wings(section, vehicle),
        wakes=_wakes(section, vehicle),
        fuselage=doubles(
            Fuselage,
            centre=np.array(body.centre_m),
            drag_area=np.array(body.drag_area_m2),
            volume=body.volume_m3,
        ),
        tail=_tail(section, vehicle),
        geometry=_geometry(vehicle),
        effects=_effects(scenario, vehicle),
    )


def _coefficients(scenario: Scenario) -> Coefficients:
    section, vehicle = read_coefficients(scenario), scenario.aircraft()
    terms = [
        (name, factors_of(product), term, f"{SECTION}.{name}, term '{product}'")
        for name, product, term in section.terms()
    ]
    products = tuple(dict.fromkeys(factors for _, factors, _, _ in terms))
    grids: dict[tuple, list[tuple[int, int, Floats]]] = {}
    constant = np.zeros((len(section.names), len(products)))
    for name, factors, term, where in terms:
        points, values = points_and_values(term, where)
        at = section.names.index(name), products.index(factors)
        if isinstance(term, Table):
            grids.setdefault((term.variables, points), []).append((*at, values))
        else:
            constant[at] += values
    layout = Layout(
        section.names,
        products,
        tuple(variables for variables, _ in grids),
        *(
            tuple(e.name for e in vehicle.effectors if e.kind == kind)
            for kind in ("surface", "tilt", "rotor")
        ),
    )
    filled = []
    for (_, points), tables in grids.items():
        whole = np.zeros((*constant.shape, *(len(row) for row in points)))
        for row, column, values in tables:
            whole[row, column] += values
        filled.append(doubles(Grid, points=tuple(np.array(row) for row in points), values=whole))
    nondimensional = section.form == "coefficient"
    rotors = {r.name: r.diameter_m or 0.0 for r in vehicle.rotors}
    return doubles(
        Coefficients,
        layout=layout,
        constant=constant,
        grids=tuple(filled),
        about=np.array([section.about.get(name, 0.0) for name in variables_of(layout)]),
        lengths=np.array([vehicle.span_m or 0.0, vehicle.chord_m or 0.0]),
        arms=np.array([vehicle.span_m, vehicle.chord_m] if nondimensional else [1.0, 1.0]),
        area=vehicle.area_m2 if nondimensional else 1.0,
        per_pressure=float(nondimensional),
        point=np.array(section.point_m or vehicle.mass_properties.cg_m),
        diameter=np.array([rotors.get(name, 0.0) for name in layout.rotors]),
        frames=_frames(vehicle),
        propellers=_propellers(section.propeller or _NO_PROPELLER, vehicle),
        geometry=_geometry(vehicle),
        effects=_effects(scenario, vehicle),
    )


def _frames(vehicle: Vehicle) -> Frames:
    return doubles(Frames, pivot=np.vstack([*(w.pivot_m for w in vehicle.wings), np.zeros(3)]))


def _geometry(vehicle: Vehicle) -> Geometry:
    return doubles(
        Geometry,
        area=vehicle.area_m2 or 0.0,
        span=vehicle.span_m or 0.0,
        chord=vehicle.chord_m or 0.0,
        centre=np.array(vehicle.mass_properties.cg_m),
        surfaces=order(vehicle, "surface"),
        rotors=order(vehicle, "rotor"),
    )


def _effects(scenario: Scenario, vehicle: Vehicle) -> effects.Settings:
    """Return the settings of every effect; those that act must have what they need of the vehicle."""
    found = effects.settings(scenario.simulation.effects, vehicle)
    for identifier in absent_effects(scenario):
        if identifier in scenario.simulation.effects:
            raise UsageError(
                f"effect '{identifier}' acts in strips and slipstreams, which a simulation by coefficients "
                "does not have",
                remedy=f"describe it in the tables of [{SECTION}]",
            )
    for identifier, effect in library().items():
        missing = [n for n in unmet(effect, vehicle) if n.startswith("vehicle.")]
        if missing and found[identifier][effect.size]:
            raise UsageError(
                f"effect '{identifier}' needs {missing[0].partition('.')[2]} of vehicle '{vehicle.name}'",
                remedy="add it to [vehicle] of the scenario, or leave the effect out",
            )
    return found


def _on_frame(vehicle: Vehicle) -> Floats:
    """Return one where a rotor (row) is on a wing, or in the last column on the body."""
    names = [*(w.name for w in vehicle.wings), None]
    found = [[float(r.wing == name) for name in names] for r in vehicle.rotors]
    return np.array(found).reshape(len(vehicle.rotors), len(names))


def _hubs(vehicle: Vehicle) -> Floats:
    """Return the hubs from their frames' origins, shape (rotor, 3), m."""
    pivots = np.array([*(w.pivot_m for w in vehicle.wings), (0.0, 0.0, 0.0)])
    hubs = np.array([r.position_m for r in vehicle.rotors]).reshape(-1, 3)
    return hubs - _on_frame(vehicle) @ pivots


def _diameters(vehicle: Vehicle) -> Floats:
    return np.array([r.diameter_m or 0.0 for r in vehicle.rotors])


def _propellers(blades: PropellerSection, vehicle: Vehicle) -> Propellers:
    return doubles(
        Propellers,
        frame=_on_frame(vehicle),
        hub=_hubs(vehicle),
        axis=np.array([shaft_axis(r.axis, 0.0) for r in vehicle.rotors]).reshape(-1, 3),
        spin=np.array([r.spin for r in vehicle.rotors]),
        diameter=_diameters(vehicle),
        thrust=np.array(blades.thrust),
        torque=np.array(blades.torque),
        crossflow_thrust=blades.crossflow_thrust,
        inplane_force=blades.inplane_force,
        hub_moment=blades.hub_moment,
    )


def _quarter_chord(section: AirframeSection, vehicle: Vehicle) -> Floats:
    """Return the quarter-chord lines' x and z from the tilt axes, shape (wing, 2), m."""
    lines = [w.quarter_chord_m for w in section.wing]
    return np.array(lines) - np.array([w.pivot_m for w in vehicle.wings])[:, [0, 2]]


def _slipstreams(section: AirframeSection, vehicle: Vehicle) -> Slipstreams:
    on_wing = _on_frame(vehicle)[:, :-1]
    hubs, line = _hubs(vehicle), on_wing @ _quarter_chord(section, vehicle)
    all_edges = np.array([strip_edges(w.span_m, section.strips) for w in section.wing])
    place = np.zeros((len(section.wing), int(on_wing.sum(axis=0).max(initial=1)), len(hubs)))
    for i in range(len(section.wing)):
        rotors = np.flatnonzero(on_wing[:, i])
        place[i, np.arange(len(rotors)), rotors] = 1.0
    return doubles(
        Slipstreams,
        radius=_diameters(vehicle) / 2,
        distance=hubs[:, 0] - line[:, 0],
        drop=line[:, 1] - hubs[:, 2],
        place=place,
        edges=all_edges[:, None, :] - (place @ hubs[:, 1])[:, :, None],
        width=np.diff(all_edges),
        mixing=section.mixing_m,
    )


def _section(aerofoil: AerofoilSection, slope: float, lift_drag: float) -> Section:
    return doubles(
        Section,
        lift_slope=slope,
        stall=1 - np.cos(aerofoil.stall_rad),
        drag=aerofoil.drag,
        lift_drag=lift_drag,
        plate=aerofoil.plate,
        moment=aerofoil.moment,
    )


def _coverage(edges: Floats, span: tuple[float, float]) -> Floats:
    """Return the share of each strip that a surface covers, shape (strip,)."""
    return np.diff(np.clip(edges, min(span), max(span))) / np.diff(edges)


def _wings(section: AirframeSection, vehicle: Vehicle) -> Wings:
    n, aerofoil = section.strips, section.aerofoil
    surfaces = [e.name for e in vehicle.effectors if e.kind == "surface"]
    shape = (len(section.wing), n)
    centre, chord, width = np.zeros((*shape, 3)), np.zeros(shape), np.zeros(shape)
    flap, flap_moment = np.zeros((*shape, len(surfaces))), np.zeros((*shape, len(surfaces)))
    line = _quarter_chord(section, vehicle)
    for i, wing in enumerate(section.wing):
        edges, y = strip_edges(wing.span_m, n), strip_centres(wing.span_m, n)
        width[i] = np.diff(edges)
        chord[i] = np.interp(np.abs(y), [0, wing.span_m / 2], wing.chord_m)
        centre[i] = np.stack([np.full(n, line[i, 0]), y, np.full(n, line[i, 1])], axis=-1)
        for surface in section.surface:
            if surface.on == wing.name:
                column, covered = surfaces.index(surface.name), _coverage(edges, surface.span_m)
                angle, moment = flap_effect(surface.chord_fraction)
                flap[i, :, column] = section.surface_efficiency * angle * covered
                flap_moment[i, :, column] = section.surface_efficiency * moment * covered
    aspect = np.array([w.span_m**2 for w in section.wing]) / np.sum(chord * width, axis=1)
    # On an elliptic wing, the angle of attack exceeds the section's by CL / (pi A).
    undisturbed = aerofoil.stall_rad * (1 + aerofoil.lift_slope / (pi * aspect))
    return doubles(
        Wings,
        section=_section(aerofoil, aerofoil.lift_slope, aerofoil.lift_drag),
        centre=centre,
        chord=chord,
        width=width,
        induction=np.array(
            [induction(w.span_m, c, aerofoil.lift_slope) for w, c in zip(section.wing, chord, strict=True)]
        ),
        stall_undisturbed=1 - np.cos(undisturbed)[:, None],
        camber=np.full(shape, np.tan(-aerofoil.zero_lift_rad)),
        flap=flap,
        flap_moment=flap_moment,
    )


def _wakes(section: AirframeSection, vehicle: Vehicle) -> Wakes:
    front, rear = section.wing
    halves, received = [], []
    for wing in section.wing:
        edges = strip_edges(wing.span_m, section.strips)
        covered = np.array([_coverage(edges, (-wing.span_m, 0)), _coverage(edges, (0, wing.span_m))])
        halves.append(covered * np.diff(edges) / (wing.span_m / 2))
        received.append(covered.T)
    on_wing = _on_frame(vehicle)[:, :-1]
    y = np.array([r.position_m[1] for r in vehicle.rotors])
    sides = np.array([y < 0, y >= 0]) * on_wing.T[:, None, :]
    lines = np.array([[w.quarter_chord_m[0], 0.0, w.quarter_chord_m[1]] for w in (front, rear)])
    tail = np.array(section.tail.centre_m) * [1.0, 0.0, 1.0]
    return doubles(
        Wakes,
        halves=np.array(halves),
        rotors=sides / np.maximum(sides.sum(axis=2, keepdims=True), 1),
        span=np.array([[w.span_m] for w in section.wing]),
        behind=np.array([lines[1] - lines[0], tail - lines[1]]),
        depth=section.wake.depth_m,
        downwash=section.wake.downwash,
        blowing=section.wake.blowing,
        received=received[1],
        distance=np.linalg.norm(lines[1] - lines[0]),
    )


def _tail(section: AirframeSection, vehicle: Vehicle) -> Tail:
    tail, surfaces = section.tail, [e.name for e in vehicle.effectors if e.kind == "surface"]
    aspect = tail.span_m / tail.chord_m
    slope = tail.aerofoil.lift_slope / (1 + tail.aerofoil.lift_slope / (pi * aspect))
    sides = np.array([-1.0, 1.0])
    flap, flap_moment = np.zeros((2, len(surfaces))), np.zeros((2, len(surfaces)))
    for surface in section.surface:
        if surface.on in PANELS:
            at = PANELS.index(surface.on), surfaces.index(surface.name)
            angle, moment = flap_effect(surface.chord_fraction)
            flap[at] = section.surface_efficiency * angle
            flap_moment[at] = section.surface_efficiency * moment
    x, y, z = tail.centre_m
    return doubles(
        Tail,
        section=_section(tail.aerofoil, slope, tail.aerofoil.lift_drag + slope**2 / (pi * aspect)),
        centre=np.array([[x, side * y, z] for side in sides]),
        up=np.array([[0, -side * np.sin(tail.dihedral_rad), -np.cos(tail.dihedral_rad)] for side in sides]),
        area=np.full(2, tail.span_m * tail.chord_m),
        chord=np.full(2, tail.chord_m),
        camber=np.full(2, np.tan(tail.incidence_rad - tail.aerofoil.zero_lift_rad)),
        flap=flap,
        flap_moment=flap_moment,
        side=np.eye(2),
    )
