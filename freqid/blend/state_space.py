"""Small motions about a condition of the corridor, as a state-space model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import WRENCH
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.extras import extra
from freqid.core.results.point import PointModel
from freqid.core.units import STANDARD_GRAVITY
from freqid.core.vehicle import Vehicle
from freqid.dynamics.mass import with_tilted_wings
from freqid.dynamics.small_motion import (
    NAVIGATION,
    SIGNALS,
    STATES,
    equations_of_motion,
    navigation_rows,
    rotor_spin,
    signal_row,
)


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
    residual : ndarray, shape (6,)
        Accelerations, m/s2 and rad/s2, that the model's loads leave at the trim: zero in balance.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    A: Array
    B: Array
    trim: dict[str, float]
    residual: Array = field(default_factory=lambda: np.zeros(6))

    @classmethod
    def of(
        cls,
        derivatives: Mapping[str, Array],
        trim: Mapping[str, float],
        vehicle: Vehicle,
        loads: Array | None = None,
    ) -> StateSpace:
        """Put derivatives of the wrench into the equations of motion (`freqid.dynamics.small_motion`).

        Parameters
        ----------
        derivatives : mapping of str to ndarray of shape (6,)
            X to N per unit of u v w p q r, where the model has them, and of each effector; N and N m.
        trim : mapping of str to float
            ``u v w``, ``theta``, effectors and tilts.
        vehicle : Vehicle
            Mass properties and rotors; the wings' masses are moved to the trimmed tilts.
        loads : ndarray, shape (6,), optional
            X to N at the trim, N and N m; in balance where absent.

        Raises
        ------
        DataError
            Where a rotor that has inertia is no effector of the model.
        """
        effectors = tuple(n for n in derivatives if n not in STATES)
        names = (*STATES, *effectors)
        wrench = np.array([derivatives.get(n, np.zeros(6)) for n in names]).T
        rotors = [r.name for r in vehicle.rotors if r.inertia]
        missing = [n for n in rotors if n not in trim]
        if missing:
            raise DataError(
                f"the model has no rotor '{missing[0]}' among its regressors, whose momentum matters",
                remedy="regress on the speeds of all rotors, or give a vehicle whose rotors have no inertia",
            )
        tilts = {w.tilt: trim[w.tilt] for w in vehicle.wings if w.tilt in trim}
        vehicle = with_tilted_wings(vehicle, tilts)
        momentum = rotor_spin(vehicle, rotors, tilts) @ np.array([trim[n] for n in rotors])
        velocity = np.array([trim[n] for n in STATES[:3]])
        reaction = np.zeros((3, len(effectors)))
        E, A = equations_of_motion(wrench, vehicle, velocity, trim["theta"], reaction, momentum)
        both: Array = np.asarray(np.linalg.solve(E[:, :8], A), dtype=float)
        residual = np.zeros(6)
        if loads is not None:
            down = np.array([-np.sin(trim["theta"]), 0.0, np.cos(trim["theta"]), 0.0, 0.0, 0.0])
            residual = np.linalg.solve(E[:6, :6], loads) + STANDARD_GRAVITY * down
        return cls(STATES, effectors, both[:, :8], both[:, 8:], dict(trim), residual)

    @property
    def velocity(self) -> Array:
        """Of the trim, u v w, m/s."""
        return np.array([self.trim[n] for n in STATES[:3]])

    def to_control(self, outputs: Sequence[str] = (), name: str | None = None) -> Any:
        """Return the same as a python-control ``StateSpace`` with names on states, inputs and outputs.

        Parameters
        ----------
        outputs : sequence of str
            Among u v w p q r phi theta, psi, alt, V, alpha and beta; the eight states where empty. Heading
            and altitude become states where they are asked for.
        name : str, optional

        Raises
        ------
        UsageError
            For an unknown output, or one without meaning at rest.
        DataError
            Where python-control is not installed.
        """
        control = extra("control", "control")
        wanted = tuple(outputs) or self.states
        for one in wanted:
            if one not in SIGNALS:
                raise UsageError(f"the motion has no '{one}'", remedy=nearest(one, SIGNALS))
        try:
            C = np.array([signal_row(one, self.velocity) for one in wanted])
        except ValueError as error:
            raise UsageError(str(error), remedy="leave it out, or take another condition") from None
        used = [i for i, n in enumerate(NAVIGATION) if n in wanted]
        size = 8 + len(used)
        A, B = np.zeros((size, size)), np.zeros((size, len(self.inputs)))
        A[:8, :8], B[:8] = self.A, self.B
        A[8:, :8] = navigation_rows(self.velocity, self.trim["theta"])[used]
        return control.ss(
            A,
            B,
            C[:, [*range(8), *(8 + i for i in used)]],
            np.zeros((len(wanted), len(self.inputs))),
            states=[*self.states, *(list(NAVIGATION)[i] for i in used)],
            inputs=list(self.inputs),
            outputs=list(wanted),
            name=name,
        )


def vehicle_of(given: Vehicle | None, stated: Vehicle | None) -> Vehicle:
    """Return the vehicle whose mass counts: the one given, or that of the model.

    Raises
    ------
    UsageError
        Where there is none.
    """
    vehicle = given or stated
    if vehicle is None:
        raise UsageError(
            "the model does not say what its aircraft weighs, or its points were flown with different masses",
            remedy="give the vehicle (--scenario SCENARIO, or vehicle=scenario.aircraft()), or identify the "
            "points again",
        )
    return vehicle


def check_loads(responses: Sequence[str], form: str, axes: str = "body") -> None:
    """Raise UsageError where a model has not all six loads as forces and moments in body axes."""
    if [r for r in WRENCH if r not in responses] or (form, axes) != ("force", "body"):
        raise UsageError(
            f"a state-space model needs X Y Z L M N in N and N m, found {' '.join(responses)} in form "
            f"'{form}'" + ("" if axes == "body" else f" and {axes} axes"),
            remedy="blend points of all six responses, identified with form 'force'",
        )


def point_statespaces(
    point: PointModel, vehicle: Vehicle | None = None, draws: int = 0, seed: int = 0
) -> list[StateSpace]:
    """Return a point model's small motion, alone or of models drawn from its covariance.

    Parameters
    ----------
    point : PointModel
    vehicle : Vehicle, optional
        In place of the point's own.
    draws, seed : int
        Without draws, one: the estimate.

    Raises
    ------
    UsageError
        Where the model lacks a response, is not one of forces in body axes, or has no vehicle.
    """
    check_loads(list(point.responses), point.form, point.axes)
    described = vehicle_of(vehicle, point.aircraft)
    return [_of_point(one, described) for one in (point.drawn(draws, seed) if draws else [point])]


def _of_point(point: PointModel, vehicle: Vehicle) -> StateSpace:
    trim: dict[str, float] = {"u": point.reference.u, **point.reference.scheduled}
    derivatives: dict[str, Array] = {}
    for i, response in enumerate(WRENCH):
        r = point[response]
        for name, value, at in zip(r.regressors, r.estimate, r.trim, strict=True):
            derivatives.setdefault(name, np.zeros(6))[i] = value
            trim[name] = float(at)
    return trimmed(derivatives, np.array([point[r].bias for r in WRENCH]), trim, vehicle)


def trimmed(
    derivatives: Mapping[str, Array], loads: Array, trim: Mapping[str, float], vehicle: Vehicle
) -> StateSpace:
    """Return the motion about a trim whose pitch angle is that at which its loads carry the weight."""
    theta = float(np.arctan2(loads[0], -loads[2]))
    at = {"v": 0.0, "w": trim["u"] * float(np.tan(theta)), **trim, "theta": theta}
    return StateSpace.of(derivatives, at, vehicle, loads)
