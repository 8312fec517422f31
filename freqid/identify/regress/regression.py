"""Equation error by linear least squares, on complex lines or real samples, with its diagnostics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.lapack import dtrtri

from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.identify.regress.confidence_interval import confidence_interval
from freqid.identify.regress.equations import checked_channels, real_equations, refuse_zero

PERFECT = 1e-12
"""Ratio of singular values of unit columns below which columns count as exactly dependent: some 5000
rounding errors, and far below what the noise of any measured signal leaves."""


@dataclass(frozen=True)
class Collinearity:
    """Belsley's diagnostics of the columns of a regression, each scaled to unit length.

    Parameters
    ----------
    names : tuple of str, length n
        The columns: nuisance columns first, then regressors.
    condition_index : ndarray, shape (n,)
        Largest singular value over each singular value, ascending; the last is the condition number.
    direction : ndarray, shape (n, n)
        Row i: the combination of unit columns that belongs to condition index i (right singular vector).
    proportion : ndarray, shape (n, n)
        Row i, column j: the share of the variance of estimate j that comes from direction i (the
        variance-decomposition proportions). Every column sums to one.
    inflation : ndarray, shape (n,)
        Variance inflation factor of each column: 1 / (1 - R2) of that column regressed on the others.
        Of a regressor it is taken after the nuisance columns are projected out, which makes it the
        usual, centred factor where the nuisance column is a constant.

    References
    ----------
    Belsley, Kuh, Welsch, *Regression Diagnostics*, Wiley 1980, ch. 3; Klein & Morelli, *Aircraft System
    Identification*, 2nd ed., ch. 5 (data collinearity).
    """

    names: tuple[str, ...]
    condition_index: NDArray[np.float64]
    direction: NDArray[np.float64]
    proportion: NDArray[np.float64]
    inflation: NDArray[np.float64]

    @property
    def condition_number(self) -> float:
        """Ratio of the largest to the smallest singular value of the unit columns."""
        return float(self.condition_index[-1])

    def inseparable(
        self, *, condition_index: float = 30.0, proportion: float = 0.5
    ) -> tuple[tuple[str, ...], ...]:
        """Name the groups of parameters that these data cannot tell apart.

        Parameters
        ----------
        condition_index : float
            A direction is weak where its condition index exceeds this.
        proportion : float
            A parameter is involved where more than this share of its variance comes from the weak
            directions together.

        Returns
        -------
        tuple of tuple of str
            The groups, each of at least two names; empty where the data separate everything.

        Notes
        -----
        Where several directions are weak, the data fix the space they span but hardly the directions
        themselves, so one row of `proportion` can hide a dependence or mix two. Belsley therefore sums
        the proportions over such directions; the names found are then sorted into groups by the
        projector on the space, which does not depend on the mixing.
        """
        weak = self.condition_index > condition_index
        involved = np.flatnonzero(self.proportion[weak].sum(axis=0) > proportion)
        return _groups(self.names, self.direction[weak], involved)


def examine_columns(factor: NDArray[np.float64], names: Sequence[str], n_nuisance: int) -> Collinearity:
    """Examine the columns of a regression through their triangular factor.

    Parameters
    ----------
    factor : ndarray, shape (n, n)
        R of the QR decomposition of the columns, each scaled to unit length, nuisance columns first.
    names : sequence of str, length n
        Names of the columns.
    n_nuisance : int
        How many of the first columns are nuisance columns.

    Returns
    -------
    Collinearity
        The diagnostics.

    Raises
    ------
    DataError
        Where columns are exactly dependent; the sentence names them.
    """
    names = tuple(names)
    _, singular, direction = np.linalg.svd(factor)
    null = direction[singular < PERFECT * singular[0]]
    if len(null):
        groups = _groups(names, null, np.flatnonzero((null**2).sum(axis=0) > 1e-8))
        raise DataError(
            "; ".join(" and ".join(f"'{name}'" for name in group) for group in groups)
            + " are perfectly collinear over these data, so their parameters cannot be told apart",
            remedy="keep one of them, or excite them independently",
        )
    variance = (direction / singular[:, None]) ** 2
    total = variance.sum(axis=0)
    free = factor.copy()  # what the nuisance columns leave of each regressor
    free[:n_nuisance, n_nuisance:] = 0.0
    inflation = total * (free**2).sum(axis=0)
    return Collinearity(names, singular[0] / singular, direction, variance / total, inflation)


def _groups(
    names: tuple[str, ...], span: NDArray[np.float64], involved: NDArray[np.intp]
) -> tuple[tuple[str, ...], ...]:
    """Split the involved columns into sets that the projector on a row space connects."""
    if len(involved) < 2:
        return ()
    projector = span.T @ span
    length = np.sqrt(np.diag(projector))
    # m columns that all equal each other are connected by 1 / (m - 1), separate sets by nearly nothing.
    linked = np.abs(projector) > 0.5 / (len(involved) - 1) * np.outer(length, length)
    left, groups = [int(index) for index in involved], []
    while left:
        group: list[int] = [left.pop(0)]
        for member in group:  # grows while it is walked
            group += [other for other in left if linked[member, other]]
            left = [other for other in left if other not in group]
        if len(group) > 1:
            groups.append(tuple(names[index] for index in sorted(group)))
    return tuple(groups)


@dataclass(frozen=True)
class LeastSquares:
    """Estimates of R responses on the same p regressors and q nuisance columns over M lines or samples.

    Parameters
    ----------
    names, nuisance_names, response_names : tuple of str
        The p regressors, the q nuisance columns and the R responses.
    solution : ndarray, shape (R, q + p)
        Estimates, nuisance columns first; unit of the response per unit of the column.
    solution_covariance : ndarray, shape (R, q + p, q + p)
        Their covariance. As solved it holds for white residuals whose real equations are all
        independent; `freqid.identify.regress.covariance_corrections` corrects it.
    degrees_of_freedom : ndarray, shape (R, q + p)
        Of the variance behind each standard error, for Student's t.
    equations : int
        Real equations: 2 M for complex lines, M for real samples.
    residual : ndarray, shape (R, M), complex or real
        Response less its fit, unit of the response.
    total_square : ndarray, shape (R,)
        Sum of squares of each response that regressors could explain: what the nuisance columns leave,
        about the mean where the data are real samples.
    dual : ndarray, shape (q + p, M), complex or real
        The weights that make the estimates, `solution = Re(responses @ dual^H)`.
    leverage : ndarray, shape (M,)
        Parameters that each line or sample fixes on its own; they add up to q + p.
    collinearity : Collinearity
        What the data can separate: condition indices, variance proportions, inflation factors.
    """

    names: tuple[str, ...]
    nuisance_names: tuple[str, ...]
    response_names: tuple[str, ...]
    solution: Array
    solution_covariance: Array
    degrees_of_freedom: Array
    equations: int
    residual: NDArray
    total_square: Array
    dual: NDArray
    leverage: Array
    collinearity: Collinearity

    @property
    def estimate(self) -> Array:
        """Parameters, shape (R, p)."""
        return self.solution[:, len(self.nuisance_names) :]

    @property
    def nuisance_estimate(self) -> Array:
        """Coefficients of the nuisance columns, shape (R, q)."""
        return self.solution[:, : len(self.nuisance_names)]

    @cached_property
    def solution_std_error(self) -> Array:
        """Standard errors of nuisance coefficients and parameters, shape (R, q + p)."""
        return np.sqrt(np.einsum("rii->ri", self.solution_covariance))

    @property
    def std_error(self) -> Array:
        """Standard errors of the parameters, shape (R, p)."""
        return self.solution_std_error[:, len(self.nuisance_names) :]

    @property
    def nuisance_std_error(self) -> Array:
        """Standard errors of the nuisance coefficients, shape (R, q)."""
        return self.solution_std_error[:, : len(self.nuisance_names)]

    @property
    def covariance(self) -> Array:
        """Covariance of the parameters, shape (R, p, p)."""
        q = len(self.nuisance_names)
        return self.solution_covariance[:, q:, q:]

    @cached_property
    def correlation(self) -> Array:
        """Correlation of the parameters' errors, shape (R, p, p)."""
        with np.errstate(invalid="ignore"):  # a response that is fitted exactly has no errors: nan
            return self.covariance / (self.std_error[:, :, None] * self.std_error[:, None, :])

    @property
    def t_statistic(self) -> Array:
        """Estimate over standard error, shape (R, p)."""
        with np.errstate(invalid="ignore", divide="ignore"):  # infinite where the fit is exact
            return self.estimate / self.std_error

    @property
    def variance_inflation(self) -> Array:
        """Variance inflation factor of each parameter, shape (p,)."""
        return self.collinearity.inflation[len(self.nuisance_names) :]

    @cached_property
    def residual_square(self) -> Array:
        """Sum of squared residual magnitudes, shape (R,)."""
        return np.einsum("rm,rm->r", self.residual.conj(), self.residual).real

    @property
    def fit_error(self) -> Array:
        """Standard deviation of the residual of one real equation, sqrt(s2), shape (R,)."""
        return np.sqrt(self.residual_square / (self.equations - self.solution.shape[1]))

    @property
    def r2(self) -> Array:
        """Coefficient of determination, shape (R,); 1 is a perfect fit."""
        with np.errstate(invalid="ignore"):  # a response that is zero throughout: nan
            return 1.0 - self.residual_square / self.total_square

    @property
    def pse(self) -> Array:
        """Predicted squared error of one real equation, shape (R,).

        The mean squared residual plus the penalty s2max n / N, where n = q + p columns are fitted to N
        real equations and s2max is the mean square of the response.
        """
        penalty = self.total_square * self.solution.shape[1] / self.equations
        return (self.residual_square + penalty) / self.equations

    def interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """Return lower and upper confidence limits of the parameters, each of shape (R, p).

        Parameters
        ----------
        level : float
            Probability that an interval holds its true parameter.
        """
        dof = self.degrees_of_freedom[:, len(self.nuisance_names) :]
        return confidence_interval(self.estimate, self.std_error, level=level, degrees_of_freedom=dof)


def least_squares(
    regressors: ArrayLike,
    responses: ArrayLike,
    *,
    names: Sequence[str] | None = None,
    response_names: Sequence[str] | None = None,
    nuisance: ArrayLike | None = None,
    nuisance_names: Sequence[str] | None = None,
) -> LeastSquares:
    """Fit responses that share regressors, by one QR of the stacked real and imaginary parts.

    Parameters
    ----------
    regressors : array_like, shape (p, M), complex or real
        Transforms on M lines, or M samples.
    responses : array_like, shape (R, M), complex or real
        Responses on the same lines or samples.
    names, response_names : sequence of str, optional
        Names for results and errors; numbered where not given.
    nuisance : array_like, shape (q, M), optional
        Columns estimated along and reported apart: the end terms `1` and `exp(-2j pi f T)` of a
        transformed derivative, or a constant.
    nuisance_names : sequence of str, optional
        Their names.

    Returns
    -------
    LeastSquares
        Estimates, uncertainties and diagnostics.

    Raises
    ------
    DataError
        A channel is not finite or zero throughout, columns are perfectly collinear, or there are no
        more equations than unknowns.
    UsageError
        Shapes or numbers of names do not agree, or a name comes twice.

    Notes
    -----
    The estimate is `theta = Re(Phi^H Phi)^-1 Re(Phi^H z)`, the ordinary one on stacked real and
    imaginary parts; where all data are real it is ordinary least squares. The normal matrix is never
    formed, so rounding grows with the condition number and not with its square. Columns are scaled to
    unit length first.

    References
    ----------
    Klein & Morelli, *Aircraft System Identification*, 2nd ed., ch. 5 (regression, diagnostics, PSE) and
    ch. 7 (complex least squares in the frequency domain).
    """
    phi, names = checked_channels(regressors, names, "regressor")
    z, response_names = checked_channels(responses, response_names, "response")
    if nuisance is None:
        nuisance = np.empty((0, phi.shape[1]))
    extra, nuisance_names = checked_channels(nuisance, nuisance_names, "nuisance column")
    stacked_phi, stacked_z, stacked_extra = real_equations(phi, z, extra)
    stacked, column_names = np.concatenate([stacked_extra, stacked_phi]), nuisance_names + names
    (n_columns, equations), n_lines = stacked.shape, z.shape[1]
    complex_data = equations > n_lines
    if equations <= n_columns:
        raise DataError(
            f"{len(names)} regressors and {len(extra)} nuisance columns need more than {n_columns} real "
            f"equations, but {n_lines} {'lines' if complex_data else 'samples'} give {equations}",
            remedy="use more lines or a longer record, or drop regressors",
        )
    length = refuse_zero(stacked, column_names)
    basis, factor = np.linalg.qr((stacked / length[:, None]).T)
    collinearity = examine_columns(factor, column_names, len(extra))
    inverse = dtrtri(factor)[0] / length[:, None]

    projection = stacked_z @ basis
    solution = projection @ inverse.T
    residual = z - solution @ np.concatenate([extra, phi])
    dof = equations - n_columns
    variance = np.einsum("rm,rm->r", residual.conj(), residual).real / dof
    explainable = stacked_z - projection[:, : len(extra)] @ basis[:, : len(extra)].T
    total_square = np.einsum("re,re->r", explainable, explainable)
    if not complex_data:
        total_square -= explainable.sum(axis=1) ** 2 / equations
    dual, leverage = inverse @ basis.T, (basis**2).sum(axis=1)
    if complex_data:
        dual = dual[:, :n_lines] + 1j * dual[:, n_lines:]
        leverage = leverage[:n_lines] + leverage[n_lines:]
    return LeastSquares(
        names=names,
        nuisance_names=nuisance_names,
        response_names=response_names,
        solution=solution,
        solution_covariance=variance[:, None, None] * (inverse @ inverse.T),
        degrees_of_freedom=np.full(solution.shape, float(dof)),
        equations=equations,
        residual=residual,
        total_square=total_square,
        dual=dual,
        leverage=leverage,
        collinearity=collinearity,
    )
