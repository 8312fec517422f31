"""What a good simulation may be wrong by: not an effect, but a prior scatter that every test allows for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import UsageError, nearest
from freqid.gap.residual import Histories
from freqid.gap.signature import Trial, made, untestable
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]

DERIVATIVES, RESPONSES, DYNAMICS = "derivatives", "responses", "dynamics"
EACH_FLIGHT: dict[str, float] = {
    "sensor_bias.u": 0.1,
    "sensor_bias.v": 0.1,
    "sensor_bias.w": 0.1,
    "sensor_bias.surface": 0.005,
    "sensor_bias.tilt": 0.005,
}
"""One sigma of parameters that are another in each flight, unless a scenario says otherwise."""

OF_EFFECT = "tolerance:"
"""Before the name of an effect's parameter that may be a little off without being an effect."""

DEFAULT: dict[str, float] = {
    DERIVATIVES: 0.05,  # of each derivative of each response, the same in all manoeuvres
    RESPONSES: 0.02,  # of each response's change with motion and controls, manoeuvre by manoeuvre
    DYNAMICS: 0.05,  # of each actuator's time to follow
    "mass": 0.01,
    "cg_offset": 0.005,
    "inertia": 0.03,
    "sensor_scale": 0.005,
    "time_skew": 0.002,
    "misalignment": 0.005,
    "lever_arm": 0.005,
    "flow_upwash": 0.02,
}
"""One sigma by name: of the three kinds, or of every parameter of an effect, in its unit."""


@dataclass(frozen=True, eq=False)
class Tolerances:
    """Changes of the residual by one sigma of each tolerance, over one manoeuvre.

    Attributes
    ----------
    common : dict of Histories
        By name ``kind:what``; the same error in all manoeuvres.
    own : dict of Histories
        By name; an error in this manoeuvre alone.
    """

    common: dict[str, Histories]
    own: dict[str, Histories]


def stated(table: Mapping[str, float], library: Mapping[str, Effect]) -> dict[str, float]:
    """Return all tolerances: those of a scenario's ``[tolerance]`` over the defaults.

    Raises
    ------
    UsageError
        For a name that is neither a tolerance nor an effect, or a value that is no size.
    """
    known = {*DEFAULT, *library, *(f"{e.id}.{p}" for e in library.values() for p in e.parameters)}
    for name, value in table.items():
        if name not in known:
            raise UsageError(f"[tolerance] has no '{name}'", remedy=nearest(name, known))
        if not (isinstance(value, int | float) and 0 <= value < np.inf):
            raise UsageError(f"[tolerance] {name} is {value!r}", remedy="give one sigma, zero or more")
    return {**DEFAULT, **EACH_FLIGHT, **table}


def tolerances(trial: Trial, library: Mapping[str, Effect], sizes: Mapping[str, float]) -> Tolerances:
    """Return what tolerances may do to a residual.

    Parameters
    ----------
    trial : Trial
    library : dict of Effect
        Effects whose parameters may be a little off.
    sizes : dict of float
        Of `stated`.
    """
    common: dict[str, Histories] = {}
    own: dict[str, Histories] = {}
    responses = trial.simulation.responses
    record = trial.maneuver.record
    moves = np.array([record[name] - record[name].mean() for name in trial.inputs])
    each = trial.gradient * moves if len(moves) else np.zeros((len(responses), 0, record.time.size))
    for i, response in enumerate(responses):
        for j, name in enumerate(trial.inputs):
            if sizes[DERIVATIVES] and each[i, j].any():
                direct = np.zeros_like(trial.predicted)
                direct[i] = sizes[DERIVATIVES] * each[i, j]
                common[f"{DERIVATIVES}:{response}:{name.partition('/')[2]}"] = trial.rows(direct)
    for name in trial.positions:
        if sizes[DYNAMICS]:
            common |= _dynamics(trial, name, sizes[DYNAMICS])
    for effect in (e.of(trial.maneuver.vehicle) for e in library.values()):
        for parameter in effect.parameters:
            size = sizes.get(f"{effect.id}.{parameter}", sizes.get(effect.id, 0.0))
            if size and untestable(effect, trial) is None:
                step = 0.5 * size
                change = made(effect, trial, {parameter: step}) - made(effect, trial, {parameter: -step})
                kind = own if f"{effect.id}.{parameter}" in EACH_FLIGHT else common
                kind[f"{OF_EFFECT}{effect.id}:{parameter}"] = change
    if sizes[RESPONSES]:
        for i in range(len(responses)):
            direct = np.zeros_like(trial.predicted)
            direct[i] = sizes[RESPONSES] * (trial.predicted[i] - trial.predicted[i].mean())
            own[f"{RESPONSES}:{responses[i]}"] = trial.rows(direct)
    return Tolerances(common, own)


def _dynamics(trial: Trial, name: str, size: float) -> dict[str, Histories]:
    """Return what a share of an actuator's time to follow does, and of its gain.

    The time is that by which the simulated position follows the command on the whole.
    """
    record = trial.maneuver.record
    position = trial.positions[name]
    sent = f"command/{name}"
    command = record[sent] if sent in record else position
    rate = np.gradient(position, record.dt)
    late = float(np.dot(command - position, rate) / max(np.dot(rate, rate), 1e-300))
    late = max(late, 0.02)  # s: an actuator that is taken as ideal still takes its time
    slow = trial.rows(positions={name: -size * late * rate})
    gain = trial.rows(positions={name: 0.2 * size * (position - position.mean())})
    return {f"{DYNAMICS}:{name}:time": slow, f"{DYNAMICS}:{name}:gain": gain}
