"""The air around a vehicle: density, wind, gusts and the ground."""

from __future__ import annotations

from typing import NamedTuple

import jax
import numpy as np
from numpy.typing import NDArray

from freqid.dynamics.precision import doubles
from freqid.simulate.loads.quantities import Flow
from freqid.simulate.motion import attitude
from freqid.simulate.motion.rigid_body import BodyState


class Surroundings(NamedTuple):
    """The air that the vehicle moves in.

    Attributes
    ----------
    wind : Array, shape (3,)
        Velocity of the air with its gusts: north, east, down, m/s.
    spin : Array, shape (3,)
        Rotation of the air in gusts, the same axes, rad/s.
    rho : Array, shape ()
        Density, kg/m3.
    ground : Array, shape ()
        Height of the ground on the scale of the state's altitude, m.
    """

    wind: jax.Array
    spin: jax.Array
    rho: jax.Array
    ground: jax.Array


def calm(rho: float, ground: float = 0.0) -> Surroundings:
    """Return air at rest."""
    still = np.zeros(3)
    return doubles(Surroundings, still, still, rho, ground)


def windy(
    wind: NDArray[np.float64],
    gusts: NDArray[np.float64],
    rho: float,
    *,
    heading: float = 0.0,
    ground: float = 0.0,
) -> Surroundings:
    """Return the air at every step of a flight.

    Parameters
    ----------
    wind : ndarray, shape (3,)
        Steady, north, east, down, m/s.
    gusts : ndarray, shape (6, step)
        Of `turbulence.gusts`: along the flight path, right, down.
    rho : float
        kg/m3; it stays, as a manoeuvre's change of altitude is worth little of it.
    heading : float
        Of the flight path, rad.
    ground : float
        Height of the ground, m.

    Returns
    -------
    Surroundings of Array, shape (step, ...)
    """
    cosine, sine = np.cos(heading), np.sin(heading)
    turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    steps = gusts.shape[1]
    return doubles(
        Surroundings,
        wind + (turn @ gusts[:3]).T,
        (turn @ gusts[3:]).T,
        np.full(steps, float(rho)),
        np.full(steps, float(ground)),
    )


def relative_flow(body: BodyState, around: Surroundings) -> Flow:
    """Return how the vehicle moves through the air around it."""
    velocity = body.velocity - attitude.to_body(body.attitude, around.wind)
    rates = body.rates - attitude.to_body(body.attitude, around.spin)
    return Flow(velocity, rates, around.rho, -body.position[2] - around.ground)
