"""A propeller that thrusts less at its speed than the others: worn, nicked or badly set."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from freqid.core.vehicle import Vehicle
from freqid.simulate.effects import along
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.effects.places import spread

Signals = dict[str, NDArray[np.float64]]

_MOST = 0.75  # of the thrust that may be lost: without any a rotor is at rest, and has no advance ratio


def sound_speeds(settings: dict[str, jax.Array], order: jax.Array, speed: jax.Array) -> jax.Array:
    """Return the speeds at which sound propellers would do what these do, rad/s, shape (rotor,).

    Thrust goes with the square of the speed; a loss of all and one of a rotor's own add up to `_MOST` at
    most. `order` as in `places.spread`.
    """
    losses = {n: x for n, x in settings.items() if n != "torque_kept"}
    return jnp.sqrt(jnp.maximum(1 - spread(losses, "loss", order), 1 - _MOST)) * speed


def _feel(settings: Mapping[str, float], signals: Signals, dt: float, kinds: dict[str, str]) -> Signals:
    """Return the speeds of sound propellers that would do what these do at the measured ones."""
    del dt
    found = dict(signals)
    for name in (n for n in signals if kinds.get(n) == "rotor"):
        loss = settings["loss"] + settings.get(name, 0.0)
        found[name] = np.sqrt(max(1 - loss, 1 - _MOST)) * signals[name]
    return found


def _departs(settings: Mapping[str, float]) -> dict[str, float]:
    """Return the relative departures of rotors' thrusts and torques; of both alike unless torque is kept."""
    found = {}
    for name in (n for n in settings if n not in EFFECT.parameters):
        loss = settings["loss"] + settings[name]
        if loss:
            found[f"{name}.thrust"] = -loss
            if settings["torque_kept"] != 1:
                found[f"{name}.torque"] = -(1 - settings["torque_kept"]) * loss
    return found


def _replay(settings: Mapping[str, float], replay: Any) -> NDArray[np.float64]:
    """Return the torque that weak rotors keep: `_feel` lowers it with the thrust, as another speed does.

    A blade that is set too flat loses both; one whose tip is worn or nicked still drags.
    """
    record, vehicle = replay.record, replay.vehicle
    found = np.zeros((6, record.time.size))
    losses = {r.name: settings["loss"] + settings.get(r.name, 0.0) for r in vehicle.rotors}
    weak = [r for r in vehicle.rotors if losses[r.name] and f"effector/{r.name}" in record]
    if settings["torque_kept"] and weak:
        for rotor, torque in zip(weak, along.torques(replay, weak), strict=True):
            kept = settings["torque_kept"] * losses[rotor.name] * torque
            found[3:] += kept * along.shaft(record, vehicle, rotor)
    return found


def _for_vehicle(vehicle: Vehicle) -> dict[str, Parameter]:
    """Return a loss for each rotor."""
    names = [e.name for e in vehicle.effectors if e.kind == "rotor"]
    return {
        n: Parameter(0.0, "1", f"share of the thrust of {n} that is lost", 0.1, -1.0, _MOST) for n in names
    }


EFFECT = Effect(
    id="weak_rotor",
    stage="airframe",
    meaning="A propeller thrusts less than its measured speed says.",
    parameters={
        "loss": Parameter(
            0.0,
            "1",
            "share of every rotor's thrust that is lost",
            0.05,
            -1.0,
            _MOST,
            signs=(
                "A propeller thrusts less than its measured speed says",
                "A propeller thrusts more than its measured speed says",
            ),
        ),
        "torque_kept": Parameter(
            0.0,
            "1",
            "share of the torque of the lost thrust that is still there",
            0.5,
            0.0,
            1.0,
            looked_at=(1.0,),
            replay_only=True,
        ),
    },
    needs=("rotor", "effector"),
    alternatives=True,
    feel=_feel,
    departs=_departs,
    replay=_replay,
    for_vehicle=_for_vehicle,
)
