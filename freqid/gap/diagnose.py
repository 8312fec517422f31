"""The whole diagnosis: compare, ask whether, where, which, and how far the gap shrinks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from freqid.core.diagnosis import GapDiagnosis, Which
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.gap_map import GapMap
from freqid.core.record import Maneuver
from freqid.gap import attribute, calibrate, calibration, locate, remarks
from freqid.gap.attribute import NONE, Judged
from freqid.gap.changes import changes
from freqid.gap.closures import closures_of
from freqid.gap.compare import Compared, compare
from freqid.gap.evidence import Evidence
from freqid.gap.existence import existence_of, with_reached
from freqid.gap.finalists import weighed_in_full
from freqid.gap.gather import evidence_of
from freqid.gap.overlap import overlap
from freqid.gap.refit import Refit
from freqid.gap.self_test import self_test
from freqid.gap.simulation import Simulation, side_by_side
from freqid.gap.verdict import verdict
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]

LEVEL = 0.02
"""At which a gap is called one, unless told otherwise."""

INTERVAL = 0.90
_IDLE = "it changes nothing in these manoeuvres"


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
    cache : Path, optional
        Folder in which draws of the null are kept from one diagnosis to the next, as `kept_draws.folder`.
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
    cache: Path | None = None


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

    def one(i: int) -> Compared:
        tell(f"comparing {names[i]} ({i + 1} of {len(names)})")
        return _compared(simulation, (*maneuvers, *held_out)[i], q, i, names[i])

    every = side_by_side(simulation, one, range(len(maneuvers) + len(held_out)))
    tell("weighing effects")
    used, kept = every[: len(maneuvers)], every[len(maneuvers) :]
    library = {i: e.of(maneuvers[0].vehicle) for i, e in q.candidates.items()}
    evidence = evidence_of(used, seed=q.seed, apart=True)
    judged = attribute.judge(evidence, library)
    statistic, null = attribute.existence(judged)
    existence = existence_of(statistic, null, used, evidence, judged, library, q.level)
    if existence.exists:
        tell("weighing finalists in full")
        judged = weighed_in_full(judged, evidence, library, used)
        judged = attribute.with_the_unexplained(judged, evidence)
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
        existence = with_reached(existence, tested, evidence, judged)
    table = tested.table if tested else table
    which = calibrate.which(
        judged,
        evidence,
        library,
        not_tested,
        existence.exists,
        INTERVAL,
        table,
        overlap(judged, evidence, used),
    )
    for name in q.named:
        if name not in library:
            raise UsageError(f"effect '{name}' is unknown", remedy=nearest(name, library))
        if name in not_tested:
            raise UsageError(f"effect '{name}' cannot be tested here: {not_tested[name]}")
    leading = _leading(judged, which)
    explained = _explained(leading, evidence, library, used)
    found = locate.gap_map(used, explained)
    where = tuple(found.places()) if existence.exists else ()
    tell("closing")
    closures, refits = (
        closures_of(used, kept, names, evidence, judged, library, which, existence.exists, q.named, INTERVAL)
        if q.close
        else ([], {})
    )
    diagnosis = GapDiagnosis(
        verdict=verdict(existence, where, found, which, closures),
        simulation=simulation.name,
        records=tuple(names),
        gap=existence,
        where=where,
        which=which,
        how_far=tuple(closures),
        remarks=(*remarks.of_records(used, simulation), *remarks.of_calibration(which, why)),
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
            cache=q.cache,
        )
    except DataError as error:
        raise DataError(str(error), where=name) from None


def _leading(judged: Sequence[Judged], which: Which) -> Judged | None:
    """Return the explanation that the gap is drawn by: the pair where one is called, else the likeliest."""
    if which.pair:
        return next(j for j in judged if set(j.name.split("+")) == set(which.pair))
    ranked = sorted(which.probabilities.items(), key=lambda item: -item[1])
    for name, _ in ranked:
        if name != NONE:
            return next((j for j in judged if j.name == name), None)
    return None


def _explained(
    leading: Judged | None, evidence: Evidence, library: Mapping[str, Effect], used: Sequence[Compared]
) -> list[NDArray[np.complex128]]:
    """Return what an explanation makes of each manoeuvre's residual, in full where it was weighed so."""
    if leading and leading.settings:
        effects = [library[i] for i in leading.settings]
        return [changes(c, effects, leading.settings) for c in used]
    return locate.explained(used, attribute.coefficients(leading, evidence) if leading else {})
