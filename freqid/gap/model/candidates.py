"""Candidate effects at finite size: where each may act, and what it makes of the stack there."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf
from typing import Literal, NamedTuple

import numpy as np
from scipy.linalg import qr

from freqid.core.arrays import Array, Complex
from freqid.core.errors import DataError, ImpossibleSettings
from freqid.core.vehicle import Vehicle
from freqid.gap.model.changes import beside, change
from freqid.gap.model.form import actuator_terms, load_terms
from freqid.gap.model.testable import in_force_of, untestable
from freqid.gap.simulation import side_by_side
from freqid.gap.stack.block import Block
from freqid.simulate.effects.effect import Effect, Parameter

OTHER = "other"
"""Free changes of the simulation's terms: what no effect of the library explains."""

_SMALLEST, _LARGEST = (
    1 / 16,
    10.0,
)  # sizes that are looked at, of an effect's scale, within its physical range
_STRAIGHT = 0.03  # departure from proportionality, of the change at the largest size, that counts as none
_BENT = 0.1  # ... of the change half way between two sizes, from which more sizes are taken between them
_DEPTH = 3  # times that a distance between sizes is halved at most
_SIZES = 7  # at which an effect that is not proportional is computed, either sign
_SEEN = 1e-3  # of energy over noise, below which a change at its largest size is none
_SAME = 1e-3  # of the strongest change: what is left of another beyond a sum of those kept
_NO_ANSWER = 1e8  # standard deviations of the noise: no load that flew is as large
_UNSEEN = 0.03  # ... in standard deviations of the noise
_GRID = 33  # sizes of the prior, either sign
_VECTOR_SCALES = (0.3, 1.0, 3.0, 10.0)  # prior standard deviations of a vector, of each parameter's scale
_SHARES = (1.0, -1.0, 0.1, -0.1)  # of one sigma of a vector, of which what no body can be is passed over
_OTHER_SCALES = (0.1, 0.3, 1.0)  # ... of free changes: share of each term; smaller ones are of form


@dataclass(frozen=True)
class Place:
    """Where an effect may act, or what else is given about it.

    Attributes
    ----------
    label : str
        ``de1``, ``group v_tail``, ``onset=0.2``; empty where there is one place only.
    parameters : tuple of str
        That are moved: all by the same size, or each by its own in a vector.
    fixed : tuple of (str, float)
        Other parameters that are not at their default.
    effectors : tuple of str
        That it is at; empty where it is not at effectors.
    """

    label: str
    parameters: tuple[str, ...]
    fixed: tuple[tuple[str, float], ...] = ()
    effectors: tuple[str, ...] = ()


class Curve(NamedTuple):
    """Changes at many sizes as sums of those at a few.

    Attributes
    ----------
    sizes : ndarray, shape (size,)
        Ascending, zero not among them.
    mix : ndarray, shape (size, column)
        What the change at each size is made of.
    """

    sizes: Array
    mix: Array


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect at one place.

    Attributes
    ----------
    effect : str
    place : Place
    kind : {"scalar", "vector"}
    sizes : ndarray, shape (column,)
        Of a scalar: the sizes of its columns, ascending, zero not among them; of a vector: one sigma each.
    prior : ndarray
        Of a scalar: sizes that are equally likely; of a vector: multiples of `sizes` that are.
    columns : list of ndarray of complex, shape (column, row, line)
        By block: of a scalar, the change at each size; of a vector, by one sigma of each parameter.
    unit : str
        Of sizes.
    units : tuple of str
        Of a vector, by parameter.
    bounds : tuple of 2 floats
        Physical range of the size.
    curve : Curve, optional
        Of a scalar whose change was computed at more sizes than it has columns: the columns are those of
        which all others are sums.
    beside : tuple of (str, dict of float)
        Effects that were in force where it was computed, with their parameters, in order.
    """

    effect: str
    place: Place
    kind: Literal["scalar", "vector"]
    sizes: Array
    prior: Array
    columns: list[Complex]
    unit: str = "1"
    bounds: tuple[float, float] = (-inf, inf)
    curve: Curve | None = None
    units: tuple[str, ...] = ()
    beside: tuple[tuple[str, dict[str, float]], ...] = ()

    @property
    def name(self) -> str:
        """``effect`` or ``effect@place``."""
        return f"{self.effect}@{self.place.label}" if self.place.label else self.effect

    def weights(self, size: float | Array) -> Array:
        """Return the weights of a scalar's columns at a size: straight between sizes, and to zero.

        Shape (column,), or (size, column) at several sizes.
        """
        weights = _straight(self.sizes if self.curve is None else self.curve.sizes, np.atleast_1d(size))
        weights = weights if self.curve is None else weights @ self.curve.mix
        return weights if np.ndim(size) else weights[0]

    def settings(self, size: float | Array) -> dict[str, float]:
        """Return the effect's parameters at a size, as departures from their values in force."""
        values = np.broadcast_to(np.asarray(size, dtype=float), (len(self.place.parameters),))
        return dict(zip(self.place.parameters, values.tolist(), strict=True)) | dict(self.place.fixed)


def _straight(sizes: Array, wanted: Array) -> Array:
    """Return the weights of the changes at some sizes in those at others, shape (wanted, size)."""
    weights = np.zeros((wanted.size, sizes.size))
    for sign in (-1, 1):
        mine, same = np.flatnonzero(np.sign(wanted) == sign), np.flatnonzero(np.sign(sizes) == sign)
        if same.size == 0:  # proportional, or nothing is known on that side
            weights[mine, 0] = wanted[mine] / sizes[0]
            continue
        order = same[np.argsort(np.abs(sizes[same]))]
        at, x = np.abs(sizes[order]), np.abs(wanted[mine])
        for k, column in enumerate(np.eye(at.size)):
            weights[mine, order[k]] = np.interp(x, [0.0, *at], [0.0, *column])
        beyond = x > at[-1]
        weights[mine[beyond], order[-1]] = x[beyond] / at[-1]
    return weights


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
    free = {n: p for n, p in effect.parameters.items() if p.scale > 0 and not (own and p.replay_only)}
    if effect.alternatives:
        shapes = [(n, x) for n, p in free.items() for x in p.looked_at]
        free = {n: p for n, p in free.items() if not p.looked_at}
        places = [Place(n, (n,), effectors=_effectors_of(n, vehicle)) for n in free]
        first = next(iter(free), "")
        places = [Place("", (first,)) if p.label == first and first == effect.size else p for p in places]
        for group in vehicle.groups:
            if all(e in free for e in group.effectors):
                places.append(Place(f"group {group.name}", group.effectors, effectors=group.effectors))
        for name, value in shapes:
            given = f"{name}={value:.4g}"
            places += [
                replace(p, label=f"{p.label} {given}".strip(), fixed=((name, value),))
                for p in places
                if not p.fixed
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
    found = [_placed(c, Place("", (size,))) for c in moving.values()]
    for name, parameter in free.items():
        if name == size:
            continue
        beside = (parameter.default - 2 * parameter.scale, parameter.default + 2 * parameter.scale)
        values = parameter.looked_at or tuple(np.clip(beside, parameter.low, parameter.high).tolist())
        for value in values:
            if value != parameter.default:
                place = Place(f"{name}={value:.4g}", (size,), ((name, value),))
                made = _scalar(effect, place, free[size], blocks)
                found += [made] if made else []
    return found


def _placed(candidate: Candidate, place: Place) -> Candidate:
    c = candidate
    return Candidate(c.effect, place, c.kind, c.sizes, c.prior, c.columns, c.unit, c.bounds, c.curve)


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
        settings = {n: force[n] + size for n in place.parameters} | dict(place.fixed)
        try:
            made = side_by_side(
                blocks[0].trial.simulation,
                lambda b: b.transform(change(effect, b.trial, settings, first_order=True)),
                blocks,
            )
        except ImpossibleSettings:
            return None
        return None if _absurd(made, blocks) else made

    start = max(force.values())
    low, high = of.low - min(force.values()), of.high - start
    up, down = min(high, _LARGEST * of.scale), max(low, -_LARGEST * of.scale)
    if effect.sizes:  # those of a limit or of play are looked for where it acts
        made = _from_onset(at, [s for s in effect.sizes if low <= s <= high], blocks)
    else:
        made = [one for one in _made(at, up, down, of.scale) if seen(one[1], blocks)]
    if not made:
        return None
    made.sort(key=lambda one: one[0])
    for _, c in made:
        if not all(np.isfinite(z).all() for z in c):
            raise DataError(f"effect '{effect.id}' makes a change that is not finite")
    straight = _proportional(made, blocks)
    columns = [made[straight]] if straight is not None else made
    smallest = _SMALLEST * of.scale if not effect.sizes else min(effect.sizes) / 2
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
    )


def few_of(columns: Sequence[Complex], blocks: Sequence[Block]) -> tuple[list[int], Array]:
    """Return which columns, by block of shape (column, row, line), all are sums of, and these sums.

    By a pivoted QR decomposition in the metric of the noise (G. H. Golub, C. F. Van Loan, Matrix
    Computations, 4th ed., section 5.4): as a delay grows its change moves in a few directions only.

    Returns
    -------
    few : list of int
        Ascending.
    mix : ndarray, shape (column, kept)
    """
    white = [(z / np.sqrt(b.noise_power)).reshape(len(z), -1) for z, b in zip(columns, blocks, strict=True)]
    stacked = np.concatenate([part for z in white for part in (z.real, z.imag)], axis=1)
    r, pivot = qr(stacked.T, mode="r", pivoting=True, check_finite=False)
    size = np.abs(np.diag(r))
    count = max(int((size > max(_SAME * size[0], _UNSEEN)).sum()), 1)
    mix = np.zeros((len(stacked), count))
    mix[pivot] = np.concatenate([np.eye(count), np.linalg.solve(r[:count, :count], r[:count, count:]).T])
    order = np.argsort(pivot[:count])
    return [int(k) for k in pivot[:count][order]], mix[:, order]


def seen(change: Sequence[Complex], blocks: Sequence[Block]) -> bool:
    """Return whether a change, by block, stands out of the noise at all."""
    powers = (np.abs(z) ** 2 / b.noise_power for z, b in zip(change, blocks, strict=True))
    return sum(float(p.sum()) for p in powers) > _SEEN


def _absurd(change: Sequence[Complex], blocks: Sequence[Block]) -> bool:
    """Return whether a simulation was asked so far from what it was made for that its answer means nothing.

    Polynomials without bounds say 1e187 N in a tail wind that is as fast as the aircraft.
    """
    powers = (np.abs(z) / np.sqrt(b.noise_power) for z, b in zip(change, blocks, strict=True))
    return any(float(p.max(initial=0.0)) > _NO_ANSWER for p in powers)


def _from_onset(
    at: Callable, sizes: Sequence[float], blocks: Sequence[Block]
) -> list[tuple[float, list[Complex]]]:
    """Return the change at ascending sizes from the largest on that does nothing, as a limit has one.

    Straight lines to zero would give a limit an effect where it is never reached.
    """
    every = [(s, c) for s in sizes if (c := at(s))]
    first = next((k for k, (_, c) in enumerate(every) if seen(c, blocks)), None)
    if first is None:
        return []
    found = every[max(first - 1, 0) :]
    return found + [one for a, b in pairwise(found) for one in _between(at, a, b)]


def _made(at: Callable, up: float, down: float, scale: float) -> list[tuple[float, list[Complex]]]:
    """Return the change at a small size and at both ends, and at more where it is not proportional."""
    ends = [end for end in (up, down) if end]
    near = np.sign(ends[0]) * min(scale / 2, abs(ends[0]) / 2)
    found = [(s, c) for s, c in [(near, at(float(near))), *(_farthest(at, end, near) for end in ends)] if c]
    if len(found) < 2 or found[0][0] != near:
        return found
    for end, last in found[1:]:
        energy = sum(float((np.abs(z) ** 2).sum()) for z in last)
        apart = sum(
            float((np.abs(b - a * (end / near)) ** 2).sum()) for a, b in zip(found[0][1], last, strict=True)
        )
        if apart > _STRAIGHT**2 * energy:
            inner = np.sign(end) * np.geomspace(_SMALLEST * 4 * scale, abs(end), _SIZES)[:-1]
            more = [(float(s), c) for s in inner if abs(s - near) > 0.1 * scale and (c := at(float(s)))]
            found += more
            outwards = sorted([(end, last), *more], key=lambda one: -abs(one[0]))
            for outer, next_ in pairwise(outwards):  # the inner ones are closer together
                between = _between(at, outer, next_)
                found += between
                if len(between) < 2:
                    break
    return found


def _farthest(at: Callable, end: float, near: float) -> tuple[float, list[Complex] | None]:
    """Return the change at a largest size, or at a half of it, and so on, where there can be none."""
    size = end
    while (made := at(float(size))) is None and abs(size) > 2 * abs(near):
        size /= 2
    return size, made


def _between(
    at: Callable, one: tuple[float, list[Complex]], other: tuple[float, list[Complex]], depth: int = 0
) -> list[tuple[float, list[Complex]]]:
    """Return the change at sizes between two, so many that straight lines between them are near enough.

    A delay turns the phase: half way between two that are far apart it is not their mean.
    """
    size = (one[0] + other[0]) / 2
    made = at(size)
    if not made:
        return []
    energy = sum(float((np.abs(z) ** 2).sum()) for z in made)
    ends = zip(made, one[1], other[1], strict=True)
    apart = sum(float((np.abs(z - (a + b) / 2) ** 2).sum()) for z, a, b in ends)
    middle = (size, made)
    if depth == _DEPTH or apart < _BENT**2 * energy:
        return [middle]
    return [
        middle,
        *_between(at, one, middle, depth + 1),
        *_between(at, middle, other, depth + 1),
    ]


def _proportional(made: Sequence[tuple[float, list[Complex]]], blocks: Sequence[Block]) -> int | None:
    """Return the column that all others are multiples of, seen in the metric of the noise, or None."""
    first = min(range(len(made)), key=lambda k: abs(made[k][0]))
    unit = [z / made[first][0] for z in made[first][1]]
    for size, columns in made:
        apart = [
            (z - size * u) / np.sqrt(b.noise_power) for z, u, b in zip(columns, unit, blocks, strict=True)
        ]
        whole = [z / np.sqrt(b.noise_power) for z, b in zip(columns, blocks, strict=True)]
        if sum((np.abs(z) ** 2).sum() for z in apart) > _STRAIGHT**2 * sum(
            (np.abs(z) ** 2).sum() for z in whole
        ):
            return None
    return first


def recomputed(candidate: Candidate, library: Mapping[str, Effect], blocks: Sequence[Block]) -> list[Complex]:
    """Return a candidate's columns on other blocks, shape (column, row, line) each."""
    c = candidate
    if c.effect == OTHER:
        return [_free_changes(b, c.place.parameters) for b in blocks]
    vehicle = blocks[0].trial.maneuver.vehicle
    effect, others = library[c.effect].of(vehicle), [(library[n].of(vehicle), x) for n, x in c.beside]
    found = []
    for block in blocks:
        force = in_force_of(effect, block.trial.simulation)
        trial = beside(others, block.trial)
        made = []
        for k, size in enumerate(c.sizes):
            moved = c.place.parameters if c.kind == "scalar" else c.place.parameters[k : k + 1]
            fixed = dict(c.place.fixed)
            for share in (1.0,) if c.kind == "scalar" else _SHARES:
                settings = {n: force[n] + share * size for n in moved} | fixed
                try:
                    made.append(block.transform(change(effect, trial, settings)) / share)
                    break
                except ImpossibleSettings:
                    if c.kind == "scalar" or share == _SHARES[-1]:
                        raise
        found.append(np.array(made))
    return found


def _free_changes(block: Block, labels: Sequence[str]) -> Complex:
    """Return the columns of `OTHER` on one block in the order of some labels; zero where it has none."""
    own = _other([block])
    shape = (len(labels), len(block.rows), block.lines.hz.size)
    z = np.zeros(shape, dtype=complex)
    if own:
        for k, label in enumerate(labels):
            if label in own.place.parameters:
                z[k] = own.columns[0][own.place.parameters.index(label)]
    return z


def _other(blocks: Sequence[Block]) -> Candidate | None:
    """Return free changes of every term of the simulation; those of actuators in and out of phase."""
    names: list[tuple[str, int]] = []
    columns: list[Complex] = []
    for block in blocks:
        kinds = [r.kind for r in block.rows]
        made, keys, seen = [], [], dict[int, int]()
        for i, _, spectrum in [*load_terms(block), *actuator_terms(block)]:
            seen[i] = seen.get(i, -1) + 1
            for phase in (1, 1j) if kinds[i] == "actuator" else (1,):
                z = np.zeros((len(block.rows), block.lines.hz.size), dtype=complex)
                z[i] = phase * spectrum
                made.append(z)
                keys.append((f"{block.rows[i].name}{'' if phase == 1 else ' out of phase'}", seen[i]))
        if names and keys != names:
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
