"""How sensor noise makes an integrated path drift, how gusts come, and columns made white of both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtrs
from scipy.optimize import brentq, minimize_scalar

from freqid.core.arrays import Array
from freqid.identify.sensors.flight_path import FlightPath, skew

BLOCK = 0.1  # s, of which the filter takes the mean; drift and gusts change little within
LEAST_BLOCKS = 150
WEAKEST, STRONGEST = 1e-4, 30.0  # m/s, of gusts
PRECISE = 0.05  # of the logarithm of the gusts' strength
STEP = 0.2  # of that logarithm, for derivatives of the likelihood
ORDER = 1.96  # normal, 95 %


@dataclass(frozen=True, eq=False)
class PathNoise:
    """Standard deviations of white noise, by sample.

    Attributes
    ----------
    rates : ndarray, shape (3,)
        p q r, rad/s.
    force : ndarray, shape (3,)
        ax ay az, m/s2.
    gusts : float
        Of each axis of the wind about its mean, m/s: a first-order process (Gauss-Markov).
    gust_time : float
        Its time constant, s.
    outputs : ndarray, shape (k,)
        The channels that are compared, in their units.
    """

    rates: Array
    force: Array
    gusts: float
    gust_time: float
    outputs: Array


def whiten(
    path: FlightPath, window: slice, seen: Array, noise: PathNoise, z: Array, every: int = 1
) -> tuple[Array, float]:
    """Return columns as a filter sees them that knows how noise makes the path drift, and how gusts come.

    Integrated noise makes residuals of path and measurement wander, and so do gusts, which the path of
    inertial sensors does not hold. Least squares on them would believe far too much of slow motion. The
    innovations of a Kalman filter of that wandering are white; least squares on them, with every column of
    the problem filtered alike, has least variance.

    Parameters
    ----------
    path : FlightPath
    window : slice
        Samples of the path that are compared.
    seen : ndarray, shape (k, 10, n)
        Derivatives of the outputs by errors of the path and by wind, over the window.
    noise : PathNoise
    z : ndarray, shape (c, k, n)
        Residual and derivatives by parameters, a column each.
    every : int
        Samples of which the mean is taken first: the filter is the slow part, and drift and gusts change
        little within a tenth of a second.

    Returns
    -------
    white : ndarray, shape (c, k, n // every)
        Uncorrelated, and of unit variance for a residual that obeys `noise`.
    log_determinant : float
        Of the covariance of the residual.

    Notes
    -----
    States: turn, velocity, height as in `flight_path`, and gusts. Only these are uncertain at the window's
    start, for there the parameters hold the initial values. The filter's gain depends on no measurement, so
    it is linear. A channel that is late shows the drift of a moment ago, in the attitude of that moment; only
    the noise since then is neglected.
    """
    n, dt = z.shape[2] // every, path.dt * every
    middle = slice(every // 2, every // 2 + n * every, every)
    force, turn = path.force[:, window][:, middle], path.turn[:, :, window][:, :, middle]
    step = np.zeros((n, 10, 10))
    step[:] = np.eye(10)
    step[:, 3:6, :3] = -dt * skew(force).transpose(2, 0, 1)
    step[:, 6, 5] = -dt
    decay = np.exp(-dt / noise.gust_time)
    step[:, 7:, 7:] *= decay
    spread = np.zeros((n, 10, 10))
    turn = turn.transpose(2, 0, 1) * dt
    spread[:, :3, :3] = (turn * (noise.rates**2 / every)) @ turn.transpose(0, 2, 1)
    spread[:, 3:6, 3:6] = (turn * (noise.force**2 / every)) @ turn.transpose(0, 2, 1)
    spread[:, 7:, 7:] = noise.gusts**2 * (1 - decay**2) * np.eye(3)
    seen, z = (x[..., : n * every].reshape(*x.shape[:-1], n, every).mean(axis=-1) for x in (seen, z))
    seen = seen.transpose(2, 0, 1)
    measured, white = z.transpose(2, 1, 0), np.empty((n, z.shape[1], z.shape[0]))
    own = np.diag(noise.outputs**2 / every)
    p, x = np.zeros((10, 10)), np.zeros((10, z.shape[0]))
    p[7:, 7:] = noise.gusts**2 * np.eye(3)
    diagonal = np.empty((n, z.shape[1]))
    for i in range(n):
        h = seen[i]
        hp = h @ p
        factor, _ = dpotrf(hp @ h.T + own, lower=1)
        diagonal[i] = factor.diagonal()
        solved, _ = dtrtrs(factor, np.concatenate((measured[i] - h @ x, hp), axis=1), lower=1)
        white[i] = solved[:, : z.shape[0]]
        gain = solved[:, z.shape[0] :]
        f = step[i]
        x = f @ (x + gain.T @ white[i])
        p = f @ (p - gain.T @ gain) @ f.T + spread[i]
    return white.transpose(2, 1, 0), 2 * float(np.log(diagonal).sum())


def block_of(dt: float, window: slice) -> int:
    """Return how many samples `whiten` may take the mean of."""
    return max(1, min(round(BLOCK / dt), (window.stop - window.start) // LEAST_BLOCKS))


@dataclass(frozen=True)
class GustStrength:
    """Standard deviation of each axis of the gusts.

    Attributes
    ----------
    std : float
        m/s.
    lower, upper : float
        95 % limits, m/s; `lower` is zero where the data do not say that there are gusts.
    equations : float
        How many of the white equations the gusts make: the derivative of the covariance's log determinant by
        the logarithm of the gusts' variance.
    """

    std: float
    lower: float
    upper: float
    equations: float


def estimate_gusts(
    path: FlightPath,
    window: slice,
    seen: Array,
    noise: PathNoise,
    z: Array,
    every: int,
    *,
    limits: bool = False,
) -> GustStrength:
    """Return the strength of the gusts that makes a residual most likely.

    Parameters
    ----------
    path, window, seen, noise, every
        As in `whiten`.
    z : ndarray, shape (1 + m, k, n)
        The residual, and its derivatives by the parameters that are estimated beside.
    limits : bool
        Find the limits too; else they are those of what is possible.

    Returns
    -------
    GustStrength

    Notes
    -----
    Restricted likelihood: the parameters are integrated out, so that what they take up of the gusts does not
    count as calm. Limits are where it falls by half the square of 1.96.

    References
    ----------
    Patterson & Thompson, Biometrika 58, 1971.
    """

    def unlikely(log_std: float) -> tuple[float, float]:
        white, log_det = whiten(path, window, seen, replace(noise, gusts=np.exp(log_std)), z, every)
        flat = white.reshape(len(white), -1)
        flat = flat[np.append(True, flat[1:].any(axis=1))]
        length = np.linalg.norm(flat[1:], axis=1, keepdims=True)
        basis, factor = np.linalg.qr((flat[1:] / length).T)
        left = flat[0] - basis @ (basis.T @ flat[0])
        taken = 2 * np.log(np.abs(np.diag(factor))).sum() + 2 * np.log(length).sum()
        return (left @ left + log_det + taken) / 2, log_det

    found = minimize_scalar(
        lambda x: unlikely(x)[0],
        bounds=(np.log(WEAKEST), np.log(STRONGEST)),
        method="bounded",
        options={"xatol": PRECISE},
    )
    best, ends = float(found.x), (np.log(WEAKEST), np.log(STRONGEST))
    log_above, log_below = unlikely(best + STEP)[1], unlikely(best - STEP)[1]
    low, high = 0.0, STRONGEST
    if limits:
        level = unlikely(best)[0] + ORDER**2 / 2

        def limit(end: float, otherwise: float) -> float:
            if unlikely(end)[0] <= level:  # within what is searched it does not fall by that much
                return otherwise
            below, above = sorted((best, end))
            return float(np.exp(brentq(lambda x: unlikely(x)[0] - level, below, above, xtol=PRECISE)))

        low, high = limit(ends[0], 0.0), limit(ends[1], STRONGEST)
    return GustStrength(float(np.exp(best)), low, high, (log_above - log_below) / (4 * STEP))
