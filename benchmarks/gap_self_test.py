"""Power as the self-test predicts it, beside flights: how often a surface with a loss is called a gap.

    python benchmarks/gap_self_test.py

The aircraft of ``examples/linear_record.py`` flies with one surface that has lost a part of its effect,
with derivatives scattered within tolerance and fresh noise in every flight. The prediction is of one flight
without any loss, from draws alone. The table is written beside the script.
"""

from __future__ import annotations

import csv
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))

from linear_record import DERIVATIVES, fly

import freqid as fq
from freqid.cli.main import run
from freqid.core.record import read_record
from freqid.core.results.gap_self_test import Rate
from freqid.gap import flights
from freqid.gap.connect import connect
from freqid.gap.diagnose import Findings, Question, diagnose
from freqid.gap.model.tolerance import DERIVATIVES as SHARED
from freqid.gap.model.tolerance import UNDECLARED, stated
from freqid.gap.self_test.answers import DrawnData, Weighed
from freqid.gap.self_test.smallest import smallest_sizes
from freqid.simulate.effects import library

PROJECT = Path(__file__).resolve().parents[1]
TABLE = Path(__file__).with_suffix(".csv")
SCENARIO = PROJECT / "scenarios" / "linear.toml"
EFFECTS = ("mass", "surface_effectiveness", "sensor_scale", "cg_offset", "time_skew", "unsteady_lift")
SURFACES, FACTORS, FLIGHTS, DRAWS = ("de", "da", "dr"), (0.6, 0.8, 1.0), 20, 1000
"""Factors of the size that is predicted to be called a gap in 95 of 100 flights."""


def diagnosed(folder: Path, seed: int, surface: str, loss: float) -> Findings:
    """Fly, import and diagnose one flight; without a surface, of the aircraft as the simulation has it."""
    rng = np.random.default_rng([seed, 1])
    sigma = UNDECLARED[SHARED] if surface else 0.0
    derivatives = {
        r: {n: c * (1 - loss * (n == surface)) * (1 + sigma * rng.standard_normal()) for n, c in row.items()}
        for r, row in DERIVATIVES.items()
    }
    log, path = folder / "flight.csv", folder / "flight.h5"
    fly(seed=seed, period=30.0, periods=1, derivatives=derivatives).to_csv(log, index=False)
    words = ["import-log", log, "--scenario", SCENARIO, "--at", "u20", "-o", path]
    try:
        run([str(w) for w in [*words, "--map", PROJECT / "scenarios" / "maps" / "linear.toml"]])
    except SystemExit as left:
        if left.code:
            raise
    record = read_record(path)
    described = fq.read_scenario(SCENARIO)
    function = f"{PROJECT / 'examples' / 'linear_simulation.py'}:wrench"
    simulation = connect(function, scenario=SCENARIO, record=record)
    vehicle = flights.vehicle_of([record], simulation, described.aircraft())
    flown = flights.maneuvers([record], ["flight"], simulation, vehicle)
    every = library()
    asked = {n: every[n] for n in EFFECTS}
    question = Question(asked, stated(described.tolerance, asked), (0.05, 1.8), draws=DRAWS, close=False)
    return diagnose(simulation, flown, question, names=["flight"])


def predicted(findings: Findings, draws: DrawnData, surface: str, size: float) -> float:
    """Return how often a loss is called a gap in draws."""
    system = findings.evidence.system
    index = next(k for k, c in enumerate(system.candidates) if c.name == f"surface_effectiveness@{surface}")
    weights = np.zeros(system.columns)
    weights[system.columns_of(index)] = system.candidates[index].weights(-size)
    weighed = Weighed.of(findings.evidence, draws.with_effect(weights, range(draws.count)))
    return float((weighed.statistics() >= findings.threshold).mean())


def main() -> None:
    rows, seed = [], 1
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        first = diagnosed(folder, seed, "", 0.0)
        draws = DrawnData.of(first.evidence, first.evidence.system, DRAWS, 1)
        every = smallest_sizes(first.evidence, draws, first.threshold, every=True)
        lost = [s for s in every if s.effect == "surface_effectiveness" and s.place in SURFACES]
        sizes = {s.place: s.size for s in lost}
        for surface, smallest in sizes.items():
            for factor in FACTORS:
                share = predicted(first, draws, surface, factor * smallest)
                called = []
                for _ in range(FLIGHTS):
                    seed += 1
                    called.append(diagnosed(folder, seed, surface, factor * smallest).diagnosis.gap.exists)
                rate = Rate.over(called)
                rows.append(
                    {
                        "surface": surface,
                        "loss": f"{factor * smallest:.4g}",
                        "of_smallest": factor,
                        "predicted": f"{share:.3f}",
                        "called": rate.count,
                        "flights": rate.of,
                        "observed": f"{rate.share:.3f}",
                        "lo": f"{rate.lo:.3f}",
                        "hi": f"{rate.hi:.3f}",
                    }
                )
                print(rows[-1], flush=True)
    with TABLE.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
