"""The two estimators of a point model: least squares, and instruments with least squares beside them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from freqid.core.arrays import Array
from freqid.core.results.point import ErrorsInVariables
from freqid.identify.regress.regression import LeastSquares, least_squares
from freqid.identify.regress.two_stage import WeakInstruments, two_stage_least_squares

Correct = Callable[[LeastSquares], LeastSquares]

# Below this first-stage F an estimate by instruments is neither unbiased nor normal (Staiger & Stock, 1997).
LEAST_STRENGTH = 10.0


@dataclass(frozen=True, eq=False)
class Estimate:
    """A fit with the covariance that holds for it.

    Attributes
    ----------
    fit : LeastSquares
    errors_in_variables : tuple of ErrorsInVariables or None, length R
        By response; None where least squares is all there is.
    """

    fit: LeastSquares
    errors_in_variables: tuple[ErrorsInVariables | None, ...]


def estimate(
    x: NDArray,
    z: NDArray,
    *,
    names: Sequence[str],
    response_names: Sequence[str],
    nuisance: NDArray,
    nuisance_names: Sequence[str],
    instruments: NDArray | None,
    correct: Correct,
    independent: float,
    confidence: float,
) -> Estimate:
    """Fit responses by least squares, or by instruments where there are some.

    Parameters
    ----------
    x, z : ndarray, shape (p, M) and (R, M)
        Regressors and responses on complex lines or real samples.
    names, response_names, nuisance, nuisance_names
        As in `least_squares`.
    instruments : ndarray, shape (p, M), or None
    correct : callable
        Gives a fit the covariance that holds, from `freqid.identify.regress.covariance_corrections`.
    independent : float
        Independent equations per equation, min(1, T df).
    confidence : float
        Level at which the two estimates are said to differ.

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
    named = {
        "names": names,
        "response_names": response_names,
        "nuisance": nuisance,
        "nuisance_names": nuisance_names,
    }
    plain = least_squares(x, z, **named)
    if instruments is None:
        return Estimate(correct(plain), (None,) * len(z))
    raw, strength = two_stage_least_squares(x, z, instruments, **named)
    strength = strength * independent
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
    tail = (1.0 - confidence) / (2 * len(names))
    critical = stdtrit(difference.degrees_of_freedom[:, len(nuisance) :], 1.0 - tail)
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
        said = " and ".join(f"'{name}' (first-stage F {f:.2g})" for name, f in weak)
        error = WeakInstruments(
            f"the injected signals hardly move {said} apart from the other regressors, expected an F of at "
            f"least {LEAST_STRENGTH:g}",
            remedy="excite it more, drop it from the regressors, or use the estimator 'least-squares'",
        )
        error.weakest = names[int(np.argmin(strength))]
        raise error
