"""Least squares without the bias that the sensors' noise gives it, where that noise shows in the record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import eigh

from freqid.core.arrays import Array
from freqid.core.results.point import ResponseModel
from freqid.identify.model.line_equations import LineEquations
from freqid.identify.model.problem import Problem
from freqid.identify.model.widening import with_covariance
from freqid.identify.regress.equations import real_equations
from freqid.identify.spectra.smoothing import smooth

MOST_NOISE = 0.5
"""Share of noise in a combination of regressors beyond which no more of it is taken off."""


def without_noise_bias(problem: Problem, equations: LineEquations, model: ResponseModel) -> ResponseModel:
    """Return a fit by least squares with the bias of noise in its regressors taken off.

    Parameters
    ----------
    problem : Problem
    equations : LineEquations
        Of all regressors of the problem.
    model : ResponseModel
        Of one response, fitted by least squares to these equations.

    Returns
    -------
    ResponseModel
        Other estimate, covariance and limits; what else it says is that of the fit.

    Notes
    -----
    With A the normal matrix of the measured regressors and N that of their noise, least squares converges to
    ``A^-1 (A - N) theta``; the estimate returned is ``(A - N)^-1 A`` times that of the fit, and its
    covariance follows. The noise is taken to be white and of its own in each regressor, as strong as Fourier
    smoothing sees it: then its transform has variance ``sigma^2 T dt`` on every line. Noise that is not
    white is seen too small, and gusts that a regressor lacks are not seen at all.

    References
    ----------
    Fuller, *Measurement Error Models*, Wiley 1987, section 1.2.
    """
    columns = [problem.names.index(n) for n in model.regressors]
    ends, rows = real_equations(equations.nuisance, equations.x[columns])
    if len(ends):
        basis = np.linalg.qr(ends.T)[0]
        rows = rows - (rows @ basis) @ basis.T
    normal = rows @ rows.T
    free = 1 - len(ends) / ends.shape[1]  # of the equations, which end terms take some of
    noise = free * _noise_power(problem, equations)[columns]
    share, along = eigh(np.diag(noise), normal)  # of the noise in each combination of regressors
    gain = along @ np.diag(1 / (1 - np.minimum(share, MOST_NOISE))) @ along.T @ normal
    estimate = gain @ model.estimate
    moved = estimate - model.estimate
    shifted = replace(model, estimate=estimate, lower=model.lower + moved, upper=model.upper + moved)
    return with_covariance(shifted, gain @ model.covariance @ gain.T)


def _noise_power(problem: Problem, equations: LineEquations) -> Array:
    """Return the sum over all lines of the power that noise has in each regressor, shape (p,)."""
    power = np.zeros(len(problem.names))
    weights = np.split(equations.weight, len(problem.x))
    for x, dt, weight in zip(problem.x, problem.dt, weights, strict=True):
        power += smooth(x, dt).noise_std ** 2 * x.shape[1] * dt**2 * (weight**2).sum()
    return power
