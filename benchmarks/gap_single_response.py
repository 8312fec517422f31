"""Pitch rate from a stick: a delay and a lag that the simulation lacks, refitted and scored.

Run: python benchmarks/gap_single_response.py
Prints a table and writes benchmarks/gap_single_response.csv. Three flights of examples/stick_to_pitch_rate.py
are used, a fourth is held out.
"""

from __future__ import annotations

import csv
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))

from stick_to_pitch_rate import DELAY_S, LAG_S, fly, pitch_rate

from freqid.core.record import Maneuver
from freqid.gap.connect.callable import CallableSimulation
from freqid.gap.diagnose import Question, diagnose
from freqid.gap.tolerance import stated
from freqid.gap.undescribed import without_vehicle
from freqid.simulate.effects import shipped

EFFECTS = ("actuator_delay", "actuator_lag")


def main() -> None:
    """Print and write the table."""
    simulation = CallableSimulation(pitch_rate, "pitch_rate", ("q",))
    rows = []
    for case, delay, lag in (("none", 0.0, 0.0), ("both", DELAY_S, LAG_S)):
        flights = [fly(seed, delay=delay, lag=lag) for seed in (1, 2, 3, 4)]
        maneuvers = [Maneuver.of(f, without_vehicle("any", f)) for f in flights]
        question = Question(shipped(), stated({}, shipped()), (0.1, 3.0), named=EFFECTS, draws=60)
        found = diagnose(simulation, maneuvers[:3], question, held_out=maneuvers[3:]).diagnosis
        print(case, found.verdict)
        for c in found.how_far:
            fitted = "; ".join(
                f"{i} {n} {x.estimate:.4f} [{x.lo:.4f}, {x.hi:.4f}]"
                for i, s in c.settings.items()
                for n, x in s.items()
            )
            share, change = c.wrench, c.rmse["q"]
            numbers = [f"{x:.4f}" for x in (share.G, share.lo, share.hi, change.before, change.after)]
            called = "+".join(found.which.pair) or next(iter(found.which.probabilities))
            rows.append(
                [case, found.gap.exists, f"{found.gap.p:.2g}", called, "+".join(c.effects), *numbers, fitted]
            )
            print("  ", *rows[-1], sep="  ")
    header = [
        "truth",
        "gap",
        "p",
        "unnamed",
        "closed",
        "G",
        "G_lo",
        "G_hi",
        "rmse_q",
        "rmse_q_after",
        "settings",
    ]
    with Path(__file__).with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])


if __name__ == "__main__":
    main()
