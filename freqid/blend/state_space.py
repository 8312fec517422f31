"""Small motions about a condition of the corridor, as a state-space model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.core.vehicle import Vehicle
from freqid.dynamics.small_motion import STATES, equations_of_motion, rotor_spin


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

    @classmethod
    def of(cls, derivatives: Mapping[str, Array], trim: Mapping[str, float], vehicle: Vehicle) -> StateSpace:
        """Put derivatives of the wrench into the equations of motion (`freqid.dynamics.small_motion`).

        Parameters
        ----------
        derivatives : mapping of str to ndarray of shape (6,)
            X to N per unit of u v w p q r, where the model has them, and of each effector; N and N m.
        trim : mapping of str to float
            ``u v w``, ``theta``, effectors and tilts.
        vehicle : Vehicle
            Mass properties, as they are at the trimmed tilts, and rotors.

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
        momentum = rotor_spin(vehicle, rotors, tilts) @ np.array([trim[n] for n in rotors])
        velocity = np.array([trim[n] for n in STATES[:3]])
        reaction = np.zeros((3, len(effectors)))
        E, A = equations_of_motion(wrench, vehicle, velocity, trim["theta"], reaction, momentum)
        both: Array = np.asarray(np.linalg.solve(E[:, :8], A), dtype=float)
        return cls(STATES, effectors, both[:, :8], both[:, 8:], dict(trim))
