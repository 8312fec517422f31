"""The body between the wings: drag across and along it, and the moment of a slender body."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from freqid.simulate.loads.quantities import Flow, Wrench

SMALLEST_SPEED = 0.02  # m/s


class Fuselage(NamedTuple):
    """The body.

    Attributes
    ----------
    centre : Array, shape (3,)
        Where its drag acts, vehicle axes, m.
    drag_area : Array, shape (3,)
        Drag coefficient times area for flow along x, y and z, m2.
    volume : Array, shape ()
        Effective volume of the slender-body moment, m3.
    """

    centre: jax.Array
    drag_area: jax.Array
    volume: jax.Array


def loads(fuselage: Fuselage, flow: Flow) -> Wrench:
    """Return the body's force, and moment about the vehicle's origin.

    Parameters
    ----------
    fuselage : Fuselage
    flow : Flow

    Returns
    -------
    Wrench

    References
    ----------
    Munk, M. M., "The Aerodynamic Forces on Airship Hulls", NACA Report 184, 1924.
    """
    velocity = flow.velocity + jnp.cross(flow.rates, fuselage.centre)
    speed = jnp.sqrt(jnp.sum(velocity**2) + SMALLEST_SPEED**2)
    force = -0.5 * flow.rho * speed * fuselage.drag_area * velocity
    u, v, w = velocity
    munk = flow.rho * fuselage.volume * u * jnp.stack([jnp.zeros_like(u), w, -v])
    return Wrench.of(force, fuselage.centre, munk)
