"""The propellers' slipstreams over the wing that carries them."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import RATES, VELOCITY
from freqid.core.vehicle import Rotor
from freqid.dynamics.frames import cross, turn_about_y
from freqid.simulate.effects import along
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.loads.propeller import Discs
from freqid.simulate.loads.slipstream import Slipstreams, added_velocity

# That strength 1 stands for in a replay: lift slope, and share of a surface behind propellers.
_SLOPE, _COVERED = 4.5, 0.7
_SLOWEST = 3.0  # m/s: below, loads that go with dynamic pressure are not told from nothing


def over_wing(
    settings: dict[str, jax.Array], slipstreams: Slipstreams, discs: Discs, rho: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Return what `slipstream.added_velocity` does, the velocity over the strips scaled."""
    added, at_disc = added_velocity(slipstreams, discs, rho)
    return settings["strength"] * added, at_disc


def _replay(settings: Mapping[str, float], replay: Any) -> NDArray[np.float64]:
    """Return what blown wings and surfaces add to a simulation whose wings meet the free stream alone.

    Linear in the thrust coefficient ``Tc = T / (A rho V^2 / 2)``, the gain of dynamic pressure far behind
    a disc. Lift goes with the air's speed, which gains by ``Tc / 2``, times its unchanged component across
    the chord: on a span of a diameter behind each rotor. Surfaces gain by ``Tc``, as the mean of the rotors.
    """
    record, vehicle = replay.record, replay.vehicle
    rotors = [r for r in vehicle.rotors if r.diameter_m]
    on_wings = [r for r in rotors if r.wing] or rotors
    ram = 0.5 * record["air/rho"] * np.maximum((along.velocity(record) ** 2).sum(axis=0), _SLOWEST**2)
    areas = np.array([pi / 4 * (r.diameter_m or 0.0) ** 2 for r in on_wings])
    gains = along.thrusts(replay, on_wings) / areas[:, None] / ram
    lifts = [_lift(replay, r, gain, ram) for r, gain in zip(on_wings, gains, strict=True)]
    found = np.sum(lifts, axis=0)
    names = [f"effector/{e.name}" for e in vehicle.effectors if e.kind == "surface"]
    moved = [name for name in names if name in record]
    if moved:
        turned = np.einsum("cn,crn->rn", record.matrix(moved), replay.gradients(moved))
        found = found + _COVERED * gains.mean(axis=0) * turned
    return settings["strength"] * found


def _lift(replay: Any, rotor: Rotor, gain: NDArray[np.float64], ram: NDArray[np.float64]) -> Any:
    """Return the loads that a rotor's slipstream adds to the wing behind it."""
    record, vehicle = replay.record, replay.vehicle
    wing = along.rotor_wing(vehicle, rotor)
    tilt = along.tilt(record, wing) if wing else np.zeros(record.time.size)
    pivot = np.array(wing.pivot_m if wing else rotor.position_m)
    place = np.array([pivot[0], rotor.position_m[1], pivot[2]])
    moving = along.velocity(record) + cross(along.rates(record), place[:, None])
    across = turn_about_y(moving, -tilt)[2]
    speed = np.sqrt(2 * ram / record["air/rho"])
    lift = _SLOPE * vehicle.chord_m * (rotor.diameter_m or 0.0) * ram * gain / 2 * across / speed
    return along.wrench(replay, turn_about_y(np.stack([0 * lift, 0 * lift, -lift]), tilt), place)


EFFECT = Effect(
    id="slipstream",
    stage="airframe",
    meaning="Propellers accelerate the air over the wing strips behind them.",
    parameters={
        "strength": Parameter(
            1.0,
            "1",
            "share of the added velocity that the strips feel",
            0.3,
            0.0,
            signs=(
                "Propellers accelerate the air over the wing strips behind them more than described",
                "Propellers accelerate the air over the wing strips behind them less than described",
            ),
        )
    },
    needs=(
        "rotor.diameter_m",
        "wing or surface",
        "vehicle.chord_m",
        "effector",
        *VELOCITY,
        *RATES,
        "air/rho",
    ),
    replay=_replay,
)
