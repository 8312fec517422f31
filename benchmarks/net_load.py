"""Net peak loads before and after the signals are played together: `python benchmarks/net_load.py`.

The 18 effectors of scenarios/la8.toml, T = 60 s, 106 harmonics, all six axes alike. Figures are recomputed
from the signals on 64 points per shortest period. Reductions are told against two baselines: the same signals
with the starts that `lowest_peaks` gives them, and the median over 200 random ways of playing them. Times are
process times. Writes benchmarks/net_load.csv.
"""

from __future__ import annotations

import csv
import os
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from freqid.core.channels import WRENCH
from freqid.core.design import Multisine
from freqid.core.scenario import read_scenario
from freqid.design.allocation import interleave, lines_in_band, search
from freqid.design.mirrored import mirrored
from freqid.design.multisine import effectiveness, excited
from freqid.design.net_load import lowest_net_loads, net_loads, peaks_by_chance
from freqid.design.phases import lowest_peak, lowest_peaks
from freqid.design.power import limits_from_db
from freqid.design.signals import relative_peak_factor

SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "la8.toml"
CEILING = 72  # 1.2 Hz, of propulsors
ALL = np.ones(len(WRENCH))
SIDE_FORCE = np.array([axis == "Y" for axis in WRENCH], dtype=float)


def peaks(signals: list[Multisine], loads: np.ndarray) -> np.ndarray:
    return np.abs(net_loads(signals, loads)).max(axis=1)


def factors(signals: list[Multisine]) -> np.ndarray:
    return np.array([float(relative_peak_factor(s.index, s.amplitude, s.phase)) for s in signals])


def main() -> None:
    excitation = read_scenario(SCENARIO)[0].excitation
    effectors = excited(excitation, read_scenario(SCENARIO)[0].effector)
    loads = effectiveness(effectors)
    amplitude = np.array([excitation.amplitude[e.name] for e in effectors])
    lines = lines_in_band(excitation.period_s, excitation.band_hz)
    rotors = [e.kind == "rotor" for e in effectors]
    dealt = interleave(lines, len(effectors))
    low = search(lines, rotors, CEILING, limits=limits_from_db(3.0))
    allocations = {
        "interleaved": dealt,
        "interleaved, mirrored": mirrored(dealt, loads * amplitude),
        "propulsors low": low,
        "propulsors low, mirrored": mirrored(low, loads * amplitude, [e.kind for e in effectors]),
    }
    rows = []
    for name, sets in allocations.items():
        for db in (0.0, 3.0):
            limits = limits_from_db(db)
            waves = lowest_peaks(sets, limits=limits)
            signals = [
                Multisine(e.name, e.unit, w.index, w.amplitude * a / np.sqrt(2), w.phase)
                for e, w, a in zip(effectors, waves, amplitude, strict=True)
            ]
            given, chance = peaks(signals, loads), peaks_by_chance(signals, loads, seed=1)
            rms = np.sqrt(loads**2 @ (amplitude**2 / 2))
            print(f"\n{name}, powers within {db:g} dB; RPF {spread(factors(signals))}")
            print(f"{'net peak / rms: default starts':<44}{row(given / rms, 2)}")
            print(f"{'net peak / rms: median by chance':<44}{row(chance / rms, 2)}")
            for what, weights, budget in (
                ("starts and senses only", ALL, 0.0),
                ("and phases, RPF + 3 %", ALL, 0.03),
                ("the same, side force alone counts", SIDE_FORCE, 0.03),
            ):
                began = time.process_time()
                played = lowest_net_loads(signals, loads, weights, rpf_budget=budget, limits=limits)
                seconds = time.process_time() - began
                after, rise = peaks(played, loads), 100 * (factors(played) / factors(signals) - 1)
                cut, cut_chance = 100 * (1 - after / given), 100 * (1 - after / chance)
                print(f"{what}: RPF {spread(rise)} %, {seconds:.1f} s")
                for label, value, digits in (
                    ("  net peak / rms", after / rms, 2),
                    ("  % below default starts", cut, 1),
                    ("  % below chance", cut_chance, 1),
                ):
                    counted = np.where(weights > 0, value, np.nan)
                    print(f"{label:<44}{row(counted, digits)}")
                    rows.append(
                        [name, f"{db:g}", what, label.strip(), *(f"{v:.{digits}f}" for v in counted)]
                        + [f"{v:.2f}" for v in (rise.min(), np.median(rise), rise.max())]
                        + [f"{seconds:.1f}"]
                    )
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.writer(file)
        rise = [f"rpf_rise_{what}_percent" for what in ("min", "median", "max")]
        writer.writerow(["allocation", "power_db", "method", "figure", *WRENCH, *rise, "process_seconds"])
        writer.writerows(rows)
    print("\nLowest crest factor of the two ruddervators' harmonics as one signal, no limit on either's RPF")
    for name, sets in allocations.items():
        both = np.sort(
            np.concatenate([s for s, e in zip(sets, effectors, strict=True) if e.name[:2] == "dr"])
        )
        crest = [lowest_peak(both, limits=limits_from_db(db), measure="peak").factor for db in (0.0, 3.0)]
        print(f"{name:<44}flat {crest[0]:.2f}, within 3 dB {crest[1]:.2f}")


def row(values: np.ndarray, digits: int) -> str:
    return "".join(
        f"{a:>5}{'-' if np.isnan(v) else format(v, f'.{digits}f'):>6}"
        for a, v in zip(WRENCH, values, strict=True)
    )


def spread(values: np.ndarray) -> str:
    return f"{values.min():.3f} / {np.median(values):.3f} / {values.max():.3f}"


if __name__ == "__main__":
    main()
