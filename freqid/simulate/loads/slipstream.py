"""Slipstreams by momentum theory: induced velocity, acceleration and contraction, wetted span."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import jax
import jax.numpy as jnp

from freqid.simulate.loads.propeller import Discs

SMALLEST_SPEED = 0.1  # m/s, through the disc
DESCENT = 1.0  # m/s, over which momentum theory is faded out where a rotor meets its own wake
NEWTON_STEPS = 5


class Slipstreams(NamedTuple):
    """Where the slipstreams meet the wings that carry their rotors.

    Attributes
    ----------
    radius : Array, shape (rotor,)
        Of the discs, m.
    distance : Array, shape (rotor,)
        From the disc back to the wing's quarter-chord line, m.
    drop : Array, shape (rotor,)
        Height of the quarter-chord line below the shaft, m.
    place : Array, shape (wing, place, rotor)
        One where the rotor takes that place on that wing; otherwise zero.
    edges : Array, shape (wing, place, strip + 1)
        Ends of the wing's strips to the right of the shaft of the rotor in that place, m.
    width : Array, shape (wing, strip)
        m.
    mixing : Array, shape ()
        Half the thickness of the slipstream's edge, m.
    """

    radius: jax.Array
    distance: jax.Array
    drop: jax.Array
    place: jax.Array
    edges: jax.Array
    width: jax.Array
    mixing: jax.Array


def induced_velocity(
    thrust: jax.Array, axial: jax.Array, inplane: jax.Array, area: jax.Array, rho: jax.Array
) -> jax.Array:
    """Return the velocity that thrust induces at the disc, ``T = 2 rho A v |V + v e|``.

    Parameters
    ----------
    thrust, axial, inplane : Array, shape (rotor,)
        N; velocity of the disc along its axis and across it, m/s.
    area : Array, shape (rotor,)
        m2.
    rho : Array, shape ()
        kg/m3.

    Returns
    -------
    Array, shape (rotor,)
        Against the thrust, m/s.

    Notes
    -----
    A fixed number of Newton steps, so that it differentiates. In descent, where momentum theory has no
    single solution (vortex ring), the axial velocity fades from the equation: the induced velocity then
    stays that of hover.

    References
    ----------
    Glauert, H., *The Elements of Aerofoil and Airscrew Theory*, 2nd ed., 1947; Leishman, J. G.,
    *Principles of Helicopter Aerodynamics*, 2nd ed., eqs. 2.127 and 2.135.
    """
    climb = axial * 0.5 * (1 + jnp.tanh(axial / DESCENT))
    # Momentum theory knows no disc that takes more than k = -U^2/4 from the wind.
    k = jnp.maximum(thrust / (2 * rho * area), -0.24 * climb**2 - 1e-3)
    across = inplane**2 + SMALLEST_SPEED**2
    # The solution without cross-flow starts Newton's method; its derivative does not matter.
    speed2 = 0.25 * (climb**2 + across)
    v = jax.lax.stop_gradient(jnp.sqrt(jnp.maximum(speed2 + k, 0.0)) - jnp.sqrt(speed2))
    for _ in range(NEWTON_STEPS):
        through = climb + v
        s2 = through**2 + across
        v = v - (v * s2 - k * jnp.sqrt(s2)) / (s2 + v * through)
    return v


def added_velocity(slipstreams: Slipstreams, discs: Discs, rho: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return what the rotors add to the flow over their wings, and at their discs.

    Parameters
    ----------
    slipstreams : Slipstreams
    discs : Discs
    rho : Array, shape ()
        kg/m3.

    Returns
    -------
    over_wing : Array, shape (wing, strip)
        Mean added velocity along the chord over each strip, m/s.
    at_disc : Array, shape (rotor,)
        Induced velocity v at the disc; 2 v far behind, m/s.

    Notes
    -----
    Behind the disc the induced velocity grows as on the axis of a semi-infinite vortex cylinder,
    ``v (1 + s / sqrt(s^2 + R^2))``, the radius follows from continuity, and the cross-flow carries the
    slipstream sideways. Neighbouring slipstreams add up where their edges overlap. No swirl.

    References
    ----------
    McCormick, B. W., *Aerodynamics of V/STOL Flight*, 1967, chapter 4.
    """
    radius, distance, mixing = slipstreams.radius, slipstreams.distance, slipstreams.mixing
    across = jnp.sum(discs.inplane**2, axis=-1)
    v = induced_velocity(discs.thrust, discs.axial, jnp.sqrt(across + 1e-12), pi * radius**2, rho)
    behind = v * (1 + distance / jnp.sqrt(distance**2 + radius**2))
    floor = across + SMALLEST_SPEED**2
    at_disc2, behind2 = (discs.axial + v) ** 2 + floor, (discs.axial + behind) ** 2 + floor
    contracted = radius * jnp.sqrt(jnp.sqrt(at_disc2 / behind2))
    # The air moves against the hub's own cross-flow velocity: the slipstream is left behind.
    drift = (distance / jnp.sqrt(at_disc2))[:, None] * discs.inplane
    height = slipstreams.drop + drift[:, 2]
    hit = 0.5 * (_step(height + contracted, mixing) - _step(height - contracted, mixing))
    of_rotor = jnp.stack([hit * behind, contracted, drift[:, 1]], axis=-1)
    velocity, reach, aside = jnp.einsum("wpr,rk->kwp", slipstreams.place, of_rotor)[..., None]
    edges = slipstreams.edges + aside
    # Integrals over the span of a smooth step at either edge; strips see the difference over their width.
    left, right = jnp.sqrt((edges + reach) ** 2 + mixing**2), jnp.sqrt((edges - reach) ** 2 + mixing**2)
    wetted = jnp.sum(0.5 * velocity * (left - right), axis=1)
    return (wetted[:, 1:] - wetted[:, :-1]) * (1 / slipstreams.width), v


def _step(x: jax.Array, thickness: jax.Array) -> jax.Array:
    """Return a smooth step from -1 to 1."""
    return x / jnp.sqrt(x**2 + thickness**2)
