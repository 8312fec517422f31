"""How often a worn elevator is found, by how much it is worn: `python benchmarks/gap_rates.py`.

A campaign of `freqid.monte_carlo` with stage ``diagnose`` on scenarios/linear.toml: flights of the linear
aircraft, its mass drawn anew within 1 % each time, with an elevator that does less than is described, or as
much. Size zero tells the false-alarm rate. It goes on where it was stopped; ``SEEDS`` of each size. Writes
benchmarks/gap_rates.csv beside the table it prints.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import freqid as fq

SIZES = [0.0, 0.02, 0.05, 0.1, 0.2]
SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "linear.toml"


def main(seeds: int = 20) -> None:
    """Run the campaign, print the rates and write them."""
    with TemporaryDirectory() as folder:
        campaign = Path(folder) / "rates.toml"
        campaign.write_text(
            f'stage = "diagnose"\nscenario = "{SCENARIO}"\nseeds = {seeds}\nbatch = 2\n'
            'axis = "effects.surface_effectiveness.de"\n[fixed]\nat = "u20"\ntolerance.mass = 0.01\n'
            f"[vary.effects.surface_effectiveness]\nde = {SIZES}\n"
        )
        found = fq.monte_carlo(campaign, Path(folder) / "rates", jobs=2)
    rows = [
        {
            "elevator does less by": f"{float(m.at):g}",
            "rate": m.measure,
            "percent": f"{100 * m.mean:.0f}",
            "interval, percent": f"{100 * m.lo:.0f} to {100 * m.hi:.0f}",
            "flights": str(m.count),
        }
        for rate in ("alarm", "detection", "right")
        for m in found.of(rate)
    ]
    for row in rows:
        print("  ".join(f"{value:<24}" for value in row.values()))
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
