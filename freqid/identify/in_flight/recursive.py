"""Equation error sample by sample, on a Fourier integral that grows with the record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.core.arrays import Array
from freqid.core.errors import DataError, UsageError
from freqid.core.sections.identification import Identification
from freqid.identify.regress.covariance_corrections import correct_coloured_lines, correct_line_spacing
from freqid.identify.regress.regression import LeastSquares, least_squares
from freqid.identify.spectra.fourier import ORDER, fourier_end_weights
from freqid.identify.spectra.trend import TrendKind, trend_columns


class RecursiveTransform:
    """Finite Fourier integral of channels at fixed frequencies, sample by sample.

    ``X_i(f) = X_(i-1)(f) + x_i exp(-j 2 pi f t_i)``. The end corrections, which change with every sample,
    are added when the transform is read, so an update is one outer product.

    Parameters
    ----------
    channels : int
        Number of channels.
    dt : float
        Sampling interval, s.
    frequencies_hz : array_like, shape (frequency,)
        Increasing, positive frequencies up to the Nyquist frequency, Hz.

    Attributes
    ----------
    dt, frequencies_hz
        As given.
    samples : int
        Samples taken in so far.

    Raises
    ------
    UsageError
        Frequencies that are not positive and increasing, or an interval that is not positive.
    DataError
        A frequency above Nyquist.

    Notes
    -----
    The phasors are computed from the sample's number and not by multiplication, so that their rounding does
    not grow with time. Beside the transforms the sums of x and of i x are kept: with them a least-squares
    line can be taken away exactly when the transform is read.

    References
    ----------
    Morelli, J. Guidance, Control, and Dynamics 23(5), 2000 (the recursion); docs/theory/recursive.md.
    """

    def __init__(self, channels: int, dt: float, frequencies_hz: ArrayLike):
        f = np.array(frequencies_hz, dtype=float)
        if f.ndim != 1 or f.size == 0 or not (np.all(np.isfinite(f)) and f[0] > 0 and np.all(np.diff(f) > 0)):
            raise UsageError("the frequencies of a transform must be a list of positive, increasing Hz")
        if not dt > 0:
            raise UsageError(f"a transform needs a positive sampling interval, not {dt} s")
        if f[-1] > 0.5 / dt * (1 + 1e-9):
            raise DataError(
                f"the highest frequency, {f[-1]:.6g} Hz, is above Nyquist, {0.5 / dt:.6g} Hz",
                remedy="lower the band or sample faster",
            )
        f.flags.writeable = False
        self.dt, self.frequencies_hz, self.samples = float(dt), f, 0
        self._angle = 2 * np.pi * f * self.dt  # per sample, rad
        self._start_weights = fourier_end_weights(self._angle, ORDER)
        self._sums = np.zeros((channels, 2 + 2 * f.size))  # of x, i x, and interleaved real and imaginary
        self._first = np.empty((channels, 0))
        self._latest = np.empty((channels, 0))

    def update(self, x: Array) -> None:
        """Take in one sample of every channel, or several in a row.

        Parameters
        ----------
        x : ndarray, shape (channel, n)
            Any unit.

        Raises
        ------
        DataError
            A value is NaN or infinite; nothing of `x` is then taken in.
        """
        if not np.isfinite(x).all():
            channel, sample = np.argwhere(~np.isfinite(x))[0]
            raise DataError(
                f"channel {channel} is {x[channel, sample]} at sample {self.samples + sample}",
                remedy="hold the last good value, or start again after the gap",
            )
        count = np.arange(self.samples, self.samples + x.shape[1], dtype=float)[:, None]
        kernel = np.empty((x.shape[1], self._sums.shape[1]))
        kernel[:, :1], kernel[:, 1:2] = 1.0, count
        angle = count * self._angle
        np.cos(angle, out=kernel[:, 2::2])
        np.negative(np.sin(angle), out=kernel[:, 3::2])
        self._sums += x @ kernel
        if self._first.shape[1] <= ORDER:
            self._first = np.concatenate((self._first, x), axis=1)[:, : ORDER + 1]
        self._latest = np.concatenate((self._latest, x), axis=1)[:, -ORDER - 1 :]
        self.samples += x.shape[1]

    @property
    def duration(self) -> float:
        """Time from the first to the last sample, s."""
        return self.dt * (self.samples - 1)

    @property
    def mean(self) -> Array:
        """Mean of every channel, shape (channel,)."""
        return self._sums[:, 0] / self.samples

    @property
    def change(self) -> Array:
        """Last sample less the first, shape (channel,)."""
        return self._latest[:, -1] - self._first[:, 0]

    def end_terms(self) -> NDArray[np.complex128]:
        """Return 1 and exp(-j 2 pi f T), shape (2, frequency): the end terms of a derivative."""
        last = np.exp(-1j * self._angle * (self.samples - 1))
        return np.stack((np.ones_like(last), last))

    def read(self, trend: TrendKind = "none") -> NDArray[np.complex128]:
        """Return the transform of the samples so far, with its end corrections.

        Parameters
        ----------
        trend : {"none", "mean", "endpoints", "line"}
            What is taken away first, as in `remove_trend`.

        Returns
        -------
        X : ndarray of complex, shape (channel, frequency)
            Unit of the channel times s: what `FourierPlan` gives for a record that ends now.

        Raises
        ------
        DataError
            The samples so far do not last one period of the lowest frequency.
        """
        lowest = self.frequencies_hz[0]
        if self.samples < 2 * (ORDER + 1) or lowest * self.samples * self.dt < 1 - 1e-9:
            raise DataError(
                f"the {self.samples} samples so far do not last {1 / lowest:.6g} s, the period of the lowest "
                f"frequency, {lowest:.6g} Hz",
                remedy="wait, or raise the band",
            )
        last = self.end_terms()[1]
        plain = np.ascontiguousarray(self._sums[:, 2:]).view(complex)
        start, end = self._start_weights, last * self._start_weights[::-1].conj()
        x = self.dt * (plain + self._first @ start + self._latest @ end)
        bias, slope = self._line(trend)
        s = 2j * np.pi * self.frequencies_hz
        of_one = (1 - last) / s
        of_time = (of_one - self.duration * last) / s
        return x - np.outer(bias, of_one) - np.outer(slope, of_time)

    def read_derivative(self) -> NDArray[np.complex128]:
        """Return the transform of the derivative less its mean, shape (channel, frequency).

        By parts, without differentiating; with the line through the ends taken away, the end terms vanish.
        """
        return 2j * np.pi * self.frequencies_hz * self.read("endpoints")

    def _line(self, trend: TrendKind) -> tuple[Array, Array]:
        """Return value at t = 0 and slope, shape (channel,) each, of the line to take away."""
        none, n = np.zeros(len(self._sums)), self.samples
        if trend == "none":
            return none, none
        if trend == "mean":
            return self.mean, none
        if trend == "endpoints":
            return self._first[:, 0], self.change / self.duration
        if trend == "line":
            centred = self._sums[:, 1] - (n - 1) / 2 * self._sums[:, 0]
            slope = centred / (n * (n * n - 1) / 12 * self.dt)
            return self.mean - slope * self.duration / 2, slope
        raise UsageError(f"the trend to remove is 'none', 'mean', 'endpoints' or 'line', not {trend!r}")


# The bias is a mean over the record; its error is judged by the residual on the lines nearest to zero.
BIAS_LINES = 10
# A regressor whose lines stay below this share of its mean's is constant but for rounding.
STILL = 1e-9


@dataclass(frozen=True, eq=False)
class RunningEstimate:
    """One response as a linear function of p regressors, from the samples up to one time.

    Attributes
    ----------
    response : str
        Among X Y Z L M N.
    regressors : tuple of str, length p
    time : float
        From the first sample to the last one used, s.
    estimate, std_error : ndarray, shape (p,)
        Unit of the response per unit of the regressor.
    covariance : ndarray, shape (p, p)
    lower, upper : ndarray, shape (p,)
        Confidence limits at the level of the settings.
    bias, bias_std_error : float
        Mean of the response, in its unit.
    r2 : float
        Coefficient of determination on the lines.
    """

    response: str
    regressors: tuple[str, ...]
    time: float
    estimate: Array
    std_error: Array
    covariance: Array
    lower: Array
    upper: Array
    bias: float
    bias_std_error: float
    r2: float


class RecursiveRegression:
    """Least squares on transforms that grow by one sample at a time.

    An update costs the same however long it has run and allocates nothing that stays; `estimate` may be
    called at any time, seldom or often, and equals the batch estimate from the same samples.

    Parameters
    ----------
    settings : Identification
        Responses, regressors, trend, nuisance and residuals; the method must be "frequency".
    dt : float
        Sampling interval, s.
    frequencies_hz : array_like, shape (M,)
        Lines of the regression, Hz.

    Attributes
    ----------
    names : tuple of str, length p
        The regressors of all responses, in the order of `update`.
    settings
        As given.

    Raises
    ------
    UsageError
        The method is not "frequency", or frequencies or sampling are impossible.
    DataError
        A frequency is above Nyquist.

    References
    ----------
    Morelli, "Real-Time Parameter Estimation in the Frequency Domain", J. Guidance, Control, and Dynamics
    23(5), 2000; Klein & Morelli, Aircraft System Identification, 2nd ed., ch. 7; docs/theory/recursive.md.
    """

    def __init__(self, settings: Identification, dt: float, frequencies_hz: ArrayLike):
        if settings.method != "frequency":
            raise UsageError(
                f"method is '{settings.method}', expected 'frequency': only transforms are carried along",
                remedy="identify the whole record for estimates in the time domain",
            )
        self.settings = settings
        self.names = tuple(dict.fromkeys(n for r in settings.responses for n in settings.regressors_of(r)))
        self._n_responses = len(settings.responses)
        self._transform = RecursiveTransform(len(self.names) + 2 * self._n_responses, dt, frequencies_hz)
        self._changing = False
        shared: dict[tuple[str, ...], list[int]] = {}
        for row, response in enumerate(settings.responses):
            shared.setdefault(settings.regressors_of(response), []).append(row)
        self._groups = [(rows, [self.names.index(n) for n in x]) for x, rows in shared.items()]

    def update(self, x: Array, direct: Array, momentum: Array) -> None:
        """Take in one sample, or several in a row.

        Parameters
        ----------
        x : ndarray, shape (p, n)
            Regressors, in the order of `names`.
        direct, momentum : ndarray, shape (R, n)
            Responses in the two parts of `AppliedWrench`: ``response = direct + d(momentum)/dt``.

        Raises
        ------
        DataError
            A value is not finite; the sample is then not taken in.
        """
        self._transform.update(np.concatenate((x, direct, momentum)))
        self._changing = self._changing or bool(momentum.any())

    def estimate(self) -> dict[str, RunningEstimate]:
        """Return the estimates of all responses from the samples so far, by response.

        Raises
        ------
        DataError
            The samples so far are shorter than the period of the lowest line or do not determine the
            parameters, or a regressor does not move.
        """
        transform, settings = self._transform, self.settings
        p, n = len(self.names), self._n_responses
        spectra = transform.read(settings.trend or "line")
        self._refuse_still(spectra[:p])
        x, z = spectra[:p], spectra[p : p + n]
        if self._changing:
            z = z + transform.read_derivative()[p + n :]
        nuisance = self._nuisance()
        means, change = transform.mean, transform.change / transform.duration
        bias = means[p : p + n] + change[p + n :]
        correct = correct_coloured_lines if settings.residuals != "white" else correct_line_spacing
        found = {}
        for rows, columns in self._groups:
            fit = least_squares(
                x[columns],
                z[rows],
                names=[self.names[j] for j in columns],
                response_names=[settings.responses[r] for r in rows],
                nuisance=nuisance,
                nuisance_names=[f"end term {i + 1}" for i in range(len(nuisance))],
            )
            fit = correct(fit, transform.frequencies_hz, transform.duration)
            found |= self._results(fit, bias[rows])
        return {response: found[response] for response in settings.responses}

    def _results(self, fit: LeastSquares, bias: Array) -> dict[str, RunningEstimate]:
        duration = self._transform.duration
        lower, upper = fit.interval(self.settings.confidence)
        low_lines = fit.residual[:, :BIAS_LINES]  # the lines ascend
        bias_error = np.sqrt(np.mean(np.abs(low_lines) ** 2, axis=1)) / duration
        return {
            response: RunningEstimate(
                response=response,
                regressors=fit.names,
                time=duration,
                estimate=fit.estimate[i],
                std_error=fit.std_error[i],
                covariance=fit.covariance[i],
                lower=lower[i],
                upper=upper[i],
                bias=float(bias[i]),
                bias_std_error=float(bias_error[i]),
                r2=float(fit.r2[i]),
            )
            for i, response in enumerate(fit.response_names)
        }

    def _refuse_still(self, x: NDArray[np.complex128]) -> None:
        size = STILL * np.abs(self._transform.mean[: len(x)]) * self._transform.duration
        still = np.flatnonzero(np.abs(x).max(axis=1) <= size)
        if still.size:
            raise DataError(
                f"regressor '{self.names[still[0]]}' has been constant, or a straight line, for "
                f"{self._transform.duration:.4g} s, so its parameter cannot be estimated",
                remedy="drop it from the regressors, or excite it",
            )

    def _nuisance(self) -> NDArray[np.complex128]:
        """Return the columns for trend and end samples, as of a batch of the same length."""
        transform, kind = self._transform, self.settings.nuisance
        ends = transform.end_terms()
        if kind != "auto":
            return ends[: 1 if kind == "constant" else 0]
        columns = [trend_columns(transform.frequencies_hz, transform.duration)]
        if self._changing:
            parallel = abs(float(np.mean(ends[1].real))) > 1 - 1e-9  # on harmonics of 1/T, or half-way
            columns.append(ends[: 1 if parallel else 2])
        return np.concatenate(columns)
