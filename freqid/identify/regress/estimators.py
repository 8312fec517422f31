"""What an estimator of a point model is, how each is found by name, and the first of them: least squares."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TypedDict

from numpy.typing import NDArray

from freqid.core.errors import UsageError, nearest
from freqid.core.results.point import ErrorsInVariables
from freqid.core.sections.estimators import ESTIMATOR_NAMES
from freqid.identify.regress.regression import LeastSquares, least_squares


class _Columns(TypedDict):
    """Keywords of `least_squares`."""

    names: Sequence[str]
    response_names: Sequence[str]
    nuisance: NDArray
    nuisance_names: Sequence[str]


@dataclass(frozen=True, eq=False)
class Regression:
    """What an estimator is given.

    Attributes
    ----------
    x, z : ndarray, shape (p, M) and (R, M)
        Regressors and responses on complex lines or real samples.
    names, response_names, nuisance, nuisance_names
        As in `least_squares`.
    instruments : ndarray, shape (p, M), or None
        Where the estimator needs them.
    correct : callable
        Gives a fit the covariance that holds, from `freqid.identify.regress.covariance_corrections`.
    independent : float
        Independent equations per equation, min(1, T df).
    confidence : float
        Level at which two estimates are said to differ.
    """

    x: NDArray
    z: NDArray
    names: Sequence[str]
    response_names: Sequence[str]
    nuisance: NDArray
    nuisance_names: Sequence[str]
    instruments: NDArray | None
    correct: Callable[[LeastSquares], LeastSquares]
    independent: float
    confidence: float

    @property
    def columns(self) -> _Columns:
        """Names and nuisance columns, as keywords of `least_squares`."""
        return {
            "names": self.names,
            "response_names": self.response_names,
            "nuisance": self.nuisance,
            "nuisance_names": self.nuisance_names,
        }


@dataclass(frozen=True, eq=False)
class Estimate:
    """A fit with the covariance that holds for it.

    Attributes
    ----------
    fit : LeastSquares
    errors_in_variables : tuple of ErrorsInVariables or None, length R
        By response; None where there is no second estimate beside it.
    """

    fit: LeastSquares
    errors_in_variables: tuple[ErrorsInVariables | None, ...]


@dataclass(frozen=True)
class Estimator:
    """One estimator; its file in this folder holds one of these as ``ESTIMATOR``.

    Attributes
    ----------
    name : str
        Among `freqid.core.sections.estimators.ESTIMATOR_NAMES`.
    label : str
        What reports call it.
    fit : callable
        ``fit(regression) -> Estimate``; errors as `least_squares`.
    needs_instruments : bool
        Whether it needs the regressors as the injected signals alone would have made them.
    """

    name: str
    label: str
    fit: Callable[[Regression], Estimate]
    needs_instruments: bool = False


@cache
def estimators() -> dict[str, Estimator]:
    """Return the estimators of this folder by name."""
    modules = pkgutil.iter_modules([str(Path(__file__).parent)])
    loaded = [import_module(f"{__package__}.{module.name}") for module in modules]
    return {module.ESTIMATOR.name: module.ESTIMATOR for module in loaded if hasattr(module, "ESTIMATOR")}


def find_estimator(name: str) -> Estimator:
    """Return one estimator.

    Raises
    ------
    UsageError
        Where there is none of that name.
    """
    if name not in estimators():
        raise UsageError(f"estimator '{name}' is unknown", remedy=nearest(name, ESTIMATOR_NAMES))
    return estimators()[name]


def _fit(regression: Regression) -> Estimate:
    """Fit responses by least squares, which takes regressors to be free of noise."""
    fit = least_squares(regression.x, regression.z, **regression.columns)
    return Estimate(regression.correct(fit), (None,) * len(regression.z))


ESTIMATOR = Estimator("least-squares", "least squares", _fit)


def label_of(name: str) -> str:
    """Return what reports call an estimator; its name where a result is from one that is not here."""
    known = estimators().get(name)
    return known.label if known else name
