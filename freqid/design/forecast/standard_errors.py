"""What a flight will buy: expected standard errors of every parameter, and the shortest flight for some."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import WRENCH
from freqid.core.errors import UsageError
from freqid.core.results.design import MultisineDesign
from freqid.core.sections.identification import Identification
from freqid.core.vehicle import Vector
from freqid.design.forecast.closed_loop import PerturbedAircraft
from freqid.design.forecast.experiment import Equation, Experiment, refuse_unidentified


@dataclass(frozen=True, eq=False)
class ResponseForecast:
    """What least squares will find for one response.

    Attributes
    ----------
    response, unit : str
        Among X Y Z L M N; N or N m.
    regressors : tuple of str, length p
    parameter : ndarray, shape (p,)
        As the model has them, unit of the response per unit of the regressor.
    std_error : ndarray, shape (p,)
        Scatter of the estimates from flight to flight.
    bias : ndarray, shape (p,)
        What noise in the regressors adds to the estimates on average; instruments take it away.
    covariance : ndarray, shape (p, p)
    """

    response: str
    unit: str
    regressors: tuple[str, ...]
    parameter: Array
    std_error: Array
    bias: Array
    covariance: Array

    @property
    def correlation(self) -> Array:
        """Correlation of the parameters' errors, shape (p, p)."""
        return self.covariance / np.outer(self.std_error, self.std_error)

    @property
    def det_figure(self) -> float:
        """``det(F)^(1/p)`` with F the inverse covariance: mean information per parameter, own units."""
        # By the correlation: the covariance of parameters with mixed units is badly scaled.
        log_det = np.linalg.slogdet(self.correlation)[1] + 2 * np.log(self.std_error).sum()
        return float(np.exp(-log_det / len(self.std_error)))


@dataclass(frozen=True, eq=False)
class Forecast:
    """Expected accuracy of a point model that is identified from a design.

    Attributes
    ----------
    design : MultisineDesign
        As flown, with its number of periods.
    responses : mapping of str to ResponseForecast
    """

    design: MultisineDesign
    responses: Mapping[str, ResponseForecast]

    def __getitem__(self, response: str) -> ResponseForecast:
        return self.responses[response]

    @property
    def det_figure(self) -> float:
        """``det(F)^(1/p)`` over all parameters of all responses."""
        count = [len(r.regressors) for r in self.responses.values()]
        return float(
            np.exp(np.average([np.log(r.det_figure) for r in self.responses.values()], weights=count))
        )


def forecast(
    design: MultisineDesign,
    loop: PerturbedAircraft,
    settings: Identification,
    noise: Mapping[str, float],
    *,
    accelerometer_m: Vector | None = None,
) -> Forecast:
    """Forecast the standard errors of equation error on the lines of a design.

    Parameters
    ----------
    design : MultisineDesign
    loop : PerturbedAircraft
        The aircraft as it is thought to be.
    settings : Identification
        Responses and regressors; forces and moments in body axes.
    noise : mapping of str to float
        One sigma of a sample, white, SI, of every channel that is needed: states in the regressors, rates
        for moments, ``ax ay az`` for forces, effectors.
    accelerometer_m : tuple of 3 floats, optional
        Position in vehicle axes, m; the centre of gravity where absent.

    Returns
    -------
    Forecast

    Raises
    ------
    UsageError
        Where a noise level is missing, a regressor does not move, or the design cannot separate some.

    Notes
    -----
    With X the regressors' transforms, R the covariance of the noise in them on a line, e the residual that
    noise leaves (the response's own and ``- theta^T`` the regressors'), d the residual that bias leaves,
    S = E|e|^2 and c = E[conj(noise in X) e], sums over the lines::

        H     = Re sum (conj(X) X^T + R)
        theta = H^-1 Re sum (conj(X) z + E[conj(noise in X) noise in z])
        W     = 1/2 Re sum (conj(X) X^T S + conj(X) d c^T + (..)^H + |d|^2 R + R S + c c^T)
        Cov   = H^-1 W H^-1

    which is exact for Gaussian noise on independent lines but for the scatter of H itself. It holds for the
    steady state; plain least squares is what is forecast, not a weighted one. Derivation, and how it
    compares with Monte Carlo: docs/theory/forecast.md.

    References
    ----------
    Klein & Morelli, *Aircraft System Identification*, 2nd ed., ch. 7 (complex least squares) and ch. 9
    (experiment design). Fuller, *Measurement Error Models*, 1987, ch. 1, for noisy regressors.
    """
    experiment = Experiment.of(design, loop, settings, noise, accelerometer_m)
    return Forecast(design, {r: _least_squares(experiment.equation(r)) for r in settings.responses})


def _least_squares(equation: Equation) -> ResponseForecast:
    """Forecast one response; columns are scaled to unit length so that units do not spoil the algebra."""
    x, z = equation.columns, equation.response
    length = np.linalg.norm(x, axis=1)
    x, g = x / length[:, None], equation.column_noise / length[:, None]
    k, v = equation.response_noise, equation.variance
    lines = z.size
    r = (g * v) @ g.T

    signal = (x.conj() @ x.T).real
    projection = (x.conj() @ z).real
    clean = np.linalg.solve(signal, projection)
    normal = signal + lines * r
    theta = np.linalg.solve(normal, projection + (k.real @ (g * v).T).sum(axis=0))

    e = k - theta @ g  # what each sensor's noise does to the residual, by line
    d = z - theta @ x
    s = np.abs(e) ** 2 @ v
    c = e @ (g * v).T
    mixed = (x.conj() * d) @ c
    scatter = (x.conj() * s) @ x.T + mixed + mixed.T + (np.abs(d) ** 2 + s).sum() * r + c.T @ c
    half = np.linalg.solve(normal, 0.5 * scatter.real)
    covariance = np.linalg.solve(normal, half.T)

    q, p_length = equation.nuisances, length[equation.nuisances :]
    covariance = covariance[q:, q:] / np.outer(p_length, p_length)
    return ResponseForecast(
        response=equation.name,
        unit="N" if equation.name in WRENCH[:3] else "N m",
        regressors=equation.regressors,
        parameter=clean[q:] / p_length,
        std_error=np.sqrt(np.diag(covariance)),
        bias=(theta - clean)[q:] / p_length,
        covariance=covariance,
    )


def shortest(
    design: MultisineDesign,
    loop: PerturbedAircraft,
    settings: Identification,
    noise: Mapping[str, float],
    wanted: Mapping[str, Mapping[str, float]],
    *,
    longest_s: float = 600.0,
    accelerometer_m: Vector | None = None,
) -> Forecast:
    """Find the fewest periods of a design that reach wanted standard errors.

    Parameters
    ----------
    design, loop, settings, noise, accelerometer_m
        As for `forecast`; the design's own number of periods does not matter.
    wanted : mapping of str to mapping of str to float
        Highest standard error by response and regressor, unit of the parameter.
    longest_s : float
        Longest manoeuvre that may be flown, s.

    Returns
    -------
    Forecast
        Of the shortest manoeuvre, whose design says its periods and duration.

    Raises
    ------
    UsageError
        Where the longest manoeuvre does not reach them: which parameter is worst, and what it reaches.
    """
    refuse_unidentified(settings, wanted)
    if not 0 < longest_s < inf:
        raise UsageError(f"the longest manoeuvre is {longest_s:g} s, expected a positive time")
    most = int(longest_s / design.period_s + 1e-9)
    if most < 1:
        raise UsageError(
            f"one period lasts {design.period_s:g} s, longer than the {longest_s:g} s allowed",
            remedy="allow a longer manoeuvre or shorten period_s",
        )

    def flown(periods: int) -> Forecast:
        longer = replace(design, periods=periods)
        return forecast(longer, loop, settings, noise, accelerometer_m=accelerometer_m)

    def worst(result: Forecast) -> tuple[float, str, str]:
        return max(
            (result[r].std_error[result[r].regressors.index(j)] / error, r, j)
            for r, row in wanted.items()
            for j, error in row.items()
        )

    if not any(wanted.values()):
        return flown(1)
    ratio, response, regressor = worst(flown(most))
    if ratio > 1:
        error = wanted[response][regressor]
        raise UsageError(
            f"a standard error of {error:.4g} of '{regressor}' in '{response}' is out of reach: "
            f"{most} periods, {most * design.period_s:g} s, reach {ratio * error:.4g}, the nearest feasible",
            remedy=f"accept that, allow about {most * design.period_s * ratio**2:.4g} s, or raise amplitudes",
        )
    # The standard error falls with every period, so the first that suffices is found by halving.
    return flown(1 + bisect_left(range(1, most), True, key=lambda n: worst(flown(n))[0] <= 1))
