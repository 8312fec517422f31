"""The next flight that a diagnosis proposes, flown: how often the right one of two effects is named.

Run: python benchmarks/gap_next_flight.py
Prints a table and writes benchmarks/gap_next_flight.csv. One minute of the LA-8 with a small effect leaves
two explanations; the proposed flight is flown by the aircraft that has the effect, with the research suite's
noise, and the likelier of the two is taken with the first flight alone and with both. Beside the counts
stands what the expected separation promised, Phi(sqrt(separation / 2)).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
from _la8 import EXCITATION, SCENARIO, inputs, write
from scipy.stats import norm

from freqid.core.design import SampledInputs
from freqid.core.record import Maneuver
from freqid.design.multisine import sampled
from freqid.gap.attribute import variants
from freqid.gap.compare import Compared, compare
from freqid.gap.connect.scenario import ScenarioSimulation
from freqid.gap.evidence import Evidence
from freqid.gap.explanations import Explanation
from freqid.gap.gather import evidence_of
from freqid.gap.next_bench import Bench
from freqid.gap.next_flight import next_flight
from freqid.gap.next_test import on_ground
from freqid.gap.tolerance import stated
from freqid.simulate.effects import library
from freqid.simulate.maneuver import Conditions, fly_maneuver, with_effects

MINUTE = msgspec.structs.replace(EXCITATION, periods=1)
SCENE = msgspec.structs.replace(SCENARIO, excitation=MINUTE)
SIMULATION = ScenarioSimulation(SCENE)
LIBRARY = {i: e.of(SCENARIO.aircraft()) for i, e in library().items()}
TOLERANCES = stated({}, LIBRARY)
BAND_HZ, SECONDS, SEEDS = (0.05, 1.9), 60.0, 4
CASES = (  # condition, truth, its parameter, its size, the other one
    ("u45", "mass", "fraction", 0.08, "inertia"),
    ("u20", "cg_offset", "x", 0.018, "tilt_inertia"),
    ("u10", "slipstream", "strength", -0.065, "wing_wake"),
    ("u45", "flow_upwash", "alpha", 0.08, "sensor_scale"),
    ("u20", "actuator_delay", "extra", 0.010, "motor_lag"),
)


def flight(at: str, effects: dict, signals: SampledInputs, pair: tuple[str, str], seed: int) -> Compared:
    """Fly the truth and compare the simulation with it."""
    flown = fly_maneuver(
        with_effects(SCENARIO, effects),
        SCENARIO.reference_of(at),
        signals,
        Conditions(noise=1.0, seed=seed),
        duration=SECONDS,
    )
    candidates = {n: LIBRARY[n] for n in pair}
    return compare(
        SIMULATION, Maneuver.of(flown.record), candidates, TOLERANCES, BAND_HZ, count=30, seed=seed
    )


def one_minute() -> SampledInputs:
    """Return the study's multisines for one period."""
    both = inputs(0)
    kept = both.time <= SECONDS + 1e-9
    return replace(both, time=both.time[kept], values=both.values[:, kept])


def explanations(evidence: Evidence, truth: str, parameter: str, size: float, rival: str):
    """Return the truth at its size, and the other one at the size that comes closest to it."""
    ways = {
        n: tuple(tuple(evidence.signatures[c - 1] for c in h.columns) for h in variants(LIBRARY[n], evidence))
        for n in (truth, rival)
    }
    column, found = evidence.column(f"{truth}:{parameter}"), []
    for way in ways[rival]:
        at = [evidence.column(n) for n in way]
        gram = evidence.metric[np.ix_(at, at)]
        value = np.linalg.pinv(gram, rcond=1e-9, hermitian=True) @ evidence.metric[at, column] * size
        found.append((float(value @ gram @ value), dict(zip(way, value.tolist(), strict=True))))
    value = max(found, key=lambda one: one[0])[1]
    return {
        truth: Explanation(truth, {f"{truth}:{parameter}": size}, ways[truth]),
        rival: Explanation(rival, value, ways[rival]),
    }


def prefers(compared: list[Compared], truth: str, rival: str) -> bool:
    """Return whether data fit the truth better than the other one, each at its best size."""
    evidence = evidence_of(compared)
    best = {
        n: max(float(evidence.likelihood_gain(h)[0]) for h in variants(LIBRARY[n], evidence))
        for n in (truth, rival)
    }
    return best[truth] > best[rival]


def main() -> None:
    """Print and write the table."""
    rows, flown = [], one_minute()
    for at, truth, parameter, size, rival in CASES:
        pair, effects = (truth, rival), {truth: {parameter: size}}
        first = [flight(at, effects, flown, pair, seed) for seed in range(SEEDS)]
        evidence = evidence_of(first[:1])
        rivals = explanations(evidence, truth, parameter, size, rival)
        both = (min(pair), max(pair))
        candidates = {n: LIBRARY[n] for n in pair}
        bench = Bench(SIMULATION, first[:1], evidence, rivals, (both,), candidates, TOLERANCES, SCENE)
        now = bench.separations(bench.at_hand)[both]
        ground = on_ground(rivals, {both: now}, TOLERANCES)
        best = max(ground, key=lambda t: t["pairs"][0]["after"], default=None)
        row = {
            "at": at,
            "truth": f"{truth} {size:g}",
            "rival": rival,
            "now": f"{now:.2f}",
            "promised_now": f"{norm.cdf(np.sqrt(now / 2)):.2f}",
            "right_now": f"{sum(prefers([c], truth, rival) for c in first)}/{SEEDS}",
        }
        proposed = next_flight(bench)
        if proposed is None:
            row |= dict.fromkeys(("next_at", "excited", "band_hz", "after", "promised", "right"), "none")
        else:
            after = proposed.after[both]
            signals = sampled(proposed.design)
            then = [flight(proposed.at, effects, signals, pair, 100 + seed) for seed in range(SEEDS)]
            right = sum(prefers([a, b], truth, rival) for a, b in zip(first, then, strict=True))
            row |= {
                "next_at": proposed.at,
                "excited": proposed.excited,
                "band_hz": f"{proposed.band_hz[0]:.2g}-{proposed.band_hz[1]:.2g}",
                "after": f"{after:.2f}",
                "promised": f"{norm.cdf(np.sqrt(after / 2)):.2f}",
                "right": f"{right}/{SEEDS}",
            }
        row |= {"ground": best["name"] if best else "none"}
        rows.append(row)
        print(*row.values(), sep="  ", flush=True)
    write(Path(__file__), rows)


if __name__ == "__main__":
    main()
