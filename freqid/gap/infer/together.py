"""What tolerances, offsets of records and effects make together, each where it is likeliest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import cast

from freqid.core.arrays import Array, Complex
from freqid.core.vehicle import Vehicle
from freqid.gap.departed import Departed
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.columns import Columns
from freqid.gap.infer.evidence import Estimate, weights_of
from freqid.gap.infer.system import System
from freqid.gap.model.candidate import OTHER
from freqid.gap.model.changes import as_moved, beside, change_together
from freqid.gap.model.testable import in_force_of, route_of
from freqid.gap.model.tolerance import of_effects, offsets_of, own_departures
from freqid.gap.simulation import Simulation
from freqid.gap.stack.block import Block
from freqid.gap.stack.trial import Trial
from freqid.simulate.effects.effect import Effect

_MADE_TOGETHER = ("own", "distort", "load")
"""Routes of effects that are asked for with all else; those on actuators are once slopes are seen through
them, and the others add up."""


Acting = Sequence[tuple[int, Estimate]]
"""Candidates that are taken to act, with their sizes."""


@dataclass(frozen=True, eq=False)
class Point:
    """Sizes of all that is unknown, asked for together.

    Attributes
    ----------
    departures : dict of float
        Of the simulation's own parameters.
    own : dict of dict of float
        Parameters of effects of the simulation's own.
    effects : list of (Effect, dict of float)
        Of sensors and mass properties.
    sensors : list of (Effect, dict of float)
        Those of sensors as far as they are tolerances and offsets.
    channels : dict of float
        Offsets of effectors' channels.
    sigmas : dict of float
        Tolerances and own unknowns of the record that are among these.
    acting : list of (int, Estimate)
        Effects that are.
    """

    departures: dict[str, float] = field(default_factory=dict)
    own: dict[str, dict[str, float]] = field(default_factory=dict)
    effects: list[tuple[Effect, dict[str, float]]] = field(default_factory=list)
    sensors: list[tuple[Effect, dict[str, float]]] = field(default_factory=list)
    channels: dict[str, float] = field(default_factory=dict)
    sigmas: dict[str, float] = field(default_factory=dict)
    acting: list[tuple[int, Estimate]] = field(default_factory=list)

    @classmethod
    def about(
        cls,
        columns: Columns,
        block: Block,
        system: System,
        fitted: Array,
        acting: Acting,
        library: Mapping[str, Effect],
        sizes: Mapping[str, float],
        form_error: Form,
        *,
        bodies: bool = True,
    ) -> Point:
        """Return where all is likeliest, the record's own unknowns beside what is fitted.

        As in `Linearised`; mass properties are among it where `bodies` are.
        """
        c, weights = columns, weights_of(system, acting)
        known = dict(zip(system.tolerances, fitted.tolist(), strict=True))
        own = c.likeliest_own(c.residual - fitted @ c.tolerances - weights @ c.effects, form_error)
        offsets = dict(zip(c.own_names, own.tolist(), strict=True))
        trial, vehicle = block.trial, block.trial.maneuver.vehicle
        simulation = trial.nominal.simulation
        at = cls()
        added: dict[str, dict[str, float]] = {}

        def add(effect: str, parameter: str, size: float) -> None:
            of = added.setdefault(effect, {})
            of[parameter] = of.get(parameter, 0.0) + size

        for key, sigmas in own_departures(trial, sizes).items():
            if key in known:
                at.sigmas[key] = known[key]
                for name, sigma in sigmas.items():
                    at.departures[name] = at.departures.get(name, 0.0) + sigma * known[key]
        for key, effect, name, size in of_effects(trial, library, sizes):
            if known.get(key) and (bodies or effect.load is None):
                add(effect.id, name, size * known[key])
                at.sigmas[key] = known[key]
        settings, channels = offsets_of(offsets, block, sizes)
        at.channels.update(channels)
        at.sigmas.update({n: x for n, x in offsets.items() if n.startswith("offset.")})
        for effect_id, values in settings.items():
            for name, x in values.items():
                add(effect_id, name, x)
        stated = {n: dict(x) for n, x in added.items()}
        for i, e in acting:
            c = e.candidate
            if c.effect == OTHER and c.kind == "scalar" and c.place.label in simulation.tolerances:
                at.departures[c.place.label] = at.departures.get(c.place.label, 0.0) + float(e.size[0])
            elif c.effect in library:
                effect = library[c.effect].of(vehicle)
                route = route_of(effect, simulation)
                seen_through = route == "act" and trial.acts
                if not seen_through and (route not in _MADE_TOGETHER or effect.stage == "command"):
                    continue
                if route == "load" and not bodies:
                    continue
                force = in_force_of(effect, simulation)
                for name, value in c.place.settings(force, e.size).items():
                    add(effect.id, name, value - force[name])
            else:
                continue
            at.acting.append((i, e))
        for effect, values in _in_force(stated, library, vehicle, simulation):
            if route_of(effect, simulation) == "distort":
                at.sensors.append((effect, values))
        for effect, values in _in_force(added, library, vehicle, simulation):
            if route_of(effect, simulation) == "own" and effect.stage != "command":
                at.own[effect.id] = {**in_force_of(effect, simulation), **values}
            else:
                at.effects.append((effect, values))
        return at

    def trial(self, block: Block) -> Trial:
        """Return a block's trial on the simulation as it is there."""
        return self._departed(block.trial.nominal)

    def _departed(self, nominal: Trial) -> Trial:
        if not (self.departures or self.own):
            return nominal
        return nominal.asked_of(cast(Simulation, Departed(nominal.simulation, self.departures, self.own)))

    def moved(self, block: Block) -> Trial:
        """Return the same on the motion as it was, not as sensors saw it.

        What an effect that is taken to act does to sensors stays: its own columns begin without it.
        """
        there = self.trial(block)
        record = as_moved(self.sensors, there, self.channels)
        return there if record is there.maneuver.record else there.flown_as(record)

    def made(self, block: Block) -> Complex:
        """Return what all of it makes of a block's residual together, shape (row, line).

        One after the other, as where nothing acts yet: the simulation's own parameters, what acts on its
        actuators, what sensors did. That is taken back from the motion as far as the records tell it, all
        else is asked on motion without noise: a parameter that makes noise quieter, as a smaller mass does
        that of accelerometers, would seem the likelier for it.
        """
        before = block.plain
        late = [one for one in self.effects if route_of(one[0], before.simulation) == "act"]
        there = beside(late, self._departed(before))
        moved = {n: x - before.positions[n] for n, x in there.positions.items()}
        whole = before.rows(there.predicted - before.predicted, moved)
        sensors = [one for one in self.effects if route_of(one[0], there.simulation) == "distort"]
        if sensors or self.channels:
            logged = beside(late, self._departed(block.as_logged))
            whole = whole + change_together(sensors, logged, self.channels)
        others = [one for one in self.effects if one not in late + sensors]
        if others:
            there = there.flown_as(as_moved(sensors, there, self.channels))
            whole = whole + change_together(others, there)
        return block.transform(whole)


def _in_force(
    departures: Mapping[str, Mapping[str, float]],
    library: Mapping[str, Effect],
    vehicle: Vehicle,
    simulation: Simulation,
) -> Iterator[tuple[Effect, dict[str, float]]]:
    """Yield effects with parameters that depart from those in force."""
    for name, departs in departures.items():
        effect = library[name].of(vehicle)
        force = in_force_of(effect, simulation)
        yield effect, {n: force[n] + x for n, x in departs.items()}
