"""The flight that separates the explanations of a gap best, of a few that the simulation tries."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from freqid.core.errors import UsageError
from freqid.core.record import FlightRecord
from freqid.core.results.design import MultisineDesign
from freqid.core.scenario import Scenario
from freqid.gap.infer.which import APART
from freqid.gap.next.excitations import (
    STRONGEST,
    Plan,
    amplitudes_flown,
    halves,
    largest_scale,
    scaled_signals,
    stated_excitation,
    tilting,
    unflown,
    whole,
)
from freqid.gap.next.predicted_flight import FlightContext, PredictedFlight, fly_alone, predict_columns
from freqid.gap.next.rivals import Pair
from freqid.gap.simulation import side_by_side
from freqid.gap.stack.block import Block

_COUNTS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
MOST_FLIGHTS = _COUNTS[-1]
"""Flights beyond which nobody flies on."""

_MORE = 1.05  # times the separation at hand: what a flight that is worth a proposal gives at least
_LEAST = 0.2  # expected separation below which nothing is told apart
_CONDITIONS = 2  # flown ones, and as many that nobody has flown
_TRIES = 4  # of the amplitude
_WEAKEST = 0.2  # of what was flown: less is no experiment


@dataclass(frozen=True, eq=False)
class NextFlight:
    """A flight, and what it is expected to say together with those at hand.

    Attributes
    ----------
    plan : Plan
        With amplitudes inside all limits.
    over_flown : float
        Largest rms of a signal over its rms in the flights at hand; zero where none was excited there.
    after : dict of float
        Expected separation of each pair with it.
    same : set of tuple
        Pairs that make the same change in all these flights.
    flights : dict
        How many of such flights tell each pair apart; None where `MOST_FLIGHTS` do not.
    """

    plan: Plan
    over_flown: float
    after: dict[Pair, float]
    same: set[Pair]
    flights: dict[Pair, int | None]


def next_flight(
    around: FlightContext, scenario: Scenario | None, tell: Callable[[str], None] = lambda _: None
) -> tuple[NextFlight | None, str]:
    """Return the flight that separates the rivals best together with those at hand.

    All effectors over the whole band at conditions that were flown, and where the simulation is the scenario
    at some that were not; at the best of them either half of the band, and the tilt drives.

    Parameters
    ----------
    around : FlightContext
    scenario : Scenario, optional
        Its excitation and conditions are what can be flown.
    tell : callable, optional
        Called with what is being done.

    Returns
    -------
    NextFlight or None
    str
        Why there is none; empty where there is one.
    """
    simulation = around.simulation
    if not simulation.can_fly:
        return None, f"{simulation.name} cannot fly, so no flight was predicted"
    vehicle = around.blocks[0].trial.maneuver.vehicle
    try:
        stated = stated_excitation(around.blocks, scenario)
        first = whole(stated, vehicle) if stated else None
    except UsageError as error:
        return None, f"no excitation can be designed: {error}"
    if stated is None or first is None:
        return None, "nothing was injected and no scenario states an excitation, so no flight was predicted"
    conditions = dict(_conditions(around, scenario))
    there = {at: scenario.at(at).excitation if scenario else None for at in conditions}
    abort = {at: (excitation or stated).abort for at, excitation in there.items()}
    judged = _judged(around, [Plan(at, "all", first) for at in conditions], conditions, abort, tell)
    if not judged:
        return None, f"{simulation.name} flies none of the proposed flights inside the limits"
    best = max(judged, key=lambda one: one[0])[1].at
    plans = [Plan(best, "all", design) for design in halves(stated, vehicle)]
    tilts = tilting(stated, vehicle)
    plans += [Plan(best, "tilt", tilts)] if tilts else []
    judged += _judged(around, plans, conditions, abort, tell)
    _, plan, predicted, after = max(judged, key=lambda one: one[0])
    rivals = around.rivals
    if not any(x > max(_MORE * rivals.now[p], _LEAST) for p, x in after.items()):
        return None, "no flight within the limits adds to what the flights at hand say"
    same = rivals.same(rivals.with_flight(predicted.matrices()))
    over = _over_flown(around.blocks, plan.design)
    return NextFlight(plan, over, after, same, _flights(around, predicted)), ""


def _judged(
    around: FlightContext,
    plans: Sequence[Plan],
    conditions: Mapping[str, Block],
    abort: Mapping[str, Mapping[str, float]],
    tell: Callable[[str], None],
) -> list[tuple[float, Plan, PredictedFlight, dict[Pair, float]]]:
    """Return what plans are worth, as strong as limits allow, and what makes them so; flown side by side."""
    rivals = around.rivals
    rivals.separations(rivals.system)  # what all plans share is computed once
    _ = around.allowed, around.airframe

    def judge(plan: Plan) -> tuple[float, Plan, PredictedFlight, dict[Pair, float]] | None:
        tell(f"trying a flight{' at ' + plan.at if plan.at else ''}")
        made = _tried(around, plan, conditions[plan.at], abort[plan.at])
        if made is None:
            return None
        after = rivals.separations(rivals.with_flight(made[1].matrices()))
        return _worth(after), *made, after

    return [one for one in side_by_side(around.simulation, judge, plans) if one is not None]


def _conditions(around: FlightContext, scenario: Scenario | None) -> Iterator[tuple[str, Block]]:
    """Yield conditions to be tried, each with the block at hand that is nearest to it in speed."""
    blocks = {b.maneuvers[0].record.reference: b for b in around.blocks}
    if scenario is None or around.simulation.kind != "scenario":
        yield from list(blocks.items())[:_CONDITIONS]
        return
    known = sorted((r for r in scenario.reference if r.id in blocks), key=lambda r: r.u)
    if not known:
        yield next(iter(blocks.items()))
        return
    for reference in {r.id: r for r in (known[0], known[-1])}.values():
        yield reference.id, blocks[reference.id]
    for reference in unflown(scenario.reference, known, _CONDITIONS):
        near = min(known, key=lambda r: abs(r.u - reference.u))
        yield reference.id, blocks[near.id]


def _tried(
    around: FlightContext, plan: Plan, like: Block, abort: Mapping[str, float]
) -> tuple[Plan, PredictedFlight] | None:
    """Return a plan as strong as its limits allow, and its columns; None where it cannot be flown."""
    vehicle, factor = like.trial.maneuver.vehicle, STRONGEST
    record: FlightRecord | None = None
    for _ in range(_TRIES):
        record = fly_alone(around.simulation, scaled_signals(plan.design, factor), plan.at, like)
        slack = largest_scale(record, vehicle, abort) if record else 0.5
        if slack >= 1:
            break
        factor, record = 0.98 * slack * factor, None
        if factor < _WEAKEST:
            return None
    if record is None:
        return None
    predicted = predict_columns(around, record, like, plan.design.periods)
    strong = Plan(plan.at, plan.effectors, scaled_signals(plan.design, factor))
    return None if predicted is None else (strong, predicted)


def _flights(around: FlightContext, predicted: PredictedFlight) -> dict[Pair, int | None]:
    """Return how many of such flights tell each pair apart."""
    rivals = around.rivals
    found: dict[Pair, int | None] = dict.fromkeys(rivals.pairs)
    for count in _COUNTS:
        each = rivals.separations(rivals.with_flight(predicted.matrices(count)))
        found = {p: count if n is None and each[p] >= APART else n for p, n in found.items()}
        if None not in found.values():
            break
    return found


def _over_flown(blocks: Sequence[Block], design: MultisineDesign) -> float:
    """Return the largest rms of a design's signals over theirs in the flights at hand."""
    flown = amplitudes_flown(blocks)
    sizes = {s.name: float(np.sqrt((s.amplitude**2).sum())) for s in design.signals}
    return max((x / flown[n] for n, x in sizes.items() if n in flown), default=0.0)


def _worth(separations: Mapping[Pair, float]) -> float:
    """Return what an experiment is worth: pairs told apart, then how far apart all are."""
    apart = sum(x >= APART for x in separations.values())
    return apart + float(np.mean(np.log1p(np.array(list(separations.values())) / APART))) / 100
