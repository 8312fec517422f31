"""Net peak loads of 18 multisines on the LA-8 class aircraft, before and after their starts are chosen.

Baselines: every signal started where it is gentlest, as the phase search leaves it, and the median of 200
random starts and senses. Run as ``python benchmarks/net_load.py``.
"""

from __future__ import annotations

import csv
import os
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import msgspec
import numpy as np

from freqid.core.channels import WRENCH
from freqid.core.scenario import read_scenario
from freqid.design.multisine import (
    design_multisines,
    effectiveness,
    excited,
    merit,
    with_low_net_loads,
)
from freqid.design.net_load import net_loads, ways

SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "la8.toml"


def peaks(signals, loads, points=64):
    """Return the net peak of each axis."""
    return np.abs(net_loads(signals, loads, points)).max(axis=1)


def main() -> None:
    """Judge flat power and power within 3 dB, on interleaved combs, and write the table."""
    described, _ = read_scenario(SCENARIO)
    assert described.excitation is not None
    rows = []
    for power_db in (0.0, 3.0):
        excitation = msgspec.structs.replace(
            described.excitation,
            allocation="interleaved",
            power_db=power_db,
            net_load=dict.fromkeys(WRENCH, 1.0),
        )
        design = design_multisines(excitation, described.effector)
        loads = effectiveness(excited(excitation, described.effector))
        start = time.process_time()
        chosen = with_low_net_loads(design, excitation, described.effector)
        took = time.process_time() - start
        rng = np.random.default_rng(0)
        every = [ways(s) for s in design.signals]
        random = [peaks([w[rng.integers(len(w))] for w in every], loads, 16) for _ in range(200)]
        before, after, usual = (
            peaks(design.signals, loads),
            peaks(chosen.signals, loads),
            np.median(random, axis=0),
        )
        change = np.abs(merit(chosen).rpf / merit(design).rpf - 1).max()
        print(f"power within {power_db:g} dB: {took:.1f} s of processor, RPF changes by at most {change:.1e}")
        for i, axis in enumerate(WRENCH):
            less, than_usual = 1 - after[i] / before[i], 1 - after[i] / usual[i]
            print(
                f"  {axis}: {before[i]:.3g} -> {after[i]:.3g}, {less:.0%} less, {than_usual:.0%} than random"
            )
            rows.append(
                {
                    "power_db": power_db,
                    "axis": axis,
                    "before": f"{before[i]:.4g}",
                    "random_median": f"{usual[i]:.4g}",
                    "after": f"{after[i]:.4g}",
                    "reduction": f"{less:.3f}",
                    "reduction_from_random": f"{than_usual:.3f}",
                    "largest_rpf_change": f"{change:.1e}",
                }
            )
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
