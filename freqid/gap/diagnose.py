"""The whole diagnosis: one stack, one model, and every answer a question to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from freqid.core.arrays import Complex
from freqid.core.errors import UsageError, nearest
from freqid.core.memory import give_back_large_arrays
from freqid.core.record import Maneuver
from freqid.core.results.diagnosis import Closure, Existence, GapDiagnosis, Interval, SensorFault, Which
from freqid.core.results.gap import GapMap
from freqid.gap.close.closing import Closing, closing_of
from freqid.gap.close.closure import Closed, close
from freqid.gap.closest_flight import apart, as_near, closest, effect_of_its_own, flown, nearer
from freqid.gap.infer.build import at_their_size, build, flown_departures
from freqid.gap.infer.columns import Columns
from freqid.gap.infer.evidence import NONE, Estimate, Evidence, estimate
from freqid.gap.infer.explain import Explanation, explain
from freqid.gap.infer.joint_replay import about_explanation, about_single
from freqid.gap.infer.joint_sizes import form_beside, joint_estimates
from freqid.gap.infer.linearise import Linearised
from freqid.gap.infer.null_draws import null_statistics, threshold_of
from freqid.gap.infer.system import System
from freqid.gap.infer.where import gap_map
from freqid.gap.infer.which import Ranking, detectable_sizes, groups_of, probability_of_none, rank
from freqid.gap.model.candidate import OTHER, Candidate
from freqid.gap.settings import FORM_ERRORS, FORM_TYPICAL, INTERVAL, LEVEL, NAMED, NULL_DRAWS, TEMPERATURE
from freqid.gap.simulation import Settings, Simulation
from freqid.gap.stack.block import Block, stack_of
from freqid.gap.verdict import remarks_of, tolerances_used, verdict
from freqid.simulate.effects.effect import Effect

_STRAINED = 3  # tolerances whose strain is said
_AWAY = 1.0  # sigmas between departures with and without the effect, from which those with it are flown
_SHOWN = 0.001  # of what a row moves, from which an effect is said to move it
_FORM_SHOWN = 1.05 * FORM_TYPICAL  # from which an error of form is one that the record shows
_FLIGHTS = 2  # times at most that it flies with what was found


@dataclass(frozen=True, eq=False)
class Question:
    """What is asked.

    Attributes
    ----------
    candidates : dict of Effect
        Effects that are asked about, by id.
    tolerances : dict of float
        One sigma by name, of `freqid.gap.model.tolerance.stated`.
    given : tuple of str
        Those among them that the user stated.
    band_hz : tuple of 2 floats
    named : tuple of str
        Effects whose closure is wanted; those found where empty.
    level : float
        Share of flights without a gap in which one may be called.
    draws : int
        Of the model without effect.
    seed : int
    close : bool
        Whether the gap is closed on manoeuvres that were not used.
    """

    candidates: Mapping[str, Effect]
    tolerances: Mapping[str, float]
    band_hz: tuple[float, float] = (0.05, 2.0)
    given: tuple[str, ...] = ()
    named: tuple[str, ...] = ()
    level: float = LEVEL
    draws: int = NULL_DRAWS
    seed: int = 0
    close: bool = True


@dataclass(frozen=True, eq=False)
class Findings:
    """A diagnosis, and what its pictures and further questions are made from.

    Attributes
    ----------
    diagnosis : GapDiagnosis
    blocks : list of Block
        Conditions.
    columns : list of Columns
        By block, those of the evidence.
    system : System
        With effects at the sizes of the explanation, where there is one.
    evidence : Evidence
    threshold : float
        Of the statistic, at the level asked for.
    explanation : Explanation, optional
    map : GapMap
    closing : Closing, optional
        What the gap was closed on.
    closed : list of Closed
        The leading closure first.
    explained : list of ndarray of complex, shape (row, line)
        What the leading explanation makes of each block's residual.
    """

    diagnosis: GapDiagnosis
    blocks: list[Block]
    columns: list[Columns]
    system: System
    evidence: Evidence
    threshold: float
    explanation: Explanation | None
    map: GapMap
    closing: Closing | None = None
    closed: list[Closed] = field(default_factory=list)
    explained: list[Complex] = field(default_factory=list)


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
        On which closures are scored; without them, the conditions take turns.
    names : sequence of str
        Of the manoeuvres, then of those held out.
    tell : callable, optional
        Called with what is being done.

    Raises
    ------
    DataError
        Where a record and the simulation do not fit together, or nothing can be told from them.
    UsageError
        For a named effect that is unknown or cannot be tested here.
    """
    q = question
    give_back_large_arrays()
    if not maneuvers:
        raise UsageError("there is no manoeuvre to compare", remedy="name one record or more")
    names = list(names) or [f"manoeuvre {i + 1}" for i in range(len(maneuvers) + len(held_out))]
    library = {i: e.of(maneuvers[0].vehicle) for i, e in q.candidates.items()}
    tell("replaying the simulation")
    count = len(maneuvers)
    used = stack_of(simulation, maneuvers, names[:count], q.band_hz, seed=q.seed)
    departures: dict[str, float] = {}
    departs = bool(simulation.tolerances) and any(b.motion.flown for b in used)
    if departs:
        tell("flying the simulation as it is likeliest")
        departures = flown_departures(used, library, q.tolerances)
        used, departures = closest(flown(simulation, used, departures, {}), (used, {}))
    tell("computing effects and tolerances")
    at, not_tested = build(used, library, q.tolerances)
    for name in q.named:
        if name not in library:
            raise UsageError(f"effect '{name}' is unknown", remedy=nearest(name, library))
        if name in not_tested:
            raise UsageError(f"effect '{name}' cannot be tested here: {not_tested[name]}")
    tell("weighing effects")
    at, without = at.settled_beside_none(at.evidence.form_error())
    evidence = replace(at.evidence, without=without)  # asked here alone: later ones stand on other lines
    null = null_statistics(evidence, q.draws, q.seed)
    drawn = float((1 + (null >= evidence.statistic).sum()) / (1 + null.size))
    p_none = probability_of_none(evidence)
    p = max(drawn, p_none)
    threshold = threshold_of(null, q.level)
    exists = p <= q.level
    if exists:
        tell("computing the likeliest effects at their size")
        at = at_their_size(at)
        evidence = at.evidence
    found: dict[str, Settings] = {}
    blocks, repeated = at.blocks, any(len(b.maneuvers) > 1 for b in used)
    for _ in range(_FLIGHTS if exists and (departs or repeated) else 0):
        beside = at.likeliest_departures(evidence.form_error())[0] if departs else {}
        likely = effect_of_its_own(evidence, simulation, library)
        near = as_near(*(dict(x.get("effects", {})) for x in (likely, found)))
        near = near and apart(beside, departures, simulation, q.tolerances) <= _AWAY
        if near and not repeated:
            break
        tell("flying the simulation as it is likeliest with what was found")
        again, departed = at.blocks, departures
        if not near:
            again, departed = closest(*(flown(simulation, blocks, d, likely) for d in (beside, {})))
        if repeated:
            told, _ = flown(simulation, blocks, departed, likely, seen=True)
            again = nearer(told, again)
        if near and again == at.blocks:
            break
        found, used, departures = likely, again, departed
        at, not_tested = build(used, library, q.tolerances, _behind(evidence, library), at.system)
        at = at_their_size(at)
        at = at.settled(at.evidence.form_error())
        evidence = at.evidence
    if exists:
        at = at.among_likeliest(at.evidence.form_error())
        evidence = at.evidence
    ranking = rank(evidence, exists, INTERVAL, TEMPERATURE, p_none if exists else max(p_none, 0.5))
    leading = _leading(q.named, ranking)
    explanation: Explanation | None = None
    joint, used = at, at.blocks
    if leading and exists:
        tell("looking for a second effect")
        explanation, joint = _explanation(at, leading, asked=bool(q.named))
        if explanation.effects[0] not in leading:  # computed at its size, another one took its place
            evidence, ranking = joint.evidence, rank(joint.evidence, exists, INTERVAL, TEMPERATURE, p_none)
    by_effect = [_made(e, used) for e in _clear(explanation)]
    explained = [sum((one[i] for one in by_effect), np.zeros_like(b.residual)) for i, b in enumerate(used)]
    form_error = (
        form_beside(joint.system, explanation.places, explanation.estimates)
        if explanation
        else evidence.form_error()
    )
    cells = gap_map(used, joint.columns, by_effect or [[b.residual for b in used]], form_error)
    closing: Closing | None = None
    closed: list[Closed] = []
    if q.close and explanation:
        tell("closing the gap")
        others = stack_of(
            simulation, held_out, names[count:], q.band_hz, seed=q.seed + 500, departures=departures, **found
        )
        closing = closing_of(joint, others, explanation, form_error)
        singles = [
            closing_of(about, others, single, form_error)
            for about, single in (
                about_single(joint, one, form_error) for one in explanation.interacting(joint.system)
            )
        ]
        closed = close(closing, explanation, q.seed, library, q.tolerances, len(leading), singles)
    forms = evidence.form_sizes(at.columns[0].form_names)
    relations = {n.partition("/")[2]: f for n, f in forms.items() if n.startswith("kinematic/")}
    relations = {n: f if f >= FORM_ERRORS[1] else 0.0 for n, f in relations.items()}
    forms = {n: f if f >= _FORM_SHOWN else 0.0 for n, f in forms.items() if "/" not in n}
    existence = _existence(exists, p, threshold, q.level, evidence, used, forms)
    which = _which(ranking, evidence, explanation, exists, not_tested, closed, used, library)
    sensors = _sensors(explanation, library, which) if exists else ()
    where = tuple(cells.places()) if exists else ()
    closures = tuple(_figures(c, joint.system) for c in closed)
    diagnosis = GapDiagnosis(
        verdict=verdict(existence, where, cells, which, closures, sensors, library),
        simulation=simulation.name,
        records=tuple(names),
        gap=existence,
        where=where,
        which=which,
        how_far=closures,
        remarks=tuple(remarks_of(used, simulation, existence, relations, tried=len(names) > 1)),
        sensors=sensors,
        tolerances=tolerances_used(q.tolerances, simulation, library, used[0].maneuvers[0], q.given),
    )
    return Findings(
        diagnosis,
        used,
        at.columns,
        joint.system,
        evidence,
        threshold,
        explanation,
        cells,
        closing,
        closed,
        explained,
    )


def _behind(evidence: Evidence, library: Mapping[str, Effect]) -> dict[str, list[Candidate]]:
    """Return the candidates of all effects that do not lead, by effect.

    These stay as they are when the leading ones are computed on another flight: they are computed there once
    they may act beside one that leads.
    """
    every = evidence.system.candidates
    leading = {every[i].effect for i in evidence.likeliest}
    return {e: [c for c in every if c.effect == e] for e in library if e not in leading}


def _explanation(at: Linearised, leading: Sequence[str], *, asked: bool) -> tuple[Explanation, Linearised]:
    """Return the explanation that leading effects begin, and the model about it."""

    def compute(
        at: Linearised, explanation: Explanation, others: list[tuple[int, Estimate]], anew: bool
    ) -> Linearised:
        form_error = form_beside(at.system, explanation.places, explanation.estimates)
        return about_explanation(at, explanation, others, form_error, anew=anew)

    start = at.all_redrawn()
    return explain(start, leading, at.columns[0].form_names, asked=asked, compute=compute)


def _leading(named: Sequence[str], ranking: Ranking) -> tuple[str, ...]:
    return tuple(dict.fromkeys(named)) or tuple(n for n in ranking.probabilities if n != NONE)[:1]


def _clear(explanation: Explanation | None) -> list[Estimate]:
    """Return the effects of an explanation whose intervals leave out zero; those asked for need not."""
    found = explanation.estimates if explanation else ()
    return [e for e in found if np.any((e.lo > 0) | (e.hi < 0))]


def _figures(closed: Closed, system: System) -> Closure:
    """Return a closure with the tolerances that are off most where the effect is not allowed for.

    Relations between sensors have no simulation, so no Theil coefficient either.
    """
    off = closed.fit.tolerances_alone
    strained = {system.tolerances[i]: float(off[i]) for i in np.argsort(-np.abs(off))[:_STRAINED]}
    theil = {n: c for n, c in closed.closure.theil.items() if not n.startswith("kinematic/")}
    return replace(closed.closure, theil=theil, strained=strained)


def _made(estimate: Estimate, blocks: Sequence[Block]) -> list[Complex]:
    """Return what an effect makes of every block, shape (row, line) each."""
    return [np.tensordot(estimate.weights, estimate.candidate.columns[i], 1) for i in range(len(blocks))]


def _moved(explanation: Explanation | None, blocks: Sequence[Block]) -> dict[str, dict[str, float]]:
    """Return how large each effect is in loads and positions, over what these move; largest first.

    Root mean squares over all lines but zero frequency: a mean is no movement.
    """
    found = {}
    whole = [b.transform(b.trial.measured) for b in blocks]
    for e in explanation.estimates if explanation else ():
        shares: dict[str, float] = {}
        for i, row in enumerate(blocks[0].rows):
            if row.kind in ("response", "actuator"):
                parts = [[z[i, 1:] for z in x] for x in (_made(e, blocks), whole)]
                made, moved = (float(np.linalg.norm(np.concatenate(x))) for x in parts)
                shares[row.name] = made / moved if moved else 0.0
        seen = sorted((n for n in shares if shares[n] >= _SHOWN), key=lambda n: -shares[n])
        found[e.candidate.effect] = {n: shares[n] for n in seen}
    return found


def _existence(
    exists: bool,
    p: float,
    threshold: float,
    level: float,
    evidence: Evidence,
    used: Sequence[Block],
    forms: dict[str, float],
) -> Existence:
    from scipy.stats import chi2

    reached = detectable_sizes(evidence, threshold)
    sizes = {name: size for name, (size, _) in reached.items()}
    energy = sum(float((b.white(b.residual) ** 2).sum()) for b in used)
    return Existence(
        exists=exists,
        p=p,
        level=level,
        naive_p=float(chi2.sf(energy, evidence.system.number)),
        smallest_detectable=sizes,
        unit={name: unit for name, (_, unit) in reached.items()},
        largest_undetected={} if exists else sizes,
        form_errors=forms,
        noise_from=tuple(dict.fromkeys(b.noise_from for b in used)),
    )


def _which(
    ranking: Ranking,
    evidence: Evidence,
    explanation: Explanation | None,
    exists: bool,
    not_tested: dict[str, str],
    closed: Sequence[Closed],
    blocks: Sequence[Block],
    library: Mapping[str, Effect],
) -> Which:
    effects = [e for e in ranking.credible if e not in (NONE, OTHER)]
    effects += [e for e in (explanation.effects if explanation else ()) if e not in effects and e != OTHER]
    parameters = {}
    held = zip(explanation.places, explanation.estimates, strict=True) if explanation else ()
    explained = {e.candidate.effect: (i, e) for i, e in held}
    at = {e: explained[e][0] if e in explained else evidence.best_place(e) for e in effects}
    for effect, index in at.items():
        found = explained[effect][1] if effect in explained else joint_estimates(evidence.system, [index])[0]
        c = found.candidate
        names = c.place.parameters if c.kind == "vector" else (c.place.at or c.place.parameters[0],)
        parameters[effect] = {
            n: Interval(float(x), float(lo), float(hi), unit)
            for n, x, lo, hi, unit in zip(
                names, found.size, found.lo, found.hi, c.units or (c.unit,) * len(names), strict=False
            )
        }
        parameters[effect] |= {
            n: Interval(v, v, v, library[effect].parameters[n].unit) for n, v in c.place.fixed
        }
    own = evidence.best_place(OTHER) if OTHER in ranking.credible else None
    if own is not None and evidence.system.candidates[own].kind == "scalar":
        found, name = estimate(evidence, own, INTERVAL), evidence.system.candidates[own].place.label
        size, lo, hi = (float(x[0]) for x in (found.size, found.lo, found.hi))
        parameters[OTHER] = {name: Interval(size, lo, hi, found.candidate.unit)}
    withdrawn = {}
    pair = tuple(e.candidate.effect for e in _clear(explanation))[:2]
    pair = pair if len(pair) > 1 else ()
    share = sum(ranking.probabilities.get(n, 0.0) for n in ranking.alike)
    named = ranking.alike if exists and share >= NAMED else ()
    if closed and closed[0].withdrawn and {*named, *pair} & set(closed[0].closure.effects):
        withdrawn = dict.fromkeys((*named, *pair), closed[0].withdrawn)
        named, pair = (), ()
    possible = [n for n in ranking.credible if ranking.probabilities[n] > 0.01]
    return Which(
        probabilities=ranking.probabilities,
        set=ranking.credible,
        aliases=groups_of(evidence, possible) if exists else (),
        not_tested=not_tested,
        parameters=parameters if exists else {},
        calibrated=True,
        pair=tuple(pair),
        named=tuple(named),
        withdrawn=withdrawn,
        places={e: evidence.system.candidates[i].place.label for e, i in at.items()},
        groups={g.name: g.effectors for g in blocks[0].trial.maneuver.vehicle.groups},
        moves=_moved(explanation, blocks) if exists else {},
    )


def _sensors(
    explanation: Explanation | None, library: Mapping[str, Effect], which: Which
) -> tuple[SensorFault, ...]:
    """Return the faults of sensors that an explanation holds, unless they are withdrawn."""
    found = []
    for e in explanation.estimates if explanation else ():
        effect = library.get(e.candidate.effect)
        if effect is None or effect.stage != "sensor" or effect.id in which.withdrawn:
            continue
        if effect.id not in (*which.named, *which.pair):
            continue
        for name, interval in which.parameters.get(effect.id, {}).items():
            found.append(
                SensorFault(effect.id, name, interval.estimate, interval.lo, interval.hi, interval.unit)
            )
    return tuple(found)
