"""Flights that could be rehearsed: where nobody has flown yet, and with drives that nobody has moved."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from freqid.core.design import SampledInputs
from freqid.core.record import FlightRecord
from freqid.core.scenario import Reference
from freqid.design.multisine import design_multisines, sampled
from freqid.gap.excitations import tilting
from freqid.gap.next_bench import Bench
from freqid.gap.rehearsal import Rehearsal, simulated

_CONDITIONS = 2  # that nobody has flown
_SAME_DENSITY = 0.03
_SLOWEST = 1.0  # m/s: below it flow angles are undefined, and what was seen in forward flight says nothing


def elsewhere(bench: Bench, tell: Callable[[str], None]) -> list[Rehearsal]:
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
    plans += [(inputs, r) for r in unflown(bench.scenario.reference, known)]
    tilts = tilting(bench.scenario.aircraft(), stated, records[0].duration) if stated and known else None
    if tilts is not None:
        middle = sorted(known, key=lambda r: r.u)[len(known) // 2]
        plans.append((sampled(tilts), middle))
    for one, reference in plans:
        tell(f"rehearsing {reference.id}")
        rehearsal = rehearsed(bench, one, reference)
        if rehearsal is not None:
            found.append(rehearsal)
    return found


def rehearsed(bench: Bench, inputs: SampledInputs, reference: Reference) -> Rehearsal | None:
    """Fly in the simulation, with the noise of the flight at hand whose speed is nearest."""
    known = {r.id: r.u for r in bench.scenario.reference} if bench.scenario else {}
    like = min(
        bench.compared, key=lambda c: abs(known.get(c.maneuver.record.reference, np.inf) - reference.u)
    )
    rivals = {n: bench.candidates[n] for n in bench.rivals if n in bench.candidates}
    return simulated(
        bench.simulation, inputs, reference, like, rivals, bench.candidates, bench.sizes, bench.loops
    )


def reference_of(bench: Bench, identifier: str) -> Reference | None:
    """Return a condition by its id where the simulation can fly it, else None."""
    if bench.scenario is None or bench.simulation.kind != "scenario":
        return None
    return next((r for r in bench.scenario.reference if r.id == identifier), None)


def unflown(references: Sequence[Reference], known: Sequence[Reference]) -> list[Reference]:
    """Return the conditions that are furthest in speed from those flown, at the same density."""
    if not known:
        return []
    density, slowest = known[0].rho, min(_SLOWEST, *(k.u for k in known))
    near = _SAME_DENSITY * max(density, 1e-9)
    left = [r for r in references if r not in known and r.u >= slowest and abs(r.rho - density) <= near]
    found: list[Reference] = []
    while left and len(found) < _CONDITIONS:
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
