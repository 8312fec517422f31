"""A model at one condition, as a prediction needs it: derivatives, their covariance, what the fit left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from freqid.blend.global_model import GlobalModel
from freqid.core.arrays import Array, Complex
from freqid.core.channels import WRENCH
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.results.fit import Fit
from freqid.core.results.point import PointModel, ResponseModel
from freqid.core.results.prediction import PredictedResponse
from freqid.core.scenario import Reference
from freqid.core.vehicle import Vehicle
from freqid.design.forecast.modelled import derivatives_of, positions_at
from freqid.dynamics.control_law import ControlLaw
from freqid.dynamics.controlled import ControlledAircraft, UnevenLags
from freqid.dynamics.mass import with_tilted_wings
from freqid.dynamics.small_motion import STATES, rotor_spin

REGRESSORS = STATES[:6]
"""States that a free-running response can be made from, beside effectors."""


@dataclass(frozen=True, eq=False)
class ModelAtCondition:
    """A linear model about a trim.

    Attributes
    ----------
    reference : Reference
    responses : tuple of PredictedResponse
    velocity : ndarray, shape (3,)
        u v w of the trim, m/s.
    theta : float
        rad: the angle at which the trim wrench carries the weight.
    trim : dict of float
        Of regressors and tilts, as far as the model tells.
    highest_hz : float
        Infinite where the model was identified in time.
    kind : {"point", "global"}
    """

    reference: Reference
    responses: tuple[PredictedResponse, ...]
    velocity: Array
    theta: float
    trim: dict[str, float]
    highest_hz: float
    kind: str

    def wrench(self, effectors: Sequence[str], estimates: Sequence[Array] | None = None) -> Array:
        """Return X to N per unit of states and effectors, shape (6, 8 + n).

        Parameters
        ----------
        effectors : sequence of str, length n
        estimates : sequence of ndarray, optional
            In place of the model's own, by response.
        """
        columns = {name: j for j, name in enumerate((*STATES, *effectors))}
        found = np.zeros((6, len(columns)))
        given = estimates if estimates is not None else [r.estimate for r in self.responses]
        for response, values in zip(self.responses, given, strict=True):
            found[WRENCH.index(response.response), [columns[n] for n in response.regressors]] = values
        return found

    def draw(self, count: int, seed: int) -> list[list[Array]]:
        """Return estimates as far off as the covariance lets them be, each response independently."""
        rng = np.random.default_rng(seed)
        drawn = [rng.multivariate_normal(r.estimate, r.covariance, count) for r in self.responses]
        return [list(one) for one in zip(*drawn, strict=True)]

    def controlled(
        self, vehicle: Vehicle, law: ControlLaw, lags: UnevenLags | None = None
    ) -> ControlledAircraft:
        """Return the aircraft under a control law.

        Parameters
        ----------
        vehicle : Vehicle
            Its mass properties are taken to the trimmed tilts.
        law : ControlLaw
            Of all effectors of the vehicle, in order.
        lags : UnevenLags, optional
            Of its actuators.
        """
        tilts = {w.tilt for w in vehicle.wings} & set(self.trim)
        tilted = with_tilted_wings(vehicle, {n: self.trim[n] for n in tilts})
        spin = rotor_spin(tilted, law.effectors, self.trim)
        positions = np.array([self.trim.get(n, 0.0) for n in law.effectors])
        wrench = self.wrench(law.effectors)
        return ControlledAircraft(
            tilted, wrench, self.velocity, self.theta, spin, spin @ positions, law, lags
        )


def of_point(model: PointModel, vehicle: Vehicle) -> ModelAtCondition:
    """Return a point model at its own condition.

    Raises
    ------
    UsageError
        Where it is not of forces in body axes, or regresses on what a free-running response does not have.
    DataError
        Where it has no covariance.
    """
    derivatives_of(model)  # refuses another form
    responses = tuple(_of_response(r) for r in model.responses.values())
    trim = {n: float(x) for r in responses for n, x in zip(r.regressors, r.trim, strict=True)}
    trim = positions_at(model.reference, vehicle) | trim
    found = {r.response: r.bias for r in responses}
    return _at(model.reference, responses, trim, found, _highest_line(model), "point", vehicle)


def _highest_line(model: PointModel) -> float:
    """Return the highest line of a fit, Hz; infinite where the model was identified in time."""
    lines = [r.fit["frequency"].axis[-1] for r in model.responses.values() if "frequency" in r.fit]
    return float(max(lines, default=np.inf))


def of_global(
    model: GlobalModel, reference: Reference, vehicle: Vehicle, residual: PointModel | None = None
) -> ModelAtCondition:
    """Return a global model at a condition of its corridor.

    Parameters
    ----------
    model : GlobalModel
    reference : Reference
        Its speed and density; trim and tilts are the model's own there.
    vehicle : Vehicle
    residual : PointModel, optional
        Whose residual stands for what the model leaves; a global model does not keep that of its points.

    Raises
    ------
    UsageError
        As `of_point`.
    DataError
        Where the condition is outside the corridor.
    """
    if model.corridor.form != "force":
        raise UsageError(
            f"the model has the form '{model.corridor.form}', expected 'force'",
            remedy="blend points that were identified with form 'force' and axes 'body'",
        )
    c = model.corridor
    knots_at = c.u if c.along == "u" else c.schedule[c.scheduled.index(c.along)]
    at = reference.u if c.along == "u" else reference[c.along]
    nearest_knot = int(np.argmin(np.abs(knots_at - at)))
    inputs = model.reference(at, reference.rho)
    gradient = model.gradient(inputs)[:, :, 0]
    bias = model.wrench(inputs).values[:, 0]
    place = {name: i for i, name in enumerate(model.inputs)}
    left = residual.responses if residual is not None else {}
    responses = []
    for row, knots in enumerate(c.responses.values()):
        found = _left_by(left[knots.response]) if knots.response in left else _NOTHING_LEFT
        responses.append(
            PredictedResponse(
                response=knots.response,
                unit=knots.unit,
                regressors=knots.regressors,
                regressor_units=knots.regressor_units,
                trim=np.array([inputs[n][0] for n in knots.regressors]),
                regressor_rms=knots.regressor_rms[:, nearest_knot],
                estimate=gradient[row, [place[n] for n in knots.regressors]],
                covariance=model.parameter_covariance(knots.response, inputs),
                bias=float(bias[row]),
                **found,
            )
        )
    trim = {n: float(x[0]) for n, x in inputs.items()}
    lines = [c.highest_hz, _highest_line(residual)] if residual is not None else [c.highest_hz]
    highest = min((hz for hz in lines if np.isfinite(hz)), default=np.inf)
    by_name = dict(zip(model.names, map(float, bias), strict=True))
    return _at(reference, tuple(responses), trim, by_name, float(highest), "global", vehicle)


_NOTHING_LEFT: dict[str, Any] = {
    "residual_rms": float("nan"),
    "residual_hz": np.empty(0),
    "residual": np.empty(0, dtype=complex),
    "residual_noise": np.empty(0),
    "duration": float("nan"),
    "rate_hz": float("nan"),
}


def _at(
    reference: Reference,
    responses: tuple[PredictedResponse, ...],
    trim: Mapping[str, float],
    bias: Mapping[str, float],
    highest_hz: float,
    kind: str,
    vehicle: Vehicle,
) -> ModelAtCondition:
    """Return a model at a condition, once it is known to be able to move the aircraft."""
    missing = [n for n in WRENCH if n not in bias]
    if missing:
        raise UsageError(
            f"a free-running response needs X Y Z L M N, and the model has no {' '.join(missing)}",
            remedy="identify all six responses",
        )
    known = (*REGRESSORS, *vehicle.effector_kinds)
    for response in responses:
        for name in response.regressors:
            if name not in known:
                raise UsageError(
                    f"response '{response.response}' depends on '{name}', which is no body-axis state and "
                    f"no effector of '{vehicle.name}'",
                    remedy=f"{nearest(name, known)} Identify with regressors among u v w p q r and effectors",
                )
        spread = response.covariance
        if not np.isfinite(spread).all() or not (np.diag(spread) > 0).all():
            raise DataError(
                f"response '{response.response}' has no covariance of its parameters, so that no band "
                "can be drawn",
                remedy="identify the model again, so that its covariance is in the file",
            )
    theta = float(np.arctan2(bias["X"], -bias["Z"]))
    u = trim.get("u", reference.u)
    velocity = np.array([u, trim.get("v", 0.0), trim.get("w", u * np.tan(theta))])
    if not np.isfinite(velocity).all():
        raise DataError("the model does not say at which speed it holds", remedy="identify it with --at")
    return ModelAtCondition(reference, responses, velocity, theta, dict(trim), highest_hz, kind)


def _of_response(model: ResponseModel) -> PredictedResponse:
    """Return a response of a point model with what its fit left.

    Where noise lines told the covariance, it is of noise alone: how estimates of one design scatter. With
    another design they scatter by the distortion too, whose power over that of noise is then known.
    """
    scatter = max(model.distortion or 1.0, 1.0)
    return PredictedResponse(
        response=model.response,
        unit=model.unit,
        regressors=model.regressors,
        regressor_units=model.regressor_units,
        trim=model.trim,
        regressor_rms=model.regressor_rms,
        estimate=model.estimate,
        covariance=model.covariance * scatter,
        bias=float(model.bias),
        **_left_by(model),
    )


def _left_by(model: ResponseModel) -> dict[str, Any]:
    """Return residual fields of a response: rms in time, and amplitude densities on the lines.

    The densities are those of noise and of what is not linear, once the share that the fit took with its
    parameters is given back.
    """
    times = [f for name, f in model.fit.items() if name.startswith("time")]
    if not times:
        return _NOTHING_LEFT
    duration = float(np.mean([f.axis[-1] + f.axis[1] - f.axis[0] for f in times]))
    lines = [f for name, f in model.fit.items() if name.startswith("frequency")]
    highest = float(lines[0].axis[-1]) if lines else float("inf")
    equations = 2 * sum(f.axis.size for f in lines) if lines else sum(f.axis.size for f in times)
    freed = max(1 - len(model.regressors) / equations, 0.1)
    square = np.mean([np.var(f.inside(highest).residual) for f in times])
    step = float(times[0].axis[1] - times[0].axis[0])
    found = {
        **_NOTHING_LEFT,
        "residual_rms": float(np.sqrt(square / freed)),
        "duration": duration,
        "rate_hz": 1 / step,
    }
    if lines:
        scale = np.sqrt(2 / duration / freed)
        noise = [f.noise if f.noise is not None else np.full(f.axis.size, np.nan) for f in lines]
        slow = [_slow_lines(f, float(lines[0].axis[0])) for f in times]
        drift = np.sqrt(2 / duration) * np.concatenate([left for _, left in slow])
        found |= {
            "residual_hz": np.concatenate([*(hz for hz, _ in slow), *(f.axis for f in lines)]),
            "residual": np.concatenate([drift, scale * np.concatenate([f.residual for f in lines])]),
            "residual_noise": np.concatenate([np.abs(drift), scale * np.concatenate(noise)]),
        }
    return found


def _slow_lines(fit: Fit, lowest_hz: float) -> tuple[Array, Complex]:
    """Return lines below those of a fit and what is left there: drifts, of a battery or of the trim."""
    step = float(fit.axis[1] - fit.axis[0])
    count = int(np.ceil(lowest_hz * step * fit.axis.size - 1e-6)) - 1
    lines = np.arange(1, count + 1) / (step * fit.axis.size)
    residual = fit.residual - fit.residual.mean()
    return lines, step * np.exp(-2j * np.pi * np.outer(lines, fit.axis)) @ residual
