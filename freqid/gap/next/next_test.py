"""What to do next where a diagnosis leaves several explanations: a flight, and tests on the ground."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from math import isfinite
from pathlib import Path
from typing import Any

from freqid.core.scenario import Scenario
from freqid.gap.diagnose import Findings, Question
from freqid.gap.infer.which import APART
from freqid.gap.next.ground_tests import TESTS, UNTESTABLE, distance
from freqid.gap.next.next_flight import MOST_FLIGHTS, NextFlight, next_flight
from freqid.gap.next.predicted_flight import FlightContext
from freqid.gap.next.rivals import Pair, RivalExplanations, rivals_of
from freqid.gap.simulation import Simulation

_CLEARLY = 1.0  # of a pair's expected separation: what a ground test adds at least to be listed
_ENOUGH = 20 * APART  # beyond it more separation is worth nothing


def propose_test(
    findings: Findings,
    simulation: Simulation,
    question: Question,
    scenario: Scenario | None,
    design_file: Path | None,
    *,
    scenario_sha256: str = "",
    tell: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """Return the flight and the ground tests that separate what a diagnosis leaves best.

    Parameters
    ----------
    findings : Findings
    simulation : Simulation
    question : Question
        That the findings answer.
    scenario : Scenario, optional
        Its excitation and conditions are what can be flown.
    design_file : Path, optional
        Where the flight's design is written; nothing is written where it is absent or no flight is proposed.
    scenario_sha256 : str
        For the design's file.
    tell : callable, optional
        Called with what is being done.

    Returns
    -------
    dict
        ``next_flight`` of `GapDiagnosis`; empty where nothing remains to be told apart.

    Raises
    ------
    DataError
        Where the design cannot be written.
    """
    rivals = rivals_of(findings)
    if rivals is None:
        return {}
    tell("looking for the next flight")
    around = FlightContext(
        simulation=simulation,
        rivals=rivals,
        candidates=question.candidates,
        sizes=question.tolerances,
        band_hz=question.band_hz,
        blocks=findings.blocks,
        columns=findings.columns,
    )
    flight, why_none = next_flight(around, scenario, tell)
    tests = [_flight_table(flight, rivals.now)] if flight else []
    tests += ground_tables(rivals, question.tolerances)
    tests.sort(key=lambda t: (-len(t["separates"]), -sum(min(p["after"], _ENOUGH) for p in t["pairs"])))
    same = flight.same if flight else rivals.same(rivals.system)
    return {
        "separates": [list(p) for p in _separated(rivals.now, flight.after)] if flight else [],
        "gain": next((t["gain"] for t in tests if t["kind"] == "flight"), None),
        "design": _written(flight, design_file, scenario_sha256),
        "no_flight": why_none,
        "groups": [_group(g, rivals, flight, why_none, tests, same) for g in rivals.groups],
        "tests": tests,
    }


def ground_tables(rivals: RivalExplanations, tolerances: Mapping[str, float]) -> list[dict[str, Any]]:
    """Return the ground tests that add to what flights say of the pairs, as tables.

    Parameters
    ----------
    rivals : RivalExplanations
    tolerances : dict of float
        One sigma by name.
    """
    tables = []
    for test in TESTS:
        after: dict[Pair, float] = {}
        measures: dict[str, None] = {}
        for pair, now in rivals.now.items():
            adds, measured = distance(test, rivals, pair, tolerances)
            if adds > _CLEARLY:
                after[pair] = now + adds
                measures |= dict.fromkeys(measured)
        if after:
            table = _table("ground", test.id, test.how, rivals.now, after)
            tables.append(table | {"instrument": test.instrument, "measures": list(measures)})
    return tables


def _written(flight: NextFlight | None, design_file: Path | None, scenario_sha256: str) -> str:
    """Write a flight's design and return where it is; empty where nothing is written."""
    if flight is None or design_file is None:
        return ""
    from freqid.core.results.design import write_design
    from freqid.design.multisine.orthogonal_set import sampled

    write_design(design_file, flight.plan.design, sampled(flight.plan.design), scenario_sha256)
    return str(design_file)


def _flight_table(flight: NextFlight, now: Mapping[Pair, float]) -> dict[str, Any]:
    plan, design = flight.plan, flight.plan.design
    what = {"all": "all effectors"}.get(plan.effectors, f"{plan.effectors}s alone")
    low, high = design.band_hz
    how = f"excite {what} from {low:.2g} to {high:.2g} Hz for {design.duration_s:.0f} s"
    how += f" at {plan.at}" if plan.at else ""
    how += f", up to {flight.over_flown:.2g} times as strong as flown" if flight.over_flown else ""
    table = _table("flight", "next flight", how, now, flight.after)
    for one in table["pairs"]:
        first, second = one["rivals"]
        one["flights"] = flight.flights[first, second]
    return table | {
        "at": plan.at,
        "effectors": list(design.names),
        "band_hz": list(design.band_hz),
        "duration_s": design.duration_s,
        "over_flown": flight.over_flown,
        "rms": {x.name: float((x.amplitude**2).sum() / 2) ** 0.5 for x in design.signals},
        "predicted_by": "the simulation's own flight",
    }


def _table(
    kind: str, name: str, how: str, now: Mapping[Pair, float], after: Mapping[Pair, float]
) -> dict[str, Any]:
    separates = _separated(now, after)
    gain = min(after[p] / now[p] if now[p] > 0 else float("inf") for p in separates or after)
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
    apart = [p for p, x in after.items() if x >= APART]
    return [p for p in apart if now[p] < APART] or apart


def _group(
    group: Sequence[str],
    rivals: RivalExplanations,
    flight: NextFlight | None,
    why_none: str,
    tests: Sequence[Mapping[str, Any]],
    same: set[Pair],
) -> dict[str, Any]:
    """Return what splits a group, in a sentence for each pair."""
    sentences: list[str] = []
    split: list[str] = []
    for pair in combinations(sorted(group), 2):
        if pair not in rivals.pairs:
            continue
        by_flight = flight is not None and flight.after[pair] >= APART
        ground = [t for t in tests if t["kind"] == "ground" and _after(t, pair) >= APART]
        best = max(ground, key=lambda t: _after(t, pair), default=None)
        split.append("next flight" if by_flight else best["name"] if best else "")
        on = f"on the ground: {best['name']}" if best else _why_not(pair)
        sentences.append(f"{pair[0]} and {pair[1]}: {_by_flight(pair, rivals, flight, why_none, same)}; {on}")
    return {
        "rivals": list(group),
        "split_by": sorted({name for name in split if name}),
        "splits": all(split),
        "sentence": ". ".join(sentences) + ".",
    }


def _by_flight(
    pair: Pair, rivals: RivalExplanations, flight: NextFlight | None, why_none: str, same: set[Pair]
) -> str:
    """Return what flights say of a pair."""
    now = rivals.now[pair]
    if flight is not None and flight.after[pair] >= APART:
        return f"the next flight tells them apart ({now:.1f} now, {flight.after[pair]:.1f} with it)"
    if pair in same:
        return "no flight of this kind can, they make the same change"
    if flight is None:
        return why_none
    count = flight.flights[pair]
    return f"{count} such flights would" if count else f"{MOST_FLIGHTS} such flights would not"


def _after(test: Mapping[str, Any], pair: Pair) -> float:
    """Return the separation of a pair with a test; zero where the test adds nothing to it."""
    return next((p["after"] for p in test["pairs"] if p["rivals"] == list(pair)), 0.0)


def _why_not(pair: Pair) -> str:
    """Return why no ground test splits a pair."""
    known = [UNTESTABLE[n] for n in pair if n in UNTESTABLE]
    if len(known) == len(pair):
        return f"none on the ground can: {known[0]}"
    return "none on the ground can at the sizes estimated" + (f"; {known[0]}" if known else "")
