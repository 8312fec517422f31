"""A point model as an exact calculation, and the states that its exports are checked at."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from freqid.blend.exports.calculation import (
    Apply,
    Calculation,
    CheckCase,
    Expression,
    Steps,
    beyond,
    less,
    product,
    total,
)
from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.results.point import PointModel, ResponseModel
from freqid.core.sections.identification import factors_of

DEPARTURE = 3.0
"""How far inputs go from their trim in the stated range, in rms of the manoeuvre of identification."""
CHECKS = 24


def exact(model: PointModel) -> Calculation:
    """Return a point model as a calculation.

    Raises
    ------
    UsageError
        Where a product has a factor whose trim is not known.
    """
    steps, outputs, limits = Steps(), {}, {}
    named: dict[str, str] = {}
    factors = factor_trims(model)
    for name, (unit, trim, rms) in factors.items():
        span = f"{name}, trim {trim:.6g}, moved by {rms:.3g} rms when the model was identified"
        named[name] = steps.add(name, unit, span, None, label=name)
    for response in model.responses.values():
        r = response.response
        terms: list[Expression] = [
            steps.add(f"{r}_trim", response.unit, f"{r} at the trim", response.bias, response.bias_std_error)
        ]
        before: list[str] = []
        for j, (name, unit) in enumerate(zip(response.regressors, response.parameter_units, strict=True)):
            correlation = {
                other: float(response.correlation[j, i])
                for i, other in enumerate(before)
                if np.isfinite(response.correlation[j, i])
            }
            estimate, error = float(response.estimate[j]), float(response.std_error[j])
            parameter = steps.add(
                f"{r}_{name}", unit, f"derivative of {r} by {name}", estimate, error, correlation
            )
            before.append(parameter)
            parts, trim = factors_of(name), float(response.trim[j])
            if len(parts) == 1:
                moved = less(named[name], trim)
            else:
                moved = less(product(*(less(named[f], factors[f][1]) for f in parts)), trim)
            terms.append(product(parameter, moved))
        outputs[r] = steps.add(r, response.unit, f"applied {r}, whole", total(terms), label=r)
        limits[r] = 0.0
    far = total(
        [beyond(less(named[n], trim), DEPARTURE * rms) for n, (_, trim, rms) in factors.items() if rms > 0]
    )
    outside = steps.add(
        "outside",
        "1",
        f"1 where an input is more than {DEPARTURE:g} rms from its trim",
        Apply("min", (far, 1.0)),
    )
    return Calculation(
        title=f"{model.vehicle or 'aircraft'}: point model at {model.reference.id or 'one condition'}",
        notes=(*range_notes(model), "Parameters are exact; standard errors are one sigma."),
        axes={},
        quantities=tuple(steps.quantities),
        outputs=outputs,
        outside=outside,
        inner=(),
        bounds=limits,
        checks=_checks(model),
        form=model.form,
    )


def range_notes(model: PointModel) -> tuple[str, ...]:
    """Return which states a model is for and what happens elsewhere, one sentence each."""
    at = model.reference
    scheduled = "".join(f", {n} = {v:.6g}" for n, v in at.scheduled.items())
    return (
        f"Model of {model.vehicle} at the condition '{at.id}': u = {at.u:.6g} m/s, rho = {at.rho:.6g} kg/m3"
        f"{scheduled}; form '{model.form}', {model.axes} axes, moments about the centre of gravity.",
        "Inputs are absolute values in SI units and radians, not deviations from the trim.",
        f"The model is linear and is meant for inputs within {DEPARTURE:g} rms of its trim; beyond, it goes "
        "on linearly and the quantity 'outside' is 1.",
    )


def factor_trims(model: PointModel) -> dict[str, tuple[str, float, float]]:
    """Return unit, trim and rms of all inputs of a point model, by name."""
    found: dict[str, tuple[str, float, float]] = {}
    for response in model.responses.values():
        rows = zip(
            response.regressors,
            response.regressor_units,
            response.trim.tolist(),
            response.regressor_rms.tolist(),
            strict=True,
        )
        for name, unit, trim, rms in rows:
            if len(factors_of(name)) == 1:
                found.setdefault(name, (unit, trim, rms))
    lacking = [
        f for r in model.responses.values() for n in r.regressors for f in factors_of(n) if f not in found
    ]
    if lacking:
        raise UsageError(
            f"a product has the factor '{lacking[0]}', which is no regressor, so its trim is not known",
            remedy="identify the point with the factor among its regressors",
        )
    return found


def values_at(model: PointModel, inputs: Mapping[str, Array]) -> tuple[Array, Array]:
    """Return responses and their standard errors for absolute inputs, shape (response, n) each."""
    factors, values, errors = factor_trims(model), [], []
    for response in model.responses.values():
        x = _moved(response, factors, inputs)
        values.append(response.bias + response.estimate @ x)
        errors.append(np.sqrt(response.bias_std_error**2 + ((response.covariance @ x) * x).sum(axis=0)))
    return np.array(values), np.array(errors)


def _moved(
    response: ResponseModel, factors: Mapping[str, tuple[str, float, float]], inputs: Mapping[str, Array]
) -> Array:
    """Return the regressors less their trims, shape (p, n); a product is of its factors' departures."""
    rows = []
    for name, trim in zip(response.regressors, response.trim.tolist(), strict=True):
        parts = factors_of(name)
        moved = (
            inputs[name] if len(parts) == 1 else np.prod([inputs[f] - factors[f][1] for f in parts], axis=0)
        )
        rows.append(moved - trim)
    return np.array(rows)


def states_about(model: PointModel) -> tuple[dict[str, Array], NDArray[np.bool_]]:
    """Return states about the trim, that itself first and one outside last, and whether each is outside."""
    factors, rng = factor_trims(model), np.random.default_rng(0)
    size = rng.uniform(-1, 1, (len(factors), CHECKS)) * np.append(0.0, np.linspace(0.5, 2.9, CHECKS - 1))
    size[:, -1] = DEPARTURE + 1
    inputs = {n: trim + rms * row for (n, (_, trim, rms)), row in zip(factors.items(), size, strict=True)}
    return inputs, np.arange(CHECKS) == CHECKS - 1


def _checks(model: PointModel) -> tuple[CheckCase, ...]:
    inputs, outside = states_about(model)
    values = dict(zip(model.responses, values_at(model, inputs)[0], strict=True))
    bounds = {n: 1e-12 * float(np.abs(v).max()) for n, v in values.items()}
    return tuple(
        CheckCase(
            name="at the trim" if i == 0 else "outside" if out else f"about the trim {i}",
            inputs={n: float(v[i]) for n, v in inputs.items()},
            outputs={n: float(v[i]) for n, v in values.items()},
            bounds=bounds,
            outside=bool(out),
        )
        for i, out in enumerate(outside)
    )


def start_at(model: PointModel) -> dict[str, float]:
    """Return the inputs at the trim and ``theta``, SI."""
    at = {name: trim for name, (_, trim, _) in factor_trims(model).items()}
    at = {**model.reference.scheduled, "u": model.reference.u, "rho": model.reference.rho} | at
    bias = {name: r.bias for name, r in model.responses.items()}
    theta = float(np.arctan2(bias.get("X", 0.0), -bias.get("Z", -1.0)))
    return {"w": at["u"] * np.tan(theta)} | at | {"theta": theta}
