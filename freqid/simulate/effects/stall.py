"""Lift that wings lose beyond an angle of attack."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import RATES, VELOCITY
from freqid.dynamics.frames import cross, turn_about_y
from freqid.dynamics.moment_reference_point import moment_about
from freqid.simulate.effects import along
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.loads.quantities import Wrench
from freqid.simulate.motion import attitude

_ROUNDING = 0.1  # of the onset, in the sine of the angle of attack
_STILL = 0.01  # m2/s2
# Middles of six strips of equal width, over the span, from the middle of the wing: in a roll one half of it
# meets the air at a larger angle. A vehicle without a span has all of them there.
_STRIPS = np.outer(np.array([-5, -3, -1, 1, 3, 5]) / 12, (0.0, 1.0, 0.0))
_ONSETS = (0.1, 0.15, 0.2, 0.4)  # sines; below, the lift curve of any wing bends by some per cent


def _loss(settings: Mapping[str, Any], u: Any, w: Any, rho: Any, area: Any) -> Any:
    """Return the normal force that is lost, N, positive down.

    Beyond the onset the lift coefficient falls below ``2 pi sin(alpha)`` by ``2 pi x^2 / (x + 0.1)`` with x
    the sine's excess: a parabola at first, then as steep as the lift itself, which stays level.

    Parameters
    ----------
    settings : dict
    u, w : array
        Velocity along the chord and normal to it, m/s.
    rho, area : array
        kg/m3 and m2.
    """
    speed2 = u**2 + w**2 + _STILL
    sine = w / speed2**0.5
    beyond = abs(sine) - settings["onset"]
    excess = (beyond + abs(beyond)) / 2
    lost = 2 * pi * excess**2 / (excess + _ROUNDING) * sine / (abs(sine) + 1e-9)
    return settings["strength"] * 0.5 * rho * speed2 * area * lost


def _add(settings: dict[str, jax.Array], situation: Any) -> Wrench:
    geometry, flow = situation.parameters.geometry, situation.flow
    pivot, tilt = situation.parameters.frames.pivot[:-1], situation.positions.tilt
    if not tilt.size:  # a wing that does not tilt
        pivot, tilt = geometry.centre[None], jnp.zeros(1)
    area = geometry.area / pivot.shape[0] / len(_STRIPS)
    place = (pivot[:, None] + geometry.span * _STRIPS).reshape(-1, 3)
    tilt = jnp.repeat(tilt, len(_STRIPS))
    cos, sin = jnp.cos(tilt), jnp.sin(tilt)
    x, _, z = (flow.velocity + attitude.cross(flow.rates, place)).T
    down = _loss(settings, x * cos - z * sin, x * sin + z * cos, flow.rho, area)
    force = jnp.stack([down * sin, jnp.zeros_like(down), down * cos], axis=-1)
    return Wrench(force.sum(0), moment_about(place, force, axis=-1).sum(0))


def _replay(settings: Mapping[str, float], replay: Any) -> NDArray[Any]:
    record, vehicle = replay.record, replay.vehicle
    wings = [(np.array(w.pivot_m), along.tilt(record, w)) for w in vehicle.wings]
    wings = wings or [(np.array(vehicle.mass_properties.cg_m), np.zeros(record.time.size))]
    area = vehicle.area_m2 / len(wings) / len(_STRIPS)
    flow, turning = along.velocity(record), along.rates(record)
    found = np.zeros((6, record.time.size))
    for pivot, tilt in wings:
        for place in pivot + (vehicle.span_m or 0.0) * _STRIPS:
            u, _, w = turn_about_y(flow + cross(turning, place[:, None]), -tilt)
            down = _loss(settings, u, w, record["air/rho"], area)
            found += along.wrench(replay, turn_about_y(np.stack([0 * down, 0 * down, down]), tilt), place)
    return found


EFFECT = Effect(
    id="stall",
    stage="airframe",
    meaning="Beyond an angle of attack the wings lose lift, or their lift curve bends.",
    parameters={
        "strength": Parameter(0.0, "1", "share of the slope of lift that is lost far beyond", 0.2, 0.0, 3.0),
        "onset": Parameter(
            0.3, "1", "sine of the angle of attack at which it begins", 0.05, 0.0, 1.0, _ONSETS
        ),
    },
    needs=("wing or surface", "vehicle.area_m2", *VELOCITY, *RATES, "air/rho"),
    add=_add,
    replay=_replay,
)
