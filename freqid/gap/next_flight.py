"""The flight that would tell the remaining explanations of a gap apart best."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.design import MultisineDesign
from freqid.core.errors import UsageError
from freqid.core.excitation import Excitation
from freqid.design.multisine import sampled
from freqid.gap.calibrate import APART
from freqid.gap.elsewhere import elsewhere, reference_of, rehearsed
from freqid.gap.excitations import Option, design, options, scaled
from freqid.gap.next_bench import Bench, Pair
from freqid.gap.rehearsal import Rehearsal, flown

Array = NDArray[np.float64]

MOST_FLIGHTS = 64
"""Flights beyond which nobody flies on."""

_MORE = 1.05  # times the separation at hand: what a flight that is worth a proposal gives at least
_LEAST = 0.1  # expected separation below which nothing is told
_TRIED = 2  # designs that are made, of the best options


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
        Largest rms of a signal over its rms in the flights at hand; zero where none was excited there.
    duration_s : float
    now, after : dict of float
        Expected separation of each pair by the flights at hand, and with this one.
    same : set of tuple
        Pairs that make the same change in all these flights.
    flights : dict
        How many of such flights tell each pair apart; None where `MOST_FLIGHTS` do not.
    simulated : bool
        Whether it was flown in the simulation, or scaled from what was flown.
    design : MultisineDesign
    """

    at: str
    excited: str
    names: tuple[str, ...]
    band_hz: tuple[float, float]
    amplitude: float
    duration_s: float
    now: dict[Pair, float]
    after: dict[Pair, float]
    same: set[Pair]
    flights: dict[Pair, int | None]
    simulated: bool
    design: MultisineDesign


def next_flight(bench: Bench, tell: Callable[[str], None] = lambda _: None) -> Proposal | None:
    """Return the flight that separates the rivals best together with those at hand.

    Rehearsed are the flights at hand, and where the simulation flies, conditions that nobody has flown and
    tilt drives that nobody has moved. Parts of each are judged, with other power; the best are designed, and
    flown in the simulation once more where it flies.

    Parameters
    ----------
    bench : Bench
    tell : callable, optional
        Called with what is being done.

    Returns
    -------
    Proposal or None
        None where no flight would tell more, or nothing is excited in the flights at hand and the
        simulation does not fly.
    """
    hand = bench.at_hand
    now = bench.separations(hand)
    tell("looking for the next flight")
    rehearsals = [flown(c, bench.sizes) for c in bench.compared]
    rehearsals += elsewhere(bench, tell)
    stated = bench.scenario.excitation if bench.scenario else None
    abort = stated.abort if stated else {}
    judged: list[tuple[float, Option, Array]] = []
    for rehearsal in rehearsals:
        for option in options(rehearsal, abort):
            gram = rehearsal.gram(bench.columns, option.power) * _longer(rehearsal, stated)
            judged.append((_worth(bench.separations(hand + gram)), option, gram))
    judged.sort(key=lambda one: -one[0])
    made = [_designed(bench, option, gram, now, stated) for _, option, gram in judged[:_TRIED]]
    found = max((p for p in made if p is not None), key=lambda p: _worth(p.after), default=None)
    if found is None or not any(x > max(_MORE * found.now[p], _LEAST) for p, x in found.after.items()):
        return None
    return found


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
    reference = reference_of(bench, record.reference)
    if reference is not None:
        flight = rehearsed(bench, sampled(made), reference)
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
        amplitude=_over_flown(bench, made),
        duration_s=made.duration_s,
        now=now,
        after=after,
        same=bench.same(bench.at_hand + gram),
        flights=_flights(bench, gram),
        simulated=checked,
        design=made,
    )


def _over_flown(bench: Bench, made: MultisineDesign) -> float:
    """Return the largest rms of a design's signals over theirs in the flights at hand."""
    ratios = [0.0]
    for signal in made.signals:
        name, rms = f"excitation/{signal.name}", float(np.sqrt((signal.amplitude**2).sum() / 2))
        before = [np.std(c.maneuver.record[name]) for c in bench.compared if name in c.maneuver.record]
        ratios += [rms / float(max(before))] if before and max(before) > 0 else []
    return max(ratios)


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
