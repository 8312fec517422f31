"""What to do next where a diagnosis leaves several explanations: a flight, and tests on the ground."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from freqid.core.design import MultisineDesign
from freqid.core.scenario import Scenario
from freqid.gap.attribute import NONE
from freqid.gap.calibrate import APART
from freqid.gap.diagnose import Findings, Question
from freqid.gap.explanations import Explanation, left_standing, pairs_of
from freqid.gap.ground_tests import TESTS, UNTESTABLE, distance
from freqid.gap.next_bench import Bench, Pair
from freqid.gap.next_flight import MOST_FLIGHTS, Proposal, next_flight
from freqid.gap.simulation import Simulation

_CLEARLY = 0.5  # of a pair's expected separation: what a test adds at least to be listed


@dataclass(frozen=True, eq=False)
class NextTest:
    """What would tell the remaining explanations apart.

    Attributes
    ----------
    table : dict
        As ``next_flight`` of ``diagnose-gap --json``; empty where nothing remains to be told apart.
    design : MultisineDesign or None
        Of the flight.
    """

    table: dict[str, Any] = field(default_factory=dict)
    design: MultisineDesign | None = None


def next_test(
    found: Findings,
    simulation: Simulation,
    question: Question,
    scenario: Scenario | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> NextTest:
    """Return the flight and the ground tests that would best tell apart what a diagnosis leaves.

    Parameters
    ----------
    found : Findings
    simulation : Simulation
    question : Question
    scenario : Scenario, optional
        Its excitation and conditions are what can be flown.
    tell : callable, optional
        Called with what is being done.
    """
    diagnosis = found.diagnosis
    if not diagnosis.gap.exists:
        return NextTest()
    vehicle = found.compared[0].maneuver.vehicle
    library = {i: e.of(vehicle) for i, e in question.candidates.items()}
    rivals, groups = left_standing(diagnosis.which, found.judged, found.evidence, library)
    if not groups:
        return NextTest()
    bench = Bench(
        simulation=simulation,
        compared=found.compared,
        evidence=found.evidence,
        rivals={r.name: r for r in rivals},
        pairs=tuple(pairs_of(groups)),
        candidates=library,
        sizes=question.tolerances,
        scenario=scenario,
    )
    flight = next_flight(bench, tell)
    now = flight.now if flight else bench.separations(bench.at_hand)
    same = flight.same if flight else bench.same(bench.at_hand)
    tests = [_flight(flight)] if flight else []
    tests += on_ground(bench.rivals, now, question.tolerances)
    tests.sort(key=lambda t: (-len(t["separates"]), -sum(min(p["after"], 100.0) for p in t["pairs"])))
    table: dict[str, Any] = {
        "separates": [list(p) for p in _separated(flight.now, flight.after)] if flight else [],
        "gain": next((t["gain"] for t in tests if t["kind"] == "flight"), None),
        "design": "",
        "groups": [_group(g, bench.rivals, flight, tests, same) for g in groups],
        "tests": tests,
    }
    return NextTest(table, flight.design if flight else None)


def on_ground(
    rivals: Mapping[str, Explanation], now: Mapping[Pair, float], tolerances: Mapping[str, float]
) -> list[dict[str, Any]]:
    """Return the ground tests that add to what flights say of pairs, as tables.

    Parameters
    ----------
    rivals : dict of Explanation
    now : dict of float
        Expected separation by the flights at hand, by pair.
    tolerances : dict of float
    """
    tables = []
    for test in TESTS:
        after, told = {}, {}
        for pair, have in now.items():
            adds, measured = distance(test, rivals[pair[0]], rivals[pair[1]], tolerances)
            if adds > _CLEARLY:
                after[pair] = have + adds
                told |= dict.fromkeys(measured)
        if after:
            table = _test("ground", test.id, test.how, now, after)
            tables.append(table | {"instrument": test.instrument, "measures": list(told)})
    return tables


def _flight(flight: Proposal) -> dict[str, Any]:
    """Return a flight as a table."""
    what = {"all": "all effectors", "": "the inputs"}.get(flight.excited, f"{flight.excited}s alone")
    low, high = flight.band_hz
    how = f"excite {what} from {low:.2g} to {high:.2g} Hz for {flight.duration_s:.0f} s"
    how += f" at {flight.at}" if flight.at else ""
    how += f", up to {flight.amplitude:.2g} times as strong as flown" if flight.amplitude else ""
    table = _test("flight", "next flight", how, flight.now, flight.after)
    for one in table["pairs"]:
        one["flights"] = flight.flights[tuple(one["rivals"])]
    return table | {
        "at": flight.at,
        "effectors": list(flight.names),
        "band_hz": list(flight.band_hz),
        "duration_s": flight.duration_s,
        "over_flown": flight.amplitude,
        "rms": {x.name: float((x.amplitude**2).sum() / 2) ** 0.5 for x in flight.design.signals},
        "predicted_by": "the simulation's own flight" if flight.simulated else "the flights at hand, scaled",
    }


def _test(
    kind: str, name: str, how: str, now: Mapping[Pair, float], after: Mapping[Pair, float]
) -> dict[str, Any]:
    separates = _separated(now, after)
    gains = [after[p] / now[p] if now[p] > 0 else float("inf") for p in separates or after]
    gain = min(gains)
    return {
        "kind": kind,
        "name": name,
        "how": how,
        "separates": [list(p) for p in separates],
        "gain": gain if isfinite(gain) else None,
        "pairs": [{"rivals": list(p), "now": now[p], "after": after[p]} for p in after],
    }


def _separated(now: Mapping[Pair, float], after: Mapping[Pair, float]) -> list[Pair]:
    """Return the pairs that an experiment tells apart and flights at hand do not; else all that it tells."""
    told = [p for p, x in after.items() if x >= APART]
    return [p for p in told if now[p] < APART] or told


def _group(
    group: Sequence[str],
    rivals: Mapping[str, Explanation],
    flight: Proposal | None,
    tests: Sequence[Mapping[str, Any]],
    same: set[Pair],
) -> dict[str, Any]:
    """Return what splits a group, in a sentence for each pair that is not told apart yet."""
    said, split = [], {}
    for pair in pairs_of([tuple(group)]):
        names = f"{pair[0]} and {pair[1]}"
        by_flight = flight is not None and flight.after[pair] >= APART
        ground = [t for t in tests if t["kind"] == "ground" and list(pair) in _told(t)]
        best = max(ground, key=lambda t: _after(t, pair), default=None)
        split[pair] = "next flight" if by_flight else best["name"] if best else ""
        on = f"on the ground: {best['name']}" if best else _why_not(pair)
        if by_flight:
            assert flight is not None
            said.append(
                f"{names}: the next flight tells them apart ({flight.now[pair]:.1f} now, "
                f"{flight.after[pair]:.1f} with it); {on}"
            )
            continue
        count = flight.flights[pair] if flight else None
        if pair in same:
            why = "no flight of this kind can, they make the same change"
        elif count is not None:
            why = f"{count} such flights would"
        elif flight is not None:
            why = f"{MOST_FLIGHTS} such flights would not"
        else:
            why = "no flight within limits tells more than tolerances allow"
        said.append(f"{names}: {why}; {on}")
    return {
        "rivals": list(group),
        "split_by": sorted({name for name in split.values() if name}),
        "splits": all(split.values()),
        "sentence": ". ".join(said) + ".",
    }


def _told(test: Mapping[str, Any]) -> list[list[str]]:
    return [p["rivals"] for p in test["pairs"] if p["after"] >= APART]


def _after(test: Mapping[str, Any], pair: Pair) -> float:
    return next(p["after"] for p in test["pairs"] if p["rivals"] == list(pair))


def _why_not(pair: Pair) -> str:
    """Return why no ground test splits a pair."""
    known = [UNTESTABLE[n] for n in pair if n in UNTESTABLE]
    named = [n for n in pair if n != NONE and n not in UNTESTABLE]
    if known and not named:
        return f"none on the ground can: {known[0]}"
    return "none on the ground can at the sizes estimated" + (f"; {known[0]}" if known else "")
