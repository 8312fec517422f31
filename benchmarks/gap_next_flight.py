"""The next flight that a diagnosis proposes, flown: how often the right one of two effects is the likelier.

Run: python benchmarks/gap_next_flight.py [case number ...]
Prints a table and writes benchmarks/gap_next_flight.csv, with all cases. One minute of the LA-8 with a small
effect leaves two explanations; the proposed flight is flown by the aircraft that has the effect, with the
research suite's noise, and the likelier of the two is taken with the first flight alone and with both. Beside
the counts stands what the expected separation promised, Phi(sqrt(separation) / 2).
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
from _la8 import EXCITATION, SCENARIO, inputs, write
from scipy.stats import norm

from freqid.core.record import Maneuver
from freqid.core.results.design import SampledInputs
from freqid.design.multisine.orthogonal_set import sampled
from freqid.gap.connect.scenario import ScenarioSimulation
from freqid.gap.diagnose import Findings, Question, diagnose
from freqid.gap.infer.evidence import Evidence
from freqid.gap.model.tolerance import stated
from freqid.gap.next.next_flight import next_flight
from freqid.gap.next.next_test import ground_tables
from freqid.gap.next.predicted_flight import FlightContext
from freqid.gap.next.rivals import rivals_of
from freqid.simulate.effects import library
from freqid.simulate.maneuver import Conditions, fly_maneuver, with_effects

SCENE = msgspec.structs.replace(SCENARIO, excitation=msgspec.structs.replace(EXCITATION, periods=1))
SIMULATION = ScenarioSimulation(SCENE)
LIBRARY = library()
TOLERANCES = stated(SCENE.tolerance, LIBRARY, SIMULATION, SCENE.aircraft())
HELD = (
    "mass",
    "cg_offset",
    "inertia",
    "sensor_bias",
    "sensor_scale",
    "time_skew",
    "misalignment",
    "lever_arm",
)
BAND_HZ, SECONDS, SEEDS = (0.05, 1.9), 60.0, 2
CASES = (  # condition, truth, its parameter, its size, the other one
    ("u45", "mass", "fraction", 0.08, "inertia"),
    ("u20", "cg_offset", "x", 0.018, "tilt_inertia"),
    ("u10", "slipstream", "strength", -0.065, "wing_wake"),
    ("u45", "flow_upwash", "alpha", 0.08, "sensor_scale"),
    ("u20", "actuator_delay", "extra", 0.010, "motor_lag"),
)


def flight(at: str, effects: dict, signals: SampledInputs, seed: int) -> Maneuver:
    """Fly the truth and log it."""
    flown = fly_maneuver(
        with_effects(SCENARIO, effects),
        SCENARIO.reference_of(at),
        signals,
        Conditions(noise=1.0, seed=seed),
        duration=SECONDS,
    )
    return Maneuver.of(flown.record)


def one_minute() -> SampledInputs:
    """Return the study's multisines for one period."""
    both = inputs(0)
    within = both.time <= SECONDS + 1e-9
    return replace(both, time=both.time[within], values=both.values[:, within])


def asked(pair: tuple[str, str], seed: int) -> Question:
    """Return the question which of two effects it is; effects that hold tolerances are in it too."""
    candidates = {n: LIBRARY[n] for n in (*pair, *HELD)}
    return Question(candidates, TOLERANCES, BAND_HZ, draws=50, seed=seed, close=False)


def undecided(found: Findings, pair: tuple[str, str]) -> Findings:
    """Return findings that call a gap and leave two effects, whatever these data said."""
    d = found.diagnosis
    which = replace(d.which, set=pair, aliases=(), pair=())
    return replace(found, diagnosis=replace(d, which=which, gap=replace(d.gap, exists=True)))


def prefers(evidence: Evidence, pair: tuple[str, str]) -> bool:
    """Return whether the first effect is the likelier, each at its likeliest place, as is promised."""
    first, second = (evidence.candidate[evidence.best_place(n)] for n in pair)
    return bool(first > second)


def row_of(at: str, truth: str, parameter: str, size: float, rival: str) -> dict[str, str]:
    """Return one case."""
    pair, effects = (truth, rival), {truth: {parameter: size}}
    ordered = (min(pair), max(pair))
    first = [flight(at, effects, one_minute(), seed) for seed in range(SEEDS)]
    alone = [diagnose(SIMULATION, [m], asked(pair, seed)) for seed, m in enumerate(first)]
    found, question = undecided(alone[0], pair), asked(pair, 0)
    rivals = rivals_of(found)
    assert rivals is not None
    now = rivals.now[ordered]
    ground = ground_tables(rivals, TOLERANCES)
    best = max(ground, key=lambda t: t["pairs"][0]["after"], default=None)
    row = {
        "at": at,
        "truth": f"{truth} {size:g}",
        "rival": rival,
        "now": f"{now:.2f}",
        "promised_now": f"{norm.cdf(np.sqrt(now) / 2):.2f}",
        "right_now": f"{sum(prefers(f.evidence, pair) for f in alone)}/{SEEDS}",
    }
    around = FlightContext(
        SIMULATION, rivals, question.candidates, TOLERANCES, BAND_HZ, found.blocks, found.columns
    )
    start = time.perf_counter()
    proposed, _ = next_flight(around, SCENE)
    row["seconds"] = f"{time.perf_counter() - start:.0f}"
    if proposed is None:
        row |= dict.fromkeys(("next_at", "excited", "band_hz", "after", "promised", "right"), "none")
    else:
        plan, after = proposed.plan, proposed.after[ordered]
        signals, right = sampled(plan.design), 0
        for seed, before in enumerate(first):
            then = flight(plan.at, effects, signals, 100 + seed)
            both = diagnose(SIMULATION, [before, then], asked(pair, seed))
            right += prefers(both.evidence, pair)
        low, high = plan.design.band_hz
        row |= {
            "next_at": plan.at,
            "excited": plan.effectors,
            "band_hz": f"{low:.2g}-{high:.2g}",
            "after": f"{after:.2f}",
            "promised": f"{norm.cdf(np.sqrt(after) / 2):.2f}",
            "right": f"{right}/{SEEDS}",
        }
    return row | {"ground": best["name"] if best else "none"}


def main() -> None:
    """Print the table, and write it where all cases are asked for."""
    chosen = [CASES[int(n)] for n in sys.argv[1:]] or CASES
    rows = []
    for case in chosen:
        rows.append(row_of(*case))
        print(*rows[-1].values(), sep="  ", flush=True)
    if len(rows) == len(CASES):
        write(Path(__file__), rows)


if __name__ == "__main__":
    main()
