"""Least squares on a path that noise makes drift: whitened columns, covariance of coloured residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import next_fast_len, rfft
from scipy.linalg.lapack import dpotrf, dtrtrs
from scipy.ndimage import uniform_filter1d

from freqid.core.arrays import Array
from freqid.identify.sensors.flight_path import FlightPath, skew

# Half width of the window that smooths a residual's power, in units of 1/T: twice that of `uncertainty`,
# since what the filter has whitened varies less with frequency.
HALF_WIDTH = 4
# Least share of the equations around a line that the fit must leave free for its residual to tell anything.
FREE_SHARE = 0.25


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviations of white noise, by sample.

    Attributes
    ----------
    rates : ndarray, shape (3,)
        p q r, rad/s.
    force : ndarray, shape (3,)
        ax ay az, m/s2.
    wind : float
        Intensity of the wind's random walk in each axis, m/s per square root of a second.
    outputs : ndarray, shape (k,)
        The channels that are compared, in their units.
    """

    rates: Array
    force: Array
    wind: float
    outputs: Array


def whiten(path: FlightPath, window: slice, seen: Array, noise: Noise, z: Array) -> Array:
    """Return columns as a filter sees them that knows how sensor noise makes the path drift.

    Integrated noise makes residuals of path and measurement wander, and least squares on them would believe
    far too much of slow motion. The innovations of a Kalman filter of that wandering are white; least squares
    on them, with every column of the problem filtered alike, has least variance.

    Parameters
    ----------
    path : FlightPath
    window : slice
        Samples of the path that are compared.
    seen : ndarray, shape (k, 10, n)
        Derivatives of the outputs by errors of the path and by wind, over the window.
    noise : Noise
    z : ndarray, shape (c, k, n)
        Residual and derivatives by parameters, a column each.

    Returns
    -------
    ndarray, shape (c, k, n)
        Uncorrelated, and of unit variance for a residual that obeys `noise`.

    Notes
    -----
    States: turn, velocity, height as in `flight_path`, and wind; none is uncertain at the window's start,
    where the parameters hold the initial values. The filter's gain depends on no measurement, so it is
    linear. A channel that is late shows the drift of a moment ago, in the attitude of that moment; only the
    noise since then is neglected.
    """
    n = z.shape[2]
    step = np.zeros((n, 10, 10))
    step[:] = np.eye(10)
    step[:, 3:6, :3] = -path.dt * skew(path.force[:, window]).transpose(2, 0, 1)
    step[:, 6, 5] = -path.dt
    spread = np.zeros((n, 10, 10))
    turn = path.turn[:, :, window].transpose(2, 0, 1) * path.dt
    spread[:, :3, :3] = (turn * noise.rates**2) @ turn.transpose(0, 2, 1)
    spread[:, 3:6, 3:6] = (turn * noise.force**2) @ turn.transpose(0, 2, 1)
    spread[:, 7:, 7:] = path.dt * noise.wind**2 * np.eye(3)
    seen = seen.transpose(2, 0, 1)
    measured, white = z.transpose(2, 1, 0), np.empty((n, z.shape[1], z.shape[0]))
    own = np.diag(noise.outputs**2)
    p, x = np.zeros((10, 10)), np.zeros((10, z.shape[0]))
    for i in range(n):
        h = seen[i]
        hp = h @ p
        factor, _ = dpotrf(hp @ h.T + own, lower=1)
        solved, _ = dtrtrs(factor, np.concatenate((measured[i] - h @ x, hp), axis=1), lower=1)
        white[i] = solved[:, : z.shape[0]]
        gain = solved[:, z.shape[0] :]
        f = step[i]
        x = f @ (x + gain.T @ white[i])
        p = f @ (p - gain.T @ gain) @ f.T + spread[i]
    return white.transpose(2, 1, 0)


def coloured_covariance(jacobian: Array, residual: Array) -> tuple[Array, Array]:
    """Return the covariance of least squares over several channels, each residual with its own colour.

    Parameters
    ----------
    jacobian : ndarray, shape (m, k, n)
        Derivatives of k whitened channels by m parameters.
    residual : ndarray, shape (k, n)
        What the fit leaves of the whitened channels.

    Returns
    -------
    covariance : ndarray, shape (m, m)
    degrees_of_freedom : ndarray, shape (m,)
        For Student's t.

    Notes
    -----
    ``sum_k D_k R_k D_k^T`` with D the weights of the estimate and R_k the Toeplitz matrix of a channel's
    autocovariance, taken on the lines of the padded transform with the residual's power smoothed over
    neighbouring lines. As in `uncertainty.correct_coloured_samples` the power that the parameters took is
    given back first, and degrees of freedom follow Satterthwaite.
    """
    m, k, n = jacobian.shape
    basis, factor = np.linalg.qr(jacobian.reshape(m, k * n).T)
    dual = np.linalg.solve(factor, basis.T).reshape(m, k, n)
    padded = next_fast_len(2 * n, real=True)
    share = n / padded  # independent lines per line
    width = 2 * round(HALF_WIDTH / share) + 1
    covariance, mean, scatter = np.zeros((m, m)), np.zeros(m), np.zeros(m)
    for channel in range(k):
        weight = rfft(dual[:, channel], padded)
        weight[:, 1 : (padded + 1) // 2] *= np.sqrt(2)  # these stand for their mirror images too
        power = np.abs(rfft(residual[channel], padded)) ** 2 / n
        taken = (np.abs(rfft(basis.T.reshape(m, k, n)[:, channel], padded)) ** 2).sum(axis=0) / n
        free = np.maximum(uniform_filter1d(1 - taken, width, mode="mirror"), FREE_SHARE)
        spectrum = uniform_filter1d(power, width, mode="mirror") / free
        covariance += ((weight * spectrum) @ weight.conj().T).real / padded
        gain = np.abs(weight) ** 2 / padded
        mean += gain @ spectrum
        smooth = uniform_filter1d(gain / free, width, axis=1, mode="mirror")
        scatter += (smooth**2) @ (spectrum**2 * free) / share
    return covariance, np.maximum(2 * mean**2 / scatter - 2, 1.0)
