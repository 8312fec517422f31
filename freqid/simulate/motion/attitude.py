"""Attitude as a unit quaternion, scalar first, that turns body components into north-east-down ones."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from freqid.dynamics import frames
from freqid.dynamics import precision as precision


def cross(a: jax.Array, b: jax.Array) -> jax.Array:
    """Return a x b along the last axis."""
    return frames.cross(a, b, axis=-1)


def to_ground(attitude: jax.Array, vector: jax.Array) -> jax.Array:
    """Return a vector given in body axes in north-east-down axes, shape (3,)."""
    turned = cross(attitude[1:], vector)
    return vector + 2 * (attitude[0] * turned + cross(attitude[1:], turned))


def to_body(attitude: jax.Array, vector: jax.Array) -> jax.Array:
    """Return a vector given in north-east-down axes in body axes, shape (3,)."""
    turned = cross(vector, attitude[1:])
    return vector + 2 * (attitude[0] * turned + cross(turned, attitude[1:]))


def down(attitude: jax.Array) -> jax.Array:
    """Return the unit vector that points down, body axes, shape (3,)."""
    w, x, y, z = attitude
    return jnp.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])


def rate(attitude: jax.Array, rates: jax.Array) -> jax.Array:
    """Return the quaternion's rate of change, 1/s, shape (4,), from p q r in rad/s."""
    scalar, vector = attitude[0], attitude[1:]
    turning = scalar * rates + cross(vector, rates)
    return 0.5 * jnp.concatenate([-(vector * rates).sum(keepdims=True), turning])


def from_euler(phi: ArrayLike, theta: ArrayLike, psi: ArrayLike) -> jax.Array:
    """Return the quaternion of roll, pitch and heading angle (rad; turned in the order psi, theta, phi)."""
    (cr, cp, cy), (sr, sp, sy) = (
        f(jnp.asarray([phi, theta, psi], dtype=float) / 2) for f in (jnp.cos, jnp.sin)
    )
    return jnp.stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def euler(attitude: jax.Array) -> jax.Array:
    """Return roll, pitch and heading angle, rad, shape (..., 3), of quaternions, shape (..., 4).

    References
    ----------
    Stevens, Lewis & Johnson, *Aircraft Control and Simulation*, 3rd ed., section 1.8.
    """
    w, x, y, z = jnp.moveaxis(attitude, -1, 0)
    phi = jnp.arctan2(2 * (y * z + w * x), 1 - 2 * (x * x + y * y))
    theta = jnp.arcsin(jnp.clip(2 * (w * y - x * z), -1, 1))
    psi = jnp.arctan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z))
    return jnp.stack([phi, theta, psi], axis=-1)
