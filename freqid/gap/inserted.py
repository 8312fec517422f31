"""Candidate effects put into the simulation along flown trajectories, at sizes of a stated detectability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import FreqidError
from freqid.gap.compare import Compared
from freqid.gap.evidence import Evidence, everywhere
from freqid.gap.gather import evidence_of
from freqid.gap.signature import GIVEN, made
from freqid.gap.testable import in_force_of
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

PLACES = 4  # of one effect that are tried
FAR = 100.0
"""Times the size that is expected of a parameter: beyond it nothing is inserted."""

_ROUNDS = 4  # in which a size is found
_CLOSE = 0.25  # of the logarithm of a detectability that is good enough: what is left is linear
_COLUMN = "inserted/"


@dataclass(frozen=True)
class Place:
    """A parameter by which an effect is inserted.

    Attributes
    ----------
    effect : str
    name : str
        Of the signature's column, without the effect: ``size`` or ``size|other=value``.
    sign : int
        Of the change.
    gain : float
        Detectability of a unit's change, to first order.
    expected : float
        Size expected before any data.
    largest : float
        That the parameter's range allows, or that is plausible at all.
    """

    effect: str
    name: str
    sign: int
    gain: float
    expected: float
    largest: float

    @property
    def column(self) -> str:
        """Of its signature."""
        return f"{self.effect}:{self.name}"


@dataclass(frozen=True, eq=False)
class Insertion:
    """An effect at one place and size.

    Attributes
    ----------
    place : Place
    size : float
        Change of the parameter, without sign.
    column : str
        Of the evidence that it was added to.
    detectability : float
        ``s^T S^-1 s``.
    """

    place: Place
    size: float
    column: str
    detectability: float


@dataclass(frozen=True, eq=False)
class Inserted:
    """Insertions with the evidence that holds them as columns beside signatures.

    Attributes
    ----------
    evidence : Evidence
    insertions : tuple of Insertion
        By place, then size.
    failed : dict of str
        Why an effect could not be inserted.
    """

    evidence: Evidence
    insertions: tuple[Insertion, ...]
    failed: dict[str, str] = field(default_factory=dict)


def places(
    library: Mapping[str, Effect], evidence: Evidence, compared: Sequence[Compared], told: Sequence[str] = ()
) -> list[Place]:
    """Return where each effect is inserted: at most `PLACES` parameters, from the best to the least seen.

    Parameters
    ----------
    library : dict of Effect
        With the parameters that they have on the vehicle.
    evidence : Evidence
    compared : sequence of Compared
    told : sequence of str
        Columns that must be among them.
    """
    found = []
    for effect in library.values():
        known = []
        for column in evidence.signatures:
            owner, _, name = column.partition(":")
            at = evidence.column(column)
            gain = float(evidence.metric[at, at])
            if owner != effect.id or gain < 1e-12 or not everywhere(name):
                continue
            own, _, given = name.partition(GIVEN)
            if given.startswith(f"{own}=") and any(p.name.partition(GIVEN)[0] == own for p in known):
                continue  # the same parameter at another size
            parameter = effect.parameters[own]
            force = in_force_of(effect, compared[0].trial.simulation)[own]
            up, down = parameter.high - force, force - parameter.low
            sign = -1 if down > 0.9 * up and (len(known) % 2 or up <= 0) else 1
            largest = min(up if sign > 0 else down, FAR * parameter.scale)
            known.append(Place(effect.id, name, sign, gain, parameter.scale, largest))
        known.sort(key=lambda p: -p.gain * p.expected**2)
        spread = np.unique(np.linspace(0, len(known) - 1, min(PLACES, len(known))).round().astype(int))
        chosen = {int(i) for i in spread} | {i for i, p in enumerate(known) if p.column in told}
        found += [known[i] for i in sorted(chosen)]
    return found


def insert(
    library: Mapping[str, Effect],
    compared: Sequence[Compared],
    evidence: Evidence,
    where: Sequence[Place],
    detectabilities: Sequence[float],
    seed: int = 0,
) -> Inserted:
    """Insert effects by their full formulas at sizes of given detectabilities.

    Parameters
    ----------
    library : dict of Effect
    compared : sequence of Compared
    evidence : Evidence
        Of these manoeuvres.
    where : sequence of Place
    detectabilities : sequence of float
        Ascending.
    seed : int
        Of the tolerances in the null draws.

    Returns
    -------
    Inserted
        Each within a quarter of what was asked for, in logarithm; what an effect cannot reach within its
        range is inserted at the end of the range.
    """
    wanted = [(place, goal) for place in where for goal in detectabilities]
    size = np.array([min(np.sqrt(goal / p.gain), p.largest) for p, goal in wanted])
    columns: list[list[Complex] | None] = [None] * len(wanted)
    last = np.full(len(wanted), np.nan), np.full(len(wanted), np.nan)  # log size and log detectability
    energy, failed = np.zeros(len(wanted)), {}
    open_ = np.ones(len(wanted), dtype=bool)
    whole = evidence
    for _ in range(_ROUNDS):
        for i in np.flatnonzero(open_):
            effect = library[wanted[i][0].effect]
            try:
                columns[i] = [_change(effect, wanted[i][0], float(size[i]), c) for c in compared]
            except (FreqidError, ValueError, ArithmeticError) as error:
                # no vehicle or no flight is of such a size
                columns[i], open_[i] = None, False
                failed[effect.id] = str(error)
        kept = [i for i, column in enumerate(columns) if column is not None]
        whole = _with_columns(compared, {i: columns[i] or [] for i in kept}, seed)
        for i in kept:
            at = whole.column(f"{_COLUMN}{i}")
            energy[i] = float(whole.metric[at, at])
        goal = np.array([g for _, g in wanted])
        reached = np.abs(np.log(np.maximum(energy, 1e-12) / goal)) < _CLOSE
        largest = np.array([p.largest for p, _ in wanted])
        stuck = (size >= largest) & (energy < goal)
        open_ &= ~(reached | stuck)
        if not open_.any():
            break
        size = np.where(open_, _next(size, energy, goal, last, largest), size)
    found = []
    for i, column in enumerate(columns):
        if column is not None and energy[i] > 1e-9:
            found.append(Insertion(wanted[i][0], float(size[i]), f"{_COLUMN}{i}", float(energy[i])))
    there = {one.place.effect for one in found}
    return Inserted(whole, tuple(_once(found)), {n: why for n, why in failed.items() if n not in there})


def _next(size: Array, energy: Array, goal: Array, last: tuple[Array, Array], largest: Array) -> Array:
    """Return sizes nearer to their goals: a secant step of logarithms, the first one as if linear."""
    x, y = np.log(size), np.log(np.maximum(energy, 1e-12))
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (y - last[1]) / (x - last[0])
    slope = np.where(np.isfinite(slope), np.clip(slope, 0.5, 6.0), 2.0)
    last[0][:], last[1][:] = x, y
    return np.minimum(np.exp(x + np.clip((np.log(goal) - y) / slope, -2.0, 2.0)), largest)


def _change(effect: Effect, place: Place, size: float, compared: Compared) -> Complex:
    """Return what an effect of some size makes of a residual, shape (row, line)."""
    name, _, given = place.name.partition(GIVEN)
    force = in_force_of(effect, compared.trial.simulation)
    settings = {name: force[name] + place.sign * size}
    other, _, value = given.partition("=")
    if other not in ("", name):
        settings[other] = float(value)
    return compared.lines.transform(made(effect, compared.trial, settings))


def _with_columns(
    compared: Sequence[Compared], columns: Mapping[int, Sequence[Complex]], seed: int
) -> Evidence:
    """Return the evidence of manoeuvres with columns beside their signatures."""
    taken = [
        (0 * c.residual, {**c.signatures, **{f"{_COLUMN}{i}": z[k] for i, z in columns.items()}})
        for k, c in enumerate(compared)
    ]
    return evidence_of(compared, changes=taken, seed=seed, apart=True)


def _once(found: Sequence[Insertion]) -> list[Insertion]:
    """Return insertions without those that stopped at the end of the range where another did."""
    kept: list[Insertion] = []
    for one in found:
        twin = kept and kept[-1].place == one.place and abs(kept[-1].size - one.size) < 1e-9 * one.size
        if not twin:
            kept.append(one)
    return kept
