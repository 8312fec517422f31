"""Smooth signals, their derivatives and their noise from noisy samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import ArrayLike, NDArray

from freqid.core.errors import UsageError
from freqid.identify.spectra.fourier import as_channels
from freqid.identify.spectra.trend import remove_trend

# Sine coefficients of a smooth signal fall like k^-3 (below), so signal over noise power falls like k^-6.
POWER = 6


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Channels parted into a smooth signal and noise.

    Attributes
    ----------
    x : ndarray, shape (channel, sample)
        The smooth signal, unit of the channel.
    derivative : ndarray, shape (channel, sample)
        Its time derivative, exact for the smooth signal, unit of the channel per s.
    noise_std : ndarray, shape (channel,)
        Standard deviation of the noise, unit of the channel.
    cutoff_hz : ndarray, shape (channel,)
        Frequency at which signal and noise are equally strong, Hz; the filter passes half of it.
    """

    x: NDArray[np.float64]
    derivative: NDArray[np.float64]
    noise_std: NDArray[np.float64]
    cutoff_hz: NDArray[np.float64]


def smooth(x: ArrayLike, dt: float, cutoff_hz: float | None = None) -> Smoothed:
    r"""Part channels into smooth signal and white noise by global Fourier smoothing.

    The line through the end points is taken away and what is left is continued by its odd reflection. That
    periodic function is continuous with its slope, so its sine coefficients fall like `k^-3`, while those
    of white noise stay level. Where the two cross, at `k_c`, the Wiener filter of the pair turns:

        Phi(k) = signal / (signal + noise) = 1 / (1 + (k / k_c)^6),      f_c = k_c / (2 T).

    Parameters
    ----------
    x : array_like of float, shape (channel, sample)
        Samples, any unit, eight or more.
    dt : float
        Sampling interval, s.
    cutoff_hz : float, optional
        f_c for all channels, Hz. Without it each channel gets the f_c of least generalised cross-validation
        score, `n sum((1 - Phi)^2 b^2) / sum(1 - Phi)^2`, the leave-one-out prediction error.

    Returns
    -------
    Smoothed
        Signal, derivative, noise and cutoff of every channel.

    Raises
    ------
    UsageError
        The shape is not (channel, eight samples or more), or the cutoff is not between 1/(2T) and Nyquist.
    DataError
        A sample is NaN or infinite.

    Notes
    -----
    No phase is lost. The first and the last sample are kept as measured, so the derivative is poor for about
    a period of the cutoff at both ends. Noise that is not white (structural modes, turbulence) counts
    as signal as far as it stands out; a cutoff from the frequencies of the rigid body then does better.

    References
    ----------
    Morelli, "Estimating noise characteristics from flight test data using optimal Fourier smoothing", Journal
    of Aircraft 32(4), 1995; Klein & Morelli, Aircraft System Identification, 2nd ed., chapter 11;
    Craven & Wahba, Numerische Mathematik 31, 1979 (the score). docs/theory/smoothing.md.
    """
    x = as_channels(x, least=8)
    count = x.shape[1] - 2  # sine coefficients, and samples between the ends
    duration = dt * (count + 1)
    k = np.arange(1, count + 1)
    flat = remove_trend(x, dt, "endpoints")
    b = np.asarray(scipy.fft.dst(flat.x[:, 1:-1], type=1, norm="ortho"))  # white noise keeps its variance

    if cutoff_hz is None:
        candidates = np.geomspace(1.0, count, 200)
        stopped = 1.0 - 1.0 / (1.0 + (k / candidates[:, None]) ** POWER)  # (candidate, k)
        score = (stopped**2 @ (b**2).T) / np.sum(stopped, axis=1, keepdims=True) ** 2
        k_c = candidates[np.argmin(score, axis=0)]
    elif 0.5 / duration <= cutoff_hz <= 0.5 / dt:
        k_c = np.full(len(x), 2.0 * duration * cutoff_hz)
    else:
        raise UsageError(
            f"the cutoff of a smoothing must lie between {0.5 / duration:.4g} and {0.5 / dt:.4g} Hz, "
            f"not at {cutoff_hz:g} Hz"
        )
    passed = 1.0 / (1.0 + (k / k_c[:, None]) ** POWER)
    noise_std = np.sqrt(np.sum(((1.0 - passed) * b) ** 2, axis=1) / np.sum((1.0 - passed) ** 2, axis=1))

    b = passed * b
    line = x - flat.x
    line[:, 1:-1] += scipy.fft.idst(b, type=1, norm="ortho")
    # d/dt of sqrt(2 / (count + 1)) b sin(pi k t / T); dct-I counts inner terms twice and has two end terms.
    cosines = np.pad(b * k * (np.pi / duration) * np.sqrt(2.0 / (count + 1)), ((0, 0), (1, 1)))
    derivative = flat.slope[:, None] + 0.5 * np.asarray(scipy.fft.dct(cosines, type=1))
    return Smoothed(line, derivative, noise_std, k_c / (2.0 * duration))


def local_derivative(x: ArrayLike, dt: float, window: int = 5, degree: int = 2) -> NDArray[np.float64]:
    """Return time derivatives from a polynomial fitted around each sample by least squares.

    Parameters
    ----------
    x : array_like of float, shape (channel, sample)
        Samples, any unit.
    dt : float
        Sampling interval, s.
    window : int, optional
        Samples in each fit, odd. At the ends the outermost window serves all its samples.
    degree : int, optional
        Degree of the polynomial, from 1 to window - 1.

    Returns
    -------
    derivative : ndarray, shape (channel, sample)
        Unit of the channel per s.

    Raises
    ------
    UsageError
        A window that is even or longer than the record, or a degree that it does not determine.
    DataError
        A sample is NaN or infinite.

    Notes
    -----
    A straight line or a parabola over w samples passes noise as `sqrt(12 / (w^3 - w)) / dt` and lowers a
    sine of frequency f by about `(pi f dt w)^2 / 10` of itself: take the longest window that the
    highest frequency of interest allows.

    References
    ----------
    Savitzky & Golay, Analytical Chemistry 36, 1964; Klein & Morelli, 2nd ed., chapter 11.
    """
    x = as_channels(x)
    if window % 2 == 0 or not 1 <= degree < window <= x.shape[1]:
        raise UsageError(
            f"a local derivative needs 1 <= degree < window <= {x.shape[1]} samples and an odd window, "
            f"not degree {degree} and window {window}"
        )
    from scipy.signal import savgol_filter  # slow to import and seldom needed

    return np.asarray(savgol_filter(x, window, degree, deriv=1, delta=dt, mode="interp", axis=1))
