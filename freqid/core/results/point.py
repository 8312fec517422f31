"""What identification gives: a point model of the applied wrench at one reference condition, and its file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.core.layout import Attribute, Attributes, Dataset, Nested, NestedSeries, ResultFile, Table
from freqid.core.scenario import Gates, Reference
from freqid.core.vehicle import Vehicle
from freqid.core.viewable import Viewable

DISTORTED = 1.5
"""Distortion from which a response is taken to be bent: of a linear one it is 1.1 +- 0.17 on 106 lines."""


@dataclass(frozen=True)
class WorstBand:
    """Where in frequency a fit is worst.

    Attributes
    ----------
    low_hz, high_hz : float
        First and last line of the band.
    over_noise : float
        Root mean square of the residual over that of noise, in the band; nan where noise is not known.
    share : float
        Of the power of the whole residual.
    """

    low_hz: float
    high_hz: float
    over_noise: float
    share: float


@dataclass(frozen=True)
class Fit:
    """A response as measured and as the model gives it, on frequencies or samples.

    Attributes
    ----------
    axis : ndarray, shape (n,)
        Frequencies in Hz, or times in s.
    measured, modelled : ndarray, shape (n,)
        Complex transforms on frequencies, real values in time.
    noise : ndarray, shape (n,), optional
        On frequencies, where noise lines tell it: rms magnitude of a residual that is noise alone, allowing
        for what the fit takes of it.
    """

    axis: Array
    measured: NDArray[Any]
    modelled: NDArray[Any]
    noise: Array | None = None

    def __repr__(self) -> str:
        kind = "lines" if np.iscomplexobj(self.measured) else "samples"
        return f"<Fit on {self.axis.size} {kind}: R2 {self.r2:.4f}, rms of the residual {self.rms:.4g}>"

    @property
    def axis_unit(self) -> str:
        """Hz or s."""
        return "Hz" if np.iscomplexobj(self.measured) else "s"

    @property
    def transform_unit(self) -> str:
        """What the unit of a transform has beyond that of the response; empty in time."""
        return " s" if np.iscomplexobj(self.measured) else ""

    @property
    def residual(self) -> NDArray[Any]:
        """Measured less modelled, shape (n,)."""
        return self.measured - self.modelled

    @property
    def r2(self) -> float:
        """Share of the measured energy that the model explains; about the mean in time."""
        centre = 0.0 if np.iscomplexobj(self.measured) else self.measured.mean()
        total = np.sum(np.abs(self.measured - centre) ** 2)
        return float(1 - np.sum(np.abs(self.residual) ** 2) / total) if total else float("nan")

    @property
    def rms(self) -> float:
        """Root mean square of the residual."""
        return float(np.sqrt(np.mean(np.abs(self.residual) ** 2)))

    def inside(self, highest_hz: float = float("inf")) -> Fit:
        """Return a history without its ends.

        A history up to a highest frequency is made from samples on both sides, and moments from differences
        of rates: within two periods of that frequency of an end it says more about the end than about the
        model. A history too short for that keeps its ends.

        Parameters
        ----------
        highest_hz : float
            Of what the history holds; infinite where it holds all.
        """
        ends = round(2 / highest_hz / (self.axis[1] - self.axis[0]))
        keep = slice(ends, self.axis.size - ends)
        if self.axis.size - 2 * ends <= 2 * ends:
            return self
        return Fit(self.axis[keep], self.measured[keep], self.modelled[keep])

    @property
    def worst_band(self) -> WorstBand | None:
        """The `LEAST_LINES` neighbouring lines with the greatest normalised residual; None of a history.

        The power of the residual on each line is normalised by that of noise; without known noise all lines
        count alike, so that the band holds the most of the residual.
        """
        count = min(LEAST_LINES, self.axis.size)
        if not np.iscomplexobj(self.measured) or not count:
            return None
        left = np.abs(self.residual) ** 2
        known = self.noise is not None and bool(np.all(self.noise > 0))
        power = left / self.noise**2 if known and self.noise is not None else left
        within = np.convolve(power, np.ones(count), mode="valid")
        first = int(within.argmax())
        band = slice(first, first + count)
        total = float(left.sum())
        return WorstBand(
            low_hz=float(self.axis[band][0]),
            high_hz=float(self.axis[band][-1]),
            over_noise=float(np.sqrt(within[first] / count)) if known else float("nan"),
            share=float(left[band].sum()) / total if total else float("nan"),
        )

    @property
    def theil(self) -> float:
        """Theil's inequality coefficient of a history, about the means: 0 is perfect, 1 is none at all.

        References
        ----------
        Theil, Economic Forecasts and Policy, 2nd ed., 1961; Jategaonkar, Flight Vehicle System
        Identification, 2nd ed., ch. 11: below 0.25 to 0.3 in flight-model validation.
        """
        both = [np.sqrt(np.mean(np.abs(x - x.mean()) ** 2)) for x in (self.measured, self.modelled)]
        return float(np.std(self.residual) / sum(both)) if sum(both) else float("nan")

    @property
    def coherence(self) -> float:
        """Lowest coherence of measured and modelled transforms over the octaves of the lines.

        ``|sum conj(measured) modelled|^2 / (sum |measured|^2 sum |modelled|^2)`` over the lines of each
        octave from the lowest line on. Octaves of fewer than eight lines are taken with the next, because two
        noises of n lines have a coherence of 1/n in the mean. nan of a history.
        """
        if not np.iscomplexobj(self.measured):
            return float("nan")
        octave = np.floor(np.log2(self.axis / self.axis[0]) + 1e-9).astype(int)
        groups: list[list[int]] = [[]]
        for k in range(octave.max() + 1):
            if len(groups[-1]) >= LEAST_LINES:
                groups.append([])
            groups[-1] += np.flatnonzero(octave == k).tolist()
        if len(groups) > 1 and len(groups[-1]) < LEAST_LINES:
            groups[-2] += groups.pop()
        values = []
        for of in groups:
            z, y = self.measured[of], self.modelled[of]
            power = float(np.sum(np.abs(z) ** 2) * np.sum(np.abs(y) ** 2))
            values.append(float(np.abs(np.vdot(z, y)) ** 2 / power) if power else float("nan"))
        return min(values)


NEAR_CEILING = 0.02
"""Below what noise allows, where R2 is still said to reach it."""
LEAST_LINES = 8
"""Lines that a coherence is taken over at least, and that make the band of the worst fit."""


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


@dataclass(frozen=True)
class MissedGate:
    """A figure of merit that is not what the scenario asks for.

    Attributes
    ----------
    response : str
    figure : str
        ``"R2"``, ``"condition number"``, ``"variance inflation"``, ``"coherence"``, ``"validation error"`` or
        ``"consistency"``.
    value, gate : float
    why : str
        What it comes from, in a few words, where that is known.
    """

    response: str
    figure: str
    value: float
    gate: float
    why: str = ""

    @property
    def unjudged(self) -> bool:
        """Whether the gate is on a manoeuvre that was not used, and none was given."""
        return self.figure == "validation error" and math.isnan(self.value)

    def __str__(self) -> str:
        said = f"{self.figure} of {self.response} is {self.value:.5g}"
        return f"{said}{f', because {self.why}' if self.why else ''}, the gate is {self.gate:g}"


def unjudged_gates(model: PointModel, gates: Gates) -> str:
    """Return one sentence on gates that nothing was given to judge by; empty where there are none."""
    left = [miss.response for miss in missed_gates(model, gates) if miss.unjudged]
    if not left:
        return ""
    return (
        f"the gate on validation of {', '.join(left)} is not judged: no manoeuvre that was not used was "
        "predicted (--predict)"
    )


def missed_gates(model: PointModel, gates: Gates) -> list[MissedGate]:
    """Return the gates that a model misses; a figure that is not a number misses its gate."""
    missed = []
    for name, response in model.responses.items():
        asked = gates.r2.get(name) if isinstance(gates.r2, dict) else gates.r2
        if asked is not None and not response.r2 >= asked:
            missed.append(MissedGate(name, "R2", response.r2, asked))
        bound = gates.condition_number
        if bound is not None and not response.condition_number <= bound:
            missed.append(MissedGate(name, "condition number", response.condition_number, bound))
        pair = response.most_collinear
        if gates.collinearity is not None and pair and not pair.inflation <= gates.collinearity:
            one, other = pair.regressors
            why = (
                f"'{one}' and '{other}' moved together (their parameters' errors are correlated by "
                f"{pair.correlation:.3f})"
            )
            missed.append(MissedGate(name, "variance inflation", pair.inflation, gates.collinearity, why))
        if gates.coherence is not None:
            lines = response.fit.get("frequency")
            value = lines.coherence if lines is not None else float("nan")
            if not value >= gates.coherence:
                missed.append(MissedGate(name, "coherence", value, gates.coherence))
        asked = gates.validation.get(name) if isinstance(gates.validation, dict) else gates.validation
        if asked is not None and not (error := validation_error(model, name)) <= asked:
            missed.append(MissedGate(name, "validation error", error, asked))
    return missed


def gate_sentences(model: PointModel, gates: Gates) -> list[str]:
    """Return a sentence for each gate that a model misses; one for all that nothing was given to judge by."""
    missed = [str(miss) for miss in missed_gates(model, gates) if not miss.unjudged]
    return [*missed, *filter(None, [unjudged_gates(model, gates)])]


def validation_error(model: PointModel, response: str) -> float:
    """Return Theil's coefficient on the manoeuvre that a model was not made from; nan where there is none."""
    fit, lines = model.prediction.get(response), model[response].fit.get("frequency")
    if fit is None:
        return float("nan")
    return fit.inside(float(lines.axis[-1]) if lines is not None else float("inf")).theil


def per(unit: str, regressor_unit: str) -> str:
    """Return the unit of a parameter: that of the response over that of the regressor."""
    if regressor_unit == "1":
        return unit
    over = f"({regressor_unit})" if any(c in regressor_unit for c in " /") else regressor_unit
    return f"{unit}/{over}"


def _fits(group: str, unit: str) -> dict[str, Dataset]:
    """Return the layout of a fit in a group."""
    values = ("measured", "modelled", "noise")
    return {"axis": Dataset(f"{group}/axis", "{axis_unit}", ("sample",))} | {
        name: Dataset(f"{group}/{name}", unit + "{transform_unit}", ("sample",)) for name in values
    }


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
    "fit": NestedSeries(Fit, _fits("fit/{response}/{domain}", "{unit}"), "domain", "fit/{response}"),
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
    "prediction": NestedSeries(Fit, _fits("prediction/{of}", "{units.of}"), "of", "prediction"),
}


def _check(model: PointModel) -> None:
    if not model.responses:
        raise ValueError("it has no response")


FILE = ResultFile("freqid-point", PointModel, _POINT, check=_check)
write_point, read_point = FILE.write, FILE.read
