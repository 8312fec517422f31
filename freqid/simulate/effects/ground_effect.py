"""What the ground adds to the thrust of rotors that blow down on it."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import RATES, VELOCITY
from freqid.dynamics.moment_reference_point import moment_about
from freqid.simulate.effects import along
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.loads import frames
from freqid.simulate.loads.quantities import Wrench

_LOWEST = 0.5  # radii above ground; the formula is stated from here up
_LEAST_THRUST = 1e-3  # N, keeps the ratio of thrust and airspeed defined when both are zero


def _add(settings: dict[str, jax.Array], situation: Any) -> Wrench:
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
    parameters, flow, positions, aero = situation[:4]
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
    return Wrench(push.sum(axis=0), moment_about(hub, push, axis=-1).sum(axis=0))


def _replay(settings: Mapping[str, float], replay: Any) -> NDArray[np.float64]:
    """Return the gain of `_add` on the thrust that the simulation gives its rotors."""
    record, vehicle = replay.record, replay.vehicle
    found = np.zeros((6, record.time.size))
    above = record["state/alt"] - settings["ground"]
    ram = record["air/rho"] * (along.velocity(record) ** 2).sum(axis=0)
    rotors = [r for r in vehicle.rotors if r.diameter_m]
    for rotor, thrust in zip(rotors, along.thrusts(replay, rotors), strict=True):
        hub, axis = along.hub(record, vehicle, rotor), along.shaft(record, vehicle, rotor)
        radius, thrust = (rotor.diameter_m or 0.0) / 2, np.maximum(thrust, 0.0) + _LEAST_THRUST
        height = np.maximum(above - hub[2], _LOWEST * radius)
        near = (radius / (4 * height)) ** 2 * thrust / (thrust + 2 * pi * radius**2 * ram)
        gain = settings["strength"] * thrust * near / (1 - near) * np.maximum(-axis[2], 0.0) ** 2
        found += along.wrench(replay, gain * axis, hub)
    return found


EFFECT = Effect(
    id="ground_effect",
    stage="airframe",
    meaning="Near the ground a rotor that blows down thrusts more.",
    parameters={
        "strength": Parameter(0.0, "1", "share of the gain in thrust; manoeuvres are flown high", 0.5, 0.0),
        "ground": Parameter(0.0, "m", "altitude of the ground where a record is replayed", 0.0),
    },
    needs=("rotor.diameter_m", "effector", "state/alt", *VELOCITY, *RATES, "air/rho"),
    add=_add,
    replay=_replay,
)
