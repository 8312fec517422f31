"""Attitude, velocity and height by integrating gyroscopes and accelerometers, and how errors grow in them.

Earth axes are north, east, down; errors of attitude are small turns about these axes. The velocity is that
of the point where the accelerometers sit, so that nothing need be differentiated for their lever arm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from freqid.core.arrays import Array
from freqid.dynamics.frames import cross, level_from_body

GRAVITY = 9.80665  # standard, m/s2
# Rows of an error state, and what makes them grow from the origin on.
STATES = ("turn north", "turn east", "turn down", "vn", "ve", "vd", "alt")
CAUSES = (*(f"{s} start" for s in STATES), *(f"{n} bias" for n in ("p", "q", "r", "ax", "ay", "az")))


@dataclass(frozen=True, eq=False)
class FlightPath:
    """A motion from inertial sensors alone.

    Attributes
    ----------
    dt : float
        s.
    origin : int
        Sample at which the initial values hold; the motion is integrated from it both ways.
    turn : ndarray, shape (3, 3, sample)
        Takes body components to north, east, down.
    velocity : ndarray, shape (3, sample)
        Of the accelerometers' point over ground, north, east, down, m/s.
    height : ndarray, shape (sample,)
        m.
    force : ndarray, shape (3, sample)
        Specific force in north, east, down, m/s2.
    """

    dt: float
    origin: int
    turn: Array
    velocity: Array
    height: Array
    force: Array


def integrate_path(
    rates: Array,
    force: Array,
    dt: float,
    origin: int,
    attitude: ArrayLike,
    velocity: ArrayLike,
    height: float,
) -> FlightPath:
    """Integrate rates and specific forces from one sample on, both ways.

    Parameters
    ----------
    rates, force : ndarray, shape (3, sample)
        p q r, rad/s, and ax ay az, m/s2, body axes; five samples or more.
    dt : float
        Sampling interval, s.
    origin : int
        Sample at which the initial values hold.
    attitude : array_like, shape (3, 3)
        Turn from body to earth axes there.
    velocity : array_like, shape (3,)
        Of the accelerometers' point, north, east, down, m/s.
    height : float
        m.

    Returns
    -------
    FlightPath

    Notes
    -----
    Rotation vectors of one interval are the integral of the rates, to fourth order in dt, and the cone that
    they describe, ``dt^2/12 w_i x w_(i+1)``. Their running product is taken by doubling, in log2 n passes.

    References
    ----------
    Klein & Morelli, Aircraft System Identification, 2nd ed., ch. 10; Savage, J. Guidance, Control, and
    Dynamics 21(1), 1998 (rotation vectors of an interval); docs/theory/kinematics.md.
    """
    step = np.diff(running_integral(rates, dt))
    step += dt * dt / 12 * cross(rates[:, :-1], rates[:, 1:])
    turned = _matrices(_products(_quaternions(step)))
    turn = np.einsum("ij,kj,kln->iln", np.asarray(attitude, dtype=float), turned[:, :, origin], turned)
    felt = np.einsum("ijn,jn->in", turn, force)
    gained = running_integral(felt + np.array([[0.0], [0.0], [GRAVITY]]), dt)
    speed = np.asarray(velocity, dtype=float)[:, None] + gained - gained[:, origin, None]
    fallen = running_integral(speed[2:], dt)[0]
    return FlightPath(dt, origin, turn, speed, height - fallen + fallen[origin], felt)


def error_growth(path: FlightPath) -> Array:
    """Return how the path changes with its initial values and with biases of its sensors.

    Parameters
    ----------
    path : FlightPath

    Returns
    -------
    ndarray, shape (7, 13, sample)
        Derivatives of `STATES` by `CAUSES`, exact to first order: integrals of what the path already holds.

    Notes
    -----
    With true = measured - bias and a small turn e of the attitude,
    ``e' = - C b_w,  v' = e x f - C b_a,  h' = - v_d``, f the specific force in earth axes.
    """
    samples = path.height.size

    def from_origin(rate: Array) -> Array:
        grown = running_integral(rate, path.dt)
        return grown - grown[..., path.origin, None]

    grown = np.zeros((7, 13, samples))
    grown[np.arange(7), np.arange(7)] = 1.0
    turned = from_origin(path.turn)
    grown[:3, 7:10] = -turned
    grown[3:6, :3] = -skew(from_origin(path.force))
    grown[3:6, 7:10] = from_origin(np.einsum("ijn,jkn->ikn", skew(path.force), turned))
    grown[3:6, 10:13] = -turned
    grown[6, :6] = -from_origin(grown[5, :6])
    grown[6, 7:] = -from_origin(grown[5, 7:])
    return grown


def running_integral(x: Array, dt: float) -> Array:
    """Return the integral from the first sample on, of shape (..., sample), cubic between samples.

    Parameters
    ----------
    x : ndarray, shape (..., sample)
        Four samples or more.
    dt : float
        Sampling interval, s.
    """
    piece = np.empty_like(x[..., 1:])
    piece[..., 1:-1] = 13 * (x[..., 1:-2] + x[..., 2:-1]) - x[..., :-3] - x[..., 3:]
    piece[..., 0] = 9 * x[..., 0] + 19 * x[..., 1] - 5 * x[..., 2] + x[..., 3]
    piece[..., -1] = 9 * x[..., -1] + 19 * x[..., -2] - 5 * x[..., -3] + x[..., -4]
    total = np.zeros_like(x)
    np.cumsum(piece * (dt / 24), axis=-1, out=total[..., 1:])
    return total


def attitude_matrix(phi: float, theta: float, psi: float) -> Array:
    """Return the turn from body to north, east, down, shape (3, 3), of Euler angles, rad."""
    return level_from_body(np.array([phi, theta, psi]))


def euler_angles(turn: Array) -> Array:
    """Return phi, theta, psi, shape (3, sample), rad, without jumps, of turns of shape (3, 3, sample)."""
    phi = np.unwrap(np.arctan2(turn[2, 1], turn[2, 2]))
    theta = -np.arcsin(np.clip(turn[2, 0], -1.0, 1.0))
    return np.stack((phi, theta, np.unwrap(np.arctan2(turn[1, 0], turn[0, 0]))))


def skew(vector: Array) -> Array:
    """Return the matrices, shape (3, 3, ...), whose product with b is vector x b."""
    x, y, z = vector
    o = np.zeros_like(x)
    return np.array([[o, -z, y], [z, o, -x], [-y, x, o]])


def _quaternions(step: Array) -> Array:
    """Return unit quaternions, shape (4, n + 1), of rotation vectors, shape (3, n), the first one neutral."""
    angle = np.linalg.norm(step, axis=0)
    turned = np.concatenate((np.cos(angle / 2)[None], step * np.sinc(angle / (2 * np.pi)) / 2))
    return np.concatenate((np.array([[1.0], [0.0], [0.0], [0.0]]), turned), axis=1)


def _products(q: Array) -> Array:
    """Return the running products q_0 q_1 ... q_i, shape (4, n), by doubling the reach in each pass."""
    reach = 1
    while reach < q.shape[1]:
        a, b = q[:, :-reach], q[:, reach:]
        scalar = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
        vector = a[0] * b[1:] + b[0] * a[1:] + cross(a[1:], b[1:])
        q = np.concatenate((q[:, :reach], np.concatenate((scalar[None], vector))), axis=1)
        reach *= 2
    return q / np.linalg.norm(q, axis=0)


def _matrices(q: Array) -> Array:
    """Return rotation matrices, shape (3, 3, n), of unit quaternions."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def turned_by(step: Array) -> Array:
    """Return the rotation matrix, shape (3, 3), of a rotation vector, shape (3,), rad."""
    return _matrices(_quaternions(step[:, None]))[:, :, 1]
