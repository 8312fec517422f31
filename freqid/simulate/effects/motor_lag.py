"""The time that motors take to reach a commanded speed."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from freqid.core.vehicle import Vehicle
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.effects.places import one_each
from freqid.simulate.effects.signals import lagged

Signals = dict[str, NDArray[np.float64]]

_KINDS = ("rotor", "thrust", "throttle")


def before(settings: Mapping[str, jax.Array]) -> jax.Array:
    """Return the time constant of the lag that stands before motors, s; none where they are slower."""
    return jnp.where(settings["time_constant"] > 0, 0.0, settings["extra"])


def longer(settings: Mapping[str, jax.Array]) -> jax.Array:
    """Return time constants of motors over those that are described; one where a lag stands before them."""
    own = settings["time_constant"]
    return jnp.where(own > 0, 1 + settings["extra"] / jnp.where(own > 0, own, 1.0), 1.0)


def _act(settings: Mapping[str, float], signals: Signals, dt: float, kinds: dict[str, str]) -> Signals:
    """Return the speeds of rotors, thrusts and throttles behind those that are described.

    What a motor of time constant T that is slower by e makes of a command is what the described one makes
    of it times ``(1 + T s) / (1 + (T + e) s)``: T / (T + e) of that, plus e / (T + e) of it behind a lag of
    T + e.
    """
    own = settings["time_constant"]

    def later(values: NDArray[np.float64], extra: float) -> NDArray[np.float64]:
        if extra <= 0:
            return values
        return (own * values + extra * lagged(values, dt, own + extra)) / (own + extra)

    return {
        name: later(v, settings["extra"] + settings.get(name, 0.0)) if kinds.get(name) in _KINDS else v
        for name, v in signals.items()
    }


def _departs(settings: Mapping[str, float]) -> dict[str, float]:
    """Return the shares by which motors' time constants are longer; a lag before a motor is no such share."""
    own = settings["time_constant"]
    each = {n: settings["extra"] + x for n, x in settings.items() if n not in EFFECT.parameters}
    return {f"{n}.time_constant": extra / own for n, extra in each.items() if extra and own}


def _for_vehicle(vehicle: Vehicle) -> dict[str, Parameter]:
    """Return a time constant for each motor."""
    return one_each(vehicle, EFFECT.parameters["extra"], _KINDS)


EFFECT = Effect(
    id="motor_lag",
    stage="command",
    meaning="Motors follow their commands later than described, by a first-order lag.",
    parameters={
        "extra": Parameter(
            0.0,
            "s",
            "time constant of that lag",
            0.04,
            0.0,
            0.5,
            signs=(
                "Motors follow their commands later than described",
                "Motors follow their commands sooner than described",
            ),
        ),
        "time_constant": Parameter(
            0.0,
            "s",
            "of the described motor, which is slower by the extra time; at zero a lag stands before it",
            0.05,
            0.0,
            0.5,
            looked_at=(0.03, 0.1),
            follows=True,
        ),
    },
    needs=("command",),
    states={"speed": "rad/s"},
    alternatives=True,
    in_loop=True,
    act=_act,
    departs=_departs,
    for_vehicle=_for_vehicle,
)
