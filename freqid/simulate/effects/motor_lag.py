"""The time that motors take to reach a commanded speed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .effect import Effect, Parameter
from .signals import lagged

Signals = dict[str, NDArray[np.float64]]


def _act(settings: Mapping[str, float], signals: Signals, dt: float, kinds: dict[str, str]) -> Signals:
    """Return the speeds of rotors, thrusts and throttles behind those that are described."""
    return {
        name: lagged(v, dt, settings["extra"]) if kinds.get(name) in ("rotor", "thrust", "throttle") else v
        for name, v in signals.items()
    }


EFFECT = Effect(
    id="motor_lag",
    stage="command",
    meaning="Motors follow their commands later than described, by a first-order lag.",
    parameters={"extra": Parameter(0.0, "s", "time constant of that lag", 0.04, 0.0, 1.0)},
    needs=("command", "rotor"),
    states={"speed": "rad/s"},
    act=_act,
)
