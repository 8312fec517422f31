"""Is a gap bookkeeping? Mistakes of units, signs, axes, points and order, found before any physics.

A mistake is named only where taking it back, by exactly what it is, makes nearly all of a residual go:
an effect of physics is hardly ever a whole sign, a factor of 57.3 or two names exchanged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import WRENCH
from freqid.core.errors import DataError
from freqid.core.record import FlightRecord
from freqid.core.units import STANDARD_GRAVITY
from freqid.core.vehicle import Vehicle
from freqid.gap.bookkeeping.candidates import possible_faults
from freqid.gap.bookkeeping.comparison import Comparison, bench_of, energy
from freqid.gap.bookkeeping.correction import LEAST, Correction
from freqid.gap.bookkeeping.fault import Bench, Fault
from freqid.gap.bookkeeping.gyroscopic import rotor_account
from freqid.gap.simulation import Simulation

EXPLAINED = 0.9  # share of a residual, noise set aside, that has to go
_LIKELY = 0.5  # the same with the noise, of what is looked at further
_OWN = 0.01  # the same of a simulation's own flight, beyond noise
_MOST = 6  # mistakes at a time


@dataclass(frozen=True)
class Finding:
    """One mistake of bookkeeping.

    Attributes
    ----------
    fault : str
        Its kind: gravity, response_sign, effector_sign, swapped_effectors, swapped_responses, degrees,
        units, coefficient, axes, moment_reference, gyroscopic, time_shift, trim_level, density or
        self_replay.
    subject : str
        Responses or channels.
    sentence : str
    remedy : str
    explained : float
        Share of the residual that goes when it is taken back.
    """

    fault: str
    subject: str
    sentence: str
    remedy: str
    explained: float


def check(
    simulation: Simulation,
    records: Sequence[FlightRecord],
    vehicle: Vehicle | None = None,
    *,
    own: bool = False,
) -> list[Finding]:
    """Look for mistakes of bookkeeping between a simulation and flights.

    Parameters
    ----------
    simulation : Simulation
    records : sequence of FlightRecord
    vehicle : Vehicle, optional
        In place of the records' and the simulation's.
    own : bool
        The records are the simulation's own flights: whatever is left is a mistake.

    Returns
    -------
    list of Finding
        Largest first; a mistake is looked for after the larger ones were taken back.

    Raises
    ------
    DataError
        Where records lack what the responses are made of, or the simulation returns a constant as a
        response that moves in the records.
    """
    vehicle = rotor_account(simulation, records, vehicle).vehicle
    comparisons = [Comparison(simulation, bench_of(simulation, record, vehicle)) for record in records]
    _refuse_constants(comparisons, simulation.name)
    findings: list[Finding] = []
    while len(findings) < _MOST:
        found = _next(comparisons)
        if found is None:
            break
        fault, explained = found
        findings.append(Finding(fault.id, fault.subject, fault.sentence, fault.remedy, explained))
        for comparison in comparisons:
            comparison.accept(fault)
    if own and not findings:
        findings += _not_its_own(comparisons)
    return findings


def _refuse_constants(comparisons: Sequence[Comparison], where: str) -> None:
    """Refuse a response that is constant in every prediction and moves in a record."""
    for i, name in enumerate(comparisons[0].bench.names):
        still = not any(np.ptp(c.predicted[i]) for c in comparisons)
        moving = [c for c in comparisons if np.ptp(c.bench.measured[i]) > 1e-9 * c.scale[1][i]]
        if still and moving:
            rms = float(moving[0].bench.measured[i].std())
            value = comparisons[0].predicted[i, 0] + 0.0  # -0 is 0
            raise DataError(
                f"the simulation returned the constant {value:.4g} as '{name}', which changes by {rms:.3g} "
                "(rms) in the records",
                where=where,
                remedy=f"compute {name} from state and effector, or leave it out of the responses",
            )


def _not_its_own(comparisons: Sequence[Comparison]) -> list[Finding]:
    """Return a finding where a simulation does not reproduce flights of its own."""
    nothing = Fault("", "", "", "")
    left = np.mean([energy(t.residual(t.predicted)) - t.noise(nothing) for t in comparisons], axis=0)
    worst = int(np.argmax(left))
    if left[worst] < _OWN:
        return []
    name = comparisons[0].bench.names[worst]
    return [
        Finding(
            "self_replay",
            name,
            f"the simulation does not reproduce its own flight: {100 * np.sqrt(left[worst]):.2g} % of {name} "
            "(rms) is left on the states and positions that it flew itself",
            "compare its logged states, positions and loads with what its model is given; records that were "
            "measured in flight are checked without --own",
            0.0,
        )
    ]


def _next(comparisons: Sequence[Comparison]) -> tuple[Fault, float] | None:
    """Return the mistake that explains most, if one explains sharply enough, with the share it explains."""
    likely = []
    for fault in possible_faults(comparisons):
        there = _everywhere(fault, comparisons)
        if there is not None:
            change = Correction.of(comparisons, there, fault.rows)
            if change.gain > 0 and change.explained(0.0) > _LIKELY and change.sharp:
                likely.append((change, fault))
    for change, fault in sorted(likely, key=lambda found: -found[0].gain):
        noise = np.sum([comparison.noise(fault) for comparison in comparisons], axis=0)
        explained = change.explained(noise, sum(c.degrees_of_freedom for c in comparisons))
        if explained > EXPLAINED:
            return fault, explained
    return _trim_level(comparisons)


def _everywhere(fault: Fault, comparisons: Sequence[Comparison]) -> list[Array] | None:
    """Return the prediction of every record with a mistake taken back.

    None where the simulation cannot be asked so, or where that makes one record worse: who makes a mistake
    makes it in all of them, so the others need not be asked.
    """
    there: list[Array] = []
    for comparison in comparisons:
        predicted = comparison.without(fault)
        if predicted is None:
            return None
        there.append(predicted)
        alone = Correction.of([comparison], [predicted], fault.rows)
        if alone.gain < -LEAST * len(alone.before):
            return None
    return there


def _trim_level(comparisons: Sequence[Comparison]) -> tuple[Fault, float] | None:
    """Return the level as a mistake where a large one is all that is wrong."""
    bench = comparisons[0].bench
    vehicle = bench.maneuver.vehicle
    weight = vehicle.mass_properties.mass_kg * STANDARD_GRAVITY
    arm = vehicle.chord_m or 0.15 * (vehicle.span_m or 1.0)
    for i, name in enumerate(bench.names):
        if name not in WRENCH:
            continue
        off = np.mean([(t.bench.measured[i] - t.predicted[i]).mean() for t in comparisons])
        spread = np.std([(t.bench.measured[i] - t.predicted[i]).mean() for t in comparisons])
        moving = np.mean([(t.residual(t.predicted)[0][i] ** 2).sum() for t in comparisons])
        size = 0.3 * weight * (1.0 if name in "XYZ" else arm)
        missing = abs(comparisons[0].predicted[i].mean()) < 0.1 * abs(off)
        if abs(off) > size and moving < (0.25 if missing else 0.05) and spread < 0.1 * abs(off):

            def undo(predicted: Array, _: Bench, i: int = i, off: float = float(off)) -> Array:
                out = predicted.copy()
                out[i] += off
                return out

            sentence = (
                f"{name} is a departure from the trim: its level, {off:.4g}, is missing"
                if missing
                else f"the level of {name} is off by {-off:.4g} while its changes are right"
            )
            total = np.sum([energy(t.residual(t.predicted))[i] for t in comparisons])
            return (
                Fault("trim_level", name, sentence, "give total loads, trim included", (i,), undo=undo),
                float(1 - moving * len(comparisons) / total),
            )
    return None
