"""The wake of a wing with rotors, at the wing and the tail behind it."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from freqid.simulate.loads.quantities import Flow, Wake

SMALLEST_SPEED = 0.5  # m/s


class Wakes(NamedTuple):
    """Geometry of the wakes; the first row is the front wing's, the second the rear wing's.

    Attributes
    ----------
    halves : Array, shape (wing, 2, strip)
        Weights that average the circulation over the left and the right half.
    rotors : Array, shape (wing, 2, rotor)
        Weights that average over the rotors of each half.
    span : Array, shape (wing, 1)
        m.
    behind : Array, shape (wing, 3)
        From each wing's tilt axis to what lies behind it: the rear wing's, and the tail, m.
    depth : Array, shape ()
        Distance from the wake's centre over which it fades, m.
    downwash : Array, shape ()
        Share of the far downwash of an elliptic wing that is felt in the wake's centre.
    blowing : Array, shape ()
        Share of the rotors' far slipstream that is felt there.
    received : Array, shape (strip, 2)
        What each strip of the rear wing receives from the left and the right half.
    distance : Array, shape ()
        From the front wing to the rear wing, m.
    """

    halves: jax.Array
    rotors: jax.Array
    span: jax.Array
    behind: jax.Array
    depth: jax.Array
    downwash: jax.Array
    blowing: jax.Array
    received: jax.Array
    distance: jax.Array


def shed(
    wakes: Wakes,
    velocity: jax.Array,
    shaft: jax.Array,
    circulation: jax.Array,
    induced: jax.Array,
) -> Wake:
    """Return what every wing sends back, with a leading axis over the wings.

    Parameters
    ----------
    wakes : Wakes
    velocity : Array, shape (3,)
        Of the vehicle through the air, body axes, m/s.
    shaft : Array, shape (wing, 3)
        Unit vector forward along each wing's chord, body axes.
    circulation : Array, shape (wing, strip)
        m2/s.
    induced : Array, shape (rotor,)
        Velocity at the discs, m/s.

    Returns
    -------
    Wake
        Each of shape (wing, 2).

    Notes
    -----
    The mean circulation G of a half gives the far downwash ``4 G / (pi b)`` of an elliptic wing, which is
    ``2 CL V / (pi A)``; the rotors give 2 v along their shafts. The wake leaves along the sum of both and
    the free stream; the further it passes from what lies behind, the less of it is felt, and in hover,
    where it goes straight down, nothing.

    References
    ----------
    Klein, V., and Morelli, E. A., *Aircraft System Identification*, 2nd ed., section 3 (downwash and its
    lag); the fading with distance is assumed.
    """
    cos, sin = shaft[:, :1], -shaft[:, 2:]
    mean = jnp.einsum("whs,ws->wh", wakes.halves, circulation)
    downwash = wakes.downwash * 4 / (jnp.pi * wakes.span) * mean
    jet = wakes.blowing * 2 * (wakes.rotors @ induced)
    back, down = velocity[0] + jet * cos, -velocity[2] + jet * sin + downwash
    length = jnp.sqrt(back**2 + down**2 + SMALLEST_SPEED**2)
    along, below = -wakes.behind[:, :1], wakes.behind[:, 2:]
    miss = (along * down - below * back) / length
    ahead = (along * back + below * down) / (length * jnp.sqrt(along**2 + below**2))
    felt = jnp.exp(-((miss / wakes.depth) ** 2)) * jax.nn.sigmoid(8 * ahead)
    return Wake(felt * (downwash + jet * sin), felt * jet * cos)


def convection_time(wakes: Wakes, flow: Flow) -> jax.Array:
    """Return how long the front wing's wake takes to reach the rear wing, s.

    Parameters
    ----------
    wakes : Wakes
    flow : Flow

    Returns
    -------
    Array, shape ()
        Distance over speed; finite in hover, where the wake does not reach the rear wing.
    """
    return wakes.distance / jnp.sqrt(jnp.sum(flow.velocity**2) + 9.0)
