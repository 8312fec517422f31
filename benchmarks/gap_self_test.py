"""Power as the self-test predicts it, beside flights: how often an effect of a size is found.

    python benchmarks/gap_self_test.py

An aircraft with linear loads and servos flies with one effect at a time, in formulas of its own, with
derivatives scattered within tolerance and fresh noise in every flight. The prediction is a self-test's on one
flight without any effect. The table is written beside the script.
"""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "unit" / "gap"))

from linear_flight import LIBRARY, MASS, SIZES, SLOPES, Linear, Truth, fly

from freqid.core.gap_self_test import Rate
from freqid.gap.attribute import LEAST_ODDS, critical, existence, judge, p_value
from freqid.gap.compare import compare
from freqid.gap.gather import evidence_of
from freqid.gap.inserted import insert, places
from freqid.gap.reach import Grown, power_at, reach
from freqid.gap.self_test import STRATA

TABLE = Path(__file__).with_suffix(".csv")
SCATTER, DRAWS, LEVEL, FLIGHTS = 0.02, 200, 0.02, 20
FACTORS = (0.6, 0.8, 1.0)
"""Of the size that is predicted to be found in 95 of 100."""

TOLERANT = {**SIZES, "derivatives": SCATTER, "dynamics": 0.02}
TRUTHS = {
    "worn": lambda size: Truth(loss=size),
    "heavy": lambda size: Truth(mass=MASS * (1 + size)),
    "late": lambda size: Truth(late=size),
    "drag": lambda size: Truth(drag=size),
}


def weighed(truth: Truth, seed: int):
    """Return what the diagnosis compares and weighs of one flight."""
    rng = np.random.default_rng([seed, 1])
    slopes = SLOPES * (1 + SCATTER * rng.standard_normal(SLOPES.shape))
    flight = fly(replace(truth, slopes=tuple(map(tuple, slopes.tolist()))), noise=1.0, seed=seed, phases=1)
    used = [compare(Linear(), flight, LIBRARY, TOLERANT, (0.1, 2.0), count=DRAWS, seed=seed)]
    evidence = evidence_of(used, seed=seed)
    return used, evidence, judge(evidence, LIBRARY)


def found(truth: Truth, seed: int) -> bool:
    """Return whether a gap is called in one flight."""
    statistic, null = existence(weighed(truth, seed)[2])
    return p_value(statistic, null) < LEVEL and statistic > LEAST_ODDS


def main() -> None:
    used, evidence, judged = weighed(Truth(), 0)
    inserted = insert(LIBRARY, used, evidence, places(LIBRARY, evidence, used), STRATA)
    threshold = critical(existence(judged)[1], LEVEL)
    columns = [inserted.evidence.column(one.column) for one in inserted.insertions]
    grown = Grown.of(inserted.evidence, LIBRARY, columns)
    nothing = dict.fromkeys(evidence.signatures, 0.0)
    sizes = reach(inserted.evidence, LIBRARY, inserted.insertions, threshold, nothing)
    rows, seed = [], 0
    for effect, truth in TRUTHS.items():
        one = next(r for r in sizes if r.effect == effect)
        at = [i for i, x in enumerate(inserted.insertions) if x.place.effect == effect]
        shapes = [inserted.insertions[i] for i in at]
        for factor in FACTORS:
            predicted = power_at(grown, at, shapes, one.detectability * factor**2, threshold)
            flags = []
            for _ in range(FLIGHTS):
                seed += 1
                flags.append(found(truth(factor * one.size), seed))
            seen = Rate.over(flags)
            rows.append(
                {
                    "effect": effect,
                    "size": f"{factor * one.size:.4g}",
                    "of_smallest": factor,
                    "predicted": f"{predicted:.3f}",
                    "found": seen.count,
                    "flights": seen.of,
                    "observed": f"{seen.share:.3f}",
                    "lo": f"{seen.lo:.3f}",
                    "hi": f"{seen.hi:.3f}",
                }
            )
            print(rows[-1], flush=True)
    with TABLE.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    for factor in FACTORS:
        here = [r for r in rows if r["of_smallest"] == factor]
        told = np.mean([float(r["predicted"]) for r in here])
        seen = Rate.over(k < r["found"] for r in here for k in range(r["flights"]))
        print(
            f"{factor:g} of the smallest size: predicted {told:.3f}, observed {seen.share:.3f} "
            f"[{seen.lo:.3f}, {seen.hi:.3f}] of {seen.of}"
        )


if __name__ == "__main__":
    main()
