"""The gap between a simulation and flights: whether there is one, where, by which effect, and how far."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from freqid import __version__
from freqid.compare import diagnosis_consequence
from freqid.core.blas import on_one_thread
from freqid.core.errors import DataError, GateFailed, UsageError, nearest
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.diagnosis import GapDiagnosis, ToleranceUsed
from freqid.core.results.gap import GapResult
from freqid.core.scenario import Scenario, find_scenario
from freqid.gap import flights as gap_flights
from freqid.gap.bookkeeping.check import Finding, check
from freqid.gap.bookkeeping.gyroscopic import as_counted
from freqid.gap.diagnose import Findings, Question, diagnose
from freqid.gap.model.tolerance import stated
from freqid.gap.next import next_test as proposing
from freqid.gap.self_test import self_test as trying
from freqid.gap.shown import shown
from freqid.gap.simulation import Simulation
from freqid.gap.verdict import tolerances_used
from freqid.identify.regress.confidence_interval import half_width
from freqid.simulate.effects import library, register
from freqid.simulate.effects.effect import Effect
from freqid.simulate.effects.files import load_file
from freqid.workflows.connect import Connected, ConnectedSimulation, resolve_simulation
from freqid.workflows.inputs import (
    File,
    Flight,
    Tell,
    names_of,
    record_of,
    scenario_of,
    several,
    silent,
    source_of,
)


class BookkeepingMistakes(GateFailed):
    """A diagnosis stopped: mistakes of bookkeeping stand between simulation and flights.

    Attributes
    ----------
    verdict : str
    findings : tuple of Finding
    table : dict
        What ``diagnose-gap --json`` prints of them.
    """

    verdict: str
    findings: tuple[Finding, ...]
    table: dict[str, Any]

    @classmethod
    def of(cls, findings: Sequence[Finding], simulation: str, names: Sequence[str]) -> BookkeepingMistakes:
        """Return the error that names what was found."""
        error = cls(
            f"{len(findings)} mistake{'s' if len(findings) > 1 else ''} of bookkeeping between simulation "
            "and flight; no gap was diagnosed",
            remedy="mend and diagnose again, or go on with --anyway",
        )
        error.verdict = f"Bookkeeping, not physics: {findings[0].sentence}."
        error.findings = tuple(findings)
        error.table = {
            "verdict": error.verdict,
            "simulation": simulation,
            "records": list(names),
            "bookkeeping": [asdict(f) for f in findings],
        }
        return error


@dataclass(frozen=True, eq=False, repr=False)
class DiagnosedGap(GapResult):
    """A diagnosis as it was made, with what further questions to it need; a file does not hold these.

    Attributes
    ----------
    findings : Findings
    simulation : Simulation
    question : Question
    scenario : Scenario, optional
    bookkeeping : tuple of Finding
        Mistakes that were passed over.
    """

    findings: Findings | None = None
    simulation: Simulation | None = None
    question: Question | None = None
    scenario: Scenario | None = None
    bookkeeping: tuple[Finding, ...] = ()


@on_one_thread
def diagnose_gap(
    simulation: Connected | None,
    flights: Flight | Iterable[Flight],
    *,
    held_out: Flight | Iterable[Flight] = (),
    scenario: Scenario | File | None = None,
    predictions: File | Sequence[File] = (),
    effects: Sequence[str] = (),
    own_effects: File | None = None,
    band_hz: tuple[float, float] | None = None,
    tolerances: Mapping[str, float] | None = None,
    level: float = 0.02,
    draws: int = 500,
    seed: int = 0,
    plan: bool = True,
    next_design: File | None = None,
    self_test: bool = False,
    anyway: bool = False,
    tell: Tell = silent,
) -> DiagnosedGap:
    """Diagnose the gap between a simulation and flights.

    Parameters
    ----------
    simulation : ConnectedSimulation, callable or str
        As `connect` takes or returns it.
    flights : FlightRecord, Maneuver or path, or several
    held_out : FlightRecord, Maneuver or path, or several
        On which closures are scored; without them the flights take turns.
    scenario : Scenario, path or name, optional
        Vehicle, tolerances and band; the one that the simulation was connected with where absent.
    predictions : path, or several
        Recorded predictions in place of a simulation.
    effects : sequence of str
        Effects to close the gap with, together; those found where empty.
    own_effects : path, optional
        Python file with effects of your own.
    band_hz : tuple of 2 floats, optional
        The scenario's, else what the injected signals drive.
    tolerances : mapping of str to float, optional
        One sigma by name of what is no gap, over the scenario's.
    level : float
        False-alarm rate at which a gap is called one.
    draws : int
        Of flights without a gap, with noise and tolerances, for the level.
    seed : int
        Of the draws.
    plan : bool
        Where several explanations remain, propose the tests that would tell them apart.
    next_design : path, optional
        Where the design of the next flight is written, if one is proposed.
    self_test : bool
        Try the diagnosis on each effect inserted into this simulation and these flights.
    anyway : bool
        Go on where mistakes of bookkeeping are found.
    tell : callable
        Told what is being done.

    Returns
    -------
    DiagnosedGap
        ``gap.verdict`` is one line, ``gap.which.probabilities`` is by effect id, and ``gap.how_far`` says how
        much of the gap is closed on what was left out: flights held out, or the flights in turn.

    Raises
    ------
    BookkeepingMistakes
        Where units, signs, axes, points, order or clock are mistaken: no gap is diagnosed then.
    UsageError
        Where a flight is given twice, or an effect is unknown or cannot be tested here.
    DataError
        Where flights and simulation do not fit together, or nothing can be told from them.

    Notes
    -----
    docs/theory/gap-diagnosis.md.

    Examples
    --------
    >>> gap = diagnose_gap("model.py:wrench", "flight.h5", held_out="other.h5")  # doctest: +SKIP
    >>> gap.verdict  # doctest: +SKIP
    """
    used, kept = several(flights), several(held_out)
    refuse_twice(used, kept)
    named = tuple(dict.fromkeys([effects] if isinstance(effects, str) else effects))
    candidates = effects_with(own_effects)
    for name in named:
        if name not in candidates:
            raise UsageError(f"effect '{name}' is unknown", remedy=nearest(name, candidates))
    described = described_by(scenario, [simulation])
    sigmas = {**(described.tolerance if described else {}), **(tolerances or {})}
    read = [record_of(flight) for flight in (*used, *kept)]
    names = [*names_of(used), *names_of(kept, len(used) + 1)]
    found, described = resolve_simulation(
        simulation, scenario=described, predictions=several(predictions), record=read[0]
    )
    vehicle = gap_flights.vehicle_of(read, found, described.aircraft() if described else None)
    every = gap_flights.maneuvers(read, names, found, vehicle)
    gap_flights.refuse_unmeasured(every, names, found)
    gap_flights.refuse_without_noise(read, names)
    allowed = stated(sigmas, candidates, found, every[0].vehicle)
    here = {i: effect.of(every[0].vehicle) for i, effect in candidates.items()}
    _refuse_absurd(sigmas, tolerances_used(sigmas, found, here))
    every, rotors = as_counted(found, every)
    tell("looking for mistakes of bookkeeping")
    faults = check(found, [m.record for m in every[: len(used)]], every[0].vehicle)
    if faults and not anyway:
        tell("")
        raise BookkeepingMistakes.of(faults, found.name, names)
    question = Question(
        candidates=candidates,
        tolerances=allowed,
        given=tuple(sigmas),
        band_hz=band_hz or band_of(described) or gap_flights.injected_band(read),
        named=named,
        level=level,
        draws=draws,
        seed=seed,
    )
    findings = diagnose(
        found, every[: len(used)], question, held_out=every[len(used) :], names=names, tell=tell
    )
    tell("costing margins")
    diagnosis = _with_consequence(findings, found, question)
    if plan:
        proposed = _proposed(findings, found, question, described, next_design, tell)
        diagnosis = replace(diagnosis, next_flight=proposed)
    if self_test:
        diagnosis = trying.with_self_test(diagnosis, trying.self_test(findings, candidates, tell=tell))
    remarks = [
        *(f"bookkeeping: {f.sentence}; {f.remedy}" for f in faults),
        *gap_flights.differing(every, found),
        *([rotors.rstrip(".")] if rotors else []),
    ]
    diagnosis = replace(diagnosis, remarks=(*remarks, *diagnosis.remarks))
    provenance = {
        "simulation": found.name,
        "kind": found.kind,
        "records": names[: len(used)],
        "held out": names[len(used) :],
        "scenario": source_of(described),
        "effects": str(own_effects or ""),
        "band_hz": list(question.band_hz),
        "level": level,
        "draws": draws,
        "seed": seed,
        "self_test": self_test,
        "freqid_version": __version__,
    }
    result = shown(replace(findings, diagnosis=diagnosis), allowed, provenance)
    return DiagnosedGap(
        **{field.name: getattr(result, field.name) for field in fields(GapResult)},
        findings=findings,
        simulation=found,
        question=question,
        scenario=described,
        bookkeeping=tuple(faults),
    )


@on_one_thread
def next_test(gap: GapResult, *, design: File | None = None, tell: Tell = silent) -> dict[str, Any]:
    """Return the flight and the ground tests that best separate what a diagnosis leaves.

    Parameters
    ----------
    gap : DiagnosedGap
        Of `diagnose_gap`, in this session.
    design : path, optional
        Where the flight's design is written, if one is proposed.
    tell : callable
        Told what is being done.

    Returns
    -------
    dict
        ``tests``, the best first, each with what it separates, ``groups`` of effects that remain, and why no
        flight helps where none does; empty where nothing remains to be told apart (docs/next-test.md).

    Raises
    ------
    UsageError
        For a diagnosis that was read from a file, which does not hold what it was made from.
    DataError
        Where the design cannot be written.

    Examples
    --------
    >>> next_test(gap)["tests"][0]["how"]  # doctest: +SKIP
    """
    if not isinstance(gap, DiagnosedGap) or not (gap.findings and gap.simulation and gap.question):
        raise UsageError(
            "the diagnosis was read from a file, which does not hold what it was made from",
            remedy="look at its next_flight, or diagnose anew",
        )
    return _proposed(gap.findings, gap.simulation, gap.question, gap.scenario, design, tell)


def described_by(scenario: Scenario | File | None, simulations: Sequence[Any]) -> Scenario | None:
    """Return the scenario that is stated, or that one of the simulations is or was connected with."""
    if scenario is not None:
        return scenario_of(scenario)
    for one in simulations:
        if isinstance(one, str) and find_scenario(one).suffix == ".toml":
            return scenario_of(one)
        if isinstance(one, ConnectedSimulation) and one.scenario:
            return one.scenario
    return None


def band_of(scenario: Scenario | None) -> tuple[float, float] | None:
    """Return the band that a scenario excites, Hz."""
    return scenario.excitation.band_hz if scenario and scenario.excitation else None


def _proposed(
    findings: Findings,
    simulation: Simulation,
    question: Question,
    scenario: Scenario | None,
    design: File | None,
    tell: Tell,
) -> dict[str, Any]:
    file = Path(design) if design is not None else None
    sha256 = scenario.sha256 if scenario else ""
    return proposing.propose_test(
        findings, simulation, question, scenario, file, scenario_sha256=sha256, tell=tell
    )


def _with_consequence(findings: Findings, simulation: Simulation, question: Question) -> GapDiagnosis:
    """Return the diagnosis with what the effects that it names cost in margins, modes and trim."""
    diagnosis = findings.diagnosis
    if not findings.closed or not (diagnosis.which.named or diagnosis.which.pair or question.named):
        return diagnosis
    settings: dict[str, dict[str, float]] = {}
    baseline: dict[str, dict[str, float]] = {}
    names: list[tuple[str, str]] = []
    spread = []
    for e in findings.closed[0].explanation.estimates:
        c = e.candidate
        settings[c.effect] = c.place.settings(dict.fromkeys(c.place.parameters, 0.0), e.size)  # departures
        own = simulation.effects.get(c.effect, {})
        baseline[c.effect] = {n: own.get(n, 0.0) for n, _ in c.place.fixed}  # these are no departures
        names += [(c.effect, n) for n in c.place.parameters]
        sigma = np.broadcast_to((e.hi - e.lo) / (2 * half_width(level=0.9)), (len(c.place.parameters),))
        # one size for all places of a group moves them together
        spread.append(np.outer(sigma, sigma) if c.kind == "scalar" else np.diag(sigma**2))
    return diagnosis_consequence.with_consequence(
        diagnosis, simulation, settings, names, block_diag(*spread), baseline=baseline
    )


def _refuse_absurd(sigmas: Mapping[str, float], used: Sequence[ToleranceUsed]) -> None:
    """Refuse a share of more than all: it would swallow every gap."""
    for one in used:
        if one.name in sigmas and one.source != "simulation" and one.unit == "1" and one.sigma > 1:
            raise DataError(
                f"the tolerance {one.name} is {one.sigma:g}, a share of more than all",
                remedy="give one standard deviation as a share: 0.05 for 5 %",
            )


def refuse_twice(used: Sequence[Any], held_out: Sequence[Any]) -> None:
    """Refuse a flight that is given twice."""
    seen: set[Any] = set()
    for flight, name in zip(used, names_of(used), strict=True):
        if _key(flight) in seen:
            raise UsageError("is given twice", where=name, remedy="name each record once")
        seen.add(_key(flight))
    held: set[Any] = set()
    for flight, name in zip(held_out, names_of(held_out, len(used) + 1), strict=True):
        if _key(flight) in seen:
            raise UsageError(
                "is both used and held out", where=name, remedy="hold out a flight that is not used"
            )
        if _key(flight) in held:
            raise UsageError("is held out twice", where=name, remedy="name each record once")
        held.add(_key(flight))


def _key(flight: FlightRecord | Maneuver | File) -> Any:
    return Path(flight).resolve() if isinstance(flight, str | Path) else id(flight)


def effects_with(own: File | None) -> dict[str, Effect]:
    """Return the effects that are asked about: all that are shipped, and the user's."""
    for effect in load_file(Path(own)).values() if own else ():
        register(effect)
    return library()
