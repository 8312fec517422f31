"""Axes and points: body and stability axes, tilted shafts, flow angles, an accelerometer's position.

Body axes are x forward, y right, z down. Vectors have shape (3, ...): the component comes first, so
that one row is one channel; further axes, samples as a rule, broadcast.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from freqid.core.arrays import Array
from freqid.core.errors import UsageError

Vector = TypeVar("Vector")


def cross(a: Any, b: Vector, *, axis: int = 0) -> Vector:
    """Return a x b of numpy or jax arrays, in less time than ``numpy.cross`` and ``jnp.cross`` take.

    Parameters
    ----------
    a, b : array
        Their other axes broadcast.
    axis : {0, -1}
        Along which the components are: shape (3, ...) or (..., 3).
    """
    pair: Any = a, b
    (ax, ay, az), (bx, by, bz) = ((v[..., 0], v[..., 1], v[..., 2]) for v in pair) if axis else pair
    components: Any = (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
    of_numpy = isinstance(components[0], np.ndarray | np.generic)
    arrays: Any = np if of_numpy else components[0].__array_namespace__()
    return arrays.stack(components, axis=axis)


def turn_about_y(vector: ArrayLike, angle: ArrayLike) -> Array:
    """Turn vectors about +y, right-handed: a positive angle lifts the leading edge.

    Parameters
    ----------
    vector : array_like, shape (3, ...)
        Any unit.
    angle : array_like, shape (...)
        Turn, rad.

    Returns
    -------
    ndarray, shape (3, ...)
        The turned vectors, in the axes that `vector` is given in.

    Notes
    -----
    ``x cos + z sin, y, -x sin + z cos``: the forward shaft (1, 0, 0) at 90 deg points up, (0, 0, -1).
    """
    x, y, z = np.asarray(vector, dtype=float)
    cosine, sine = np.cos(angle), np.sin(angle)
    turned = (x * cosine + z * sine, y, z * cosine - x * sine)
    return np.stack(np.broadcast_arrays(*turned))


def shaft_axis(axis: ArrayLike, tilt: ArrayLike) -> Array:
    """Return the direction of a rotor's shaft, a unit vector, while its wing tilts.

    Parameters
    ----------
    axis : array_like, shape (3,)
        Shaft at zero tilt, thrust side, body axes; of any length.
    tilt : array_like, shape (...)
        Tilt angle, rad, positive leading edge up; 0 for a rotor on the body.

    Returns
    -------
    ndarray, shape (3, ...)

    Raises
    ------
    UsageError
        Where the axis has no direction.
    """
    length = np.linalg.norm(axis)
    if not (np.isfinite(length) and length > 0):
        raise UsageError(
            f"rotor axis {list(np.asarray(axis))} has no direction, expected a vector like [1, 0, 0]"
        )
    return turn_about_y(np.asarray(axis, dtype=float) / length, tilt)


def stability_from_body(alpha: float) -> Array:
    """Return the matrix, shape (3, 3), that takes body components to stability axes.

    Stability axes are body axes turned about y until x is along the projection of the reference
    velocity on the plane of symmetry. Z stays positive down and is minus the lift.

    Parameters
    ----------
    alpha : float
        Reference angle of attack, rad.

    References
    ----------
    Klein & Morelli, Aircraft System Identification, 2nd ed., chapter 3, axis systems.
    """
    # Turning the axes by -alpha about y turns the components by +alpha.
    return turn_about_y(np.eye(3), alpha)


def level_from_body(attitude: Array) -> Array:
    """Return the matrices, shape (3, 3, ...), that take body components to north, east and down.

    Parameters
    ----------
    attitude : ndarray, shape (3, ...)
        phi theta psi, rad.

    References
    ----------
    Klein & Morelli, Aircraft System Identification, 2nd ed., chapter 3, Euler angles.
    """
    (cf, ct, cp), (sf, st, sp) = np.cos(attitude), np.sin(attitude)
    return np.array(
        [
            [ct * cp, sf * st * cp - cf * sp, cf * st * cp + sf * sp],
            [ct * sp, sf * st * sp + cf * cp, cf * st * sp - sf * cp],
            [-st, sf * ct, cf * ct],
        ]
    )


def flow_angles(velocity: Array) -> tuple[Array, Array, Array]:
    """Return airspeed, angle of attack and angle of sideslip.

    Parameters
    ----------
    velocity : ndarray, shape (3, ...)
        u v w, relative to the air, m/s.

    Returns
    -------
    speed, alpha, beta : ndarray, shape (...)
        m/s, rad, rad. ``alpha = atan2(w, u)``, from -pi to pi; ``beta = asin(v / V)``, evaluated as
        ``atan2(v, hypot(u, w))``, which stays defined at rest.
    """
    u, v, w = velocity
    in_plane = np.hypot(u, w)
    return np.hypot(in_plane, v), np.arctan2(w, u), np.arctan2(v, in_plane)


def body_velocity(speed: ArrayLike, alpha: ArrayLike, beta: ArrayLike) -> Array:
    """Return u v w, shape (3, ...), m/s: the inverse of `flow_angles`.

    Parameters
    ----------
    speed, alpha, beta : array_like, shape (...)
        m/s, rad, rad.
    """
    in_plane = speed * np.cos(beta)
    velocity = (in_plane * np.cos(alpha), speed * np.sin(beta), in_plane * np.sin(alpha))
    return np.stack(np.broadcast_arrays(*velocity))


def specific_force_at(force: Array, rates: Array, acceleration: Array, offset: ArrayLike) -> Array:
    """Return the specific force at another point of a rigid body.

    Parameters
    ----------
    force : ndarray, shape (3, sample)
        ax ay az at the first point, m/s2.
    rates, acceleration : ndarray, shape (3, sample)
        p q r, rad/s, and their derivatives, rad/s2.
    offset : array_like, shape (3,)
        From the first point to the second, body axes, m.

    Returns
    -------
    ndarray, shape (3, sample)
        m/s2.

    Notes
    -----
    ``a + w' x d + w x (w x d)``; with d = -r it is the ``a_m - w' x r - w x (w x r)`` that brings a
    sensor at r from the centre of gravity to it (Klein & Morelli, 2nd ed., chapter 10).
    """
    arm = np.asarray(offset, dtype=float)[:, None]
    return force + cross(acceleration, arm) + cross(rates, cross(rates, arm))
