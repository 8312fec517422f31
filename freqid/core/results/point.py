"""What identification gives: a point model of the applied wrench at one reference condition, and its file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import Any

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.core.layout import Attribute, Attributes, Dataset, Nested, NestedSeries, ResultFile, Table
from freqid.core.results.fit import Fit, fit_layout
from freqid.core.scenario import Reference
from freqid.core.vehicle import Vehicle
from freqid.core.viewable import Viewable

DISTORTED = 1.5
"""Distortion from which a response is taken to be bent: of a linear one it is 1.1 +- 0.17 on 106 lines."""
NEAR_CEILING = 0.02
"""Below what noise allows, where R2 is still said to reach it."""


@dataclass(frozen=True)
class ErrorsInVariables:
    """Least squares beside an estimate by instruments, and where noise in the regressors tells them apart.

    Attributes
    ----------
    estimate, std_error : ndarray, shape (p,)
        By least squares, unit of the response per unit of the regressor.
    difference_std_error : ndarray, shape (p,)
        Standard deviation of instruments less least squares, were the regressors free of noise.
    critical : ndarray, shape (p,)
        What the difference over its standard deviation would then exceed in any of the p parameters
        with the probability that the confidence level leaves.
    strength : ndarray, shape (p,)
        First-stage F statistic of each regressor; below ten its instrument is too weak.
    """

    estimate: Array
    std_error: Array
    difference_std_error: Array
    critical: Array
    strength: Array


@dataclass(frozen=True)
class Collinear:
    """Two regressors that moved together, as far as the data say.

    Attributes
    ----------
    regressors : tuple of 2 str
        The one with the largest variance inflation, and its nearest companion.
    inflation : float
        Variance inflation factor of the first.
    correlation : float
        Of the errors of the two parameters.
    """

    regressors: tuple[str, str]
    inflation: float
    correlation: float


@dataclass(frozen=True)
class ResponseModel:
    """One response as a linear function of p regressors about the reference, with its uncertainty.

    ``response = bias + sum_j estimate[j] (regressor[j] - trim[j])``

    Attributes
    ----------
    response, unit : str
        Name and SI unit.
    regressors, regressor_units : tuple of str, length p
    trim : ndarray, shape (p,)
        Values of the regressors that the model is expanded about.
    regressor_rms : ndarray, shape (p,)
        Of the regressors over the manoeuvre, about a straight line: what each was moved by.
    estimate, std_error : ndarray, shape (p,)
        Unit of the response per unit of the regressor.
    covariance : ndarray, shape (p, p)
    lower, upper : ndarray, shape (p,)
        Confidence limits at the level of the identification.
    bias, bias_std_error : float
        Response at the trim, from the time domain.
    r2, pse, rmse, fit_error : float
        Coefficient of determination; predicted squared error of one real equation; rms of the residual
        in the band of the fit, in the response's unit; standard deviation of one real equation.
    t_statistic, variance_inflation : ndarray, shape (p,)
    correlation : ndarray, shape (p, p)
        Of the parameters' errors.
    condition_index : ndarray, shape (n,)
        Of the n = p + nuisance columns; the last is the condition number.
    variance_proportion : ndarray, shape (n, p)
        Share of each parameter's variance by condition index.
    inseparable : tuple of tuple of str
        Groups of parameters that the data cannot tell apart.
    fit : mapping of str to Fit
        ``"frequency"`` where lines were regressed, and ``"time"``, then up to the highest line. Further
        manoeuvres of the same fit follow as ``"frequency 2"``, ``"time 2"`` and so on.
    errors_in_variables : ErrorsInVariables, optional
        Where the estimate is by instruments: what least squares says beside it.
    distortion : float, optional
        Power of the residual on the harmonics over that of noise, where noise lines tell it: one for a
        response that is linear as far as noise shows.
    r2_ceiling : float, optional
        What `r2` would be were the residual on the harmonics noise alone, likewise; a fit may chance to
        exceed it.
    """

    response: str
    unit: str
    regressors: tuple[str, ...]
    regressor_units: tuple[str, ...]
    trim: Array
    regressor_rms: Array
    estimate: Array
    std_error: Array
    covariance: Array
    lower: Array
    upper: Array
    bias: float
    bias_std_error: float
    r2: float
    pse: float
    rmse: float
    fit_error: float
    t_statistic: Array
    variance_inflation: Array
    correlation: Array
    condition_index: Array
    variance_proportion: Array
    inseparable: tuple[tuple[str, ...], ...]
    fit: Mapping[str, Fit]
    errors_in_variables: ErrorsInVariables | None = None
    distortion: float | None = None
    r2_ceiling: float | None = None

    def __repr__(self) -> str:
        rows = ", ".join(
            f"{name} {value:.4g} +- {2 * error:.2g}"
            for name, value, error in zip(self.regressors, self.estimate, self.std_error, strict=True)
        )
        return (
            f"<ResponseModel {self.response} in {self.unit}: {rows} (2 sigma); R2 {self.r2:.4f}, "
            f"rmse {self.rmse:.3g}>"
        )

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Of the parameters, length p."""
        return tuple(per(self.unit, unit) for unit in self.regressor_units)

    @property
    def normalised_difference(self) -> Array:
        """Instruments less least squares over its standard deviation, shape (p,); nan without both."""
        beside = self.errors_in_variables
        if beside is None:
            return np.full(len(self.regressors), np.nan)
        with np.errstate(invalid="ignore", divide="ignore"):  # no noise, no difference: nan
            return (self.estimate - beside.estimate) / beside.difference_std_error

    @property
    def differing(self) -> tuple[str, ...]:
        """Parameters whose two estimates differ beyond noise; empty without both."""
        if self.errors_in_variables is None:
            return ()
        beyond = np.abs(self.normalised_difference) > self.errors_in_variables.critical
        return tuple(name for name, b in zip(self.regressors, beyond, strict=True) if b)

    @property
    def warnings(self) -> list[str]:
        """What a reader should know before using the parameters, one sentence each."""
        texts = []
        beside = self.errors_in_variables
        if beside is not None and self.differing:
            listing = ", ".join(
                f"{n} {beside.estimate[self.regressors.index(n)]:.6g}" for n in self.differing
            )
            texts.append(f"least squares differs beyond noise: {listing}")
        if self.distortion is not None and self.distortion > DISTORTED:
            texts.append(
                f"on the harmonics {self.distortion:.3g} times the noise is left: not linear, or late; "
                "the errors above hold noise alone (--nonlinear products adds what products explain)"
            )
        return [*texts, *(f"the data cannot separate {' and '.join(group)}" for group in self.inseparable)]

    @property
    def most_collinear(self) -> Collinear | None:
        """The regressor that the others explain best, and its nearest companion; None of a single one.

        The companion is the regressor whose parameter has the error most correlated with that of the first:
        the correlation of two parameters' errors is, but for its sign, the correlation of their regressors
        after all others are projected out.
        """
        if len(self.regressors) < 2:
            return None
        i = int(np.argmax(np.where(np.isnan(self.variance_inflation), np.inf, self.variance_inflation)))
        beside = np.abs(np.nan_to_num(self.correlation[i]))
        beside[i] = -1.0
        j = int(beside.argmax())
        return Collinear(
            (self.regressors[i], self.regressors[j]),
            float(self.variance_inflation[i]),
            float(self.correlation[i, j]),
        )

    @property
    def condition_number(self) -> float:
        """Ratio of largest to smallest singular value of the scaled columns."""
        return float(self.condition_index[-1])

    @property
    def reaches_ceiling(self) -> bool:
        """Whether `r2` is what noise allows, but for `NEAR_CEILING` or chance; False where that is not known.

        By chance: two standard deviations of `r2` less its ceiling, were the residual noise alone. Powers on
        lines are exponential, their scatter is as large; noise lines are about as many as harmonics.
        """
        if self.r2_ceiling is None:
            return False
        of = [fit for fit in self.fit.values() if fit.noise is not None]
        power = np.concatenate([np.zeros(0), *(fit.noise**2 for fit in of if fit.noise is not None)])
        total = sum(float(np.sum(np.abs(fit.measured) ** 2)) for fit in of)
        chance = float(np.sqrt(2 * np.sum(power**2)) / total) if total else 0.0
        return self.r2 >= self.r2_ceiling - max(NEAR_CEILING, 2 * chance)

    def __getitem__(self, regressor: str) -> tuple[float, float]:
        """Return estimate and standard error of one parameter, or of ``"bias"``."""
        if regressor == "bias":
            return self.bias, self.bias_std_error
        if regressor not in self.regressors:
            raise UsageError(
                f"response '{self.response}' has no parameter '{regressor}'",
                remedy=nearest(regressor, (*self.regressors, "bias")),
            )
        j = self.regressors.index(regressor)
        return float(self.estimate[j]), float(self.std_error[j])


@dataclass(frozen=True)
class PointModel(Viewable):
    """Responses identified at one reference condition.

    Attributes
    ----------
    reference : Reference
    responses : mapping of str to ResponseModel
    method : {"frequency", "time", "output-error", "filter-error"}
    form : {"force", "specific", "coefficient"}
    axes : {"body", "stability"}
    confidence : float
        Level of the intervals.
    duration : float
        Length of the manoeuvre, or of all together, s.
    vehicle : str
    provenance : dict
        Records, scenario and settings; JSON-compatible.
    prediction : mapping of str to Fit
        By response: history of a manoeuvre that was not used, measured and as the model predicts it.
    estimator : {"least-squares", "instruments", "maximum-likelihood"}
    remarks : tuple of str
        What a reader should know before using the model, one sentence each.
    trim : mapping of str to float
        Means over the manoeuvre: ``V`` m/s, ``alpha`` rad and the propellers' ``advance_ratio``, inf where
        they are stopped; as far as the records tell.
    no_advance_ratio : str
        Why there is none in `trim`; empty where there is.
    scheduled_units : dict of str to str
        SI unit of what the reference sets beside speed and density; rad where a name is absent.
    aircraft : Vehicle, optional
        What was flown: mass, geometry and effectors; files of older releases have none.
    """

    reference: Reference
    responses: Mapping[str, ResponseModel]
    method: str
    form: str
    axes: str
    confidence: float
    duration: float
    vehicle: str
    provenance: dict[str, Any] = field(default_factory=dict)
    prediction: Mapping[str, Fit] = field(default_factory=dict)
    estimator: str = "least-squares"
    remarks: tuple[str, ...] = ()
    trim: Mapping[str, float] = field(default_factory=dict)
    no_advance_ratio: str = ""
    scheduled_units: dict[str, str] = field(default_factory=dict)
    aircraft: Vehicle | None = None

    def __repr__(self) -> str:
        fits = ", ".join(f"{name} R2 {r.r2:.4f}" for name, r in self.responses.items())
        at = f" at {self.reference.id!r}" if self.reference.id else ""
        number = len(self.warnings)
        said = f"; {number} warning{'s' * (number > 1)}, see .warnings" if number else ""
        return (
            f"<PointModel of {self.vehicle!r}{at}, u {self.reference.u:.4g} m/s: {fits}; "
            f"{self.estimator}, {self.duration:.4g} s{said}>"
        )

    @property
    def units(self) -> dict[str, str]:
        """SI unit by response."""
        return {name: response.unit for name, response in self.responses.items()}

    @property
    def warnings(self) -> list[str]:
        """What a reader should know before using the model: its remarks, then each response's warnings."""
        of_responses = [f"{name}: {text}" for name, r in self.responses.items() for text in r.warnings]
        return [*self.remarks, *of_responses]

    def __getitem__(self, response: str) -> ResponseModel:
        try:
            return self.responses[response]
        except KeyError:
            raise UsageError(
                f"the model has no response '{response}'", remedy=nearest(response, self.responses)
            ) from None

    def drawn(self, count: int, seed: int = 0) -> list[PointModel]:
        """Return models as far from this one as its covariances let them be, each response independently.

        Parameters
        ----------
        count : int
        seed : int
            Of the random numbers.

        Raises
        ------
        UsageError
            Where a response states no covariance.
        """
        rng = np.random.default_rng(seed)
        for name, r in self.responses.items():
            check_covariance(name, r.covariance)
        estimates = [
            {n: rng.multivariate_normal(r.estimate, r.covariance) for n, r in self.responses.items()}
            for _ in range(count)
        ]
        shift = {name: r.bias_std_error * rng.standard_normal(count) for name, r in self.responses.items()}
        return [
            replace(
                self,
                responses={
                    name: replace(r, estimate=estimates[i][name], bias=r.bias + float(shift[name][i]))
                    for name, r in self.responses.items()
                },
            )
            for i in range(count)
        ]

    def to_control(
        self, *, draws: int = 0, seed: int = 0, outputs: Sequence[str] = (), vehicle: Vehicle | None = None
    ) -> Any:
        """Return the aircraft's small motion as a python-control ``StateSpace``, or a list of draws.

        As `GlobalModel.to_control`, at the model's own condition. Needs the extra ``control``.

        Parameters
        ----------
        draws, seed : int
            How many models to draw from the covariance, and with which random numbers; the estimate alone
            where zero.
        outputs : sequence of str
            Among u v w p q r phi theta, psi, alt, V, alpha and beta; the eight states where empty.
        vehicle : Vehicle, optional
            Mass properties and rotors, in place of the model's own.

        Raises
        ------
        UsageError
            Where the model lacks a response, or states no vehicle or no covariance.
        DataError
            Where python-control is not installed.
        """
        of_point = import_module("freqid.blend.state_space").point_statespaces
        spaces = [one.to_control(outputs) for one in of_point(self, vehicle, draws, seed)]
        return spaces if draws else spaces[0]


def check_covariance(response: str, covariance: Array) -> None:
    """Raise UsageError where a response states no covariance, so that nothing can be drawn from it."""
    if not np.isfinite(covariance).all() or not covariance.any():
        raise UsageError(
            f"the model states no covariance of '{response}', so that no models can be drawn from it",
            remedy="identify it again, or ask for the estimate alone with draws=0",
        )


def spread_of(covariance: Array) -> Array:
    """Return F with ``F F^T`` equal to covariances, shape (..., p, p), also where these are singular."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]


def per(unit: str, regressor_unit: str) -> str:
    """Return the unit of a parameter: that of the response over that of the regressor."""
    if regressor_unit == "1":
        return unit
    over = f"({regressor_unit})" if any(c in regressor_unit for c in " /") else regressor_unit
    return f"{unit}/{over}"


_PARAMETER = "parameter/{response}/{regressors}"
_P = ("regressors",)
_BESIDE = {  # each parameter where it was estimated by instruments
    "estimate": Dataset(f"{_PARAMETER}/least_squares", "{parameter_units}"),
    "std_error": Dataset(f"{_PARAMETER}/least_squares_std_error", "{parameter_units}"),
    "difference_std_error": Dataset(f"{_PARAMETER}/difference_std_error", "{parameter_units}"),
    "critical": Dataset(f"{_PARAMETER}/difference_critical"),
    "strength": Dataset(f"{_PARAMETER}/instrument_strength"),
}
_DIAGNOSTICS = "diagnostics/{response}"
_RESPONSE = {
    "covariance": Dataset("covariance/{response}", "mixed", ("regressors", "regressors")),
    "regressors": Attribute("covariance/{response}@parameters", json=True),
    "parameter_units": Attribute("covariance/{response}@parameter_units", json=True),
    "unit": Attribute(f"{_DIAGNOSTICS}@units"),
    "regressor_units": Attribute(f"{_DIAGNOSTICS}@regressor_units", json=True, axes=_P),
    "estimate": Dataset(f"{_PARAMETER}/estimate", "{parameter_units}", _P),
    "std_error": Dataset(f"{_PARAMETER}/std_error", "{parameter_units}", _P),
    "bias": Dataset("parameter/{response}/bias/estimate", "{unit}"),
    "bias_std_error": Dataset("parameter/{response}/bias/std_error", "{unit}"),
    "errors_in_variables": Nested(ErrorsInVariables, _BESIDE),
    "inseparable": Attribute(f"{_DIAGNOSTICS}@inseparable", json=True),
    **{
        name: Attribute(f"{_DIAGNOSTICS}@{name}")
        for name in ("r2", "pse", "rmse", "fit_error", "distortion", "r2_ceiling")
    },
    **{
        name: Dataset(f"{_DIAGNOSTICS}/{name}", "mixed", _P)
        for name in ("trim", "regressor_rms", "lower", "upper")
    },
    **{name: Dataset(f"{_DIAGNOSTICS}/{name}", "1", _P) for name in ("t_statistic", "variance_inflation")},
    "condition_index": Dataset(f"{_DIAGNOSTICS}/condition_index"),
    "correlation": Dataset(f"{_DIAGNOSTICS}/correlation", "1", ("regressors", "regressors")),
    "variance_proportion": Dataset(f"{_DIAGNOSTICS}/variance_proportion"),
    "fit": NestedSeries(Fit, fit_layout("fit/{response}/{domain}", "{unit}"), "domain", "fit/{response}"),
}
_POINT = {
    "reference": Attributes("reference"),
    **{
        name: Attribute(f"@{name}")
        for name in ("method", "form", "axes", "confidence", "duration", "vehicle", "estimator")
    },
    "remarks": Attribute("@remarks", json=True),
    "scheduled_units": Attribute("@scheduled_units", json=True),
    "trim": Attributes("trim", only=("V", "alpha", "advance_ratio")),
    "no_advance_ratio": Attribute("trim@no_advance_ratio"),
    "provenance": Attribute("provenance@json", json=True),
    "aircraft": Table("aircraft"),
    "responses": NestedSeries(ResponseModel, _RESPONSE, "response", "@responses"),
    "prediction": NestedSeries(Fit, fit_layout("prediction/{of}", "{units.of}"), "of", "prediction"),
}


def _check(model: PointModel) -> None:
    if not model.responses:
        raise ValueError("it has no response")


FILE = ResultFile("freqid-point", PointModel, _POINT, check=_check)
write_point, read_point = FILE.write, FILE.read
