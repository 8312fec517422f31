"""Equation error sample by sample: parameters and standard errors while the manoeuvre is still flown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.core.arrays import Array
from freqid.core.errors import DataError, UsageError
from freqid.core.identification import Identification
from freqid.identify.in_flight.recursive_transform import RecursiveTransform
from freqid.identify.regress.regression import LeastSquares, least_squares
from freqid.identify.regress.uncertainty import correct_coloured_lines, correct_line_spacing
from freqid.identify.spectra.trend import trend_columns

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
