"""Axes that turn with a tilting wing, and how the vehicle's motion and the loads pass through them.

Everything on a wing is described once, at zero tilt, from a point of its tilt axis; the wing's motion
is carried into the wing's axes instead of the wing's points into the body's.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from freqid.dynamics.moment_reference_point import moment_about
from freqid.simulate.loads.quantities import Flow, Positions, Wrench


class Frames(NamedTuple):
    """The axes of every wing, and last the body's own.

    Attributes
    ----------
    pivot : Array, shape (frame, 3)
        Origin of each frame in vehicle axes, m.
    """

    pivot: jax.Array


class Motion(NamedTuple):
    """How each frame moves through the air, seen in its own axes.

    Attributes
    ----------
    turn : Array, shape (frame, 3, 3)
        Matrix that takes components in the frame's axes to body axes.
    velocity : Array, shape (frame, 3)
        Of the frame's origin relative to the air, m/s.
    rates : Array, shape (frame, 3)
        Angular velocity, the tilt rate included, rad/s.
    """

    turn: jax.Array
    velocity: jax.Array
    rates: jax.Array


def motion(frames: Frames, flow: Flow, positions: Positions) -> Motion:
    """Return how each frame moves through the air.

    Parameters
    ----------
    frames : Frames
    flow : Flow
    positions : Positions

    Returns
    -------
    Motion

    Notes
    -----
    Matrix products, here and in `total`, keep the compiler from evaluating a tilt's sine and cosine anew
    for every strip.
    """
    body = jnp.zeros(1)
    tilt, tilt_rate = jnp.append(positions.tilt, body), jnp.append(positions.tilt_rate, body)
    cos, sin, zero, one = jnp.cos(tilt), jnp.sin(tilt), jnp.zeros_like(tilt), jnp.ones_like(tilt)
    turn = jnp.stack([cos, zero, sin, zero, one, zero, -sin, zero, cos], axis=-1).reshape(-1, 3, 3)
    velocity = flow.velocity + jnp.cross(flow.rates, frames.pivot)
    rates = flow.rates + tilt_rate[:, None] * jnp.array([0.0, 1.0, 0.0])
    seen = jnp.einsum("fkj,fji->fki", jnp.stack([velocity, rates], axis=1), turn)
    return Motion(turn, seen[:, 0], seen[:, 1])


def total(frames: Frames, at: Motion, force: jax.Array, moment: jax.Array) -> Wrench:
    """Sum the loads of all frames.

    Parameters
    ----------
    frames : Frames
    at : Motion
    force, moment : Array, shape (frame, 3)
        In each frame's axes, the moment about its origin; N, N m.

    Returns
    -------
    Wrench
        In body axes, about the vehicle's origin.
    """
    loads = jnp.einsum("fij,fkj->fki", at.turn, jnp.stack([force, moment], axis=1))
    moment = moment_about(frames.pivot, loads[:, 0], loads[:, 1], axis=-1)
    return Wrench(loads[:, 0].sum(axis=0), moment.sum(axis=0))
