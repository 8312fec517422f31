"""The rotors' angular momentum, which turns with the body and with the wings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from freqid.dynamics.frames import cross
from freqid.simulate.effects import along
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.motion.multibody import MassModel


def spinning(settings: dict[str, jax.Array], mass: MassModel) -> MassModel:
    """Return the vehicle's mass with the rotors' spin scaled."""
    strength = settings["strength"]
    return mass._replace(wing_spin=strength * mass.wing_spin, body_spin=strength * mass.body_spin)


def _replay(settings: Mapping[str, float], replay: Any) -> NDArray[np.float64]:
    """Return the moment of the spinning rotors on the vehicle, ``-(dh/dt + w x h)``."""
    record, vehicle = replay.record, replay.vehicle
    spin = np.zeros((3, record.time.size))
    for rotor in vehicle.rotors:
        axis = along.shaft(record, vehicle, rotor)
        spin = spin + rotor.spin * rotor.inertia * record[f"effector/{rotor.name}"] * axis
    moment = -(along.slope(spin, record.dt) + cross(along.rates(record), spin))
    return settings["strength"] * np.concatenate([np.zeros_like(moment), moment])


EFFECT = Effect(
    id="gyroscopic",
    stage="airframe",
    meaning="Spinning rotors resist being turned, and push back when they are sped up.",
    parameters={
        "strength": Parameter(
            1.0,
            "1",
            "share of the rotors' angular momentum",
            0.5,
            0.0,
            signs=(
                "Spinning rotors resist being turned more than described",
                "Spinning rotors resist being turned less than described",
            ),
        )
    },
    needs=("rotor.inertia", "effector", "state/p", "state/q", "state/r"),
    states={"speed": "rad/s"},  # its moment is in the motion, not in the loads at one instant
    replay=_replay,
)
