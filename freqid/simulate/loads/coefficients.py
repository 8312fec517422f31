"""Loads from coefficients: derivatives that may be tables, and propellers beside them.

Every coefficient is a sum of terms, a derivative times a product of variables. All derivatives stand in one
matrix, coefficient by product, which the tables fill at each instant: it is also what a local
identification should find.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import NamedTuple

import jax
import jax.numpy as jnp

from freqid.dynamics import precision as precision
from freqid.simulate.loads.airframe import Geometry
from freqid.simulate.loads.frames import Frames, motion, total
from freqid.simulate.loads.propeller import Propellers, rotor_loads
from freqid.simulate.loads.quantities import Aero, Flow, Positions, Wake, Wrench
from freqid.simulate.motion.attitude import cross

MOTION = ("u", "v", "w", "p", "q", "r", "V", "alpha", "beta", "phat", "qhat", "rhat")
ADVANCE_RATIO = "J"
HIGHEST_ADVANCE_RATIO = 1000.0
"""Of a rotor that stands still; its slipstream adds less than 1e-5 of the airspeed."""

_SMALLEST_SPEED = 0.1  # m/s, keeps angles and ratios defined at rest


@jax.tree_util.register_static
@dataclass(frozen=True)
class Layout:
    """What the numbers of `Coefficients` belong to.

    Attributes
    ----------
    names : tuple of str
        Coefficients, in the order of the rows.
    products : tuple of tuple of str
        Factors by column; the empty product is the constant.
    grids : tuple of tuple of str
        Variables of each grid of tables.
    surfaces, tilts, rotors : tuple of str
        Effectors of each kind, in their order.
    """

    names: tuple[str, ...]
    products: tuple[tuple[str, ...], ...]
    grids: tuple[tuple[str, ...], ...]
    surfaces: tuple[str, ...]
    tilts: tuple[str, ...]
    rotors: tuple[str, ...]


class Grid(NamedTuple):
    """Tables over the same points.

    Attributes
    ----------
    points : tuple of Array
        Of each variable, increasing.
    values : Array, shape (name, product, point of the first variable, ...)
        Zero where a derivative is no table on this grid.
    """

    points: tuple[jax.Array, ...]
    values: jax.Array


class Coefficients(NamedTuple):
    """An airframe that is described by coefficients; the counterpart of `airframe.Parameters`.

    Attributes
    ----------
    layout : Layout
    constant : Array, shape (name, product)
        Derivatives that are no tables.
    grids : tuple of Grid
    about : Array, shape (variable,)
        By the variables of `variables_of`: products are of the departures from these.
    lengths : Array, shape (2,)
        Span and chord, of the nondimensional rates, m.
    area : Array, shape ()
        Of forces, m2; one for loads in N and N m.
    arms : Array, shape (2,)
        Span and chord, of moments, m; likewise.
    per_pressure : Array, shape ()
        One where coefficients are multiplied by the dynamic pressure, zero where they are forces.
    point : Array, shape (3,)
        Where the motion is taken and about which the moments are, vehicle axes, m.
    diameter : Array, shape (rotor,)
        For the advance ratio; zero for rotors that do not count, m.
    frames : Frames
    propellers : Propellers
    geometry : Geometry
    effects : dict of dict of Array, shape ()
    """

    layout: Layout
    constant: jax.Array
    grids: tuple[Grid, ...]
    about: jax.Array
    lengths: jax.Array
    area: jax.Array
    arms: jax.Array
    per_pressure: jax.Array
    point: jax.Array
    diameter: jax.Array
    frames: Frames
    propellers: Propellers
    geometry: Geometry
    effects: dict[str, dict[str, jax.Array]]

    def loads(self, flow: Flow, positions: Positions, arriving: Wake | None) -> Aero:
        """Return the loads before any effect is added; there is no wake that arrives late."""
        at = motion(self.frames, flow, positions)
        inplane = self.effects["rotor_inplane_force"]
        discs, loads = rotor_loads(self.propellers, at, positions.speed, flow.rho, inplane)
        thrust = total(self.frames, at, loads[:, :3], loads[:, 3:])
        air = _wrench(self, flow, positions)
        still = jnp.zeros(2)
        return Aero(
            wrench=Wrench(thrust.force + air.force, thrust.moment + air.moment),
            torque=discs.torque,
            thrust=discs.thrust,
            shed=Wake(still, still),
        )

    def convection_time(self, flow: Flow) -> jax.Array:
        """Return zero: nothing is shed."""
        return 0.0 * flow.rho


def variables_of(layout: Layout) -> tuple[str, ...]:
    """Return the variables that terms and tables may name, in the order of `Coefficients.about`."""
    return (*MOTION, ADVANCE_RATIO, *layout.surfaces, *layout.tilts, *layout.rotors)


def variables(parameters: Coefficients, flow: Flow, positions: Positions) -> dict[str, jax.Array]:
    """Return every variable by name; ``J`` is V / n D, n D the mean over the rotors that have a diameter."""
    velocity = flow.velocity + cross(flow.rates, parameters.point)
    speed = jnp.sqrt((velocity**2).sum() + _SMALLEST_SPEED**2)
    span, chord = parameters.lengths
    turning = flow.rates / (2 * speed)
    layout = parameters.layout
    found: dict[str, jax.Array] = dict(zip("uvwpqr", [*velocity, *flow.rates], strict=True))
    found |= {
        "V": speed,
        "alpha": jnp.arctan2(velocity[2], velocity[0]),
        "beta": jnp.arcsin(velocity[1] / speed),
        "phat": turning[0] * span,
        "qhat": turning[1] * chord,
        "rhat": turning[2] * span,
        ADVANCE_RATIO: _advance_ratio(parameters.diameter, positions.speed, speed),
    }
    for names, values in (
        (layout.surfaces, positions.surface),
        (layout.tilts, positions.tilt),
        (layout.rotors, positions.speed),
    ):
        found |= {name: values[i] for i, name in enumerate(names)}
    return found


def derivatives(parameters: Coefficients, at: dict[str, jax.Array]) -> jax.Array:
    """Return the matrix of derivatives at given variables, shape (name, product).

    Tables are straight between their points and held beyond their ends.
    """
    found = parameters.constant
    for names, grid in zip(parameters.layout.grids, parameters.grids, strict=True):
        values = grid.values
        for name, points in zip(reversed(names), reversed(grid.points), strict=True):
            values = values @ _weights(points, at[name])
        found = found + values
    return found


def coefficients(parameters: Coefficients, at: dict[str, jax.Array]) -> dict[str, jax.Array]:
    """Return the coefficients, or forces and moments, by name."""
    layout = parameters.layout
    about = dict(zip(variables_of(layout), parameters.about, strict=True))
    columns = []
    for factors in layout.products:
        product = jnp.ones(())
        for name in factors:
            product = product * (at[name] - about[name])
        columns.append(product)
    values = derivatives(parameters, at) @ jnp.stack(columns)
    return {name: values[i] for i, name in enumerate(layout.names)}


def _wrench(parameters: Coefficients, flow: Flow, positions: Positions) -> Wrench:
    """Return what the air does to the airframe, about the vehicle's origin."""
    at = variables(parameters, flow, positions)
    found, zero = coefficients(parameters, at), jnp.zeros(())

    def of(*names: str) -> jax.Array:
        return sum((found[name] for name in names if name in found), zero)

    cos, sin = jnp.cos(at["alpha"]), jnp.sin(at["alpha"])
    drag, lift = of("CD"), of("CL")
    force = jnp.stack(
        [of("CX", "X") - drag * cos + lift * sin, of("CY", "Y"), of("CZ", "Z") - drag * sin - lift * cos]
    )
    span, chord = parameters.arms
    moment = jnp.stack([span * of("Cl", "L"), chord * of("Cm", "M"), span * of("Cn", "N")])
    pressure = 0.5 * flow.rho * ((flow.velocity + cross(flow.rates, parameters.point)) ** 2).sum()
    scale = parameters.area * (parameters.per_pressure * pressure + 1 - parameters.per_pressure)
    force, moment = scale * force, scale * moment
    return Wrench.of(force, parameters.point, moment)


def _advance_ratio(diameter: jax.Array, speed: jax.Array, airspeed: jax.Array) -> jax.Array:
    """Return J; its inverse is bounded, so that a rotor that stands still has derivatives too."""
    counted = jnp.maximum((diameter > 0).sum(), 1)
    inverse = (speed * diameter).sum() / counted / (2 * pi * airspeed)
    return 1 / jnp.maximum(inverse, 1 / HIGHEST_ADVANCE_RATIO)


def _weights(points: jax.Array, value: jax.Array) -> jax.Array:
    """Return what each point of a table counts, shape (point,)."""
    passed = jnp.clip((value - points[:-1]) / jnp.diff(points), 0.0, 1.0)
    return jnp.concatenate([jnp.ones(1), passed]) - jnp.concatenate([passed, jnp.zeros(1)])
