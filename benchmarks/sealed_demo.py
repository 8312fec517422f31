"""How often the sealed trial of `make demo` is right: `python benchmarks/sealed_demo.py [SEEDS] [FIRST]`.

For each seed an effect, its place and its size are drawn; two manoeuvres of the tilt-wing are flown with it,
with the noise of research sensors, and diagnosed against the scenario that does not have it; then the seal is
opened. The vehicle, the noise and the conditions are those of `make demo`; apart from the effect the aircraft
is the simulation. Writes benchmarks/sealed_demo.csv, a row as each seed ends, so that a run may be broken off
and goes on from there. All 20 in the background:

    nohup nice python benchmarks/sealed_demo.py 20 > sealed_demo.log 2>&1 &

answer      right, wrong or undecided, as `freqid open-seal` says; not flown where a flight diverges
change      of the effect's parameter that was flown; found with its 90 % interval
seconds     of the diagnosis
"""

from __future__ import annotations

import csv
import sys
import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import freqid as fq
from freqid.core.errors import DataError

AT = ("u30", "u45")
SECONDS = 60.0
TABLE = Path(__file__).with_suffix(".csv")
FIELDS = ("seed", "effect", "parameter", "unit", "change", "answer", "named", "probability")
FIELDS += ("found", "lower", "upper", "covered", "seconds")


def trial(seed: int, design: fq.MultisineDesign) -> dict[str, str]:
    """Return the row of one seed."""
    with TemporaryDirectory() as folder:
        try:
            sealed = fq.fly_sealed("la8", folder, at=AT, design=design, duration=SECONDS, seed=seed)
        except DataError:  # it would take another seed
            return {"seed": str(seed), "answer": "not flown"}
        start = time.perf_counter()
        gap = fq.diagnose_gap(None, list(sealed.records), scenario="la8")
        seconds = time.perf_counter() - start
        found = fq.open_seal(sealed.seal, gap)
    numbers = {
        "change": found.after - found.before,
        "probability": found.probability,
        "found": found.estimate,
        "lower": found.lower,
        "upper": found.upper,
    }
    row = {"seed": str(seed), "effect": found.effect, "parameter": found.parameter, "unit": found.unit}
    row |= {name: f"{value:.4g}" for name, value in numbers.items()}
    row |= {"answer": found.answer, "named": " ".join(found.named), "covered": str(int(found.covered))}
    return row | {"seconds": f"{seconds:.0f}"}


def main(count: int = 20, first: int = 0) -> None:
    """Run the seeds that the table does not hold yet, and count the answers of all."""
    rows = list(csv.DictReader(TABLE.open())) if TABLE.is_file() else []
    design = fq.design_inputs("la8", seed=0).design
    for seed in range(first, first + count):
        if str(seed) in {row["seed"] for row in rows}:
            continue
        rows.append(trial(seed, design))
        print("  ".join(f"{rows[-1].get(name, ''):<10}" for name in FIELDS), flush=True)
        fresh = TABLE.with_suffix(".csv.new")  # a run that is broken off leaves the table whole
        with fresh.open("w", newline="") as file:
            writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(sorted(rows, key=lambda row: int(row["seed"])))
        fresh.replace(TABLE)
    counts = Counter(row["answer"] for row in rows)
    print(f"{len(rows)} seeds: {', '.join(f'{n} {answer}' for answer, n in counts.most_common())}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
