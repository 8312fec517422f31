"""The front wing's wake at the rear wing, and both wings' wakes at the tail."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import RATES, VELOCITY
from freqid.core.vehicle import Wing
from freqid.dynamics.frames import cross, turn_about_y
from freqid.simulate.effects import along
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.loads.quantities import Wake

# That strength 1 stands for in a replay: downwash over the front wing's normal velocity, and lift slope.
_DOWNWASH, _SLOPE = 0.15, 4.5
_STATION = 0.05  # m, within which pivots are at one station along the body
_SLOWEST = 3.0  # m/s, at which a wake travels in hover


def received(settings: dict[str, jax.Array], wake: Wake) -> Wake:
    """Return the wake as it is felt."""
    return Wake(settings["strength"] * wake.downwash, settings["strength"] * wake.blowing)


def _replay(settings: Mapping[str, float], replay: Any) -> NDArray[np.float64]:
    """Return what the front wings' downwash, once arrived, takes from the lift of the wings behind them.

    Wings at one place along the body are a station. A wing of the second station is in the wake of that wing
    of the first whose pivot is nearest to its own in y.
    """
    wings = sorted(replay.vehicle.wings, key=lambda w: -w.pivot_m[0])
    front = [w for w in wings if w.pivot_m[0] > wings[0].pivot_m[0] - _STATION]
    behind = wings[len(front) :]
    rear = [w for w in behind if w.pivot_m[0] > behind[0].pivot_m[0] - _STATION]
    found = np.zeros((6, replay.record.time.size))
    for wing in rear:
        found += _taken(settings, replay, min(front, key=lambda w: abs(w.pivot_m[1] - wing.pivot_m[1])), wing)
    return found


def _taken(settings: Mapping[str, float], replay: Any, front: Wing, rear: Wing) -> NDArray[np.float64]:
    """Return what the wake of one wing takes from the lift of another.

    ``rho S a V eps w / 2`` across the flow, with w the normal velocity that the front wing had a convection
    time ago.
    """
    from scipy.interpolate import CubicSpline

    record, vehicle = replay.record, replay.vehicle
    velocity = along.velocity(record)
    speed = np.maximum(np.sqrt((velocity**2).sum(axis=0)), _SLOWEST)
    ahead = velocity + cross(along.rates(record), np.array(front.pivot_m)[:, None])
    normal = turn_about_y(ahead, -along.tilt(record, front))[2]
    way = np.linalg.norm(np.subtract(front.pivot_m, rear.pivot_m))
    left = np.clip(record.time - way / speed, record.time[0], record.time[-1])
    arrived = CubicSpline(record.time, normal)(left)
    per_speed = 0.5 * record["air/rho"] * vehicle.area_m2 / len(vehicle.wings) * _SLOPE * _DOWNWASH
    across = np.stack([-velocity[2], 0 * speed, velocity[0]])
    return along.wrench(replay, settings["strength"] * per_speed * arrived * across, rear.pivot_m)


EFFECT = Effect(
    id="wing_wake",
    stage="airframe",
    meaning="The wake of a wing and its rotors turns and blows the flow at what lies behind it.",
    parameters={
        "strength": Parameter(
            1.0,
            "1",
            "share of the wake's velocity that is felt",
            0.3,
            0.0,
            signs=(
                "The wake of a wing and its rotors turns and blows the flow behind it more than described",
                "The wake of a wing and its rotors turns and blows the flow behind it less than described",
            ),
        )
    },
    needs=("wing", "vehicle.area_m2", "effector", *VELOCITY, *RATES, "air/rho"),
    replay=_replay,
)
