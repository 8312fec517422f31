"""Exact derivatives at a trim: of the applied wrench, and of the whole vehicle's motion.

References
----------
B. L. Stevens, F. L. Lewis, E. N. Johnson, *Aircraft Control and Simulation*, 3rd ed., Wiley, 2016,
sec. 3.7 (linearisation), with derivatives by forward differentiation in place of differences.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqid.core.arrays import Array
from freqid.core.scenario import Scenario
from freqid.simulate.control.trim import Trim
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.motion.actuators import by_kind
from freqid.simulate.motion.derivatives import STATES as STATES
from freqid.simulate.motion.derivatives import derivatives


@dataclass(frozen=True, eq=False)
class Linearization:
    """Small motions about a trim, of the centre of gravity and of effectors that move at will.

    Wakes are in their steady state and wings do not turn: rates of tilts and their reactions are left out.

    Attributes
    ----------
    effectors : tuple of str
        In the order of the scenario, tilts included.
    wrench : ndarray, shape (6, 6 + effector)
        Derivatives of X Y Z, N, and L M N about the centre of gravity, N m, by u v w of the centre of
        gravity, p q r and the effectors' positions.
    centre : ndarray, shape (3,)
        Centre of gravity, vehicle axes, m.
    A : ndarray, shape (9, 9)
        Of ``x' = A x + B d``, x in the order of `STATES`.
    B : ndarray, shape (9, effector)
    """

    effectors: tuple[str, ...]
    wrench: Array
    centre: Array
    A: Array
    B: Array


def linearize(scenario: Scenario, parameters: motion.Parameters, at: Trim) -> Linearization:
    """Differentiate the vehicle at a trim.

    Parameters
    ----------
    scenario : Scenario
    parameters : motion.Parameters
    at : Trim

    Returns
    -------
    Linearization
    """
    vehicle = scenario.aircraft()
    # the derivatives are by kind of effector; their columns go back to the scenario's order
    order = np.concatenate([np.asarray(p) for p in by_kind(vehicle, np.arange(len(vehicle.effectors)))])
    back = np.argsort(order)
    state = np.concatenate([at.body.velocity, [0.0, 0.0, 0.0, *at.angles, 0.0]])
    held = np.concatenate([at.positions.surface, at.positions.tilt, at.positions.speed])
    found = derivatives(parameters, at.around, state, held)
    return Linearization(
        effectors=tuple(effector.name for effector in vehicle.effectors),
        wrench=np.hstack([found.by_state.wrench[:, :6], np.asarray(found.by_position.wrench)[:, back]]),
        centre=np.asarray(found.centre),
        A=np.asarray(found.by_state.rate),
        B=np.asarray(found.by_position.rate)[:, back],
    )
