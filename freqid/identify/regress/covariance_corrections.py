"""Corrected covariances of least-squares estimates: dense lines, coloured residuals.

`least_squares` takes residuals to be white and equations to be independent. Neither holds where lines lie
closer than the reciprocal of the record's length, or where unmodelled motion colours the residual. Each
function here returns the same fit with its covariance and degrees of freedom replaced; the estimates stay.
How well the intervals then cover is measured in docs/theory/regression.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import next_fast_len, rfft

from freqid.core.arrays import Array
from freqid.core.errors import DataError, UsageError
from freqid.identify.regress.regression import LeastSquares

FREE_SHARE = 0.25
"""Least share of the equations in a smoothing window that the fit must leave free. Where parameters
take nearly all of them, their residuals say nothing about the noise there and the window widens."""


def correct_line_spacing(
    fit: LeastSquares, frequencies: ArrayLike | Sequence[ArrayLike], duration: float | Sequence[float]
) -> LeastSquares:
    """Correct a fit for lines closer than 1/T, residuals taken as white.

    Parameters
    ----------
    fit : LeastSquares
        A fit on complex lines.
    frequencies : array_like, shape (M,), or a sequence of them
        Its lines, Hz, ascending; where several manoeuvres are fitted together, one after another, those
        of each.
    duration : float, or a sequence of them
        Length T of the record that was transformed, or of each, s.

    Returns
    -------
    LeastSquares
        The fit with wider standard errors and fewer degrees of freedom; unchanged where no spacing is
        below 1/T.

    Raises
    ------
    DataError
        The record resolves fewer equations than there are columns.

    Notes
    -----
    White noise over T has transforms whose correlation between lines is sinc((f_m - f_n) T). For
    `k = min(1, T df)` this matrix acts on anything that lasts T as 1/k, hence with independent-equation
    results s2 (Re Phi^H Phi)^-1 and s2 = e^H e / (2M - n):

    - the covariance is sigma2 (Re Phi^H Phi)^-1 / k;
    - E e^H e = sigma2 (2M - n / k), because fitting removes n / k and not n times sigma2;
    - e^H e is distributed as chi-square with 2Mk - n degrees of freedom.

    Together: the covariance of `least_squares` times (2M - n) / (2Mk - n), and Student's t with 2Mk - n
    degrees of freedom. Dividing by k alone ignores the second line. Of several manoeuvres 2Mk is the
    sum; their lines are to be weighted by sqrt(k / T), which makes the noise of all alike.
    """
    share = _lines_of(fit, frequencies, duration).share
    n = fit.solution.shape[1]
    independent = 2 * share.sum()
    naive, effective = fit.equations - n, independent - n
    if effective <= 0:
        raise DataError(
            f"lines {share.min():.2g} of 1/T apart make {fit.equations} real equations worth "
            f"{independent:.1f} independent ones, not enough for {n} columns",
            remedy="use a longer record, a wider band or fewer regressors",
        )
    return replace(
        fit,
        solution_covariance=fit.solution_covariance * (naive / effective),
        degrees_of_freedom=np.full_like(fit.degrees_of_freedom, effective),
    )


def correct_coloured_lines(
    fit: LeastSquares,
    frequencies: ArrayLike | Sequence[ArrayLike],
    duration: float | Sequence[float],
    *,
    half_width: float = 2.0,
) -> LeastSquares:
    """Correct a fit on complex lines for coloured residuals, and for lines closer than 1/T.

    Parameters
    ----------
    fit : LeastSquares
        A fit on complex lines.
    frequencies, duration
        As in `correct_line_spacing`; each manoeuvre's residual has a spectrum of its own.
    half_width : float
        Half width of the window that smooths the residual's power, in units of 1/T.

    Returns
    -------
    LeastSquares
        The fit with the covariance that its residual's spectrum implies.

    Notes
    -----
    `Cov = Re(D S D^H) / k`, with D the dual of the columns (`theta = Re(z D^H)`), S(f) the residual's
    power per real equation smoothed over neighbouring lines, and k as in `correct_line_spacing`. The
    fit takes leverage h of a line's two equations away, so S is the sum of |e|^2 over the sum of
    2 - h / k. Each variance is a weighted sum of |e|^2, nearly exponential variables, so its degrees of
    freedom follow Satterthwaite, one number per parameter.
    """
    axis = _lines_of(fit, frequencies, duration)
    count = np.full(axis.share.size, 2.0)
    free = count - fit.leverage / axis.share
    return _coloured(fit, fit.dual, np.abs(fit.residual) ** 2, free, count, axis, half_width)


def correct_coloured_samples(
    fit: LeastSquares, *, samples: Sequence[int] | None = None, half_width: float = 2.0
) -> LeastSquares:
    """Correct a fit on real, uniform samples for coloured residuals.

    Parameters
    ----------
    fit : LeastSquares
        A fit on N real samples, uniform in time.
    samples : sequence of int, optional
        Where several manoeuvres are fitted together, one after another, the number of samples of each.
    half_width : float
        Half width of the window that smooths the residual's power, in units of 1/T.

    Returns
    -------
    LeastSquares
        The fit with the covariance that its residual's spectrum implies.

    Notes
    -----
    The covariance `D R D^T`, D the dual and R the Toeplitz matrix of the residual's autocovariance, is
    in the frequency domain the sum of |D(f)|^2 S(f): `correct_coloured_lines` on the lines of the padded
    transform. Against `correct_by_autocorrelation` it differs in smoothing S, in the power that the fit
    took away, and in the degrees of freedom.
    """
    ends = np.cumsum([_samples_of(fit)] if samples is None else samples)
    if ends[-1] != _samples_of(fit):
        raise UsageError(f"manoeuvres of {ends[-1]} samples do not make up a fit on {_samples_of(fit)}")
    basis = np.linalg.qr(fit.dual.T)[0].T  # orthonormal, spans the columns: its power is the leverage
    parts: list[list[Array]] = [[], [], [], []]
    shares, positions = [], []
    for rows in zip(*(np.split(v, ends[:-1], axis=1) for v in (fit.residual, fit.dual, basis)), strict=True):
        n_samples = rows[0].shape[1]
        padded = next_fast_len(2 * n_samples, real=True)
        residual, dual, taken = (rfft(row, padded) for row in rows)
        count = np.full(dual.shape[1], 2.0)  # each line stands for its mirror image too, but these do not
        count[0] = 1.0
        if padded % 2 == 0:
            count[-1] = 1.0
        shares.append(np.full(count.size, n_samples / padded))
        positions.append(np.arange(count.size) * n_samples / padded)
        free = count * (1.0 - (np.abs(taken) ** 2).sum(axis=0) / n_samples)
        weighted = dual * np.sqrt(count * n_samples) / padded
        for part, values in zip(
            parts, (weighted, count * np.abs(residual) ** 2 / n_samples, free, count), strict=True
        ):
            part.append(values)
    dual, power, free, count = (np.concatenate(part, axis=-1) for part in parts)
    return _coloured(fit, dual, power, free, count, _Axis.of(positions, shares), half_width)


def correct_by_autocorrelation(fit: LeastSquares) -> LeastSquares:
    """Correct a fit on real samples by its residual's autocorrelation as Morelli and Klein do.

    Parameters
    ----------
    fit : LeastSquares
        A fit on N real samples, uniform in time.

    Returns
    -------
    LeastSquares
        The fit with `Cov = D R D^T`, R(i - j) the biased autocorrelation of the residual at all lags.

    Notes
    -----
    Kept for comparison with published standard errors, which it reproduces. Its intervals are too
    narrow (docs/theory/regression.md), because the residual has lost the power that the parameters
    fitted; `correct_coloured_samples` accounts for that. The biased estimate, divided by N at every lag,
    is the one whose spectrum cannot be negative, so a variance cannot be either; unbiased or truncated
    lags give other numbers than the published ones, and zero for the bias of Cn of the Twin Otter.

    References
    ----------
    Morelli & Klein, "Accuracy of Aerodynamic Model Parameters Estimated from Flight Test Data",
    J. Guidance, Control, and Dynamics 20(1), 1997.
    """
    n_samples = _samples_of(fit)
    padded = next_fast_len(2 * n_samples, real=True)
    power = np.abs(rfft(fit.residual, padded)) ** 2 / n_samples
    dual = rfft(fit.dual, padded)
    power[:, 1 : (padded + 1) // 2] *= 2.0
    covariance = np.stack([((dual * row) @ dual.conj().T).real / padded for row in power])
    return replace(fit, solution_covariance=covariance)


def _coloured(
    fit: LeastSquares,
    dual: NDArray,
    power: Array,
    free: Array,
    count: Array,
    axis: _Axis,
    half_width: float,
) -> LeastSquares:
    """Give a fit the covariance and degrees of freedom that a smoothed spectrum implies.

    Parameters
    ----------
    dual : ndarray, shape (n, K), complex
        Weights of the lines.
    power : ndarray, shape (R, K)
        Residual power of each line; its mean is S times `free`.
    free, count : ndarray, shape (K,)
        Real equations of each line, less and with those that the fit took.
    """
    position, share = axis.position, axis.share
    while True:
        first = np.searchsorted(position, position - half_width * (1 + 1e-9))
        last = np.searchsorted(position, position + half_width * (1 + 1e-9), side="right")
        free_near = _window_sum(free, first, last)
        if (free_near >= FREE_SHARE * _window_sum(count, first, last)).all():
            break
        if half_width > axis.longest:
            raise DataError(
                f"{dual.shape[0]} columns leave too little of the residual free to tell its spectrum",
                remedy="use a longer record, a wider band or fewer regressors",
            )
        half_width += 1.0
    spectrum = _window_sum(power, first, last) / free_near
    covariance = np.stack([((dual * (row / share)) @ dual.conj().T).real for row in spectrum])
    # A variance is a sum over lines of gain times power. A power has mean S free; what it adds to the
    # scatter of the sum, with its share of the correlations that the fit made, is 2 S^2 free, and
    # 1/share neighbours move together. S has few degrees of freedom itself, which makes its square too
    # large by 1 + 2 / window, and that of the whole sum by 1 + 2 / dof.
    gain = _window_sum(np.abs(dual) ** 2 / (free_near * share), first, last)
    window = share * free_near
    scatter = (spectrum**2 / (1.0 + 2.0 / window) * np.maximum(free, 0.0) / share) @ (gain**2).T
    dof = np.maximum(((spectrum * free) @ gain.T) ** 2 / scatter - 2.0, 1.0)
    return replace(fit, solution_covariance=covariance, degrees_of_freedom=dof)


def _window_sum(values: Array, first: NDArray[np.intp], last: NDArray[np.intp]) -> Array:
    """Sum the last axis over the window [first, last) of each line."""
    running = np.concatenate([np.zeros((*values.shape[:-1], 1)), values.cumsum(axis=-1)], axis=-1)
    return running[..., last] - running[..., first]


def independent_share(lines_hz: Array, duration: float) -> float:
    """Return k = min(1, T df), the independent lines per line of a record that lasts T."""
    return float(min(1.0, duration * np.diff(lines_hz).min())) if len(lines_hz) > 1 else 1.0


@dataclass(frozen=True, eq=False)
class _Axis:
    """Where the lines of all manoeuvres lie: position in units of 1/T, and independent lines per line."""

    position: Array
    share: Array
    longest: float

    @classmethod
    def of(cls, positions: Sequence[Array], shares: Sequence[Array]) -> _Axis:
        """Put manoeuvres so far apart that no window, as wide as the longest of them, reaches two."""
        longest = max(float(p[-1] - p[0]) for p in positions)
        apart = 4.0 * (longest + 1.0)
        placed = [p - p[0] + i * apart for i, p in enumerate(positions)]
        return cls(np.concatenate(placed), np.concatenate(shares), longest)


def _lines_of(
    fit: LeastSquares, frequencies: ArrayLike | Sequence[ArrayLike], duration: float | Sequence[float]
) -> _Axis:
    """Check that the frequencies belong to a fit on complex lines."""
    if not np.iscomplexobj(fit.residual):
        raise UsageError(
            "the fit is on real samples, not on complex lines", remedy="use correct_coloured_samples"
        )
    if isinstance(duration, Sequence):
        each = [np.asarray(f, dtype=np.float64) for f in frequencies]  # type: ignore[union-attr]
    else:
        each, duration = [np.asarray(frequencies, dtype=np.float64)], [duration]
    found = [lines.size for lines in each]
    if sum(found) != fit.residual.shape[1] or any((np.diff(lines) <= 0).any() for lines in each):
        raise UsageError(f"the fit needs {fit.residual.shape[1]} ascending frequencies, found {found}")
    shares = [np.full(f.size, independent_share(f, t)) for f, t in zip(each, duration, strict=True)]
    return _Axis.of([f * t for f, t in zip(each, duration, strict=True)], shares)


def _samples_of(fit: LeastSquares) -> int:
    """Return the number of samples of a fit on real data."""
    if np.iscomplexobj(fit.residual):
        raise UsageError("the fit is on complex lines, not on samples", remedy="use correct_coloured_lines")
    return fit.residual.shape[1]
