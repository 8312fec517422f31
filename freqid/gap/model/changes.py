"""What an effect at given settings makes of a residual: the truth has it, the simulation as it is has not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import COEFFICIENT, WRENCH
from freqid.core.errors import ImpossibleSettings, UsageError
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.vehicle import Vehicle
from freqid.dynamics.moment_reference_point import moment_about
from freqid.gap.model.candidate import near
from freqid.gap.model.replay import Replay
from freqid.gap.model.testable import in_force_of, route_of
from freqid.gap.simulation import Simulation
from freqid.gap.stack.histories import Histories
from freqid.gap.stack.trial import Act, Inside, Trial
from freqid.simulate.effects.along import centre
from freqid.simulate.effects.effect import Effect

Signals = dict[str, Array]

_POSITIONS: WeakKeyDictionary[Trial, dict[tuple, Signals]] = WeakKeyDictionary()
"""Of actuators with an effect in their loops, by effect, shape and size: many places ask for the same."""


def change(
    effect: Effect, trial: Trial, settings: Mapping[str, float], *, first_order: bool = False
) -> Histories:
    """Return the change that an effect makes of a residual, other parameters at their values in force.

    Motion that was fitted to a record carries what its sensors do: there an effect of sensors is what is
    missed once it is taken back, which is not the same as having it twice.

    Parameters
    ----------
    effect : Effect
        Testable in the trial.
    trial : Trial
        On motion without noise.
    settings : dict of float
        By parameter.
    first_order : bool
        What sensors log and what the airframe feels move the simulation by its derivatives where that is
        quicker.

    Raises
    ------
    ImpossibleSettings
        Where nothing can be so, as a body with these moments of inertia.
    """
    in_force = in_force_of(effect, trial.simulation)
    values = {**in_force, **settings}
    route = route_of(effect, trial.simulation)
    if values == in_force or (route != "own" and not any(values.values())):
        return trial.rows()
    if route == "own":
        return trial.with_own_effects({effect.id: values}, actuators=effect.stage == "command")
    record, maneuver = trial.maneuver.record, trial.maneuver
    if route == "distort" and effect.distort is not None:
        return _relogged(trial, [(effect, values)], first_order=first_order)
    if route == "load" and effect.load is not None:
        return _loaded(trial, _carried(effect, values, maneuver.vehicle))
    if route == "replay":
        return trial.rows(_added(effect, values, trial))
    kinds = maneuver.vehicle.effector_kinds
    if route == "act" and effect.act is not None and trial.positions:
        before = trial.positions
        if _inside(effect, trial):
            after = _in_loop(effect, values, trial)
        else:
            after = effect.act(values, before, record.dt, kinds)
        return trial.rows(positions={n: after[n] - x for n, x in before.items()})
    hook = effect.act if route == "act" else effect.feel
    if hook is None:
        return trial.rows()
    if shares := departures_of(effect, values, trial.simulation):
        return trial.departed(shares)
    felt = trial.moved(_felt(hook, values, record, kinds), first_order=first_order)
    return trial.rows(felt + _added(effect, values, trial))


def departures_of(effect: Effect, values: Mapping[str, float], simulation: Simulation) -> dict[str, float]:
    """Return the shares of a simulation's own parameters that an effect is; none unless it declares all."""
    shares, own = effect.departs(dict(values)) if effect.departs else {}, simulation.tolerances
    return shares if all(n in own and own[n].unit == "1" for n in shares) else {}


def _added(effect: Effect, values: Mapping[str, float], trial: Trial) -> Array:
    """Return what an effect adds to the simulation's responses, shape (response, sample)."""
    if effect.replay is None:
        return np.zeros_like(trial.predicted)
    replay = Replay(trial.simulation, trial.maneuver.record, trial.maneuver.vehicle)
    return replay.responses(effect.replay(dict(values), replay))


def _in_loop(effect: Effect, values: Mapping[str, float], trial: Trial) -> Signals:
    """Return the simulation's own positions with an effect inside its actuators' loops.

    Actuators do not feel each other, so one effector's own size is asked for as that of all: what a place
    asks for is there once it was asked for at another. Many sizes at once are asked for as they are, of a
    simulation that knows those of single effectors. They come on top of what is in force.
    """
    own = trial.simulation.effects[effect.id]
    every, shape = own.get(effect.size, 0.0), _shape(effect, values, trial)
    made, sizes = _POSITIONS.setdefault(trial, {}), _sizes(effect, values, trial)
    each = {n: x for n, x in sizes.items() if x}
    if len(set(each.values())) > 1 and set(each) <= set(trial.simulation.effects[effect.id]):
        alone = {n: own.get(n, 0.0) + x for n, x in each.items()}
        return trial.positions_with({effect.id: {**shape, effect.size: every, **alone}})
    found = {}
    for name, size in sizes.items():
        key = (effect.id, *shape.items(), size)
        if key not in made:
            made[key] = trial.positions_with({effect.id: {**shape, effect.size: every + size}})
        found[name] = made[key][name]
    return found


def _inside(effect: Effect, trial: Trial) -> bool:
    """Return whether the simulation itself computes an effect that acts inside its actuators' loops."""
    return effect.in_loop and effect.id in trial.simulation.effects and bool(trial.positions)


def _sizes(effect: Effect, values: Mapping[str, float], trial: Trial) -> dict[str, float]:
    """Return an effect's size by simulated effector: that of all, of its kind and its own added up."""
    kinds = trial.maneuver.vehicle.effector_kinds
    of_kind = {k: values.get(k, 0.0) for k in kinds.values() if k not in kinds}
    return {n: values[effect.size] + of_kind.get(kinds[n], 0.0) + values.get(n, 0.0) for n in trial.positions}


def _shape(effect: Effect, values: Mapping[str, float], trial: Trial) -> dict[str, float]:
    """Return an effect's parameters that are no sizes, those that are not at their usual value."""
    kinds = trial.maneuver.vehicle.effector_kinds
    sizes = {effect.size, *kinds, *kinds.values()}
    return {n: x for n, x in values.items() if n not in sizes and x != effect.parameters[n].default}


def change_together(
    effects: Sequence[tuple[Effect, Mapping[str, float]]], trial: Trial, offsets: Mapping[str, float] = {}
) -> Histories:
    """Return the change that effects make together, each as in `change`.

    Those of sensors follow one another on the way into the log, and a body has one mass and one centre of
    gravity: what two of these make together is not the sum of what each does alone. All others add up.

    Parameters
    ----------
    effects : sequence of (Effect, dict of float)
        With their parameters, others at their values in force.
    trial : Trial
    offsets : dict of float
        Of channels, which their sensors add last.

    Raises
    ------
    ImpossibleSettings
        Where nothing can be so.
    """
    vehicle, total = trial.maneuver.vehicle, trial.rows()
    sensors, carried = [], vehicle
    for effect, settings in effects:
        values = {**in_force_of(effect, trial.simulation), **settings}
        route = route_of(effect, trial.simulation)
        if route == "distort" and effect.distort is not None:
            sensors.append((effect, values))
        elif route == "load" and effect.load is not None:
            carried = _carried(effect, values, carried)
        else:
            total = total + change(effect, trial, settings)
    if sensors or offsets:
        total = total + _relogged(trial, sensors, offsets)
    return total + _loaded(trial, carried) if carried is not vehicle else total


def as_moved(
    effects: Sequence[tuple[Effect, Mapping[str, float]]], trial: Trial, offsets: Mapping[str, float] = {}
) -> FlightRecord:
    """Return a trial's record without what sensors made of it: how the aircraft moved.

    The simulation's own flight, too, stands about the record's levels and follows what it misses of it: it
    carries what sensors make of both.

    Parameters
    ----------
    effects : sequence of (Effect, dict of float)
        With their parameters, others at their values in force; those of sensors count.
    trial : Trial
    offsets : dict of float
        Of channels.
    """
    sensors = [
        (effect, {**in_force_of(effect, trial.simulation), **settings})
        for effect, settings in effects
        if route_of(effect, trial.simulation) == "distort"
    ]
    return _without(sensors, offsets, trial.maneuver.record)


def acts_on(effect: Effect, trial: Trial) -> str:
    """Return what an effect acts on between command and airframe, empty where it does not act there.

    ``positions`` that simulated actuators have, or ``effectors`` as the airframe feels them.
    """
    route = route_of(effect, trial.simulation)
    if route == "act" and trial.positions:
        return "positions"
    return "effectors" if route in ("act", "feel") else ""


def beside(effects: Sequence[tuple[Effect, Mapping[str, float]]], trial: Trial) -> Trial:
    """Return a trial on which effects are in force already, for what others change there.

    Those between command and airframe follow one another: a delay and a lag together are not the sum of what
    each does alone, and a servo that is a little slower is so before the delay. All other effects add up:
    these leave the trial as it is. What sensors do is taken back where the motion carries it: all others act
    on the motion that was flown.

    Parameters
    ----------
    effects : sequence of (Effect, dict of float)
        With their parameters, others at their values in force.
    trial : Trial
    """
    dt, kinds = trial.maneuver.record.dt, trial.maneuver.vehicle.effector_kinds
    for effect, settings in effects:
        values, at = {**in_force_of(effect, trial.simulation), **settings}, acts_on(effect, trial)
        hook = effect.act or effect.feel
        if at == "positions" and _inside(effect, trial):
            sizes, shape = _sizes(effect, values, trial), _shape(effect, values, trial)
            trial = trial.inside_of(Inside(effect.id, effect.size, sizes, shape))
        elif at and hook is not None:
            act = _acting(hook, values, dt, kinds)
            trial = trial.acted_on(act) if at == "positions" else trial.felt_through(act)
        elif route_of(effect, trial.simulation) == "distort" and trial.carries:
            trial = trial.flown_as(_taken_back(effect, values, trial.maneuver.record))
    return trial


class Among(NamedTuple):
    """One trial twice: where effects act before another one, and where all others act.

    Attributes
    ----------
    before, all : Trial
        The same where nothing acts after it.
    about : float
        Size of that effect.
    """

    before: Trial
    all: Trial
    about: float

    def change(
        self,
        effect: Effect,
        settings: Callable[[float], Mapping[str, float]],
        size: float,
        *,
        first_order: bool = False,
    ) -> Histories:
        """Return the change that an effect makes at a size, `settings` its parameters there; as `change`.

        At the size `about` it is the effect's own change: what acts after it has one of its own. Sizes near
        that differ from it by as much as they do with the later effects in force, as a delay does that is
        seen through a lag. The tolerance of that delay is seen so; were the delay not, it would be taken for
        a part of it.
        """
        if self.all is self.before or not near(np.array(size), self.about):
            return change(effect, self.before, settings(size), first_order=first_order)
        there, seen = (change(effect, trial, settings(self.about)) for trial in (self.before, self.all))
        return there + change(effect, self.all, settings(size)) - seen


def among(
    before: Sequence[tuple[Effect, Mapping[str, float]]],
    after: Sequence[tuple[Effect, Mapping[str, float]]],
    about: float,
    trial: Trial,
) -> Among:
    """Return a trial among effects that act before and after another one; delays and lags commute."""
    first = beside(before, trial)
    return Among(first, beside(after, first) if after else first, about)


def _relogged(
    trial: Trial,
    sensors: Sequence[tuple[Effect, dict[str, float]]],
    offsets: Mapping[str, float] = {},
    *,
    first_order: bool = False,
) -> Histories:
    """Return the change of a residual that effects of sensors make, one after the other on the way to a log.

    Positions move by the noise of feedback too, which motion without noise has not: what their sensors make
    of that is in the rows of actuators alone.
    """
    record, moving = trial.maneuver.record, trial.moving
    logged = _logged(trial, sensors, offsets, record)
    found = trial.relogged(logged, first_order=first_order)
    if moving is not record:
        also = _logged(trial, sensors, offsets, moving)
        channels = {n: f"effector/{n}" for n in trial.followed}
        also_moved = {
            n: also[k] - moving[k] - (logged[k] - record[k])
            for n, k in channels.items()
            if also.channels[k] is not moving.channels[k]
        }
        found = found + trial.rows(positions=also_moved)
    return found * -1.0 if trial.carries else found


def _logged(
    trial: Trial,
    sensors: Sequence[tuple[Effect, dict[str, float]]],
    offsets: Mapping[str, float],
    record: FlightRecord,
) -> FlightRecord:
    """Return a record with effects of sensors, or without them where the record carries them already."""
    if trial.carries:
        return _without(sensors, offsets, record)
    for effect, values in sensors:
        assert effect.distort is not None
        record = effect.distort(values, record)
    return _shifted(record, offsets)


def _without(
    sensors: Sequence[tuple[Effect, dict[str, float]]], offsets: Mapping[str, float], record: FlightRecord
) -> FlightRecord:
    """Return a record without effects of sensors and offsets of channels."""
    record = _shifted(record, {n: -x for n, x in offsets.items()})
    for effect, values in sensors:
        record = _taken_back(effect, values, record)
    return record


def _shifted(record: FlightRecord, offsets: Mapping[str, float]) -> FlightRecord:
    channels = [replace(record.channel(n), values=record[n] + x) for n, x in offsets.items()]
    return record.with_channels(*channels) if channels else record


def _taken_back(effect: Effect, values: Mapping[str, float], record: FlightRecord) -> FlightRecord:
    """Return a record without what an effect of sensors made of it."""
    assert effect.distort is not None
    return effect.distort({n: effect.inverse(x) if x else x for n, x in values.items()}, record)


def _acting(hook: Callable, values: Mapping[str, float], dt: float, kinds: dict[str, str]) -> Act:
    return lambda signals: {**signals, **hook(values, signals, dt, kinds)}


def _carried(effect: Effect, values: dict[str, float], vehicle: Vehicle) -> Vehicle:
    """Return a vehicle with what an effect makes of its mass; a vehicle says itself what it cannot be."""
    assert effect.load is not None
    try:
        return effect.load(values, vehicle)
    except ValueError as error:
        raise ImpossibleSettings(f"effect '{effect.id}': {error}") from None


def _loaded(trial: Trial, vehicle: Vehicle) -> Histories:
    """Return what mass properties that are not those of the truth make of the residual."""
    try:
        measured = trial.measured_on(Maneuver(trial.maneuver.record, vehicle))
    except UsageError as error:  # what is left without its wings is no body
        raise ImpossibleSettings(str(error)) from None
    return trial.logged - measured - trial.rows(_transferred(trial, vehicle))


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
        for name, length, moment in zip(moments, lengths, moment_about(shift, np.array(rows)), strict=True):
            if name in responses and f"response/{name}" not in record:
                found[responses.index(name)] = moment / length
    return found


def _felt(hook: Callable, values: dict[str, float], record: FlightRecord, kinds: dict[str, str]) -> Signals:
    """Return changes of effectors' channels that a hook makes."""
    signals = {name: record[f"effector/{name}"] for name in record.group("effector")}
    after = hook(values, signals, record.dt, kinds)
    return {f"effector/{n}": after[n] - x for n, x in signals.items() if n in after}
