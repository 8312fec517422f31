"""What is identified from a flight: section ``[identification]`` of a scenario."""

from __future__ import annotations

from typing import Literal

from freqid.core.channels import WRENCH
from freqid.core.errors import nearest
from freqid.core.sections.estimators import EstimatorName
from freqid.core.vehicle import Strict

Method = Literal["frequency", "time", "output-error", "filter-error"]
MAXIMUM_LIKELIHOOD: tuple[Method, ...] = ("output-error", "filter-error")


class FrequencyGrid(Strict, frozen=True):
    """Lines from `start` to `stop`, both included, every `step`, Hz."""

    start: float
    step: float
    stop: float

    def __post_init__(self) -> None:
        if not (self.step > 0 and 0 < self.start <= self.stop):
            raise ValueError(
                f"found start {self.start:g}, step {self.step:g}, stop {self.stop:g} Hz, "
                "expected 0 < start <= stop and step > 0"
            )


class Identification(Strict, frozen=True):
    """Section ``[identification]``: what is regressed on what, and how.

    Attributes
    ----------
    responses : tuple of str
        Among X Y Z L M N.
    regressors : tuple of str, or dict
        Channel names without group (``u``, ``beta``, ``phat``, ``de1``), and products of two of them
        (``w*de1``: of their departures from the trim); for all responses, or by response.
    frequencies_hz : FrequencyGrid or tuple of float, optional
        Lines of the regression; the harmonics of ``[excitation]`` where absent.
    method : {"frequency", "time", "output-error", "filter-error"}
        Equation error on lines or samples; or maximum likelihood in time, with noise in the outputs alone or
        in the motion too, as turbulence is.
    form : {"force", "specific", "coefficient"}
    axes : {"body", "stability"}
    trend : {"endpoints", "line", "mean", "none"}, optional
        What is removed before the transform: the line of least squares where absent. In the time
        domain only a bias is estimated, or a bias and a slope with ``"endpoints"`` or ``"line"``.
    angular_acceleration : {"transform", "record"}
        Whether moments take the rates' derivative exactly in the transform or from pdot, qdot, rdot.
    response_source : {"reconstruct", "record"}
        Whether responses are reconstructed from motion and mass, or read from ``response/...``.
    nuisance : {"auto", "constant", "none"}
        Columns that absorb end samples and trend on the lines; ``"constant"`` is one column of ones.
    residuals : {"coloured", "white", "noise-lines"}
        What the standard errors allow the residual to be; or take noise alone from, where two periods of
        multisines or more were flown. What is not linear then makes no standard error larger: it is told
        apart, as `distortion`.
    estimator : {"least-squares", "instruments"}
        Least squares takes regressors to be free of noise; instruments, made from the injected signals, do
        not.
    structure : {"given", "stepwise"}
        Whether all regressors are in the model, or those that a stepwise choice keeps for each response.
    nonlinear : {"none", "products"}
        Whether products of regressors are added, stepwise, to responses that are not linear: those whose
        `distortion` the noise lines put beyond chance.
    confidence : float
        Of the intervals, for example 0.95.
    """

    regressors: tuple[str, ...] | dict[str, tuple[str, ...]]
    responses: tuple[str, ...] = WRENCH
    frequencies_hz: FrequencyGrid | tuple[float, ...] | None = None
    method: Method = "frequency"
    form: Literal["force", "specific", "coefficient"] = "force"
    axes: Literal["body", "stability"] = "body"
    trend: Literal["endpoints", "line", "mean", "none"] | None = None
    angular_acceleration: Literal["transform", "record"] = "transform"
    response_source: Literal["reconstruct", "record"] = "reconstruct"
    nuisance: Literal["auto", "constant", "none"] = "auto"
    residuals: Literal["coloured", "white", "noise-lines"] = "coloured"
    estimator: EstimatorName = "least-squares"
    structure: Literal["given", "stepwise"] = "given"
    nonlinear: Literal["none", "products"] = "none"
    confidence: float = 0.95

    def __post_init__(self) -> None:
        if not self.responses:
            raise ValueError(f"responses is empty, expected some of {' '.join(WRENCH)}")
        for response in self.responses:
            if response not in WRENCH:
                raise ValueError(f"response '{response}' is unknown; {nearest(response, WRENCH)}")
        if isinstance(self.regressors, dict):
            missing = [r for r in self.responses if r not in self.regressors]
            if missing:
                raise ValueError(f"regressors are missing for response {missing}, expected a list for each")
        for response in self.responses:
            chosen = self.regressors_of(response)
            if not chosen:
                raise ValueError(f"response '{response}' has no regressors, expected at least one")
            twice = sorted({name for name in chosen if chosen.count(name) > 1})
            if twice or "bias" in chosen:
                what = f"names {twice} more than once" if twice else "names 'bias', which is always estimated"
                raise ValueError(f"regressors of '{response}' {what}")
            for name in chosen:
                _check_product(response, name, chosen)
        if self.residuals == "noise-lines" and self.method != "frequency":
            raise ValueError(
                f"residuals is 'noise-lines' with method '{self.method}', expected method 'frequency' with "
                "noise lines"
            )
        if self.structure == "stepwise" and self.method != "frequency":
            raise ValueError(
                f"structure is 'stepwise' with method '{self.method}', expected method 'frequency' with it"
            )
        if self.method in MAXIMUM_LIKELIHOOD and self.estimator != "least-squares":
            raise ValueError(
                f"estimator is '{self.estimator}' with method '{self.method}', expected none: maximum "
                "likelihood needs no instruments"
            )
        if self.nonlinear == "products" and self.residuals != "noise-lines":
            raise ValueError(
                f"nonlinear is 'products' with residuals '{self.residuals}', expected 'noise-lines', "
                "which tell what is not linear from noise"
            )
        if not 0.5 <= self.confidence < 1:
            raise ValueError(f"confidence is {self.confidence:g}, expected at least 0.5 and below 1")

    def regressors_of(self, response: str) -> tuple[str, ...]:
        """Return the regressor names of one response."""
        if isinstance(self.regressors, dict):
            return tuple(self.regressors[response])
        return self.regressors


def factors_of(regressor: str) -> tuple[str, ...]:
    """Return the factors of a regressor: ``w`` and ``de1`` of ``w*de1``, itself where it is no product."""
    return tuple(regressor.split("*"))


def _check_product(response: str, name: str, chosen: tuple[str, ...]) -> None:
    """Refuse a product whose factors are not regressors too: its trim is theirs."""
    factors = factors_of(name)
    if len(factors) > 2:
        raise ValueError(f"regressor '{name}' of '{response}' has {len(factors)} factors, expected two")
    lacking = [factor for factor in factors if factor not in chosen]
    if lacking:
        raise ValueError(
            f"regressors of '{response}' hold the product '{name}' without '{lacking[0]}', "
            "expected both factors"
        )
