"""A simulation beside one manoeuvre: what was measured, what is predicted, and what changes make of both."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import FLOW, RATES, VELOCITY
from freqid.core.record import FlightRecord, Maneuver
from freqid.gap.departed import Departed
from freqid.gap.simulation import Departures, Settings, Simulation
from freqid.gap.stack.histories import Histories
from freqid.gap.stack.rows import measured_part

Act = Callable[[dict[str, Array]], dict[str, Array]]

_QUICK = ("callable", "fmu", "scenario")
"""Kinds that answer any record in milliseconds. Others are asked for their derivatives once."""


class Inside(NamedTuple):
    """An effect of the simulation's own on each of its actuators.

    Attributes
    ----------
    effect, size : str
        Ids of the effect and of the parameter that is its size.
    sizes : dict of float
        By effector.
    shape : dict of float
        Its other parameters.
    """

    effect: str
    size: str
    sizes: Mapping[str, float]
    shape: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Trial:
    """A simulation beside one manoeuvre, and what is computed of the pair once.

    Attributes
    ----------
    simulation : Simulation
    maneuver : Maneuver
    measured : Histories
    predicted : ndarray, shape (response, sample)
    positions : dict of ndarray
        That the simulation makes of the commands.
    inputs : tuple of str
        Channels by which `gradient` differentiates.
    sent : FlightRecord
        The commands at the record's own rate, which actuators are asked with.
    every : int
        How many samples of that stand behind one of the manoeuvre's.
    carries : bool
        Whether the manoeuvre's channels come from a record, with whatever its sensors did to them.
    acting : tuple of callable
        What acts on the actuators' positions besides the simulation, one after the other.
    inside : tuple of Inside
        What acts inside the actuators' loops: the simulation computes it.
    bare : Trial, optional
        The same without any of that; None where nothing acts.
    felt : bool
        Whether the airframe feels other positions of effectors than were measured.
    followed : dict of ndarray
        Movement of actuators that the manoeuvre's effectors lack: what they followed of the commands' noise.
    """

    simulation: Simulation
    maneuver: Maneuver
    measured: Histories
    predicted: Array
    positions: dict[str, Array]
    inputs: tuple[str, ...]
    sent: FlightRecord
    every: int = 1
    carries: bool = True
    acting: tuple[Act, ...] = ()
    inside: tuple[Inside, ...] = ()
    bare: Trial | None = None
    felt: bool = False
    followed: Mapping[str, Array] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        simulation: Simulation,
        maneuver: Maneuver,
        carries: bool = True,
        followed: Mapping[str, Array] | None = None,
    ) -> Self:
        """Replay a simulation on a manoeuvre.

        Raises
        ------
        DataError
            Where the record lacks what either needs.
        """
        record = maneuver.record
        positions = simulation.positions(record)
        positions = {n: x for n, x in positions.items() if f"effector/{n}" in record}
        measured = measured_part(maneuver, simulation.responses, tuple(positions))
        predicted = simulation.predict(record)
        inputs = inputs_of(simulation, record)
        followed = {n: x for n, x in (followed or {}).items() if n in positions}
        return cls(
            simulation,
            maneuver,
            measured,
            predicted,
            positions,
            inputs,
            record,
            1,
            carries,
            followed=followed,
        )

    def thinned(self, every: int) -> Trial:
        """Return the trial on fewer of its samples: smooth motion needs few. Actuators keep theirs."""
        if every == 1 or not self.quick:
            return self
        record = self.maneuver.record
        channels = {
            n: replace(c, values=c.values[::every], native_rate_hz=c.native_rate_hz / every)
            for n, c in record.channels.items()
        }
        thin = replace(self.maneuver, record=replace(record, time=record.time[::every], channels=channels))
        positions = {n: x[::every] for n, x in self.positions.items()}
        followed = {n: x[::every] for n, x in self.followed.items()}
        measured = measured_part(thin, self.simulation.responses, tuple(positions))
        predicted = self.simulation.predict(thin.record)
        return replace(
            self,
            maneuver=thin,
            measured=measured,
            predicted=predicted,
            positions=positions,
            every=every,
            followed=followed,
        )

    def positions_with(
        self,
        effects: Settings | None = None,
        departures: Departures | None = None,
        sent: FlightRecord | None = None,
    ) -> dict[str, Array]:
        """Return the actuators' positions with other effects, parameters or commands, on these samples."""
        made = self._asked(sent or self.sent, effects or {}, departures)
        return self._acted({n: made[n][:: self.every] for n in self.positions})

    def inside_of(self, inside: Inside) -> Trial:
        """Return the trial with one more effect in force inside its actuators' loops."""
        new = replace(self, inside=(*self.inside, inside), bare=self.bare and self.bare.inside_of(inside))
        new = replace(new, positions=new.positions_with())
        if "gradient" in self.__dict__:  # of loads on measured positions: the same
            new.__dict__["gradient"] = self.gradient
        return new

    def _asked(
        self, sent: FlightRecord, effects: Settings, departures: Departures | None
    ) -> dict[str, Array]:
        """Return what the simulation makes of commands, each actuator with what is in force inside it.

        Where an effect has a size of its own at an effector, all of these are asked for at once. Actuators do
        not feel each other, so elsewhere one effector's size is asked for as that of all.
        """
        made: dict[tuple[float | None, ...], dict[str, Array]] = {}
        found = {}
        in_force = [self.simulation.effects[i.effect] for i in self.inside]
        for name in self.positions:
            at = tuple(
                None if name in f else i.sizes[name] for i, f in zip(self.inside, in_force, strict=True)
            )
            if at not in made:
                asked = {n: dict(s) for n, s in effects.items()}
                for inside, force, size in zip(self.inside, in_force, at, strict=True):
                    settings = asked.setdefault(inside.effect, {})
                    settings.update(inside.shape)
                    own = {n: x for n, x in inside.sizes.items() if n in force}
                    for n, x in (own if size is None else {inside.size: size}).items():
                        settings[n] = settings.get(n, force.get(n, 0.0)) + x
                made[at] = self.simulation.positions(sent, asked or None, departures)
            found[name] = made[at][name]
        return found

    def acted_on(self, act: Act) -> Trial:
        """Return the trial with one more thing that acts on the actuators' positions.

        Whatever is asked of that trial is asked with it in force.
        """
        acting, bare = (*self.acting, act), self.bare or self
        new = replace(self, positions=act(self.positions), acting=acting, bare=bare)
        if "gradient" in self.__dict__:  # of loads on measured positions: the same
            new.__dict__["gradient"] = self.gradient
        return new

    def felt_through(self, act: Act) -> Trial:
        """Return the trial where the airframe feels other positions of effectors than were measured.

        What was measured stays.
        """
        record = self.maneuver.record
        before = {n: record[f"effector/{n}"] for n in record.group("effector")}
        moved = {f"effector/{n}": x - before[n] for n, x in act(before).items() if n in before}
        channels = [replace(record.channel(n), values=record[n] + x) for n, x in moved.items()]
        felt = replace(self.maneuver, record=record.with_channels(*channels))
        if self.quick:
            return replace(self, maneuver=felt, predicted=self.simulation.predict(felt.record), felt=True)
        new = replace(self, maneuver=felt, predicted=self.predicted + self.moved(moved), felt=True)
        new.__dict__["gradient"] = self.gradient
        return new

    def flown_as(self, record: FlightRecord) -> Trial:
        """Return the trial on other motion, where the simulation can be asked again; else itself."""
        if not self.quick:
            return self
        flown = replace(self.maneuver, record=record)
        measured, predicted = self.measured_on(flown), self.simulation.predict(record)
        return replace(self, maneuver=flown, measured=measured, predicted=predicted)

    def displaced(self, moved: Mapping[str, Array]) -> dict[str, Array]:
        """Return what becomes of displacements of the simulation's own positions by what acts on these."""
        if self.bare is None:
            return dict(moved)
        own = self.bare.positions
        after = self._acted({n: x + moved.get(n, 0.0) for n, x in own.items()})
        return {n: after[n] - x for n, x in self.positions.items()}

    def _acted(self, positions: dict[str, Array]) -> dict[str, Array]:
        for act in self.acting:
            positions = act(positions)
        return positions

    @cached_property
    def gradient(self) -> Array:
        """Derivatives of the responses, shape (response, input, sample); not all that is asked needs them."""
        return self.simulation.gradient(self.maneuver.record, self.inputs)

    @cached_property
    def nominal(self) -> Trial:
        """The same on the simulation as it is: nominal parameters, and no effect acts."""
        return self.asked_of(self.simulation.nominal) if isinstance(self.simulation, Departed) else self

    @cached_property
    def undeparted(self) -> Trial:
        """The same on nominal parameters; an effect that acts still does."""
        return self.asked_of(self.simulation.undeparted) if isinstance(self.simulation, Departed) else self

    def asked_of(self, simulation: Simulation) -> Trial:
        """Return the same, replayed on a simulation with other parameters or effects."""
        own = replace(self, simulation=simulation)
        return replace(
            own, predicted=simulation.predict(self.maneuver.record), positions=own.positions_with()
        )

    @cached_property
    def moving(self) -> FlightRecord:
        """The manoeuvre's record with effectors as they moved: also by what they followed of the noise."""
        record = self.maneuver.record
        channels = [
            replace(record.channel(f"effector/{n}"), values=record[f"effector/{n}"] + x)
            for n, x in self.followed.items()
        ]
        return record.with_channels(*channels) if channels else record

    @property
    def actuators(self) -> tuple[str, ...]:
        """Effectors whose positions the simulation predicts."""
        return tuple(self.positions)

    def rows(self, responses: Array | None = None, positions: Mapping[str, Array] | None = None) -> Histories:
        """Return histories in the residual's rows of responses, shape (response, sample), and positions."""
        direct = np.zeros_like(self.measured.direct)
        if responses is not None:
            direct[: len(responses)] = responses
        for i, row in enumerate(self.measured.rows):
            name = row.name.partition("/")[2]
            if row.kind == "actuator" and positions is not None and name in positions:
                direct[i] = positions[name]
        return Histories(self.measured.rows, direct, np.zeros_like(direct))

    @cached_property
    def simulated(self) -> Histories:
        """What the simulation says, in the rows of what was measured."""
        return self.rows(self.predicted, self.positions)

    @property
    def residual(self) -> Histories:
        """Measured less simulated."""
        return self.measured - self.simulated

    def measured_on(self, maneuver: Maneuver) -> Histories:
        """Return the measured part of another manoeuvre in the same rows."""
        return measured_part(maneuver, self.simulation.responses, self.actuators)

    @cached_property
    def logged(self) -> Histories:
        """The measured part of the manoeuvre's channels.

        It is `measured`, but where the airframe feels other positions than the log holds: see `felt_through`.
        """
        return self.measured_on(self.maneuver)

    @property
    def acts(self) -> bool:
        """Whether an effect is in force between command and airframe besides the simulation."""
        return bool(self.acting or self.inside or self.felt)

    @property
    def quick(self) -> bool:
        """Whether the simulation can be asked again for any record."""
        return self.simulation.kind in _QUICK

    @property
    def approximates(self) -> bool:
        """Whether `relogged` is quicker by derivatives, though the simulation can be asked again."""
        return self.simulation.kind == "scenario"

    def relogged(self, record: FlightRecord, *, first_order: bool = False) -> Histories:
        """Return by how much the residual would be another if the same flight had another log.

        Replayed in full, or by derivatives where the simulation is too slow or cannot be asked again.

        Parameters
        ----------
        record : FlightRecord
        first_order : bool
            By derivatives too where that is quicker: enough to weigh hundreds of candidates.
        """
        before = self.maneuver.record
        measured = self._logged(record) - self.logged
        moved = {n: record[n] - before[n] for n in self.inputs if not np.array_equal(record[n], before[n])}
        return measured - self.rows(self.moved(moved, first_order=first_order)) if moved else measured

    def _logged(self, record: FlightRecord) -> Histories:
        """Return the measured part of another log; positions of surfaces enter rows of their own alone."""
        before, kinds = self.maneuver.record, self.maneuver.vehicle.effector_kinds
        changed = [n for n, c in record.channels.items() if c is not before.channels.get(n)]
        if any(kinds.get(n.removeprefix("effector/")) != "surface" for n in changed):
            return self.measured_on(Maneuver(record, self.maneuver.vehicle))
        direct = self.logged.direct.copy()
        for i, row in enumerate(self.measured.rows):
            if row.kind == "actuator":
                direct[i] = record[f"effector/{row.name.partition('/')[2]}"]
        return replace(self.logged, direct=direct)

    def with_noise(self, noise: Mapping[str, Array], sign: float) -> Histories:
        """Return the residual with noise added to channels, shape (sample,) each."""
        record = self.maneuver.record
        channels = [replace(record.channel(n), values=record[n] + sign * x) for n, x in noise.items()]
        return self.residual + self.relogged(record.with_channels(*channels))

    def moved(self, changes: Mapping[str, Array], *, first_order: bool = False) -> Array:
        """Return what changes of input channels make of the responses, shape (response, sample).

        As `relogged` has them: a rotor's thrust goes with the square of its speed, so that a derivative at
        the speed that was flown is enough for small changes alone.
        """
        if self.quick and not (first_order and self.approximates):
            record = self.maneuver.record
            channels = [
                replace(record.channel(n), values=record[n] + x) for n, x in changes.items() if n in record
            ]
            return self.simulation.predict(record.with_channels(*channels)) - self.predicted
        known = [(j, changes[name]) for j, name in enumerate(self.inputs) if name in changes]
        return sum((self.gradient[:, j] * x for j, x in known), np.zeros_like(self.predicted))

    def departed(self, departures: Departures) -> Histories:
        """Return the change of the residual if the true parameters depart so far from the simulation's."""
        record, simulation = self.maneuver.record, self.simulation
        after = simulation.predict(record, departures=departures)
        if not self._moves_actuators(departures):
            return self.rows(after - self.predicted)
        positions = self.positions_with(departures=departures)
        moved = {n: positions[n] - x for n, x in self.positions.items()}
        return self.rows(after - self.predicted, moved)

    def departing(self, sizes: Departures) -> Iterator[tuple[str, Histories]]:
        """Yield the change of the residual by each parameter alone, to second order in its departure."""
        responses = self.simulation.sensitivity(self.maneuver.record, sizes) if sizes else ()
        for (name, size), change in zip(sizes.items(), responses, strict=True):
            moved = {}
            if self._moves_actuators([name]):
                above, below = (self.positions_with(departures={name: sign * size}) for sign in (1, -1))
                moved = {n: (above[n] - below[n]) / 2 for n in self.positions}
            yield name, self.rows(change, moved)

    def _moves_actuators(self, names: Iterable[str]) -> bool:
        """Return whether departures of some parameters may move simulated actuators."""
        own = self.simulation.tolerances
        return bool(self.positions) and not all(n in own and own[n].loads_only for n in names)

    def with_own_effects(self, settings: Settings, *, actuators: bool) -> Histories:
        """Return the change of the residual if effects of the simulation's own truly have other settings."""
        record, simulation = self.maneuver.record, self.simulation
        positions = {}
        if actuators and self.positions:
            after = self.positions_with(settings)
            positions = {n: after[n] - x for n, x in self.positions.items()}
        before = self.predicted
        if isinstance(simulation, Departed) and set(settings) & set(simulation.acting):
            before = simulation.predict(record, {i: simulation.effects[i] for i in settings})
        return self.rows(simulation.predict(record, settings) - before, positions)


def inputs_of(simulation: Simulation, record: FlightRecord) -> tuple[str, ...]:
    """Return the channels that a simulation's responses may depend on and that move."""
    names = [*VELOCITY, *RATES]
    if simulation.kind in ("callable", "fmu") or "state/u" not in record:
        names += FLOW
    names += [f"effector/{n}" for n in record.group("effector")]
    return tuple(n for n in names if n in record and np.ptp(record[n]) > 0)
