"""Candidate effects at finite size: where each may act, and what it makes of the stack there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from freqid.core.arrays import Complex
from freqid.core.errors import DataError, ImpossibleSettings
from freqid.core.vehicle import Vehicle
from freqid.gap.model.candidate import OTHER, Candidate, Curve, Place
from freqid.gap.model.changes import among, change, departures_of
from freqid.gap.model.following import time_constant
from freqid.gap.model.form import actuator_terms, load_terms
from freqid.gap.model.sizes import SMALLEST, about_zero, absurd, few_of, from_onset, proportional, seen
from freqid.gap.model.testable import in_force_of, untestable
from freqid.gap.model.tolerance import own_departures
from freqid.gap.simulation import side_by_side
from freqid.gap.stack.block import Block
from freqid.simulate.effects.effect import Effect, Parameter

_LARGEST = 10.0  # size that is looked at, of an effect's scale, within its physical range
_GRID = 33  # sizes of the prior, either sign
_VECTOR_SCALES = (0.3, 1.0, 3.0, 10.0)  # prior standard deviations of a vector, of each parameter's scale
_SHARES = (1.0, -1.0, 0.1, -0.1)  # of one sigma of a vector, of which what no body can be is passed over
_BEYOND = (3.0, 30.0)  # sigmas of an own parameter that is further off than it is stated to be
_OTHER_SCALES = (0.1, 0.3, 1.0)  # ... of free changes: share of each term; smaller ones are of form


def candidates(
    library: Mapping[str, Effect], blocks: Sequence[Block], known: Mapping[str, list[Candidate]] | None = None
) -> tuple[list[Candidate], dict[str, str]]:
    """Return all candidates that the records can tell anything of, and why others are not tested.

    Parameters
    ----------
    library : dict of Effect
    blocks : sequence of Block
    known : dict of list of Candidate, optional
        By effect, those that are not made again.

    Returns
    -------
    list of Candidate
        The last one is `OTHER`, where the simulation has terms.
    dict of str
        Reason by effect id.
    """
    vehicle = blocks[0].trial.maneuver.vehicle
    found: list[Candidate] = []
    not_tested: dict[str, str] = {}
    for effect in (e.of(vehicle) for e in library.values()):
        why = next(filter(None, (untestable(effect, b.trial) for b in blocks)), None)
        if why:
            not_tested[effect.id] = why
            continue
        made = known[effect.id] if known and effect.id in known else _of_effect(effect, vehicle, blocks)
        if not made:
            not_tested[effect.id] = "it changes nothing in these manoeuvres"
        found += made
    other = _other(blocks)
    return found + ([other] if other else []), not_tested


def _of_effect(effect: Effect, vehicle: Vehicle, blocks: Sequence[Block]) -> list[Candidate]:
    own = effect.id in blocks[0].trial.simulation.effects  # it has what stands for that in a replay
    free = {
        n: p for n, p in effect.parameters.items() if p.sought and p.scale > 0 and not (own and p.replay_only)
    }
    if effect.alternatives:
        shapes = {n: p for n, p in free.items() if p.looked_at}
        in_force = blocks[0].trial.simulation.effects.get(effect.id, {}).get(effect.size)
        free = {n: p for n, p in free.items() if n not in shapes}
        places = [Place(n, (n,), effectors=_effectors_of(n, vehicle)) for n in free]
        if effect.size in free and effect.stage != "sensor":  # at all places alike; sensors have no such size
            places[0] = Place("", (effect.size,))
        places += [
            Place(f"group {group.name}", group.effectors, effectors=group.effectors)
            for group in vehicle.groups
            if all(e in free for e in group.effectors)
        ]
        for name, parameter in () if in_force else shapes.items():  # what acts already keeps its shape
            places += [
                replace(p, label=f"{p.label} {name}={value:.4g}".strip(), fixed=((name, value),))
                for p in places
                if not p.fixed
                for value in _looked_at(parameter, p.effectors or tuple(free), blocks)
            ]
        return [c for p in places if (c := _scalar(effect, p, free[p.parameters[0]], blocks))]
    moving = {n: c for n, p in free.items() if (c := _scalar(effect, Place(n, (n,)), p, blocks))}
    if set(moving) <= {effect.size}:
        return _with_shapes(effect, free, moving, blocks)
    vectors = [v for names in _triples(moving) if (v := _vector(effect, names, moving))]
    return vectors if effect.together else [*moving.values(), *vectors]


def _with_shapes(
    effect: Effect, free: dict[str, Parameter], moving: dict[str, Candidate], blocks: Sequence[Block]
) -> list[Candidate]:
    """Return an effect of one size, with what else it has at its default and at a few other values."""
    size = effect.size
    if size not in free:  # its scale is zero: it is taken as known
        return []
    found = [replace(c, place=Place("", (size,))) for c in moving.values()]
    for name, parameter in free.items():
        if name == size:
            continue
        two_sigma = (parameter.default - 2 * parameter.scale, parameter.default + 2 * parameter.scale)
        values = parameter.looked_at or tuple(np.clip(two_sigma, parameter.low, parameter.high).tolist())
        for value in values:
            if value != parameter.default:
                place = Place(f"{name}={value:.4g}", (size,), ((name, value),))
                made = _scalar(effect, place, free[size], blocks)
                found += [made] if made else []
    return found


def _looked_at(parameter: Parameter, effectors: Sequence[str], blocks: Sequence[Block]) -> tuple[float, ...]:
    """Return the values of a parameter beside its default at which an effect's size is looked for."""
    if not parameter.follows:
        return parameter.looked_at
    times = [time_constant(b.drawn, n) for b in blocks for n in effectors if n in b.drawn.positions]
    return (float(np.median(times)),) if times else parameter.looked_at


def _effectors_of(name: str, vehicle: Vehicle) -> tuple[str, ...]:
    kinds = vehicle.effector_kinds
    return (name,) if name in kinds else tuple(n for n, kind in kinds.items() if kind == name)


def _triples(moving: Mapping[str, Candidate]) -> list[tuple[str, ...]]:
    """Return parameters that are the components of one vector: all, or those of one stem ``imu_x imu_y``."""
    stems: dict[str, list[str]] = {}
    for name in moving:
        stem, _, tail = name.rpartition("_")
        stems.setdefault(stem if len(tail) == 1 else "", []).append(name)
    return [tuple(names) for names in stems.values() if len(names) > 1]


def _vector(effect: Effect, names: tuple[str, ...], moving: Mapping[str, Candidate]) -> Candidate | None:
    each = [moving[n] for n in names]
    sigma = np.array([effect.parameters[n].scale for n in names])
    columns = []
    for b in range(len(each[0].columns)):
        unit = [np.tensordot(c.weights(s), c.columns[b], 1) for c, s in zip(each, sigma, strict=True)]
        columns.append(np.array(unit))
    label = names[0].rpartition("_")[0] or "all"
    # a standard deviation of half the physical range is the widest that makes sense
    widest = min(min(-c.bounds[0], c.bounds[1]) / (2 * s) for c, s in zip(each, sigma, strict=True))
    prior = np.array([t for t in _VECTOR_SCALES if t <= widest] or [widest])
    units = tuple(effect.parameters[n].unit for n in names)
    return Candidate(effect.id, Place(label, names), "vector", sigma, prior, columns, units=units)


def _scalar(effect: Effect, place: Place, of: Parameter, blocks: Sequence[Block]) -> Candidate | None:
    """Return an effect of one size, or None where it changes nothing."""
    force = {n: in_force_of(effect, blocks[0].trial.simulation)[n] for n in place.parameters}

    def at(size: float) -> list[Complex] | None:
        settings = place.settings(force, size)
        try:
            made = side_by_side(
                blocks[0].trial.simulation,
                lambda b: b.transform(change(effect, b.drawn, settings, first_order=True)),
                blocks,
            )
        except ImpossibleSettings:
            return None
        return None if absurd(made, blocks) else made

    start = max(force.values())
    low, high = of.low - min(force.values()), of.high - start
    up, down = min(high, _LARGEST * of.scale), max(low, -_LARGEST * of.scale)
    if effect.sizes:  # those of a limit or of play are looked for where it acts
        made = from_onset(at, [s for s in effect.sizes if low <= s <= high], blocks)
    else:
        made = [one for one in about_zero(at, up, down, of.scale) if seen(one[1], blocks)]
    if not made:
        return None
    made.sort(key=lambda one: one[0])
    for _, c in made:
        if not all(np.isfinite(z).all() for z in c):
            raise DataError(f"effect '{effect.id}' makes a change that is not finite")
    straight = proportional(made, blocks)
    columns = [made[straight]] if straight is not None else made
    smallest = SMALLEST * of.scale if not effect.sizes else min(effect.sizes) / 2
    prior = np.concatenate(
        [
            np.sign(end) * np.geomspace(min(smallest, abs(end) / 4), abs(end), _GRID)
            for end in ((max(effect.sizes),) if effect.sizes else (up, down))
            if end
        ]
    )
    sizes = np.array([s for s, _ in columns])
    each = [np.array([c[b] for _, c in columns]) for b in range(len(blocks))]
    few, mix = few_of(each, blocks)
    curve = Curve(sizes, mix) if len(few) < sizes.size else None
    values = {**in_force_of(effect, blocks[0].trial.simulation), **place.settings(force, 1.0)}
    return Candidate(
        effect.id,
        place,
        "scalar",
        sizes[few],
        np.sort(prior),
        [z[few] for z in each],
        of.unit,
        (low, high),
        curve,
        departs=departures_of(effect, values, blocks[0].trial.simulation),
    )


def beyond_tolerance(
    blocks: Sequence[Block], stated: Sequence[Mapping[str, Complex]], sizes: Mapping[str, float]
) -> list[Candidate]:
    """Return the simulation's own parameters, further off than they are stated to be, as places of `OTHER`.

    Parameters
    ----------
    blocks : sequence of Block
    stated : sequence of dict of ndarray of complex, shape (row, line)
        By block, what one sigma of each tolerance makes.
    sizes : dict of float
        One sigma by name, where it is not that of the simulation.
    """
    made, own = [], own_departures(blocks[0].trial, sizes)
    for name, tolerance in blocks[0].trial.simulation.tolerances.items():
        sigma = own[name][name]
        columns = [s[name][None] for s in stated if name in s]
        if not sigma or len(columns) < len(blocks) or not seen([z[0] for z in columns], blocks):
            continue
        beyond = sigma * np.geomspace(*_BEYOND, _GRID)
        below = beyond[beyond < 1.0] if tolerance.unit == "1" else beyond  # no share falls by more than all
        prior = np.concatenate([-below[::-1], beyond])
        place = Place(name, (name,))
        made.append(Candidate(OTHER, place, "scalar", np.array([sigma]), prior, columns, tolerance.unit))
    return made


def recomputed(
    candidate: Candidate,
    library: Mapping[str, Effect],
    blocks: Sequence[Block],
    *,
    first_order: bool = False,
) -> list[Complex]:
    """Return a candidate's columns on other blocks, shape (column, row, line) each; as in `change`."""
    c = candidate
    if c.effect == OTHER:  # its free changes: what its own parameters make are slopes of their tolerances
        return [_free_changes(b, c.place.parameters) for b in blocks]
    vehicle = blocks[0].trial.maneuver.vehicle
    effect = library[c.effect].of(vehicle)
    before, after = ([(library[n].of(vehicle), x) for n, x in some] for some in (c.beside, c.after))
    found = []
    for block in blocks:
        force = in_force_of(effect, block.trial.simulation)
        trials = among(before, after, c.about, block.drawn)
        made = []
        for k in range(c.sizes.size):
            if c.kind == "scalar":
                at = partial(c.place.settings, force)
                changed = trials.change(effect, at, float(c.sizes[k]), first_order=first_order)
                made.append(block.transform(changed))
                continue
            for share in _SHARES:
                try:
                    sizes = c.settings(k, force, share)
                    moved = change(effect, trials.before, sizes, first_order=first_order)
                    made.append(block.transform(moved) / share)
                    break
                except ImpossibleSettings:
                    if share == _SHARES[-1]:
                        raise
        found.append(np.array(made))
    return found


def _free_changes(block: Block, labels: Sequence[str]) -> Complex:
    """Return the columns of `OTHER` on one block in the order of some labels; zero where it has none."""
    own = _other([block])
    known = dict(zip(own.place.parameters, own.columns[0], strict=True)) if own else {}
    none = np.zeros((len(block.rows), block.lines.hz.size), dtype=complex)
    return np.array([known.get(n, none) for n in labels])


def _other(blocks: Sequence[Block]) -> Candidate | None:
    """Return free changes of every term of the simulation; those of actuators in and out of phase."""
    names: list[tuple[str, int]] = []
    columns: list[Complex] = []
    for block in blocks:
        kinds = [r.kind for r in block.rows]
        made, keys, place = [], [], dict[int, int]()
        for i, _, spectrum in [*load_terms(block), *actuator_terms(block)]:
            place[i] = place.get(i, -1) + 1
            for phase in (1, 1j) if kinds[i] == "actuator" else (1,):
                z = np.zeros((len(block.rows), block.lines.hz.size), dtype=complex)
                z[i] = phase * spectrum
                made.append(z)
                keys.append((f"{block.rows[i].name}{'' if phase == 1 else ' out of phase'}", place[i]))
        if columns and keys != names:
            common = [k for k in names if k in keys]
            columns = [c[[names.index(k) for k in common]] for c in columns]
            made = [made[keys.index(k)] for k in common]
            keys = common
        names = keys
        shape = (0, len(block.rows), block.lines.hz.size)
        columns.append(np.array(made) if made else np.zeros(shape, dtype=complex))
    if not names:
        return None
    labels = tuple(f"{row}:{k}" for row, k in names)
    sigma = np.ones(len(labels))
    return Candidate(OTHER, Place("", labels), "vector", sigma, np.array(_OTHER_SCALES), columns)
