"""What the ground adds to the thrust of rotors that blow down on it."""

from __future__ import annotations

from math import pi

import jax
import jax.numpy as jnp

from .. import frames
from ..quantities import Wrench
from .effect import Effect, Parameter

_LOWEST = 0.5  # radii above ground; the formula is stated from here up
_LEAST_THRUST = 1e-3  # N, keeps the ratio of thrust and airspeed defined when both are zero


def _add(settings: dict[str, jax.Array], situation) -> Wrench:
    """Return the wrench that the ground adds; the body is taken as level.

    Notes
    -----
    At the same power ``T / T_free = 1 / (1 - (R / 4z)^2 / (1 + (V / v)^2))`` with v the induced velocity of
    hover. Only the part of the thrust that holds weight counts, twice: as the component that blows down
    and as the share of the gain. No fountain between the wings, no effect on the wings.

    References
    ----------
    I. C. Cheeseman and W. E. Bennett, "The Effect of the Ground on a Helicopter Rotor in Forward Flight",
    ARC R&M 3021, 1955.
    """
    parameters, flow, positions, aero = situation
    rotors = parameters.propellers
    turn = rotors.frame @ frames.motion(parameters.frames, flow, positions).turn.reshape(-1, 9)
    turn = turn.reshape(-1, 3, 3)
    hub = rotors.frame @ parameters.frames.pivot + (turn * rotors.hub[:, None, :]).sum(-1)
    axis = (turn * rotors.axis[:, None, :]).sum(-1)
    radius = rotors.diameter / 2
    height = jnp.maximum(flow.height - hub[:, 2], _LOWEST * radius)
    thrust = jnp.maximum(aero.thrust, 0.0)
    ram = 2 * flow.rho * pi * radius**2 * (flow.velocity**2).sum()
    still = (thrust + _LEAST_THRUST) / (thrust + _LEAST_THRUST + ram)  # 1 / (1 + (V / v)^2)
    near = (radius / (4 * height)) ** 2 * still
    downward = jnp.maximum(-axis[:, 2], 0.0)
    push = (settings["strength"] * thrust * near / (1 - near) * downward**2)[:, None] * axis
    return Wrench(push.sum(axis=0), jnp.cross(hub, push).sum(axis=0))


EFFECT = Effect(
    id="ground_effect",
    stage="airframe",
    meaning="Near the ground a rotor that blows down thrusts more.",
    parameters={"strength": Parameter(0.0, "1", "share of the gain in thrust; manoeuvres are flown high")},
    needs=("rotor",),
    add=_add,
)
