"""What a falling battery voltage takes from the rotors' speed."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from freqid.simulate.effects.effect import Effect, Parameter

Signals = dict[str, NDArray[np.float64]]

# Loss of speed at a flight's mean load that strength 1 stands for where no battery is described: inner
# resistances are chosen so that the voltage drops by a few per cent.
_DROOP = 0.03

# 1/s: a cell falls from 4.2 to 3.6 V, by 15 %, while it is emptied in 40, 12 or 4 minutes of flight.
_EMPTYING = (6e-5, 2e-4, 6e-4)


def voltage_ratio(settings: dict[str, jax.Array], voltage: jax.Array, nominal: jax.Array) -> jax.Array:
    """Return the voltage that the motors feel over the nominal one."""
    return 1 + settings["strength"] * (voltage / nominal - 1)


def _act(settings: Mapping[str, float], signals: Signals, dt: float, kinds: dict[str, str]) -> Signals:
    """Return rotor speeds that droop together with the power that all of them take, their speeds cubed.

    And with the energy that they have taken since the record's start: a battery's voltage falls about in
    proportion to it.
    """
    rotors = [name for name in signals if kinds.get(name) == "rotor"]
    if not rotors or not settings["strength"]:
        return signals
    power = np.sum([np.abs(signals[name]) ** 3 for name in rotors], axis=0)
    load = power / max(float(power.mean()), np.finfo(float).tiny)
    used = cumulative_trapezoid(load, dx=dt, initial=0)  # s of the mean load
    ratio = 1 - settings["strength"] * (_DROOP * load + settings["emptying"] * used)
    return {name: values * ratio if name in rotors else values for name, values in signals.items()}


EFFECT = Effect(
    id="battery_sag",
    stage="command",
    meaning="A motor turns as fast as the voltage lets it: less under load and less as the battery empties.",
    parameters={
        "strength": Parameter(
            1.0,
            "1",
            "share of the change from the nominal voltage, or of 3 % of speed at the mean load",
            0.5,
            0.0,
            signs=(
                "Motors lose more speed to the voltage of the battery than described",
                "Motors lose less speed to the voltage of the battery than described",
            ),
        ),
        "emptying": Parameter(
            0.0,
            "1/s",
            "share of speed lost a second as the battery empties, at strength 1, where none is described",
            2e-4,
            0.0,
            0.01,
            looked_at=_EMPTYING,
            replay_only=True,
        ),
    },
    needs=("command", "rotor"),
    states={"charge": "1"},
    act=_act,
)
