"""Which terms each response of a point model has: regressors worth keeping, and products where it is bent.

Code that chooses among columns is in `freqid.identify.regress.structure`; here lines, noise and instruments
are made into such columns (docs/theory/regression.md, "Structure of a point model").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

import msgspec
import numpy as np
from scipy.ndimage import uniform_filter1d

from freqid.core.arrays import Array, Complex
from freqid.core.record import Maneuver
from freqid.core.results.point import DISTORTED, ResponseModel
from freqid.core.sections.identification import factors_of
from freqid.identify.loads.explanatory import explanatory_variables
from freqid.identify.model.fit import fit_lines
from freqid.identify.model.line_equations import LineEquations, on_lines
from freqid.identify.model.noise_bias import without_noise_bias
from freqid.identify.model.problem import Problem, numbered
from freqid.identify.model.widening import with_covariance
from freqid.identify.regress.covariance_corrections import independent_share
from freqid.identify.regress.noise_lines import HALF_WIDTH, noise_lines
from freqid.identify.regress.structure import (
    Structure,
    enter_families,
    partial_f_of_all,
    prepare_candidates,
    stepwise,
)
from freqid.identify.regress.two_stage import two_stage_least_squares

FLOW_REGRESSORS = frozenset(("u", "v", "w", "V", "alpha", "beta"))
RATE_REGRESSORS = frozenset(("p", "q", "r", "phat", "qhat", "rhat"))


def candidate_products(units: Mapping[str, str]) -> tuple[str, ...]:
    """Return the products of second degree that the loads may depend on.

    Parameters
    ----------
    units : mapping of str to str
        Unit of each regressor by name; of effectors it tells surfaces and tilts (rad) from propulsors.

    Returns
    -------
    tuple of str
        As ``w*de1``, factors in the order of `units`; a square is ``w*w``.

    Notes
    -----
    To second degree a load is dynamic pressure times angles, plus thrusts. So velocities and flow angles go
    with everything, a propulsor with the surfaces in its slipstream and, as blades meet the air that a rate
    brings, with rates; and each effector with itself, as drag and thrust do. Two surfaces, two propulsors,
    two rates, or a surface and a rate meet only through wakes, and are left out.
    """
    return tuple(f"{a}*{b}" for a, b in combinations_with_replacement(units, 2) if _act_together(a, b, units))


def _act_together(a: str, b: str, units: Mapping[str, str]) -> bool:
    kinds = {_kind(a, units[a]), _kind(b, units[b])}
    if "flow" in kinds:
        return True
    if a == b:
        return kinds != {"rate"}
    return kinds in ({"propulsor", "surface"}, {"propulsor", "rate"})


def _kind(name: str, unit: str) -> str:
    if name in FLOW_REGRESSORS:
        return "flow"
    if name in RATE_REGRESSORS:
        return "rate"
    return "surface" if unit == "rad" else "propulsor"


F_TO_STAY = 10.0
"""F that a term must keep to stay: one of 24 that do nothing has it by chance in 4 % of responses."""
RESOLVED = 1e-6
"""Share of a response's power below which what a model leaves is arithmetic, not flight."""
SUPPORTED = 10.0
"""Power of a product on the harmonics over that between them: of less, noise makes more than a tenth."""


@dataclass(frozen=True, eq=False)
class Flights:
    """The manoeuvres that a structure is chosen from.

    Attributes
    ----------
    maneuvers : sequence of Maneuver
    lines_hz : ndarray, shape (M,)
    period_s : float or None
        Of the multisines.
    driven : sequence of Maneuver, or None
        As the injected signals alone would have made them, where instruments estimate.
    """

    maneuvers: Sequence[Maneuver]
    lines_hz: Array
    period_s: float | None
    driven: Sequence[Maneuver] | None

    def instruments(self, names: Sequence[str]) -> list[Array] | None:
        """Return instruments of regressors, shape (p, N_s) each, about their means."""
        if self.driven is None:
            return None
        histories = [explanatory_variables(m, names)[0] for m in self.driven]
        return [x - x.mean(axis=1, keepdims=True) for x in histories]

    def fit(self, problem: Problem) -> dict[str, ResponseModel]:
        """Fit all responses on lines."""
        return fit_lines(problem, self.lines_hz, self.instruments(problem.names), self.period_s)


def choose_terms(
    problem: Problem, flights: Flights
) -> tuple[Problem, dict[str, Any], dict[str, ResponseModel]]:
    """Choose the terms of every response as the settings ask.

    Parameters
    ----------
    problem : Problem
        With all regressors.
    flights : Flights

    Returns
    -------
    problem : Problem
        With the regressors that each response is left with, products among them.
    account : dict
        By response, JSON-compatible: ``kept`` and ``left_out``, F by regressor, where regressors were chosen;
        ``distortion`` of the linear model and ``products``, F by product, where products were tried. Of a
        regressor that was left out, ``left_out_limits`` are its confidence limits where it is kept.
    before : dict of ResponseModel
        The fits that regressors were chosen from, for `with_choice`, by least squares without the bias of
        noise in the regressors; empty where none were.

    Raises
    ------
    DataError, UsageError
        As `fit_lines`.

    Notes
    -----
    Lines are weighted by the residual's own smoothed power, so that F means what it says under coloured
    noise; what is not linear counts as noise there, the same in every period though it is. Products come
    first: what is bent may resemble a regressor that does nothing. With instruments regressors are what the
    instruments explain of them, and products those of the instruments.
    """
    settings, offered = problem.settings, problem.names
    account: dict[str, Any] = {r: {} for r in settings.responses}
    before: dict[str, ResponseModel] = {}
    if settings.nonlinear == "products":
        models = flights.fit(problem)
        chosen = {r: settings.regressors_of(r) for r in settings.responses}
        possible = _Products.of(problem, flights, offered)
        for response, model in models.items():
            products: dict[str, float] = {}
            if model.distortion is not None and model.distortion > DISTORTED:
                products = _bend(problem, flights, model, possible)
            account[response] = {"distortion": model.distortion, "products": products}
            factors = [factor for name in products for factor in factors_of(name)]
            chosen[response] = tuple(dict.fromkeys((*chosen[response], *factors, *products)))
        problem = _changed(problem, flights, chosen)
    if settings.structure == "stepwise":
        chosen = {}
        before = flights.fit(problem)
        free_of_noise = before
        if flights.driven is None:
            equations = _equations(problem, flights, problem.x)
            free_of_noise = {r: without_noise_bias(problem, equations, m) for r, m in before.items()}
        for response, model in free_of_noise.items():
            found = _select_regressors(problem, flights, before[response])
            terms = _with_factors(model.regressors, found)
            f = {name: _figure(value) for name, value in found.partial_f.items()}
            account[response]["kept"] = {n: f[n] for n in terms}
            account[response]["left_out"] = {n: v for n, v in f.items() if n not in terms}
            account[response]["left_out_limits"] = {
                n: [float(low), float(high)]
                for n, low, high in zip(model.regressors, model.lower, model.upper, strict=True)
                if n not in terms
            }
            if "products" in account[response]:
                left = [n for n in account[response]["products"] if n in terms]
                account[response]["products"] = {n: f[n] for n in left}
            chosen[response] = terms
        problem, before = _changed(problem, flights, chosen), free_of_noise
    return problem, account, before


def with_choice(chosen: ResponseModel, before: ResponseModel) -> ResponseModel:
    """Return the fit of chosen terms with errors that hold what the choice itself may have done.

    Parameters
    ----------
    chosen : ResponseModel
        Of the terms that were kept.
    before : ResponseModel
        Of all terms that were offered, fitted to the same flights; unbiased, so far as that can be had.

    Returns
    -------
    ResponseModel

    Notes
    -----
    A term that was left out since its effect could not be told from zero need not have none, and those that
    are kept then stand for it. With all terms offered a kept parameter is free of that: there it has the
    estimate ``full`` with covariance C. The chosen estimate differs from it by ``d``, and its error is d
    beside the error of ``full``: covariance ``C + d d^T``, about the chosen estimate. Of least squares d
    holds the bias by noise in the regressors too, since ``full`` is without it (`without_noise_bias`).

    References
    ----------
    Claeskens & Hjort, "The focused information criterion", J. American Statistical Association 98, 2003 (the
    squared bias of a submodel by its difference from the wide one); Leeb & Poetscher, Econometric Theory 21,
    2005 (no interval of the chosen model alone can hold).
    """
    rows = [before.regressors.index(n) for n in chosen.regressors]
    moved = chosen.estimate - before.estimate[rows]
    return with_covariance(chosen, before.covariance[np.ix_(rows, rows)] + np.outer(moved, moved))


def _changed(problem: Problem, flights: Flights, regressors: dict[str, tuple[str, ...]]) -> Problem:
    settings = msgspec.structs.replace(problem.settings, regressors=regressors)
    return Problem.of(flights.maneuvers, settings)


def _with_factors(offered: Sequence[str], found: Structure) -> tuple[str, ...]:
    """Return what was found in the order offered, at least one, and with every product its factors."""
    terms = found.terms or (max(found.partial_f, key=found.partial_f.__getitem__),)
    needed = {factor for term in terms for factor in factors_of(term)}
    return tuple(name for name in offered if name in terms or name in needed)


def _select_regressors(problem: Problem, flights: Flights, model: ResponseModel) -> Structure:
    """Choose among the regressors of one response."""
    equations = _equations(problem, flights, problem.x)
    row = problem.settings.responses.index(model.response)
    weight = _whitening(problem, equations, model)
    x = equations.x[[problem.names.index(n) for n in model.regressors]] * weight
    z, nuisance = equations.z[[row]] * weight, equations.nuisance * weight
    driven = flights.instruments(model.regressors)
    if driven is not None:
        x, z = _explained(x, z, _equations(problem, flights, driven).x * weight, nuisance)
    return stepwise(
        x,
        z,
        names=model.regressors,
        nuisance=nuisance,
        f_enter=F_TO_STAY,
        start="everything",
        independent_share=_share(flights),
    )


def _explained(x: Complex, z: Complex, driven: Complex, nuisance: Complex) -> tuple[Complex, Complex]:
    """Return regressors and a response whose least squares is the estimate by instruments.

    The columns are what instruments explain of the regressors; the response is the sum of these times the
    estimate, plus the residual of the measured regressors. That residual is orthogonal to the instruments, so
    the estimate stays, and its variance is the one that the estimate scatters by; least squares of the
    response itself would leave the noise in the regressors out of it.
    """
    fit = two_stage_least_squares(x, z, driven, nuisance=nuisance)[0]
    basis = np.linalg.qr(_stacked(np.concatenate([nuisance, driven])).T)[0]
    explained = _stacked(x) @ basis @ basis.T
    lines = x.shape[1]
    columns = np.asarray(explained[:, :lines] + 1j * explained[:, lines:], dtype=complex)
    return columns, np.asarray(fit.estimate @ columns + fit.residual, dtype=complex)


def _stacked(columns: Complex) -> Array:
    return np.concatenate([columns.real, columns.imag], axis=1)


def _bend(problem: Problem, flights: Flights, model: ResponseModel, offered: _Products) -> dict[str, float]:
    """Return the products that one response needs beside its regressors, with their F."""
    equations = _equations(problem, flights, problem.x)
    linear = _columns(problem, flights, equations, model.regressors)
    weight = _whitening(problem, equations, model)
    present = {frozenset(factors_of(name)) for name in model.regressors if len(factors_of(name)) > 1}
    new = [j for j, name in enumerate(offered.names) if frozenset(factors_of(name)) not in present]
    if not new:
        return {}
    names = [offered.names[j] for j in new]
    candidates = prepare_candidates(
        offered.columns[new] * weight,
        _residual(equations, model) * weight,
        names,
        np.concatenate([equations.nuisance, linear]) * weight,
        _share(flights),
    )
    families = [[j for j, n in enumerate(names) if factor in factors_of(n)] for factor in problem.names]
    response = equations.z[problem.settings.responses.index(model.response)] * weight
    arithmetic = RESOLVED * float(np.sum(np.abs(response) ** 2))
    chosen = enter_families(candidates, families, F_TO_STAY, arithmetic)
    f = partial_f_of_all(candidates, chosen)
    return {names[j]: _figure(f[j]) for j in sorted(chosen)}


@dataclass(frozen=True, eq=False)
class _Products:
    """Products that physics and the excitation support, on lines: shape (c, S M)."""

    names: tuple[str, ...]
    columns: Complex

    @classmethod
    def of(cls, problem: Problem, flights: Flights, order: Sequence[str]) -> _Products:
        unit_of = dict(zip(problem.names, problem.units, strict=True))
        units = {n: unit_of[n] for n in order if n in unit_of and len(factors_of(n)) == 1}
        names = candidate_products(units)
        trim = dict(zip(problem.names, problem.trim.tolist(), strict=True))
        measured = [explanatory_variables(m, names, trim)[0] for m in flights.maneuvers]
        equations = _equations(problem, flights, measured)
        on, off = _power(equations.x), np.zeros(len(names))
        assert flights.period_s is not None  # else `fit_lines` has refused noise lines
        for x, wrench, dt, duration in zip(
            measured, problem.wrench, problem.dt, equations.durations, strict=True
        ):
            between = noise_lines(flights.lines_hz, flights.period_s, duration)
            off += _power(on_lines([x], [wrench], [dt], between).x) / len(measured)
        columns = equations.x
        driven = flights.instruments(names)
        if driven is not None:
            columns = _equations(problem, flights, driven).x
        supported = (on > SUPPORTED * off) & (_power(columns) > 0)
        return cls(tuple(n for n, s in zip(names, supported, strict=True) if s), columns[supported])


def _equations(problem: Problem, flights: Flights, histories: Sequence[Array]) -> LineEquations:
    settings = problem.settings
    trend = settings.trend or "line"
    return on_lines(
        histories, problem.wrench, problem.dt, flights.lines_hz, trend=trend, nuisance=settings.nuisance
    )


def _columns(
    problem: Problem, flights: Flights, equations: LineEquations, regressors: Sequence[str]
) -> Complex:
    """Return regressors of a response on lines, or their instruments, shape (p, S M)."""
    driven = flights.instruments(regressors)
    if driven is not None:
        return _equations(problem, flights, driven).x
    return equations.x[[problem.names.index(n) for n in regressors]]


def _residual(equations: LineEquations, model: ResponseModel) -> Complex:
    """Return what a fit leaves of its response on lines, weighted as its equations, shape (S M,)."""
    left = [model.fit[numbered("frequency", m)].residual for m in range(len(equations.durations))]
    return np.asarray(equations.weight * np.concatenate(left), dtype=complex)


def _whitening(problem: Problem, equations: LineEquations, model: ResponseModel) -> Array:
    """Return one over the residual's smoothed magnitude, relative, shape (S M,)."""
    power = np.abs(_residual(equations, model)) ** 2
    if problem.settings.residuals == "white" or not power.any():
        return np.ones_like(power)
    each = np.split(power, len(equations.durations))
    smooth = np.concatenate([uniform_filter1d(p, 2 * HALF_WIDTH + 1, mode="nearest") for p in each])
    return np.sqrt(smooth.mean() / smooth)


def _figure(f: float) -> float:
    """Return an F as a number that JSON has: of an exact fit it is infinite."""
    return round(min(float(f), 1e12), 3)


def _power(columns: Complex) -> Array:
    return np.mean(np.abs(columns) ** 2, axis=1)


def _share(flights: Flights) -> float:
    return float(np.mean([independent_share(flights.lines_hz, m.record.duration) for m in flights.maneuvers]))
