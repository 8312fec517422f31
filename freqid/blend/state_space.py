"""Small motions about a condition of the corridor, from a global model and mass properties."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from freqid.blend.locate import TILTS
from freqid.core.arrays import Array
from freqid.core.channels import WRENCH
from freqid.core.errors import DataError, UsageError
from freqid.core.frames import cross, shaft_axis
from freqid.core.scenario import Reference
from freqid.core.units import STANDARD_GRAVITY
from freqid.core.vehicle import Vehicle

if TYPE_CHECKING:
    from freqid.blend.global_model import GlobalModel


STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta")


@dataclass(frozen=True)
class StateSpace:
    """``x' = A x + B d`` about straight flight, wings level.

    Attributes
    ----------
    states, inputs : tuple of str
        Of x and d, all of them changes from the trim; the inputs are the model's effectors.
    A : ndarray, shape (8, 8)
    B : ndarray, shape (8, input)
        SI; without the reaction to rotors that speed up.
    trim : dict of str to float
        What x and d are measured from, ``theta`` and the tilts among them.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    A: Array
    B: Array
    trim: dict[str, float]


def to_statespace(model: GlobalModel, reference: Reference, vehicle: Vehicle) -> StateSpace:
    """Linearise an aircraft's motion about a condition, identified or not.

    Parameters
    ----------
    model : GlobalModel
        Of all six responses, in N and N m.
    reference : Reference
        Its speed and density; the trim there, tilts included, is the model's own.
    vehicle : Vehicle
        Mass properties, as they are at its trimmed tilts, and rotors.

    Returns
    -------
    StateSpace

    Raises
    ------
    UsageError
        Where the model lacks a response or is not one of forces and moments.
    DataError
        Where the speed is outside the corridor.

    Notes
    -----
    ``m (v' + w x V0) = F + m dg`` and ``I w' + w x h0 = M``, with h0 the rotors' momentum at the trim. The
    pitch angle is that at which the blended trim wrench carries the weight, ``tan(theta) = X / -Z``.

    References
    ----------
    Klein & Morelli, *Aircraft System Identification*, 2nd ed., ch. 3, linearised equations of motion.
    """
    missing = [r for r in WRENCH if r not in model.names]
    if missing or model.corridor.form != "force":
        raise UsageError(
            f"a state-space model needs X Y Z L M N in N and N m, found {' '.join(model.names)} in form "
            f"'{model.corridor.form}'",
            remedy="blend points of all six responses, identified with form 'force'",
        )
    inputs = model.reference(reference.u, reference.rho)
    at = {name: float(value[0]) for name, value in inputs.items()}
    rows = [model.names.index(r) for r in WRENCH]
    gradient = model.gradient(inputs)[rows, :, 0]
    column = {name: gradient[:, i] for i, name in enumerate(model.inputs)}
    effectors = tuple(n for n in model.corridor.units if n not in STATES)
    bias = model.wrench(inputs).values[rows, 0]
    theta = float(np.arctan2(bias[0], -bias[2]))
    velocity = np.array([at["u"], at.get("v", 0.0), at.get("w", at["u"] * np.tan(theta))])

    mass, inertia = vehicle.mass_properties.mass_kg, vehicle.mass_properties.inertia.matrix
    gravity = mass * STANDARD_GRAVITY
    moving = np.zeros((6, 8))
    for i, name in enumerate(STATES[:6]):
        if name in model.corridor.units:
            moving[:, i] = column[name]
    moving[:3, 3:6] -= mass * cross(np.eye(3), velocity[:, None] * np.ones(3))
    moving[3:, 3:6] -= cross(np.eye(3), _momentum(vehicle, at)[:, None] * np.ones(3))
    moving[1, 6] = gravity * np.cos(theta)
    moving[[0, 2], 7] = -gravity * np.array([np.cos(theta), np.sin(theta)])
    inverse = np.zeros((6, 6))
    inverse[:3, :3], inverse[3:, 3:] = np.eye(3) / mass, np.linalg.inv(inertia)
    A, B = np.zeros((8, 8)), np.zeros((8, len(effectors)))
    A[:6], B[:6] = inverse @ moving, inverse @ np.array([column[n] for n in effectors]).reshape(-1, 6).T
    A[6, 3], A[6, 5], A[7, 4] = 1.0, np.tan(theta), 1.0
    return StateSpace(STATES, effectors, A, B, {**at, "theta": theta})


def _momentum(vehicle: Vehicle, at: dict[str, float]) -> Array:
    """Return the rotors' angular momentum at a trim, body axes, N m s, shape (3,)."""
    tilts = {wing.name: at[name] for name, wing in zip(TILTS, vehicle.wings, strict=False)}
    momentum = np.zeros(3)
    for rotor in vehicle.rotors:
        if not rotor.inertia:
            continue
        if rotor.name not in at:
            raise DataError(
                f"the model has no rotor '{rotor.name}' among its regressors, whose momentum matters",
                remedy="regress on the speeds of all rotors, or give a vehicle whose rotors have no inertia",
            )
        axis = shaft_axis(rotor.axis, tilts.get(rotor.wing or "", 0.0))
        momentum += rotor.spin * rotor.inertia * at[rotor.name] * np.asarray(axis)
    return momentum
