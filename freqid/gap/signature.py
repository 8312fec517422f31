"""What each candidate effect would do to a residual: its derivative by the effect's parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import COEFFICIENT, WRENCH
from freqid.core.errors import ImpossibleSettings
from freqid.core.frames import cross
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.vehicle import Vehicle
from freqid.gap.histories import Histories
from freqid.gap.replay import Replay
from freqid.gap.residual import measured_part
from freqid.gap.simulation import Simulation
from freqid.gap.testable import in_force_of, route_of
from freqid.gap.trial import Trial
from freqid.simulate.effects.along import centre
from freqid.simulate.effects.effect import Effect, Parameter

Array = NDArray[np.float64]

_ASKED_AGAIN = ("scenario", "jsbsim")  # kinds that answer any record, at each instant for itself
_APPROACHES = 2  # to the log without a distortion
_SMALL = 0.25  # of a parameter's scale: the step of differences
GIVEN = "|"
"""Between the name of a size and the value of another parameter at which it is taken."""


def signature(effect: Effect, trial: Trial) -> dict[str, Histories]:
    """Return the derivative of the residual by an effect's parameters.

    Parameters
    ----------
    effect : Effect
    trial : Trial
        The effect is testable in it.

    Returns
    -------
    dict of Histories
        By parameter: change of the rows for each unit of it, where the truth has the effect and the
        simulation as it is has not. A parameter that may not be negative is stepped to one side. One that
        says nothing while the size is zero, as where a stall begins, gives the size's derivative at other
        values of its own beside the default: ``size|name=value``. So are changes at sizes of which an effect
        has several, ``size|size=value``, again for each unit.
    """
    found = {}
    for name, parameter in effect.parameters.items():
        if parameter.scale == 0:
            continue
        low, high = _steps(effect, trial.simulation, name, parameter)
        with suppress(ImpossibleSettings):  # nothing can differ by that
            found[name] = slope(effect, trial, name, low, high)
    if effect.alternatives:
        return found | _at_sizes(effect, trial)
    idle = [n for n in found if n != effect.size and not _moves(found[n])]
    for name in idle:
        del found[name]
        parameter = effect.parameters[name]
        beside = (parameter.default - 2 * parameter.scale, parameter.default + 2 * parameter.scale)
        for value in parameter.looked_at or np.clip(beside, parameter.low, parameter.high).tolist():
            if value != parameter.default:
                with suppress(ImpossibleSettings):  # then it does not show so
                    found[f"{effect.size}{GIVEN}{name}={value:.4g}"] = _sized(effect, trial, {name: value})
    return found | _at_sizes(effect, trial)


def slope(effect: Effect, trial: Trial, name: str, low: float, high: float) -> Histories:
    """Return what an effect makes of a residual for each unit of a parameter, between two of its values.

    From the value in force to one of them where nothing can be at the other: the moments of inertia of a flat
    body can only be changed to one side.

    Raises
    ------
    ImpossibleSettings
        Where nothing can be at either.
    """
    force = in_force_of(effect, trial.simulation)[name]
    impossible = ImpossibleSettings(f"effect '{effect.id}' has no two values of {name}")
    for a, b in ((low, high), (force, high), (low, force)):
        if a == b:
            continue
        try:
            return (made(effect, trial, {name: b}) - made(effect, trial, {name: a})) * (1 / (b - a))
        except ImpossibleSettings as error:
            impossible = error
    raise impossible


def _at_sizes(effect: Effect, trial: Trial) -> dict[str, Histories]:
    """Return an effect at its sizes, for each unit: below a limit it does nothing, above not its share."""
    return {
        f"{effect.size}{GIVEN}{effect.size}={value:.4g}": made(effect, trial, {effect.size: value})
        * (1 / value)
        for value in effect.sizes
    }


def scale_of(effect: Effect, name: str) -> float:
    """Return what is expected of the coefficient of one of an effect's signatures before any data."""
    own, _, given = name.partition(GIVEN)
    other, _, value = given.partition("=")
    return float(value) if other == own else effect.parameters[own].scale


def _sized(effect: Effect, trial: Trial, given: Mapping[str, float]) -> Histories:
    """Return the derivative by an effect's size where other parameters are given."""
    low, high = _steps(effect, trial.simulation, effect.size, effect.parameters[effect.size])
    change = made(effect, trial, {**given, effect.size: high})
    return (change - made(effect, trial, {**given, effect.size: low})) * (1 / (high - low))


def _moves(change: Histories) -> bool:
    return bool(change.direct.any() or change.momentum.any())


def made(effect: Effect, trial: Trial, settings: Mapping[str, float], *, in_full: bool = False) -> Histories:
    """Return the change that an effect makes of a residual, other parameters at their values in force.

    Sensors' and surfaces' effects enter through the simulation's gradient; the rest is computed in full. So
    are those of sensors where that is asked for: derivatives need no more, a wind of 2 m/s at 20 m/s does.
    """
    in_force = in_force_of(effect, trial.simulation)
    values = {**in_force, **settings}
    route = route_of(effect, trial.simulation)
    if route == "own":
        return _own(effect, trial, values)
    if values == in_force or not any(values.values()):
        return trial.rows()
    record, maneuver = trial.maneuver.record, trial.maneuver
    if route == "distort" and effect.distort is not None:
        if in_full and trial.simulation.kind in _ASKED_AGAIN:
            return _undistorted(trial, partial(effect.distort, values))
        return _distorted(trial, effect.distort(values, record))
    if route == "load" and effect.load is not None:
        return _loaded(trial, _carried(effect, values, trial))
    if route == "replay" and effect.replay is not None:
        replay = Replay(trial.simulation, record, maneuver.vehicle)
        return trial.rows(replay.responses(effect.replay(values, replay)))
    kinds = maneuver.vehicle.effector_kinds
    if route == "act" and effect.act is not None:
        if trial.positions:
            after = effect.act(values, trial.positions, record.dt, kinds)
            return trial.rows(positions={n: after[n] - x for n, x in trial.positions.items()})
        return trial.rows(trial.moved(_felt(effect.act, values, record, kinds)))
    if effect.feel is not None:
        return trial.rows(trial.moved(_felt(effect.feel, values, record, kinds)))
    return trial.rows()


def sources_of(effect: Effect, trial: Trial, name: str) -> tuple[str, ...]:
    """Return the channels that a signature is computed from, ``d/dt`` of rates among them.

    Parameters
    ----------
    effect : Effect
    trial : Trial
    name : str
        Parameter.
    """
    rates = tuple(f"d/dt state/{n}" for n in "pqr")
    felt = tuple(f"state/{n}" for n in ("ax", "ay", "az"))
    route = route_of(effect, trial.simulation)
    if route == "act" and trial.positions:
        return ()  # commands are known, not measured
    if route == "load":
        return (*felt, *rates)
    if route == "distort" and effect.distort is not None:
        record = trial.maneuver.record
        parameter = effect.parameters[name.partition(GIVEN)[0]]
        after = effect.distort({**in_force_of(effect, trial.simulation), name: parameter.scale}, record)
        changed = tuple(n for n in record.channels if not np.array_equal(after[n], record[n]))
        if effect.stage == "environment":  # through the attitude
            return tuple(f"state/{n}" for n in ("phi", "theta", "psi"))
        turned = tuple(f"d/dt {n}" for n in changed)
        return (*changed, *turned, *(rates if set(felt) & set(changed) else ()))
    return trial.inputs


def _steps(effect: Effect, simulation: Simulation, name: str, parameter: Parameter) -> tuple[float, float]:
    """Return two values of a parameter, about the one in force."""
    at = in_force_of(effect, simulation)[name]
    small = _SMALL * parameter.scale
    if parameter.low <= at - small and at + small <= parameter.high:
        return at - small, at + small
    if at + parameter.scale <= parameter.high:
        return at, at + parameter.scale
    return at - parameter.scale, at


def _own(effect: Effect, trial: Trial, values: Mapping[str, float]) -> Histories:
    """Return what other settings make of the simulation's own effect."""
    settings = {effect.id: dict(values)}
    record = trial.maneuver.record
    positions = {}
    if effect.stage == "command":
        after = trial.simulation.positions(record, settings)
        positions = {n: after[n] - x for n, x in trial.positions.items()}
    return trial.rows(trial.simulation.predict(record, settings) - trial.predicted, positions)


def _distorted(trial: Trial, record: FlightRecord) -> Histories:
    """Return what a change of the log makes of the residual."""
    maneuver = Maneuver(record, trial.maneuver.vehicle)
    measured = measured_part(maneuver, trial.simulation.responses, tuple(trial.positions))
    before = trial.maneuver.record
    changes = {n: record[n] - before[n] for n in trial.inputs if not np.array_equal(record[n], before[n])}
    return measured - trial.measured - trial.rows(trial.moved(changes))


def _undistorted(trial: Trial, distort: Callable[[FlightRecord], FlightRecord]) -> Histories:
    """Return what a distortion that is in the log makes of the residual: with it, less without.

    The log that distorted gives this one is approached from this one; distorted once more it would be as far
    off on the other side, and of what is not a straight line the wrong sign.
    """
    record = before = trial.maneuver.record
    for _ in range(_APPROACHES):
        after = distort(before)
        more = {n: after[n] - before[n] for n in record.channels if not np.array_equal(after[n], before[n])}
        before = record.with_channels(
            *(replace(record.channel(n), values=record[n] - x) for n, x in more.items())
        )
    simulation, maneuver = trial.simulation, Maneuver(before, trial.maneuver.vehicle)
    measured = measured_part(maneuver, simulation.responses, tuple(trial.positions))
    felt = any(not np.array_equal(record[n], before[n]) for n in trial.inputs)
    predicted = simulation.predict(before) if felt else trial.predicted
    return trial.measured - measured - trial.rows(trial.predicted - predicted)


def _carried(effect: Effect, values: dict[str, float], trial: Trial) -> Vehicle:
    """Return the vehicle with what an effect makes of its mass; a vehicle says itself what it cannot be."""
    assert effect.load is not None
    try:
        return effect.load(values, trial.maneuver.vehicle)
    except ValueError as error:
        raise ImpossibleSettings(f"effect '{effect.id}': {error}") from None


def _loaded(trial: Trial, vehicle: Vehicle) -> Histories:
    """Return what mass properties that are not those of the truth make of the residual."""
    measured = measured_part(
        Maneuver(trial.maneuver.record, vehicle), trial.simulation.responses, tuple(trial.positions)
    )
    return trial.measured - measured - trial.rows(_transferred(trial, vehicle))


def _transferred(trial: Trial, vehicle: Vehicle) -> Array:
    """Return what the simulation's forces add to its moments about the centre of gravity of a vehicle.

    Moments of the truth are about its own centre of gravity, those of the simulation about the stated one.
    """
    record, stated = trial.maneuver.record, trial.maneuver.vehicle
    responses, found = trial.simulation.responses, np.zeros_like(trial.predicted)
    shift = centre(record, vehicle) - centre(record, stated)
    span, chord = vehicle.span_m or 1.0, vehicle.chord_m or 1.0
    for forces, moments, lengths in (
        (WRENCH[:3], WRENCH[3:], (1.0, 1.0, 1.0)),
        (tuple(COEFFICIENT)[:3], tuple(COEFFICIENT)[3:], (span, chord, span)),
    ):
        rows = [
            trial.predicted[responses.index(n)] if n in responses else np.zeros(record.time.size)
            for n in forces
        ]
        for name, length, moment in zip(moments, lengths, cross(shift, np.array(rows)), strict=True):
            if name in responses and f"response/{name}" not in record:
                found[responses.index(name)] = moment / length
    return found


def _felt(hook, values: dict[str, float], record: FlightRecord, kinds: dict[str, str]) -> dict[str, Array]:
    """Return changes of effectors' channels that a hook makes."""
    signals = {name: record[f"effector/{name}"] for name in record.group("effector")}
    after = hook(values, signals, record.dt, kinds)
    return {f"effector/{n}": after[n] - x for n, x in signals.items() if n in after}
