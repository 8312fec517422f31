"""What propellers do across their shafts in oblique flow: in-plane force and P-factor."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import RATES, VELOCITY
from freqid.dynamics.frames import cross
from freqid.simulate.effects import along
from freqid.simulate.effects.effect import Effect, Parameter

if TYPE_CHECKING:  # propeller calls this effect
    from freqid.simulate.loads.propeller import Discs

_COEFFICIENT = 0.02  # of in-plane force and hub moment, that strength 1 stands for in a replay


def loads(settings: dict[str, jax.Array], discs: Discs) -> tuple[jax.Array, jax.Array]:
    """Return the in-plane force and the hub moment of each rotor, shape (rotor, 3), N and N m."""
    return settings["strength"] * discs.inplane_force, settings["strength"] * discs.hub_moment


def _replay(settings: Mapping[str, float], replay: Any) -> NDArray[np.float64]:
    """Return the in-plane forces and hub moments of all rotors, as `propeller.discs` has them.

    ``-k rho D^2 S W`` along the in-plane velocity W with ``S^2 = (nD)^2 + U^2``, and D times that, with the
    sign of the rotation, as the moment of the advancing side: less of it where blades flap, more where they
    are stiff.
    """
    record, vehicle = replay.record, replay.vehicle
    found = np.zeros((6, record.time.size))
    for rotor in (r for r in vehicle.rotors if r.diameter_m):
        hub, axis = along.hub(record, vehicle, rotor), along.shaft(record, vehicle, rotor)
        velocity = along.velocity(record) + cross(along.rates(record), hub)
        axial = (velocity * axis).sum(axis=0)
        speed = np.hypot(record[f"effector/{rotor.name}"] * rotor.diameter_m / (2 * pi), axial)
        size = settings["strength"] * _COEFFICIENT * record["air/rho"] * rotor.diameter_m**2 * speed
        force = -size * (velocity - axial * axis)
        arm = rotor.spin * settings["hub_moment"] * rotor.diameter_m
        found += along.wrench(replay, force, hub, arm * force)
    return found


EFFECT = Effect(
    id="rotor_inplane_force",
    stage="airframe",
    meaning="A propeller in oblique flow is pushed along with it and thrusts more on its advancing side.",
    parameters={
        "strength": Parameter(
            1.0,
            "1",
            "share of the in-plane force and hub moment",
            0.3,
            0.0,
            signs=(
                "A propeller in oblique flow is pushed along with it more than described",
                "A propeller in oblique flow is pushed along with it less than described",
            ),
        ),
        "hub_moment": Parameter(
            1.0,
            "1",
            "moment of the advancing side over the in-plane force and the diameter, in a replay",
            0.5,
            0.0,
            20.0,
            looked_at=(0.0, 4.0),
            replay_only=True,
        ),
    },
    needs=("rotor.diameter_m", "effector", *VELOCITY, *RATES, "air/rho"),
    replay=_replay,
)
