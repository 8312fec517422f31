"""The V-tail: panels in the wake of the wings, with ruddervators."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from freqid.dynamics.moment_reference_point import moment_about
from freqid.simulate.loads.quantities import Flow, Wake, Wrench
from freqid.simulate.loads.wing import Section, section_loads


class Tail(NamedTuple):
    """Flat panels, the left ones first.

    Attributes
    ----------
    section : Section
        With the lift slope and lift-dependent drag of the finite panel.
    centre : Array, shape (panel, 3)
        Vehicle axes, m.
    up : Array, shape (panel, 3)
        Unit normal of the upper surface, body axes.
    area, chord : Array, shape (panel,)
        m2 and m.
    camber : Array, shape (panel,)
        Slope of the zero-lift line, incidence included, leading edge up.
    flap, flap_moment : Array, shape (panel, surface)
        Change of that slope, and of the moment coefficient, with each deflection, per rad.
    side : Array, shape (panel, 2)
        Share of the left and right half of the wake that each panel is in.
    """

    section: Section
    centre: jax.Array
    up: jax.Array
    area: jax.Array
    chord: jax.Array
    camber: jax.Array
    flap: jax.Array
    flap_moment: jax.Array
    side: jax.Array


def loads(tail: Tail, flow: Flow, wake: Wake, surface: jax.Array) -> Wrench:
    """Return the tail's force, and moment about the vehicle's origin.

    Parameters
    ----------
    tail : Tail
    flow : Flow
    wake : Wake
        What arrives at the tail.
    surface : Array, shape (surface,)
        rad.

    Returns
    -------
    Wrench
    """
    velocity = flow.velocity + jnp.cross(flow.rates, tail.centre)
    zero = jnp.zeros(tail.area.shape)
    velocity = velocity + jnp.stack([tail.side @ wake.blowing, zero, -(tail.side @ wake.downwash)], axis=-1)
    u, w = velocity[:, 0], -jnp.sum(velocity * tail.up, axis=-1)
    slope = tail.camber + tail.flap @ surface
    _, fx, fz, m = section_loads(tail.section, u, w, slope, tail.flap_moment @ surface)
    dynamic = 0.5 * flow.rho * tail.area
    force = jnp.stack([dynamic * fx, zero, zero], axis=-1) - (dynamic * fz)[:, None] * tail.up
    span = jnp.cross(jnp.array([1.0, 0.0, 0.0]), tail.up)
    moment = moment_about(tail.centre, force, (dynamic * tail.chord * m)[:, None] * span, axis=-1)
    return Wrench(force.sum(axis=0), moment.sum(axis=0))
