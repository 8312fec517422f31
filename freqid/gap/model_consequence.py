"""The consequence of identified derivatives: point models made into vehicles that move as rigid bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import WRENCH
from freqid.core.errors import DataError, UsageError
from freqid.core.models import PointModel
from freqid.core.vehicle import Vehicle
from freqid.gap.closed_loop import Actuation, LinearLoop
from freqid.gap.condition import Condition
from freqid.gap.consequence import DRAWS, Consequence, compare
from freqid.gap.modes import MOTION
from freqid.gap.rigid_body import inertia_and_spin, rigid_body_matrices

Array = NDArray[np.float64]

_MOVED = MOTION[:6]  # regressors that are states


def model_consequence(
    before: PointModel | Condition,
    after: PointModel,
    vehicle: Vehicle,
    law: LinearLoop | None = None,
    *,
    angles: tuple[float, float] | None = None,
    actuation: Actuation | None = None,
    draws: int = DRAWS,
    level: float = 0.9,
    seed: int = 0,
) -> Consequence:
    """Return what changes between two point models under one law.

    Parameters
    ----------
    before : PointModel or Condition
        As simulated; a condition, for example of `scenario_consequence.condition`, has no errors.
    after : PointModel
        As identified from flight, form "force", body axes.
    vehicle : Vehicle
    law : LinearLoop, optional
        Its effectors, gain, allocation and actuation are used; its vehicle is not. Without a law there are
        modes and no margins.
    angles : (roll, pitch), optional
        Of the trim, rad; those at which the models' forces balance the weight where absent.
    actuation : Actuation, optional
        Of the flight, where it is not the law's.
    draws, level, seed : int, float, int
        Of the intervals: models drawn from their covariances, none for no intervals; confidence; where the
        draws start.

    Returns
    -------
    Consequence

    Raises
    ------
    UsageError
        Where a model is in coefficients or other axes, or lacks effectors of the law.
    DataError
        Where the vehicle's positions needed for its inertia are not among the model's regressors.
    """

    def made(model: PointModel | Condition, how: Actuation | None) -> Condition:
        if isinstance(model, Condition):
            return model
        return model_condition(model, vehicle, law, angles=angles, actuation=how)

    rng = np.random.default_rng(seed)
    first, second = made(before, None), made(after, actuation)
    several = [
        (
            first if isinstance(before, Condition) else made(drawn_model(before, rng), None),
            made(drawn_model(after, rng), actuation),
        )
        for _ in range(draws)
    ]
    return compare(first, second, several, level=level)


def model_condition(
    model: PointModel,
    vehicle: Vehicle,
    law: LinearLoop | None = None,
    *,
    angles: tuple[float, float] | None = None,
    actuation: Actuation | None = None,
) -> Condition:
    """Return a point model as a rigid vehicle under a law; parameters and errors as `model_consequence`."""
    if model.form != "force" or model.axes != "body":
        raise UsageError(
            f"the model is in form '{model.form}' and {model.axes} axes, expected 'force' and body axes",
            remedy="identify it again with --form force --axes body",
        )
    known = dict.fromkeys(n for r in model.responses.values() for n in r.regressors if n not in MOTION)
    effectors = law.effectors if law else tuple(n for n in known if n in vehicle.effector_kinds)
    lacking = [n for n in effectors if n not in known]
    if lacking:
        raise UsageError(
            f"the law moves {', '.join(lacking)}, of which the model knows nothing",
            remedy="identify with these effectors among the regressors",
        )
    wrench = np.zeros((6, 6 + len(effectors)))
    trim: dict[str, float] = {}
    for i, name in enumerate(WRENCH):
        if name not in model.responses:
            continue
        response = model.responses[name]
        for regressor, slope, at in zip(response.regressors, response.estimate, response.trim, strict=True):
            trim.setdefault(regressor, float(at))
            if regressor in _MOVED:
                wrench[i, _MOVED.index(regressor)] = slope
            elif regressor in effectors:
                wrench[i, 6 + effectors.index(regressor)] = slope
    turned = angles or _balanced(model)
    inertia, spin = inertia_and_spin(vehicle, _tilts(model, vehicle) | trim)
    velocity = np.array([trim.get("u", model.reference.u), trim.get("v", 0.0), trim.get("w", 0.0)])
    A, B = rigid_body_matrices(wrench, vehicle.mass_properties.mass_kg, inertia, velocity, turned, spin=spin)
    positions = {n: trim[n] for n in effectors if n in trim}
    limits = {e.name: e.limits for e in vehicle.effectors}
    return Condition(_under(law, effectors, A, B, velocity, turned[1], actuation), positions, limits)


def drawn_model(model: PointModel, rng: np.random.Generator) -> PointModel:
    """Return a point model with derivatives drawn from its covariances."""
    responses = {
        name: replace(one, estimate=rng.multivariate_normal(one.estimate, one.covariance))
        for name, one in model.responses.items()
    }
    return replace(model, responses=responses)


def _balanced(model: PointModel) -> tuple[float, float]:
    """Return roll and pitch at which the forces of the trim balance the weight."""
    force = [model.responses[n].bias if n in model.responses else 0.0 for n in "XYZ"]
    if not force[2] < 0:
        raise DataError(
            f"the model's force Z at its trim is {force[2]:.4g} N, which holds no weight up",
            remedy="give the trim's roll and pitch angle",
        )
    return float(np.arctan2(-force[1], -force[2])), float(np.arctan2(force[0], -force[2]))


def _tilts(model: PointModel, vehicle: Vehicle) -> dict[str, float]:
    """Return the tilts of the reference, the front wing's first."""
    stated = (model.reference.dw1, model.reference.dw2)
    return {w.tilt: float(t) for w, t in zip(vehicle.wings, stated, strict=False)}


def _under(
    law: LinearLoop | None,
    effectors: Sequence[str],
    A: Array,
    B: Array,
    velocity: Array,
    theta: float,
    actuation: Actuation | None,
) -> LinearLoop:
    """Return the vehicle under a law, whose integrals are states like the vehicle's."""
    n = len(effectors)
    if law is None:
        none = np.zeros((0, 9))
        how = actuation or Actuation.ideal(n)
        return LinearLoop(MOTION, tuple(effectors), (), A, B, none, np.zeros((n, 0)), how)
    more = len(law.states) - 9
    if law.states[:9] != MOTION:
        raise UsageError(f"the law's first states are {law.states[:9]}, expected {MOTION}")
    whole, driven = np.zeros((9 + more, 9 + more)), np.zeros((9 + more, n))
    whole[:9, :9], driven[:9] = A, B
    whole[9:] = law.A[9:]  # integrals, of what the law compares with its trim
    if "altitude" in law.states:
        climb = velocity[0] * np.cos(theta) + velocity[2] * np.sin(theta)
        row = law.states.index("altitude")
        whole[row, [0, 2, 7]] = np.sin(theta), -np.cos(theta), climb
    return replace(law, A=whole, B=driven, actuation=actuation or law.actuation)
