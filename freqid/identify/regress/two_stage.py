"""Two-stage least squares: equation error with instruments, for regressors that are measured with noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.core.results.point import ErrorsInVariables
from freqid.identify.regress.equations import checked_channels, real_equations
from freqid.identify.regress.estimators import Estimate, Estimator, Regression
from freqid.identify.regress.regression import LeastSquares, least_squares

# Below this first-stage F an estimate by instruments is neither unbiased nor normal (Staiger & Stock, 1997).
LEAST_STRENGTH = 10.0


class WeakInstruments(DataError):
    """An instrument that does not move its regressor; an estimate with it would mean nothing.

    Attributes
    ----------
    weakest : str
        The regressor to leave out first: what is weak makes its neighbours look weak.
    """

    weakest: str = ""


def two_stage_least_squares(
    regressors: ArrayLike,
    responses: ArrayLike,
    instruments: ArrayLike,
    *,
    names: Sequence[str] | None = None,
    response_names: Sequence[str] | None = None,
    nuisance: ArrayLike | None = None,
    nuisance_names: Sequence[str] | None = None,
) -> tuple[LeastSquares, Array]:
    """Fit responses by the part of their regressors that instruments explain.

    Parameters
    ----------
    regressors : array_like, shape (p, M), complex lines or real samples
        As measured.
    responses : array_like, shape (R, M)
    instruments : array_like, shape (p, M)
        One for each regressor, in its unit: resembles it and knows nothing of the noise in it.
    names, response_names, nuisance, nuisance_names
        As in `least_squares`; nuisance columns are free of noise and their own instruments.

    Returns
    -------
    fit : LeastSquares
        Its residual is that of the measured regressors; collinearity and the condition number are those
        of what the instruments explain.
    strength : ndarray, shape (p,)
        First-stage F statistic of each regressor, one degree of freedom: the square of that part of its
        instrument that no other column has, over what noise alone would make of it.

    Raises
    ------
    DataError
        As `least_squares`, and where instruments are fewer than regressors.
    WeakInstruments
        An instrument is zero throughout.

    Notes
    -----
    On stacked real and imaginary parts ``P = Z (Z^T Z)^-1 Z^T Phi``, ``theta = (P^T Phi)^-1 P^T z`` and, as P
    is a projection, ``P^T Phi = P^T P``: least squares on P, with the residual ``z - Phi theta``. Real
    coefficients keep as many instruments as regressors; complex ones double them, and what is fitted of the
    regressors' noise then pulls the estimate back towards least squares (docs/theory/instruments.md).

    References
    ----------
    Larsson et al., *Aerospace* 7(9), 2020 (instruments with multisines in the frequency domain); Staiger &
    Stock, *Econometrica* 65(3), 1997 (weak instruments: a first-stage F below ten).
    """
    phi, names = checked_channels(regressors, names, "regressor")
    driven, _ = checked_channels(instruments, names, "instrument")
    z, response_names = checked_channels(responses, response_names, "response")
    extra = np.empty((0, phi.shape[1])) if nuisance is None else np.asarray(nuisance)
    q, lines = len(extra), phi.shape[1]
    columns = np.concatenate([extra, phi])
    stacked, instrumental = real_equations(columns, np.concatenate([extra, driven]))
    length = np.sqrt(np.einsum("ne,ne->n", instrumental, instrumental))
    if not length.all():
        weakest = names[int(np.argmin(length)) - q]
        error = WeakInstruments(
            f"the injected signals do not move regressor '{weakest}'",
            remedy="drop it from the regressors, or excite it",
        )
        error.weakest = weakest
        raise error
    basis = np.linalg.qr((instrumental / length[:, None]).T)[0]
    explained = (stacked @ basis) @ basis.T
    if stacked.shape[1] > lines:
        explained = explained[:, :lines] + 1j * explained[:, lines:]
    fit = least_squares(
        explained[q:],
        z,
        names=names,
        response_names=response_names,
        nuisance=explained[:q],
        nuisance_names=nuisance_names,
    )
    residual = z - fit.solution @ columns
    dof = fit.equations - len(columns)
    variance = np.einsum("rm,rm->r", residual.conj(), residual).real / dof
    unit_covariance = np.real(fit.dual @ fit.dual.conj().T)
    noise = np.einsum("nm,nm->n", (phi - explained[q:]).conj(), phi - explained[q:]).real / dof
    with np.errstate(divide="ignore"):  # a regressor without any noise is infinitely well known
        strength = 1.0 / (np.diag(unit_covariance)[q:] * noise)
    fit = replace(fit, residual=residual, solution_covariance=variance[:, None, None] * unit_covariance[None])
    return fit, strength


def _fit(regression: Regression) -> Estimate:
    """Fit responses by instruments, with least squares beside them.

    Raises
    ------
    DataError
        As `least_squares`.
    WeakInstruments
        Naming the regressors that the injected signals hardly move.

    Notes
    -----
    Were the regressors free of noise, both estimates would be ``theta + Re(e D^H)`` with the same residual
    e and their own weights D; so their difference has the covariance of weights ``D_iv - D_ls``, whatever the
    colour of e.
    """
    x, z, correct, names = regression.x, regression.z, regression.correct, regression.names
    assert regression.instruments is not None  # the estimator says that it needs them
    plain = least_squares(x, z, **regression.columns)
    raw, strength = two_stage_least_squares(x, z, regression.instruments, **regression.columns)
    strength = strength * regression.independent
    _refuse_weak(names, strength)
    weights = raw.dual - plain.dual
    difference = correct(
        replace(
            raw,
            dual=weights,
            solution_covariance=(raw.fit_error**2)[:, None, None] * np.real(weights @ weights.conj().T),
        )
    )
    plain = correct(plain)
    tail = (1.0 - regression.confidence) / (2 * len(names))
    critical = stdtrit(difference.degrees_of_freedom[:, len(regression.nuisance) :], 1.0 - tail)
    beside = tuple(
        ErrorsInVariables(
            estimate=plain.estimate[r],
            std_error=plain.std_error[r],
            difference_std_error=difference.std_error[r],
            critical=critical[r],
            strength=strength,
        )
        for r in range(len(z))
    )
    return Estimate(correct(raw), beside)


def _refuse_weak(names: Sequence[str], strength: Array) -> None:
    """Name the regressors that the injected signals do not move enough."""
    weak = [(name, f) for name, f in zip(names, strength, strict=True) if f < LEAST_STRENGTH]
    if weak:
        weakest = " and ".join(f"'{name}' (first-stage F {f:.2g})" for name, f in weak)
        error = WeakInstruments(
            f"the injected signals hardly move {weakest} apart from the other regressors, expected an F of "
            f"at least {LEAST_STRENGTH:g}",
            remedy="excite it more, drop it from the regressors, or use the estimator 'least-squares'",
        )
        error.weakest = names[int(np.argmin(strength))]
        raise error


ESTIMATOR = Estimator("instruments", "instruments, least squares beside it", _fit, needs_instruments=True)
