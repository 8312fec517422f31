"""Tolerances, offsets and effects made straight about where they came out together, not about nominal.

Columns say what each makes alone. What many of them make together is not their sum: a rotor's offset is felt
through a propeller that has five per cent more thrust, and a slipstream that is missing changes what a flap's
size makes. On an aircraft of two hundred uncertain parameters, flown slowly, that is fifty standard
deviations of a mean moment. So the simulation is asked once with all of them at their likeliest sizes, and
what their columns say less than that is taken off the residual (Gauss-Newton with columns that stay: G. A. F.
Seber, C. J. Wild, Nonlinear Regression, 1989, section 2.1).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.errors import ImpossibleSettings
from freqid.core.vehicle import Vehicle
from freqid.gap.departed import Departed
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.columns import Columns, redrawn
from freqid.gap.infer.evidence import Estimate, Evidence, weigh, weights_of
from freqid.gap.infer.explain import likeliest
from freqid.gap.infer.joint_sizes import joint_estimates
from freqid.gap.infer.system import System
from freqid.gap.model.candidate import OTHER
from freqid.gap.model.changes import as_moved, change_together
from freqid.gap.model.testable import in_force_of, route_of
from freqid.gap.model.tolerance import of_effects, offsets_of, record_columns, tolerance_columns
from freqid.gap.settings import FARTHEST, MOST_ROUNDS, SETTLED
from freqid.gap.simulation import Simulation, side_by_side
from freqid.gap.stack.block import Block
from freqid.gap.stack.trial import Trial
from freqid.simulate.effects.effect import Effect

_MADE_TOGETHER = ("own", "distort", "load")
"""Routes of effects that are asked for with all else; others are in force on the trial already."""

Acting = Sequence[tuple[int, Estimate]]
"""Candidates that are taken to act, with their sizes."""


def relinearised(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
    acting: Acting | None = None,
    *,
    anew: bool = False,
) -> tuple[System, list[Columns], list[Block]]:
    """Return a system whose lines are right where all that is unknown is likeliest.

    And the blocks as they are there. Where lines are drawn anew and no effects are stated that act, those
    that lead are drawn there too: one bias as an effect and as a tolerance, each on other motion, would leave
    a change between the two that nothing makes.

    Parameters
    ----------
    system : System
    columns : sequence of Columns
        By block.
    blocks : sequence of Block
    library : dict of Effect
    sizes : dict of float
        One sigma by name.
    form_error : Form
        At which departures are fitted.
    acting : sequence of (int, Estimate), optional
        What acts beside them; the likeliest effect where absent, if one is likely.
    anew : bool
        Whether the lines also have the slopes that they have there, not those that they have.
    """
    leading: list[int] = []
    if acting is None:
        alone = replace(system, form_errors=(form_error,), _reduced={})
        evidence = weigh(alone)
        acting, leading = _likeliest_alone(evidence), _leading(evidence) if anew else []
    weights = weights_of(system, acting)
    fitted = likeliest_departures(system, blocks, sizes, form_error, weights)[1]

    def there(pair: tuple[Columns, Block]) -> Columns:
        return straightened(*pair, system, fitted, acting, library, sizes, form_error, anew=anew)

    if anew:
        blocks = drawn(system, columns, blocks, fitted, acting, library, sizes, form_error)
        system, columns = redrawn(system, columns, blocks, library, leading)
    pairs = list(zip(columns, blocks, strict=True))
    new = side_by_side(blocks[0].trial.simulation, there, pairs)
    return replace(system, blocks=[c.matrices for c in new], _reduced={}), new, list(blocks)


def drawn(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    fitted: Array,
    acting: Acting,
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
) -> list[Block]:
    """Return blocks on which columns are drawn where tolerances, offsets and effects are likeliest together.

    Parameters
    ----------
    system : System
    columns : sequence of Columns
        By block.
    blocks : sequence of Block
    fitted : ndarray, shape (tolerance,)
        Of all tolerances, in sigmas.
    acting : sequence of (int, Estimate)
    library : dict of Effect
    sizes : dict of float
        One sigma by name.
    form_error : Form
        At which the records' own unknowns are fitted.
    """

    def there(pair: tuple[Columns, Block]) -> Block:
        about = _Point.about(*pair, system, fitted, acting, library, sizes, form_error)
        return replace(pair[1], as_moved=about.moved(pair[1]))

    pairs = list(zip(columns, blocks, strict=True))
    return side_by_side(blocks[0].trial.simulation, there, pairs)


def settled(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
    acting: Acting | None = None,
) -> tuple[System, list[Columns], list[Block]]:
    """Return a system whose lines are drawn anew until the data are no likelier by another round.

    And the blocks on which they are drawn; as in `relinearised`. Two explanations are compared where both
    have settled, for each round may gain as much as an effect does. A round that leads away, as where the air
    of a hover turns a flow angle round, is not taken. What all make together is asked for first with slopes
    that stay, which is quick; where that changes nothing, slopes of the same place would not either (the
    chord method: J. M. Ortega, W. C. Rheinboldt, Iterative Solution of Nonlinear Equations in Several
    Variables, 1970, section 7.1).
    """

    def once(*, anew: bool) -> float:
        """Take a round, keep what is best, and return the log evidence."""
        nonlocal at, best, found
        at = relinearised(*at, library, sizes, form_error, acting, anew=anew)
        here = _log_evidence(replace(at[0], form_errors=(form_error,), _reduced={}), acting)
        if here > best or (anew and here > best - SETTLED):  # alike: lines that are drawn there
            best, found = here, at
        return here

    at = (system, list(columns), list(blocks))
    if acting is None:  # those that lead now may not have led when lines were drawn
        lead = _leading(weigh(replace(system, form_errors=(form_error,), _reduced={})))
        at = (*redrawn(system, columns, blocks, library, lead), list(blocks))
    best, found = -np.inf, at
    before = _log_evidence(replace(at[0], form_errors=(form_error,), _reduced={}), acting)
    for _ in range(MOST_ROUNDS):
        start = before
        for _ in range(MOST_ROUNDS):
            here = once(anew=False)
            gained, before = here - before, here
            if abs(gained) < SETTLED:
                break
        if abs(before - start) < SETTLED:
            break
        before = once(anew=True)
    return found


def likelier_without(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
) -> float:
    """Return the nats by which no effect is likelier than a system says whose lines have settled.

    These are right where tolerances are likeliest *beside* its likeliest effect. Where that effect and a
    tolerance do the same, as a late channel does, they are elsewhere without it: the case of no effect would
    be judged with the errors of lines drawn far from it. So it is judged with lines of its own.
    """
    if not _likeliest_alone(weigh(replace(system, form_errors=(form_error,), _reduced={}))):
        return 0.0
    parts = [replace(c, effects=c.effects[:0]) for c in columns]
    few = [c.matrices for c in parts]
    alone = System([], system.tolerances, few, system.form_errors)
    before = weigh(alone).log_none
    alone, _, _ = settled(alone, parts, blocks, library, sizes, form_error, [])
    return max(weigh(alone).log_none - before, 0.0)


def _log_evidence(system: System, acting: Acting | None) -> float:
    """Return the log evidence of what acts, at one error of form; of the likeliest effect where absent."""
    acting = _likeliest_alone(weigh(system)) if acting is None else acting
    if not acting:
        return system.of([]).reduced(system.form_errors[0]).log_evidence
    few = system.of([i for i, _ in acting]).reduced(system.form_errors[0])
    w = np.concatenate([weights_of(system, [one])[system.columns_of(one[0])] for one in acting])
    return few.log_evidence + float(w @ few.g - 0.5 * w @ few.G @ w)


def straightened(
    columns: Columns,
    block: Block,
    system: System,
    fitted: Array,
    acting: Acting,
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
    *,
    anew: bool = False,
) -> Columns:
    """Return the columns of a block, its residual less what all make together beyond their columns.

    Parameters
    ----------
    columns : Columns
    block : Block
    system : System
        Of whose candidates the columns are.
    fitted : ndarray, shape (tolerance,)
        Of all tolerances, in sigmas.
    acting : sequence of (int, Estimate)
    library : dict of Effect
    sizes : dict of float
        One sigma by name.
    form_error : Form
        At which the record's own unknowns are fitted.
    anew : bool
        Whether tolerances and the record's own unknowns also have the slopes of the block as it is drawn.
    """
    c, at = columns, (block, system, fitted, acting, library, sizes, form_error)
    about = _Point.about(c, *at)
    try:
        whole = about.made(block)
    except ImpossibleSettings:  # a fit may ask for a body that cannot be: its mass properties stay straight
        about = _Point.about(c, *at, bodies=False)
        whole = about.made(block)
    if anew:
        c = _sloped(c, block, system.tolerances, library, sizes)
    straight = np.zeros_like(c.residual)
    for names, made in ((system.tolerances, c.tolerances), (c.own_names, c.own)):
        straight += np.array([about.sigmas.get(n, 0.0) for n in names]) @ made
    straight += weights_of(system, about.acting) @ c.effects
    return c.with_residual(block.white(block.residual - whole) + straight)


@dataclass(frozen=True, eq=False)
class _Point:
    """Where lines are drawn: what is asked for together.

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
    ) -> _Point:
        """Return where all is likeliest, the record's own unknowns beside what is fitted.

        As in `straightened`; mass properties are among it where `bodies` are.
        """
        c, weights = columns, weights_of(system, acting)
        known = dict(zip(system.tolerances, fitted.tolist(), strict=True))
        own = c.likeliest_own(c.residual - fitted @ c.tolerances - weights @ c.effects, form_error)
        offsets = dict(zip(c.own_names, np.clip(own, -FARTHEST, FARTHEST).tolist(), strict=True))
        trial, vehicle = block.trial, block.trial.maneuver.vehicle
        simulation = trial.nominal.simulation
        at = cls()
        added: dict[str, dict[str, float]] = {}

        def add(effect: str, parameter: str, size: float) -> None:
            of = added.setdefault(effect, {})
            of[parameter] = of.get(parameter, 0.0) + size

        for key, x in known.items():
            for name in _parameters(key, simulation, vehicle.effector_kinds):
                sigma = sizes.get(name, simulation.tolerances[name].sigma)
                at.departures[name] = at.departures.get(name, 0.0) + sigma * x
                at.sigmas[key] = x
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
                if route not in _MADE_TOGETHER or effect.stage == "command":
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
        nominal = block.trial.nominal
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

        What sensors did is taken back from the records themselves: motion without noise is known to a few per
        cent, and sharp data show a few per cent of a late channel.
        """
        before, there = block.trial.nominal, self.trial(block)
        moved = {n: there.positions[n] - x for n, x in before.positions.items()}
        whole = before.rows(there.predicted - before.predicted, moved)
        sensors = [one for one in self.effects if route_of(one[0], there.simulation) == "distort"]
        others = [one for one in self.effects if one not in sensors]
        made = block.transform(whole + change_together(others, there))
        if not (sensors or self.channels):
            return made
        if not (there.quick and there.carries):
            return made + block.transform(change_together(sensors, there, self.channels))
        logs = [change_together(sensors, t, self.channels) for t in block.recorded(there.simulation)]
        return made + np.mean([block.lines.transform(h) for h in logs], axis=0)


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


def _sloped(
    columns: Columns,
    block: Block,
    names: Sequence[str],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
) -> Columns:
    """Return columns of which tolerances and the record's own unknowns have the slopes of a block."""
    z = np.zeros_like(block.residual)
    stated, unknown = (of(block, library, sizes) for of in (tolerance_columns, record_columns))
    sigmas = np.array([stated.get(n, z) for n in names]) if names else columns.sigmas
    own = (
        np.array([unknown.get(n, z) for n in columns.own_names]) if columns.own_names else columns.sigmas[:0]
    )
    return columns.with_slopes(sigmas, block.white(sigmas), block.white(own))


def _parameters(key: str, simulation: Simulation, kinds: Mapping[str, str]) -> Iterator[str]:
    """Yield the simulation's own parameters that a tolerance moves: itself, or those of all of one make."""
    if key in simulation.tolerances:
        yield key
    elif key.startswith("every "):
        kind, _, what = key.removeprefix("every ").rpartition(".")
        each = [f"{n}.{what}" for n, k in kinds.items() if k == kind]
        if all(n in simulation.tolerances for n in each):
            yield from each


def likeliest_departures(
    system: System,
    blocks: Sequence[Block],
    sizes: Mapping[str, float],
    form_error: Form,
    weights: Array | None = None,
) -> tuple[dict[str, float], Array]:
    """Return the likeliest departures of the simulation's own parameters, and of all tolerances in sigmas.

    None beyond `FARTHEST`: where a large effect is not allowed for, tolerances are asked for what no
    simulation can do.
    """
    own = blocks[0].trial.simulation.tolerances
    system = replace(system, form_errors=(form_error,), _reduced={})
    beside = weights_of(system, _likeliest_alone(weigh(system))) if weights is None else weights
    fitted = system.likeliest_tolerances(system.tolerance_rows(form_error), beside)
    fitted = np.clip(fitted, -FARTHEST, FARTHEST)
    each = zip(system.tolerances, fitted.tolist(), strict=True)
    return {name: x * sizes.get(name, own[name].sigma) for name, x in each if name in own}, fitted


def _leading(evidence: Evidence) -> list[int]:
    """Return the places of the effects that lead where these are likelier than no effect."""
    candidates = evidence.system.candidates
    lead = {candidates[i].effect for i in likeliest(evidence)}
    return [i for i in np.flatnonzero(evidence.candidate > 0).tolist() if candidates[i].effect in lead]


def _likeliest_alone(evidence: Evidence) -> Acting:
    """Return the likeliest effect with its size, that of a tolerance among it; none where none is likely."""
    best = int(np.argmax(evidence.candidate)) if len(evidence.candidate) else -1
    if best < 0 or evidence.candidate[best] <= 0:
        return []
    return [(best, joint_estimates(evidence.system, [best])[0])]
