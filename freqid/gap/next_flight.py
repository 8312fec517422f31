"""The flight that would tell the remaining explanations of a gap apart best."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from freqid.core.design import MultisineDesign, SampledInputs
from freqid.core.errors import UsageError
from freqid.core.excitation import Excitation
from freqid.core.record import FlightRecord
from freqid.core.scenario import Reference, Scenario
from freqid.design.multisine import design_multisines, sampled
from freqid.gap.calibrate import APART
from freqid.gap.compare import Compared
from freqid.gap.evidence import Evidence
from freqid.gap.excitations import Option, design, options, scaled, tilting
from freqid.gap.explanations import Explanation, alike, apart
from freqid.gap.rehearsal import Rehearsal, flown, simulated
from freqid.gap.simulation import Simulation
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]
Pair = tuple[str, str]

MOST_FLIGHTS = 64
"""Flights beyond which nobody flies on."""

_ELSEWHERE = 2  # conditions that nobody has flown and that are rehearsed
_TRIED = 3  # designs that are made, the best option's first
_SAME_DENSITY = 0.03


@dataclass(frozen=True, eq=False)
class Proposal:
    """A flight, and what it would tell together with those at hand.

    Attributes
    ----------
    at : str
        Reference condition; empty where it has none.
    excited : str
        Kind of effectors, or ``all``.
    names : tuple of str
    band_hz : tuple of 2 floats
    amplitude : float
        Of its signals, over those that were flown or would be usual; of the one that grows most.
    duration_s : float
    now, after : dict of float
        Expected separation of each pair by the flights at hand, and with this one.
    flights : dict
        How many of such flights tell each pair apart; None where `MOST_FLIGHTS` do not.
    simulated : bool
        Whether it was flown in the simulation, or scaled from what was flown.
    design : MultisineDesign or None
        None for a flight at hand that is repeated as it was.
    """

    at: str
    excited: str
    names: tuple[str, ...]
    band_hz: tuple[float, float]
    amplitude: float
    duration_s: float
    now: dict[Pair, float]
    after: dict[Pair, float]
    flights: dict[Pair, int | None]
    simulated: bool
    design: MultisineDesign | None


@dataclass(frozen=True, eq=False)
class Bench:
    """What proposals are judged on.

    Attributes
    ----------
    simulation : Simulation
    compared : sequence of Compared
        Flights at hand.
    evidence : Evidence
        Of them.
    rivals : dict of Explanation
    pairs : tuple of tuple of str
        That are to be told apart.
    library : dict of Effect
    sizes : dict of float
        Tolerances.
    scenario : Scenario or None
        Where one describes excitation and conditions.
    """

    simulation: Simulation
    compared: Sequence[Compared]
    evidence: Evidence
    rivals: Mapping[str, Explanation]
    pairs: tuple[Pair, ...]
    library: Mapping[str, Effect]
    sizes: Mapping[str, float]
    scenario: Scenario | None = None

    @property
    def columns(self) -> tuple[str, ...]:
        """Signatures of the rivals, then common tolerances."""
        signatures = dict.fromkeys(n for r in self.rivals.values() for n in r.signatures)
        return (*signatures, *self.evidence.tolerances)

    @property
    def at_hand(self) -> Array:
        """Products of the columns over the flights at hand, shape (column, column)."""
        at = [self.evidence.column(n) for n in self.columns]
        return self.evidence.gram.sum(axis=0)[np.ix_(at, at)]

    def with_more(self, gram: Array) -> Evidence:
        """Return the evidence of an experiment with such products of columns; it has no data."""
        count = len(self.columns) - len(self.evidence.tolerances)
        whole = np.zeros((1, len(gram) + 1, len(gram) + 1))
        whole[0, 1:, 1:] = gram
        return Evidence(
            whole, self.columns[:count], self.evidence.tolerances, np.zeros((0, len(gram) - count)), 0
        )

    def separations(self, gram: Array) -> dict[Pair, float]:
        """Return the expected separation of each pair by an experiment."""
        evidence = self.with_more(gram)
        return {p: apart(evidence, self.rivals[p[0]], self.rivals[p[1]]) for p in self.pairs}

    def same(self, gram: Array) -> set[Pair]:
        """Return the pairs whose changes are the same in an experiment."""
        evidence = self.with_more(gram)
        return {p for p in self.pairs if alike(evidence, self.rivals[p[0]], self.rivals[p[1]])}


def next_flight(bench: Bench, tell: Callable[[str], None] = lambda _: None) -> Proposal | None:
    """Return the flight that separates the rivals best together with those at hand.

    Rehearsed are the flights at hand, and where the simulation flies, conditions that nobody has flown and
    tilt drives that nobody has moved. Parts of each are judged, with other power; the best is designed, and
    flown in the simulation once more where it flies.

    Parameters
    ----------
    bench : Bench
    tell : callable, optional
        Called with what is being done.

    Returns
    -------
    Proposal or None
        None where nothing is excited in the flights at hand and the simulation does not fly. It does not
        have a design where no part of a flight beats flying one of those at hand again.
    """
    hand = bench.at_hand
    now = bench.separations(hand)
    tell("looking for the next flight")
    rehearsals = [flown(c, bench.sizes) for c in bench.compared]
    rehearsals += _elsewhere(bench, tell)
    stated = bench.scenario.excitation if bench.scenario else None
    abort = stated.abort if stated else {}
    judged: list[tuple[float, Option, Array]] = []
    for rehearsal in rehearsals:
        for option in options(rehearsal, abort):
            gram = rehearsal.gram(bench.columns, option.power) * _longer(rehearsal, stated)
            judged.append((_worth(bench.separations(hand + gram)), option, gram))
    judged.sort(key=lambda one: -one[0])
    for _, option, gram in judged[:_TRIED]:
        found = _designed(bench, option, gram, now, stated)
        if found is not None:
            return found
    return None


def _designed(
    bench: Bench, option: Option, gram: Array, now: dict[Pair, float], stated: Excitation | None
) -> Proposal | None:
    """Return an option as a design, flown in the simulation where that flies; None if none can be."""
    record, vehicle = option.rehearsal.trial.maneuver.record, option.rehearsal.trial.maneuver.vehicle
    try:
        made = design(option, stated, vehicle)
    except UsageError:
        return None
    checked, factor = False, 1.0
    reference = _reference(bench, record.reference)
    if reference is not None:
        flight = _rehearsed(bench, sampled(made), reference)
        if flight is not None:
            factor = _inside(flight, stated.abort if stated else {})
            made = scaled(made, factor)
            power = np.full(flight.lines.hz.size, factor**2)
            gram = flight.gram(bench.columns, power) * _longer(flight, stated)
            checked = True
        elif option.rehearsal.simulated:
            return None
    after = bench.separations(bench.at_hand + gram)
    return Proposal(
        at=record.reference,
        excited=option.kinds,
        names=made.names,
        band_hz=made.band_hz,
        amplitude=factor * max(option.gain.values()),
        duration_s=made.duration_s,
        now=now,
        after=after,
        flights=_flights(bench, gram),
        simulated=checked,
        design=made,
    )


def _flights(bench: Bench, gram: Array) -> dict[Pair, int | None]:
    """Return how many flights tell each pair apart."""
    found: dict[Pair, int | None] = dict.fromkeys(bench.pairs)
    count = 1
    while count <= MOST_FLIGHTS and None in found.values():
        each = bench.separations(bench.at_hand + count * gram)
        found = {p: count if n is None and each[p] >= APART else n for p, n in found.items()}
        count += 1 if count < 8 else count // 4
    return found


def _worth(separations: Mapping[Pair, float]) -> float:
    """Return what an experiment is worth: pairs told apart, then how far all are."""
    told = sum(x >= APART for x in separations.values())
    return told + float(np.mean(np.log1p(np.array(list(separations.values())) / APART))) / 100


def _longer(rehearsal: Rehearsal, stated: Excitation | None) -> float:
    """Return how much longer a designed flight is than the rehearsed one."""
    return stated.period_s * stated.periods / rehearsal.trial.maneuver.record.duration if stated else 1.0


def _inside(flight: Rehearsal, abort: Mapping[str, float]) -> float:
    """Return the factor that keeps a simulated flight inside its limits."""
    record, factor = flight.trial.maneuver.record, 1.0
    for name, limit in abort.items():
        if f"state/{name}" in record:
            values = record[f"state/{name}"]
            peak = float(np.max(np.abs(values - values[0])))
            factor = min(factor, limit / max(peak, 1e-300))
    return factor


def _elsewhere(bench: Bench, tell: Callable[[str], None]) -> list[Rehearsal]:
    """Return simulated flights: at conditions that nobody has flown, and of the tilt drives alone."""
    if bench.scenario is None or bench.simulation.kind != "scenario":
        return []
    records = [c.maneuver.record for c in bench.compared]
    excited = [r for r in records if r.group("excitation")]
    stated, found = bench.scenario.excitation, []
    if excited:
        inputs = _inputs(excited[0])
    elif stated is not None:
        brief = msgspec.structs.replace(stated, starts=1)
        inputs = sampled(design_multisines(brief, bench.scenario.effector))
    else:
        return []
    ids = {r.reference for r in records}
    known = [r for r in bench.scenario.reference if r.id in ids]
    plans: list[tuple[SampledInputs, Reference]] = []
    if not excited:
        plans += [(inputs, r) for r in known]
    plans += [(inputs, r) for r in _unflown(bench.scenario.reference, known)]
    tilts = tilting(bench.scenario.aircraft(), stated, records[0].duration) if stated and known else None
    if tilts is not None:
        middle = sorted(known, key=lambda r: r.u)[len(known) // 2]
        plans.append((sampled(tilts), middle))
    for one, reference in plans:
        tell(f"rehearsing {reference.id}")
        rehearsal = _rehearsed(bench, one, reference)
        if rehearsal is not None:
            found.append(rehearsal)
    return found


def _rehearsed(bench: Bench, inputs: SampledInputs, reference: Reference) -> Rehearsal | None:
    """Fly in the simulation, with the noise of the flight at hand whose speed is nearest."""
    known = {r.id: r.u for r in bench.scenario.reference} if bench.scenario else {}
    like = min(
        bench.compared, key=lambda c: abs(known.get(c.maneuver.record.reference, np.inf) - reference.u)
    )
    rivals = {n: bench.library[n] for n in bench.rivals if n in bench.library}
    return simulated(bench.simulation, inputs, reference, like, rivals, bench.library, bench.sizes)


def _reference(bench: Bench, identifier: str) -> Reference | None:
    if bench.scenario is None or bench.simulation.kind != "scenario":
        return None
    return next((r for r in bench.scenario.reference if r.id == identifier), None)


def _unflown(references: Sequence[Reference], known: Sequence[Reference]) -> list[Reference]:
    """Return the conditions that are furthest in speed from those flown, at the same density."""
    if not known:
        return []
    density = known[0].rho
    left = [
        r for r in references if r not in known and abs(r.rho - density) <= _SAME_DENSITY * max(density, 1e-9)
    ]
    found: list[Reference] = []
    while left and len(found) < _ELSEWHERE:
        far = max(left, key=lambda r: min(abs(r.u - k.u) for k in (*known, *found)))
        found.append(far)
        left.remove(far)
    return found


def _inputs(record: FlightRecord) -> SampledInputs:
    names = record.group("excitation")
    return SampledInputs(
        names,
        tuple(record.channel(f"excitation/{n}").unit for n in names),
        record.time - record.time[0],
        record.matrix(f"excitation/{n}" for n in names),
    )
