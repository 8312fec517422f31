"""What a good simulation may be wrong by: not an effect, but a prior scatter that every test allows for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import ImpossibleSettings, UsageError, nearest
from freqid.gap.following import late, slope_of, slower
from freqid.gap.histories import Histories
from freqid.gap.lines import Lines
from freqid.gap.signature import slope
from freqid.gap.testable import in_force_of, untestable
from freqid.gap.trial import Trial
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]

DERIVATIVES, RESPONSES, DYNAMICS = "derivatives", "responses", "dynamics"
FORM = "form"
TOGETHER = "together"  # derivatives that are off by the same share
TURNED = "turned"  # forces and moments that point elsewhere in the plane of symmetry
WHOLE = "whole"  # a response that is off by the same share everywhere, however crooked it is
_SAID_ALREADY = {"surface": "surface_effectiveness:loss"}  # the same error by kind, as an effect's parameter
EACH_FLIGHT: dict[str, float] = {
    "sensor_bias.u": 0.1,
    "sensor_bias.v": 0.1,
    "sensor_bias.w": 0.1,
    "sensor_bias.surface": 0.005,
    "sensor_bias.tilt": 0.005,
}
"""One sigma of parameters that are another in each flight, unless a scenario says otherwise."""

_MOTION = ("state/", "air/")
_PLANES = (("X", "Z"), ("CX", "CZ"), ("L", "N"), ("Cl", "Cn"))
_SMOOTHED = 11  # lines over which a model's own power is averaged

OF_EFFECT = "tolerance:"
"""Before the name of an effect's parameter that may be a little off without being an effect."""

DEFAULT: dict[str, float] = {
    DERIVATIVES: 0.05,  # of each derivative of each response, the same in all manoeuvres; rad, of directions
    RESPONSES: 0.02,  # of each response's change with motion and controls, manoeuvre by manoeuvre
    DYNAMICS: 0.05,  # of each actuator's time to follow
    FORM: 0.03,  # of what the parts of a model make of a response at each frequency: its formulas' own error
    "battery_sag": 0.05,
    "actuator_delay": 0.002,
    "mass": 0.01,
    "cg_offset": 0.005,
    "inertia": 0.03,
    "sensor_scale": 0.005,
    "time_skew": 0.002,
    "misalignment": 0.005,
    "lever_arm": 0.005,
    "flow_upwash": 0.02,
    # one number of the model stands for all surfaces or all rotors: they are off together
    "surface_effectiveness.loss": 0.05,
    "weak_rotor.loss": 0.03,
    "wing_wake.strength": 0.05,
    "slipstream.strength": 0.02,
    "rotor_inplane_force.strength": 0.05,
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


def form(trial: Trial, lines: Lines, sizes: Mapping[str, float]) -> Array:
    """Return the power by which a good model's formulas may be wrong, shape (row, line).

    Tolerances move derivatives and times; beyond these a model is wrong in ways that nobody lists. So the
    parts of each response, input by input, count as known to a share only, line by line, and so does what
    an actuator lags behind (M. C. Kennedy, A. O'Hagan, "Bayesian calibration of computer models", Journal of
    the Royal Statistical Society B 63, 2001: model discrepancy).
    """
    record, share = trial.maneuver.record, sizes.get(FORM, 0.0)
    power = np.zeros((len(trial.measured.rows), lines.hz.size))
    if not share:
        return power
    moves = np.array([record[name] - record[name].mean() for name in trial.inputs])
    for i in range(len(trial.predicted) if len(moves) else 0):
        power[i] = (np.abs(lines.spectrum(trial.gradient[i] * moves)) ** 2).sum(axis=0)
    for i, row in enumerate(trial.measured.rows):
        if row.kind == "actuator":
            name = row.name.partition("/")[2]
            behind = late(trial, name) * slope_of(trial.positions[name], record.dt)
            power[i] = np.abs(lines.spectrum(behind[None])[0]) ** 2
    width = min(_SMOOTHED, 2 * (lines.hz.size // 2) - 1)
    kernel = np.ones(width) / width
    padded = np.pad(power, ((0, 0), (width // 2, width // 2)), mode="edge")
    return share**2 * np.array([np.convolve(row, kernel, mode="valid") for row in padded])


def tolerances(
    trial: Trial,
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    slopes: Mapping[str, Histories] | None = None,
) -> Tolerances:
    """Return what tolerances may do to a residual.

    Parameters
    ----------
    trial : Trial
    library : dict of Effect
        Effects whose parameters may be a little off.
    sizes : dict of float
        Of `stated`.
    slopes : dict of Histories, optional
        Derivatives of the residual that are known already, by ``effect:parameter``.
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
    if sizes[DERIVATIVES]:
        common |= _together(trial, sizes[DERIVATIVES] * each)
        for i, response in enumerate(responses):
            common[f"{WHOLE}:{response}"] = _share_of(trial, i, sizes[DERIVATIVES])
    if sizes[DYNAMICS]:
        each_one = {
            name: trial.rows(positions={name: slower(trial, name, sizes[DYNAMICS])})
            for name in trial.positions
        }
        kinds = trial.maneuver.vehicle.effector_kinds
        for kind in dict.fromkeys(kinds.get(name, "") for name in each_one):
            like = [found for name, found in each_one.items() if kinds.get(name, "") == kind]
            if len(like) > 1:  # of one make: they are off together too
                common[f"{DYNAMICS}:{kind}:time"] = sum(like[1:], like[0])
                common[f"{DYNAMICS}:{kind}:shape"] = trial.rows(
                    positions={
                        n: sizes[DYNAMICS] * late(trial, n) ** 2 * slope_of(slope_of(x, record.dt), record.dt)
                        for n, x in trial.positions.items()
                        if kinds.get(n, "") == kind
                    }
                )
        for name, slow in each_one.items():
            common[f"{DYNAMICS}:{name}:time"] = slow
            position = trial.positions[name]
            gain = 0.2 * sizes[DYNAMICS] * (position - position.mean())
            common[f"{DYNAMICS}:{name}:gain"] = trial.rows(positions={name: gain})
    for effect in (e.of(trial.maneuver.vehicle) for e in library.values()):
        for parameter in effect.parameters:
            size = sizes.get(f"{effect.id}.{parameter}", sizes.get(effect.id, 0.0))
            if size and untestable(effect, trial) is None:
                kind = own if f"{effect.id}.{parameter}" in EACH_FLIGHT else common
                with suppress(ImpossibleSettings):  # what no body can be off by is no tolerance
                    name = f"{effect.id}:{parameter}"
                    known = (slopes or {}).get(name)
                    kind[f"{OF_EFFECT}{name}"] = (
                        known * size if known else _differenced(effect, trial, parameter, size)
                    )
    for kind, name in _SAID_ALREADY.items():
        if f"{OF_EFFECT}{name}" in common:
            common.pop(f"{TOGETHER}:{kind}", None)
    if sizes[RESPONSES]:
        for i, response in enumerate(responses):
            own[f"{RESPONSES}:{response}"] = _share_of(trial, i, sizes[RESPONSES])
    return Tolerances(common, own)


def _share_of(trial: Trial, i: int, size: float) -> Histories:
    """Return a share of what a response does in a manoeuvre."""
    direct = np.zeros_like(trial.predicted)
    direct[i] = size * (trial.predicted[i] - trial.predicted[i].mean())
    return trial.rows(direct)


def _differenced(effect: Effect, trial: Trial, parameter: str, size: float) -> Histories:
    """Return what one sigma of an effect's parameter does, about its value in force and within its range."""
    at, described = in_force_of(effect, trial.simulation)[parameter], effect.parameters[parameter]
    low, high = max(at - 0.5 * size, described.low), min(at + 0.5 * size, described.high)
    return slope(effect, trial, parameter, low, high) * size


def _together(trial: Trial, each: Array) -> dict[str, Histories]:
    """Return what an error does that all derivatives by motion share, or all by one kind of effector.

    A wing whose lift is a share too steep turns what acts on it: a derivative that is left over by large
    parts, as what a tilted wing's lift and its rotors' thrust make of the axial force, is off by a share of
    those and not of itself.

    Parameters
    ----------
    trial : Trial
    each : ndarray, shape (response, input, sample)
        Of each derivative for one sigma.
    """
    kinds = trial.maneuver.vehicle.effector_kinds
    label = ["motion" if n.startswith(_MOTION) else kinds.get(n.partition("/")[2], "") for n in trial.inputs]
    found = {}
    for kind in dict.fromkeys(label):
        columns = [j for j, one in enumerate(label) if one == kind]
        if len(columns) > 1 or len(each) > 1:
            shared = each[:, columns].sum(axis=1)
            found[f"{TOGETHER}:{kind}"] = trial.rows(shared)
            turned = _turned(trial.simulation.responses, shared)
            if turned.any():
                found[f"{TURNED}:{kind}"] = trial.rows(turned)
    return found


def _turned(responses: Sequence[str], rows: Array) -> Array:
    """Return what rows of forces and moments, shape (response, sample), change by for each rad about y."""
    found = np.zeros_like(rows)
    for ahead, down in _PLANES:
        if ahead in responses and down in responses:
            i, j = responses.index(ahead), responses.index(down)
            found[i], found[j] = rows[j], -rows[i]
    return found
