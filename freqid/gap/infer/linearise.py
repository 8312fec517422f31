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
from freqid.gap.departed import Departed
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.columns import Columns
from freqid.gap.infer.evidence import Estimate, estimate, weigh, weights_of
from freqid.gap.infer.system import System
from freqid.gap.model.candidate import OTHER
from freqid.gap.model.changes import as_moved, change_together
from freqid.gap.model.testable import in_force_of, route_of
from freqid.gap.model.tolerance import of_effects, offsets_of, record_columns, tolerance_columns
from freqid.gap.settings import FARTHEST, INTERVAL, MOST_ROUNDS, SETTLED
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
) -> tuple[System, list[Columns]]:
    """Return a system whose lines are right where all that is unknown is likeliest.

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
    if acting is None:
        acting = _likeliest_alone(replace(system, form_errors=(form_error,), _reduced={}))
    weights = weights_of(system, acting)
    fitted = likeliest_departures(system, blocks, sizes, form_error, weights)[1]

    def there(pair: tuple[Columns, Block]) -> Columns:
        return straightened(*pair, system, fitted, acting, library, sizes, form_error, anew=anew)

    pairs = list(zip(columns, blocks, strict=True))
    new = side_by_side(blocks[0].trial.simulation, there, pairs)
    return replace(system, blocks=[c.matrices for c in new], _reduced={}), new


def settled(
    system: System,
    columns: Sequence[Columns],
    blocks: Sequence[Block],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
    form_error: Form,
    acting: Acting | None = None,
) -> tuple[System, list[Columns]]:
    """Return a system whose lines are drawn anew until the data are no likelier by another round.

    Two explanations are compared where both have settled, for each round may gain as much as an effect does.
    As in `relinearised`.
    """
    last, columns = -np.inf, list(columns)
    for _ in range(MOST_ROUNDS):
        system, columns = relinearised(system, columns, blocks, library, sizes, form_error, acting, anew=True)
        here = _log_evidence(replace(system, form_errors=(form_error,), _reduced={}), acting)
        if here - last < SETTLED:
            break
        last = here
    return system, columns


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
    if not _likeliest_alone(replace(system, form_errors=(form_error,), _reduced={})):
        return 0.0
    parts = [replace(c, effects=c.effects[:0]) for c in columns]
    few = [c.matrices for c in parts]
    alone = System([], system.tolerances, few, system.form_errors)
    before = weigh(alone).log_none
    alone, _ = settled(alone, parts, blocks, library, sizes, form_error, [])
    return max(weigh(alone).log_none - before, 0.0)


def _log_evidence(system: System, acting: Acting | None) -> float:
    """Return the log evidence of what acts, at one error of form; of the likeliest effect where absent."""
    acting = _likeliest_alone(system) if acting is None else acting
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
        As in `relinearised`.
    """
    c, weights = columns, weights_of(system, acting)
    known = dict(zip(system.tolerances, fitted.tolist(), strict=True))

    own = c.likeliest_own(c.residual - fitted @ c.tolerances - weights @ c.effects, form_error)
    unknown = dict(zip(c.own_names, np.clip(own, -FARTHEST, FARTHEST).tolist(), strict=True))
    about = _Point.of(block, known, unknown, acting, library, sizes)
    if anew:
        there = replace(block, trial=about.moved(block))
        c = _sloped(c, there, system.tolerances, library, sizes)
    try:
        whole = about.made(block)
    except ImpossibleSettings:  # a fit may ask for a body that cannot be: its mass properties stay straight
        about = _Point.of(block, known, unknown, acting, library, sizes, bodies=False)
        whole = about.made(block)
    straight = np.zeros_like(c.residual)
    for names, sigmas, made in ((system.tolerances, known, c.tolerances), (c.own_names, unknown, c.own)):
        held = np.array([sigmas[n] if n in about.names else 0.0 for n in names])
        straight += held @ made
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
    channels : dict of float
        Offsets of effectors' channels.
    names : set of str
        Tolerances and own unknowns of the record that are among these.
    acting : list of (int, Estimate)
        Effects that are.
    """

    departures: dict[str, float] = field(default_factory=dict)
    own: dict[str, dict[str, float]] = field(default_factory=dict)
    effects: list[tuple[Effect, dict[str, float]]] = field(default_factory=list)
    channels: dict[str, float] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)
    acting: list[tuple[int, Estimate]] = field(default_factory=list)

    @classmethod
    def of(
        cls,
        block: Block,
        known: Mapping[str, float],
        offsets: Mapping[str, float],
        acting: Acting,
        library: Mapping[str, Effect],
        sizes: Mapping[str, float],
        *,
        bodies: bool = True,
    ) -> _Point:
        """Return where tolerances and offsets, in sigmas by name, and effects are; `bodies` too or not."""
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
                at.names.add(key)
        for key, effect, name, size in of_effects(trial, library, sizes):
            if known.get(key) and (bodies or effect.load is None):
                add(effect.id, name, size * known[key])
                at.names.add(key)
        settings, channels = offsets_of(offsets, block, sizes)
        at.channels.update(channels)
        at.names.update(n for n in offsets if n.startswith("offset."))
        for effect_id, values in settings.items():
            for name, x in values.items():
                add(effect_id, name, x)
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
                if route == "distort" and trial.carries:  # an explanation's trial has it taken back
                    continue
                force = in_force_of(effect, simulation)
                for name, value in c.place.settings(force, e.size).items():
                    add(effect.id, name, value - force[name])
            else:
                continue
            at.acting.append((i, e))
        for effect_id, values in added.items():
            effect = library[effect_id].of(vehicle)
            force = in_force_of(effect, simulation)
            moved = {n: force[n] + x for n, x in values.items()}
            if route_of(effect, simulation) == "own" and effect.stage != "command":
                at.own[effect_id] = {**force, **moved}
            else:
                at.effects.append((effect, moved))
        return at

    def trial(self, block: Block) -> Trial:
        """Return a block's trial on the simulation as it is there."""
        nominal = block.trial.nominal
        if not (self.departures or self.own):
            return nominal
        return nominal.asked_of(cast(Simulation, Departed(nominal.simulation, self.departures, self.own)))

    def moved(self, block: Block) -> Trial:
        """Return the same on the motion as it was, not as sensors saw it."""
        there = self.trial(block)
        record = as_moved(self.effects, there, self.channels)
        return there if record is there.maneuver.record else there.flown_as(record)

    def made(self, block: Block) -> Complex:
        """Return what all of it makes of a block's residual together, shape (row, line)."""
        before, there = block.trial.nominal, self.trial(block)
        moved = {n: there.positions[n] - x for n, x in before.positions.items()}
        whole = before.rows(there.predicted - before.predicted, moved)
        return block.transform(whole + change_together(self.effects, there, self.channels))


def _sloped(
    columns: Columns,
    block: Block,
    names: Sequence[str],
    library: Mapping[str, Effect],
    sizes: Mapping[str, float],
) -> Columns:
    """Return columns of which tolerances and the record's own unknowns have the slopes of a block's trial."""
    z = np.zeros_like(block.residual)
    stated, unknown = (of(block, library, sizes) for of in (tolerance_columns, record_columns))
    sigmas = np.array([stated.get(n, z) for n in names]) if names else columns.sigmas
    own = (
        np.array([unknown.get(n, z) for n in columns.own_names]) if columns.own_names else columns.sigmas[:0]
    )
    return replace(columns, tolerances=block.white(sigmas), sigmas=sigmas, own=block.white(own))


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
    beside = weights_of(system, _likeliest_alone(system)) if weights is None else weights
    fitted = system.likeliest_tolerances(system.tolerance_rows(form_error), beside)
    fitted = np.clip(fitted, -FARTHEST, FARTHEST)
    each = zip(system.tolerances, fitted.tolist(), strict=True)
    return {name: x * sizes.get(name, own[name].sigma) for name, x in each if name in own}, fitted


def _likeliest_alone(system: System) -> Acting:
    """Return the likeliest effect with its size; none where none is likely."""
    evidence = weigh(system)
    best = int(np.argmax(evidence.candidate)) if len(evidence.candidate) else -1
    if best < 0 or evidence.candidate[best] <= 0:
        return []
    return [(best, estimate(evidence, best, INTERVAL))]
