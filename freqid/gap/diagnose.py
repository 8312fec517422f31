"""The whole diagnosis: compare, ask whether, where, which, and how far the gap shrinks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from freqid.core.diagnosis import Closure, Existence, GapDiagnosis, Which
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.gap_map import GapMap
from freqid.core.record import Maneuver
from freqid.gap import attribute, calibrate, calibration, locate, score
from freqid.gap.attribute import LEAST_ODDS, NONE, OTHER, Judged
from freqid.gap.close import Refit, starting
from freqid.gap.compare import Compared, compare, evidence_of
from freqid.gap.evidence import Evidence, Hypothesis
from freqid.gap.reach import first_order_size
from freqid.gap.self_test import Tested, self_test
from freqid.gap.signature import GIVEN
from freqid.gap.simulation import Simulation
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]

LEVEL = 0.02
"""At which a gap is called one, unless told otherwise."""

INTERVAL = 0.90
_IDLE = "it changes nothing in these manoeuvres"
_SOUGHT = ("none", "other")
_TOLD = 3  # effects that are closed without being asked for


@dataclass(frozen=True, eq=False)
class Question:
    """What is asked.

    Attributes
    ----------
    candidates : dict of Effect
        Effects that are asked about, by id.
    tolerances : dict of float
        One sigma by name, of `tolerance.stated`.
    band_hz : tuple of 2 floats
    named : tuple of str
        Effects whose closure is wanted; those found where empty.
    level : float
    draws : int
        Of the null.
    seed : int
    close : bool
        Whether effects are refitted at all, which takes most of the time.
    self_test : bool
        Whether the diagnosis is first tried on each effect, inserted into this simulation and these flights.
    """

    candidates: Mapping[str, Effect]
    tolerances: Mapping[str, float]
    band_hz: tuple[float, float] = (0.05, 2.0)
    named: tuple[str, ...] = ()
    level: float = LEVEL
    draws: int = 200
    seed: int = 0
    close: bool = True
    self_test: bool = False


@dataclass(frozen=True, eq=False)
class Findings:
    """A diagnosis, and what its pictures are drawn from.

    Attributes
    ----------
    diagnosis : GapDiagnosis
    compared, held_out : list of Compared
    evidence : Evidence
    judged : list of Judged
    map : GapMap
    refits : dict of Refit
        By effects joined with ``+``; the leading closure's first.
    explained : list of ndarray of complex, shape (row, line)
        What the leading explanation makes of each manoeuvre's residual.
    """

    diagnosis: GapDiagnosis
    compared: list[Compared]
    held_out: list[Compared]
    evidence: Evidence
    judged: list[Judged]
    map: GapMap
    refits: dict[str, Refit] = field(default_factory=dict)
    explained: list[NDArray[np.complex128]] = field(default_factory=list)


def diagnose(
    simulation: Simulation,
    maneuvers: Sequence[Maneuver],
    question: Question,
    *,
    held_out: Sequence[Maneuver] = (),
    names: Sequence[str] = (),
    tell: Callable[[str], None] = lambda _: None,
) -> Findings:
    """Diagnose the gap between a simulation and flights.

    Parameters
    ----------
    simulation : Simulation
    maneuvers : sequence of Maneuver
    question : Question
    held_out : sequence of Maneuver
        On which closures are scored; without them, the given manoeuvres take turns.
    names : sequence of str
        Of the manoeuvres, then of those held out.
    tell : callable, optional
        Called with what is being done.

    Raises
    ------
    DataError
        Where a record and the simulation do not fit together.
    UsageError
        For a named effect that is unknown or cannot be tested here.
    """
    q = question
    if not maneuvers:
        raise UsageError("there is no manoeuvre to compare", remedy="name one record or more")
    names = list(names) or [f"manoeuvre {i + 1}" for i in range(len(maneuvers) + len(held_out))]
    every = []
    for i, (m, name) in enumerate(zip((*maneuvers, *held_out), names, strict=True)):
        tell(f"comparing {name} ({i + 1} of {len(names)})")
        every.append(_compared(simulation, m, q, i, name))
    tell("weighing effects")
    used, kept = every[: len(maneuvers)], every[len(maneuvers) :]
    library = {i: e.of(maneuvers[0].vehicle) for i, e in q.candidates.items()}
    evidence = evidence_of(used, seed=q.seed)
    judged = attribute.judge(evidence, library)
    statistic, null = attribute.existence(judged)
    existence = _existence(statistic, null, used, evidence, judged, library, q)
    not_tested = {i: why for c in used for i, why in c.not_tested.items()}
    seen = {j.name for j in judged}
    not_tested |= {i: _IDLE for i in library if i not in seen and i not in not_tested}
    table, why = calibration.table_for(used, q.tolerances)
    tested = (
        self_test(used, evidence, judged, library, table, q.level, seed=q.seed, tell=tell)
        if q.self_test
        else None
    )
    if tested:
        existence = replace(existence, smallest_detectable=_reached(existence, tested, evidence, judged))
    table = tested.table if tested else table
    which = calibrate.which(judged, evidence, library, not_tested, existence.exists, INTERVAL, table)
    for name in q.named:
        if name not in library:
            raise UsageError(f"effect '{name}' is unknown", remedy=nearest(name, library))
        if name in not_tested:
            raise UsageError(f"effect '{name}' cannot be tested here: {not_tested[name]}")
    leading = _leading(judged, which)
    explained = locate.explained(used, (leading and _coefficients(leading, evidence)) or {})
    found = locate.gap_map(used, explained)
    where = tuple(found.places()) if existence.exists else ()
    tell("closing")
    closures, refits = _closures(used, kept, names, evidence, judged, library, which, existence.exists, q)
    diagnosis = GapDiagnosis(
        verdict=score.verdict(existence, where, found, which, closures),
        simulation=simulation.name,
        records=tuple(names),
        gap=existence,
        where=where,
        which=which,
        how_far=tuple(closures),
        remarks=(*_remarks(used, simulation), *_of_calibration(which, why)),
        self_test=tested.result if tested else None,
    )
    return Findings(diagnosis, used, kept, evidence, judged, found, refits, explained)


def _compared(simulation: Simulation, maneuver: Maneuver, q: Question, i: int, name: str) -> Compared:
    try:
        return compare(
            simulation,
            maneuver,
            q.candidates,
            q.tolerances,
            q.band_hz,
            count=q.draws,
            seed=q.seed + 1000 * i,
        )
    except DataError as error:
        raise DataError(str(error), where=name) from None


def _existence(
    statistic: float,
    null: Array,
    used: Sequence[Compared],
    evidence: Evidence,
    judged: Sequence[Judged],
    library: Mapping[str, Effect],
    q: Question,
) -> Existence:
    """Return whether there is a gap, and what size of each effect would be found in 95 of 100 cases."""
    p = attribute.p_value(statistic, null)
    raw = sum(float((c.white(c.residual) ** 2).sum()) for c in used)
    threshold = attribute.critical(null, q.level)
    smallest, unit = {}, {}
    count = len([j for j in judged if "+" not in j.name])
    for j in judged:
        if j.name == OTHER or "+" in j.name:
            continue
        options = len(attribute.variants(library[j.name], evidence))
        smallest[j.name] = first_order_size(evidence, j.best, threshold, count, options)
        parameter = evidence.signatures[j.best.columns[0] - 1].partition(":")[2].partition(GIVEN)[0]
        unit[j.name] = library[j.name].parameters[parameter].unit
    return Existence(
        p < q.level and statistic > LEAST_ODDS, p, q.level, float(chi2.sf(raw, evidence.rows)), smallest, unit
    )


def _reached(
    existence: Existence, tested: Tested, evidence: Evidence, judged: Sequence[Judged]
) -> dict[str, float]:
    """Return the smallest sizes found, by insertion where the effect was inserted at the place in question.

    Without effects that no size within their range makes found.
    """
    known = {f"{r.effect}:{r.parameter}": r.size for r in tested.result.reach}
    columns = {j.name: evidence.signatures[j.best.columns[0] - 1] for j in judged if j.name != OTHER}
    found = {n: known.get(columns[n], size) for n, size in existence.smallest_detectable.items()}
    return {n: size for n, size in found.items() if np.isfinite(size)}


def _leading(judged: Sequence[Judged], which: Which) -> Judged | None:
    """Return the explanation that the gap is drawn by: the pair where one is called, else the likeliest."""
    if which.pair:
        return next(j for j in judged if set(j.name.split("+")) == set(which.pair))
    ranked = sorted(which.probabilities.items(), key=lambda item: -item[1])
    for name, _ in ranked:
        if name != NONE:
            return next((j for j in judged if j.name == name), None)
    return None


def _coefficients(judged: Judged, evidence: Evidence) -> dict[str, float]:
    every = (*evidence.signatures, *evidence.tolerances)
    return {
        every[column - 1]: float(value)
        for column, value in zip(judged.best.columns, judged.estimate.value, strict=True)
    }


def _closures(
    used: list[Compared],
    kept: list[Compared],
    names: Sequence[str],
    evidence: Evidence,
    judged: Sequence[Judged],
    library: Mapping[str, Effect],
    which: Which,
    exists: bool,
    q: Question,
) -> tuple[list[Closure], dict[str, Refit]]:
    """Return the closures asked for, or those of what was found."""
    groups: list[tuple[str, ...]] = []
    if not q.close:
        return [], {}
    if q.named:
        groups = [q.named, *((n,) for n in q.named if len(q.named) > 1)]
    elif exists:
        if which.pair:
            groups.append(which.pair)
        likely = sorted(which.probabilities.items(), key=lambda item: -item[1])
        groups += [(n,) for n, p in likely if n not in _SOUGHT and p > 0.02][:_TOLD]
    closures, refits = [], {}
    for group in groups:
        closure, fitted = score.closure(
            used,
            kept,
            names,
            [library[n] for n in group],
            _start(group, evidence, judged, library, used),
            INTERVAL,
        )
        closures.append(closure)
        refits["+".join(group)] = fitted
    return closures, refits


def _start(
    group: Sequence[str],
    evidence: Evidence,
    judged: Sequence[Judged],
    library: Mapping[str, Effect],
    used: Sequence[Compared],
) -> dict[str, dict[str, float]]:
    """Return where the refit of effects begins: their linear estimates, jointly."""
    best = [next(j for j in judged if j.name == n).best for n in group]
    joint = Hypothesis(
        "+".join(group),
        tuple(dict.fromkeys(c for b in best for c in b.columns)),
        tuple({c: s for b in best for c, s in zip(b.columns, b.scale, strict=True)}.values()),
    )
    value = evidence.estimate(joint).value
    return {n: starting(library[n], evidence, joint, value, used[0].trial) for n in group}


def _of_calibration(which: Which, why: str) -> list[str]:
    if which.calibrated:
        return []
    return [f"the probabilities are not calibrated here: {why}; --self-test calibrates them on these flights"]


def _remarks(used: Sequence[Compared], simulation: Simulation) -> list[str]:
    said = []
    if not any(c.lines.inputs for c in used):
        said.append(
            "the records hold no injected signals: where a gap lies by input cannot be told, and feedback "
            "may make one effect look like another"
        )
    silent = {row.name for c in used for row in c.rows if row.kind == "kinematic"}
    if not silent:
        said.append(
            "without velocities, specific forces and attitude, faults of the sensors cannot be told apart"
        )
    if all(not c.trial.positions and "actuator_delay" in c.not_tested for c in used):
        said.append(
            f"{simulation.name} has no actuators: what happens between command and position is not tested"
        )
    loud = [
        c.rows[i].name
        for c in used
        for i in range(len(c.rows))
        if c.rows[i].kind == "response" and np.median(c.noise.sensor_share[i]) < 0.25
    ]
    if loud:
        told = ", ".join(dict.fromkeys(loud))
        said.append(
            f"in {told} most noise is not the sensors': turbulence, vibration or a strongly nonlinear gap"
        )
    return said
