"""Finite Fourier integral of many sampled channels, planned once and applied often."""

from __future__ import annotations

import numpy as np
import scipy.fft
from numpy.typing import ArrayLike, NDArray
from scipy.special import binom, roots_legendre

from freqid.core.errors import DataError, UsageError


def as_channels(x: ArrayLike, least: int = 1) -> NDArray[np.float64]:
    """Return x as an array of finite channels, rows contiguous in memory.

    Parameters
    ----------
    x : array_like of float, shape (channel, sample)
        Samples, any unit.
    least : int, optional
        Fewest samples that the caller can work with.

    Returns
    -------
    x : ndarray of float, shape (channel, sample)
        The same array where it already qualifies.

    Raises
    ------
    UsageError
        The shape is not (channel, sample) with `least` samples or more.
    DataError
        A sample is NaN or infinite.
    """
    x = np.ascontiguousarray(x, dtype=float)
    if x.ndim != 2 or x.shape[1] < least:
        raise UsageError(
            f"expected an array (channel, sample) with {least} samples or more, found shape {x.shape}"
        )
    finite = np.isfinite(x)
    if not finite.all():
        channel, sample = np.argwhere(~finite)[0]
        raise DataError(
            f"channel {channel} is {x[channel, sample]} at sample {sample}",
            remedy="repair the channel or cut the record around it",
        )
    return x


def fourier_end_weights(theta: ArrayLike, order: int) -> NDArray[np.complex128]:
    r"""Return the weights that correct a plain Fourier sum at its first samples.

    For samples `x[k] = x(k h)`, `k = 0..n-1`, and `theta = omega h` the integral over the record is

        integral / h = sum_k x[k] exp(-j theta k)
                     + sum_i w[i] x[i] + exp(-j theta (n-1)) sum_i conj(w[i]) x[n-1-i]

    exactly whenever x is a polynomial of degree `order` or less, whatever the frequency. Gregory's
    end weights are the case `theta = 0`; used at other frequencies they need `x exp(-j omega t)`
    to be smooth instead of x, which costs accuracy and forces high orders that amplify noise.

    Parameters
    ----------
    theta : array_like of float, shape (frequency,)
        Angle per sample omega h, rad, in [0, pi]; pi is the Nyquist frequency.
    order : int
        Highest difference used, >= 0; `order + 1` samples are corrected at each end.

    Returns
    -------
    weights : ndarray of complex, shape (order + 1, frequency)
        Weight of sample i counted from the end, on top of the 1 that the plain sum gives it.

    Notes
    -----
    With `z = exp(-j theta)` and x written in forward differences, one sampling interval gives
    `I_m = integral_0^1 C(s, m) exp(-j theta s) ds` for the m-th difference, C the binomial.
    Summing all intervals, `sum_k z^k (1 + D)^k = 1 / (1 - z - z D)`, and taking the plain sum
    away leaves `sum_m c_m D^m = (sum_m I_m D^m - 1) / (1 - z - z D)`, hence

        (1 - z) c_m - z c_(m-1) = I_m - [m = 0].

    Upwards the recursion divides by `1 - z`, downwards it multiplies by it, so each frequency takes
    the direction in which rounding errors shrink. At `theta = 0` it is Gregory's `c_(m-1) = -I_m`.

    References
    ----------
    Press et al., Numerical Recipes, 3rd ed., section 13.9 (the cubic member of this family);
    Morelli, NASA TM 110340, 1997 (the same for flight data); docs/theory/fourier.md.
    """
    theta = np.atleast_1d(np.asarray(theta, dtype=float))
    z = np.exp(-1j * theta)
    downwards = np.abs(1.0 - z) < 0.7
    top = order + 100  # downwards from c = 0: by the wanted order 0.7^100 = 3e-16 of that is left
    node, weight = roots_legendre(64)
    node, weight = (node + 1.0) / 2.0, weight / 2.0
    basis = binom(node, np.arange(top + 1)[:, None])
    cell = (basis * weight) @ np.exp(-1j * np.outer(node, theta))  # I_m, (m, frequency)
    cell[0] -= 1.0

    up = np.zeros((top + 1, theta.size), dtype=complex)
    down = np.zeros_like(up)
    divisor = np.where(downwards, 1.0, 1.0 - z)
    up[0] = cell[0] / divisor
    for m in range(1, order + 1):
        up[m] = (cell[m] + z * up[m - 1]) / divisor
    for m in range(top, 0, -1):
        down[m - 1] = np.where(downwards, ((1.0 - z) * down[m] - cell[m]) / z, 0.0)
    c = np.where(downwards, down, up)[: order + 1]

    # The m-th forward difference in terms of samples: (-1)^(m - i) C(m, i).
    m, i = np.arange(order + 1)[None, :], np.arange(order + 1)[:, None]
    return (((-1.0) ** (m - i) * binom(m, i)) @ c).astype(complex)


# Degree of the end corrections. Order 6 puts the quadrature error far below any sensor's and adds 0.01 %
# noise to a 60 s record at 50 Hz; higher ones amplify more noise than they save: docs/theory/fourier.md.
ORDER = 6
# Up to this many lines a product with a stored matrix is about as fast as any other: benchmarks/fourier.py.
DIRECT_LINES = 50
# Two frequencies are one where they differ by less than this many cycles over the record.
SAME_LINE = 1e-11
# More lines than this are a slip of a unit, not a wish.
MOST_LINES = 1_000_000


class FourierPlan:
    """Finite Fourier integral of uniformly sampled channels at fixed frequencies.

    `X(f) = integral_0^T x(t) exp(-j 2 pi f t) dt`, `T = (samples - 1) dt`, as a plain sum with end
    corrections. Build it once for a record length and a frequency list; call it on any channels.

    Parameters
    ----------
    samples : int
        Number of samples of each channel.
    dt : float
        Sampling interval, s.
    frequencies_hz : array_like, shape (frequency,)
        Increasing, positive frequencies up to the Nyquist frequency, Hz.

    Attributes
    ----------
    samples, dt, frequencies_hz
        As given; the array is a read-only copy.
    duration : float
        T, s.
    resolution : float or None
        Spacing of the frequencies, Hz; None where it is not uniform or there is only one.
    order : int
        Degree of the polynomials x(t) for which the transform is exact: 6 from 14 samples on.
    method : {"direct", "bins", "shifted", "zoom"}
        How the plain sum is done: a stored matrix; a real FFT whose bins are the frequencies; a complex FFT
        of the channels turned by the share of a bin that the frequencies are off; chirp-z.
    noise_gain : float
        Standard deviation of the transform of white noise relative to the plain sum's, largest over
        the frequencies.

    Raises
    ------
    UsageError
        Frequencies that are not positive and increasing, or an impossible sampling.
    DataError
        A frequency above Nyquist, or a record shorter than one period of the lowest frequency
        (one sample is forgiven: a 20 s period at 50 Hz may be cut as 1000 samples).

    Notes
    -----
    x, not `x exp(-j 2 pi f t)`, has to be smooth over a few samples, so the accuracy lasts up to Nyquist.

    References
    ----------
    Klein & Morelli, Aircraft System Identification (finite Fourier transform, end terms of a derivative);
    Rabiner, Schafer & Rader, Bell System Technical Journal 48, 1969 (chirp-z); docs/theory/fourier.md.

    Examples
    --------
    >>> plan = FourierPlan(samples=3001, dt=0.02, frequencies_hz=harmonics(60.0, (0.05, 1.8)))
    >>> plan(np.ones((2, 3001))).shape
    (2, 106)
    """

    def __init__(self, samples: int, dt: float, frequencies_hz: ArrayLike):
        f = np.array(frequencies_hz, dtype=float)
        if samples < 2 or not dt > 0.0:
            raise UsageError(
                f"a transform needs two samples and a positive interval, not {samples} and {dt} s"
            )
        if (
            f.ndim != 1
            or f.size == 0
            or not (np.all(np.isfinite(f)) and f[0] > 0.0 and np.all(np.diff(f) > 0.0))
        ):
            raise UsageError("the frequencies of a transform must be a list of positive, increasing Hz")
        # callers may give numpy's integers
        self.samples = int(samples)  # pyrefly: ignore[unnecessary-type-conversion]
        self.dt, self.duration = float(dt), float((samples - 1) * dt)
        if f[-1] > 0.5 / self.dt * (1.0 + 1e-9):
            raise DataError(
                f"the highest frequency, {f[-1]:.6g} Hz, is above Nyquist, {0.5 / self.dt:.6g} Hz",
                remedy="lower the band or use data that were sampled faster",
            )
        if f[0] * (self.duration + self.dt) < 1.0 - 1e-9:
            raise DataError(
                f"the record lasts {self.duration:.6g} s, less than the {1.0 / f[0]:.6g} s period of its "
                f"lowest frequency, {f[0]:.6g} Hz",
                remedy="raise the band or use a longer record",
            )
        f.flags.writeable = False
        self.frequencies_hz = f
        uniform = f.size > 1 and self._are_lines(np.linspace(f[0], f[-1], f.size))
        self.resolution = float((f[-1] - f[0]) / (f.size - 1)) if uniform else None
        self.order = min(ORDER, self.samples // 2 - 1)  # the corrected ends never overlap

        # The plain sum gives sample i the factor exp(-j 2 pi f i dt); start is added to the first few of
        # these, and its mirror image (conjugate) to the last few.
        angle = 2.0 * np.pi * f * self.dt
        start = fourier_end_weights(angle, self.order)
        self._last: NDArray[np.complex128] = np.exp(-2j * np.pi * self.duration * f)
        self._ends = np.concatenate([start, self._last * start[::-1].conj()])  # (2 order + 2, frequency)
        corrected = start + np.exp(-1j * np.outer(np.arange(self.order + 1), angle))
        power = self.samples + 2.0 * np.sum(np.abs(corrected) ** 2 - 1.0, axis=0)
        self.noise_gain = float(np.sqrt(np.max(power) / self.samples))
        self._choose_method()

    def _are_lines(self, other_hz: NDArray[np.float64]) -> bool:
        return bool(np.max(np.abs(self.frequencies_hz - other_hz)) * self.duration < SAME_LINE)

    def _choose_method(self) -> None:
        f, n = self.frequencies_hz, self.samples
        if self.resolution is None or f.size <= DIRECT_LINES:
            self.method = "direct"
            kernel: NDArray[np.complex128] = np.exp(-2j * np.pi * self.dt * np.outer(np.arange(n), f))
            kernel[: self.order + 1] += self._ends[: self.order + 1]
            kernel[n - self.order - 1 :] += self._ends[self.order + 1 :]
            self._kernel = self.dt * kernel
            return
        length = round(1.0 / (self.resolution * self.dt))
        at = f[0] * length * self.dt
        first, shift = round(at), at - round(at)
        bins = np.arange(first, first + f.size)
        self._length, self._bins = length, slice(first, first + f.size)
        if length <= 4 * n and self._are_lines(bins / (length * self.dt)):
            self.method = "bins"
        elif (
            length <= 4 * n
            and first + f.size <= length
            and self._are_lines((bins + shift) / (length * self.dt))
        ):
            self.method = "shifted"
            self._turn = np.exp(-2j * np.pi * shift / length * np.arange(n))
        else:
            from scipy.signal import ZoomFFT  # slow to import and seldom needed

            self.method = "zoom"
            # By its end frequencies: powers of a rounded step would gather error over the record.
            self._zoom = ZoomFFT(n, [f[0], f[-1]], f.size, fs=1.0 / self.dt, endpoint=True)

    def __call__(self, x: ArrayLike) -> NDArray[np.complex128]:
        """Return the finite Fourier integral of every channel.

        Parameters
        ----------
        x : array_like of float, shape (channel, sample)
            Samples, any unit.

        Returns
        -------
        X : ndarray of complex, shape (channel, frequency)
            Transform, unit of x times s.

        Raises
        ------
        UsageError
            The shape is not (channel, sample) with the planned number of samples.
        DataError
            A sample is NaN or infinite.
        """
        x = self._checked(x)
        if self.method == "direct":
            return _product(x, self._kernel)
        plain = np.asarray(self._zoom(x), dtype=complex) if self.method == "zoom" else self._bin_sum(x)
        count = self.order + 1
        ends = np.concatenate([x[:, :count], x[:, self.samples - count :]], axis=1)
        return self.dt * (plain + _product(ends, self._ends))

    def derivative(self, x: ArrayLike) -> NDArray[np.complex128]:
        """Return the transform of dx/dt without differentiating.

        By parts: `F[dx/dt] = j 2 pi f X(f) + x(T) exp(-j 2 pi f T) - x(0)`.

        Parameters
        ----------
        x : array_like of float, shape (channel, sample)
            Samples of the function itself, any unit.

        Returns
        -------
        Xdot : ndarray of complex, shape (channel, frequency)
            Transform of the derivative, unit of x.

        Notes
        -----
        x(0) and x(T) are single noisy samples: a regression on this transform should carry the rows of
        `nuisance` as extra regressors, which take up their errors.
        """
        x = self._checked(x)
        return 2j * np.pi * self.frequencies_hz * self(x) + x[:, -1:] * self._last - x[:, :1]

    def end_terms(self) -> NDArray[np.complex128]:
        """Return the end terms of a derivative, 1 and exp(-j 2 pi f T).

        Returns
        -------
        terms : ndarray of complex, shape (2, frequency)
            First row the start's, second row the end's, dimensionless.
        """
        return np.stack([np.ones_like(self._last), self._last])

    def nuisance(self) -> NDArray[np.complex128]:
        """Return those end terms that real coefficients can tell apart.

        On harmonics of 1/T the two are equal, half-way between them opposite; there one is left.

        Returns
        -------
        terms : ndarray of complex, shape (1 or 2, frequency)
            Rows of `end_terms`.
        """
        parallel = abs(float(np.mean(np.real(self._last)))) > 1.0 - 1e-9
        return self.end_terms()[: 1 if parallel else 2]

    def _checked(self, x: ArrayLike) -> NDArray[np.float64]:
        x = as_channels(x)
        if x.shape[1] != self.samples:
            raise UsageError(f"the transform is planned for {self.samples} samples, not for {x.shape[1]}")
        return x

    def _bin_sum(self, x: NDArray[np.float64]) -> NDArray[np.complex128]:
        length = self._length
        if self.method == "shifted":
            turned = np.zeros((len(x), max(length, self.samples)), dtype=complex)
            np.multiply(x, self._turn, out=turned[:, : self.samples])
            return scipy.fft.fft(_folded(turned, length), overwrite_x=True)[:, self._bins]
        return scipy.fft.rfft(_folded(x, length), length)[:, self._bins]


def _folded(x: NDArray, length: int) -> NDArray:
    """Return channels added onto themselves: the exponentials of bins repeat."""
    if x.shape[1] <= length:
        return x
    folded = x[:, :length].copy()
    for start in range(length, x.shape[1], length):
        part = x[:, start : start + length]
        folded[:, : part.shape[1]] += part
    return folded


def _product(x: NDArray[np.float64], kernel: NDArray[np.complex128]) -> NDArray[np.complex128]:
    # One real product on interleaved real and imaginary columns: half the work of promoting x to complex.
    columns: NDArray[np.float64] = kernel.view(float)
    return (x @ columns).view(complex)


def fourier(x: ArrayLike, dt: float, frequencies_hz: ArrayLike) -> NDArray[np.complex128]:
    """Return the finite Fourier integral of channels, planned and applied at once.

    Parameters
    ----------
    x : array_like of float, shape (channel, sample)
        Samples, any unit.
    dt : float
        Sampling interval, s.
    frequencies_hz : array_like, shape (frequency,)
        Increasing, positive frequencies, Hz.

    Returns
    -------
    X : ndarray of complex, shape (channel, frequency)
        Transform, unit of x times s; method and errors as in `FourierPlan`.
    """
    return FourierPlan(np.shape(x)[-1], dt, frequencies_hz)(x)


def harmonics(period_s: float, band_hz: tuple[float, float]) -> NDArray[np.float64]:
    """Return the multiples of 1/period in a band, its limits included.

    Parameters
    ----------
    period_s : float
        Base period, s.
    band_hz : tuple of float
        Lowest and highest frequency, Hz.

    Returns
    -------
    frequencies_hz : ndarray, shape (frequency,)
        Increasing, Hz; UsageError where the band holds none.

    Examples
    --------
    >>> harmonics(10.0, (0.1, 0.35)).tolist()
    [0.1, 0.2, 0.3]
    """
    low, high = band_hz
    first = max(int(np.ceil(low * period_s - 1e-9)), 1)
    last = int(np.floor(high * period_s + 1e-9))
    _check_count(last - first + 1)
    if last < first:
        raise UsageError(f"no harmonic of 1/{period_s:g} Hz lies between {low:g} and {high:g} Hz")
    return np.arange(first, last + 1) / float(period_s)


def frequency_grid(low_hz: float, step_hz: float, high_hz: float) -> NDArray[np.float64]:
    """Return equally spaced frequencies from low to high, high included where a step reaches it.

    Parameters
    ----------
    low_hz, step_hz, high_hz : float
        Lowest frequency, spacing and upper limit, Hz.

    Returns
    -------
    frequencies_hz : ndarray, shape (frequency,)
        Increasing, Hz; UsageError where limits or step are not positive or out of order.
    """
    if not (0.0 < low_hz <= high_hz and step_hz > 0.0):
        raise UsageError(f"no frequencies lie on {low_hz:g}:{step_hz:g}:{high_hz:g} Hz (low:step:high)")
    count = int(np.floor((high_hz - low_hz) / step_hz + 1e-9)) + 1
    _check_count(count)
    return low_hz + step_hz * np.arange(count, dtype=float)


def _check_count(lines: int) -> None:
    if lines > MOST_LINES:
        raise UsageError(
            f"{lines} lines are asked for, expected at most {MOST_LINES}",
            remedy="correct the period or the step",
        )
