"""The propellers' slipstreams over the wing that carries them."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from ..propeller import Discs
from ..slipstream import Slipstreams, added_velocity
from . import along
from .effect import Effect, Parameter

_COVERED = 0.7  # share of a wing behind its propellers that strength 1 stands for in a replay
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
    a disc: surfaces gain by ``Tc``, lift by w by half of it, as the air's speed grows but not its w.
    """
    record, vehicle = replay.record, replay.vehicle
    rotors = [r for r in vehicle.rotors if r.diameter_m]
    load = along.thrusts(replay, rotors).sum(axis=0) / sum(
        pi / 4 * (r.diameter_m or 0.0) ** 2 for r in rotors
    )
    ram = 0.5 * record["air/rho"] * np.maximum((along.velocity(record) ** 2).sum(axis=0), _SLOWEST**2)
    gain = settings["strength"] * _COVERED * load / ram
    names = (f"effector/{e.name}" for e in vehicle.effectors if e.kind == "surface")
    moved = ["state/w", *(name for name in names if name in record)]
    share = np.array([0.5, *[1.0] * (len(moved) - 1)])
    found = np.einsum("c,cn,crn->rn", share, record.matrix(moved), replay.gradients(moved))
    return gain * found


EFFECT = Effect(
    id="slipstream",
    stage="airframe",
    meaning="Propellers accelerate the air over the wing strips behind them.",
    parameters={"strength": Parameter(1.0, "1", "share of the added velocity that the strips feel", 0.3)},
    needs=("rotor.diameter_m", "effector", "state/u", "state/v", "state/w", "air/rho"),
    replay=_replay,
)
