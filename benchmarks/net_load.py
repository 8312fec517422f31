"""Net peaks before and after the signals are played together: `python benchmarks/net_load.py`.

The 18 effectors of scenarios/la8.toml, T = 60 s, 106 harmonics, all six axes alike; the states are those of
the scenario's abort limits, predicted by the regulated aircraft of benchmarks/information.py. Figures are
recomputed from the signals on 64 points per shortest period. Reductions are told against two baselines: the
same signals with the starts that `lowest_peaks` gives them, and the median over 200 random ways of playing
them. Times are process times. Writes benchmarks/net_load.csv.
"""

from __future__ import annotations

import csv
import os
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from information import SCENARIO, regulated

import freqid as fq
from freqid.core.channels import WRENCH
from freqid.core.results.design import Multisine
from freqid.design.multisine.allocation import interleave, limits_from_db, lines_in_band, mirrored, search
from freqid.design.multisine.net_load import load_gains, lowest_nets, net_peaks, peaks_by_chance
from freqid.design.multisine.orthogonal_set import effectiveness, excited
from freqid.design.multisine.phases import lowest_peak, lowest_peaks
from freqid.design.multisine.signals import relative_peak_factor

CEILING = 72  # 1.2 Hz, of propulsors


def factors(signals: list[Multisine]) -> np.ndarray:
    return np.array([float(relative_peak_factor(s.index, s.amplitude, s.phase)) for s in signals])


def main() -> None:
    scenario = fq.read_scenario(SCENARIO)
    excitation, (loop, _) = scenario.excitation, regulated(scenario)
    effectors = excited(excitation, scenario.effector)
    loads = effectiveness(effectors)
    amplitude = np.array([excitation.amplitude[e.name] for e in effectors])
    lines = lines_in_band(excitation.period_s, excitation.band_hz)
    dealt = interleave(lines, len(effectors))
    allocations = {
        "interleaved in turn": dealt,
        "interleaved, mirrored": mirrored(dealt, loads * amplitude),
        "propulsors low": search(
            lines, [e.kind == "rotor" for e in effectors], CEILING, limits=limits_from_db(3.0)
        ),
    }
    states, allowed = tuple(excitation.abort), np.array([*excitation.abort.values()])[:, None]
    axes, rows = len(WRENCH), []
    for name, sets in allocations.items():
        for db in (0.0, 3.0):
            limits = limits_from_db(db)
            waves = lowest_peaks(sets, limits=limits)
            signals = [
                Multisine(e.name, e.unit, w.index, w.amplitude * a / np.sqrt(2), w.phase)
                for e, w, a in zip(effectors, waves, amplitude, strict=True)
            ]
            moved = [loop.response(states, [s.name], s.index / excitation.period_s)[:, 0] for s in signals]
            gains = np.concatenate([load_gains(signals, loads), np.concatenate(moved, axis=1) / allowed])
            given, chance = net_peaks(signals, gains), peaks_by_chance(signals, gains, seed=1)
            rms = np.sqrt(0.5 * np.abs(gains) ** 2 @ np.concatenate([s.amplitude for s in signals]) ** 2)
            share = given[axes:] / given[axes:].max()  # of the abort limits: as in with_low_net_loads
            print(f"\n{name}, powers within {db:g} dB; RPF {spread(factors(signals))}")
            for what, weights, budget in (
                ("starts and senses only", np.append(np.ones(axes), 0 * share), 0.0),
                ("and phases, RPF + 3 %", np.append(np.ones(axes), 0 * share), 0.03),
                ("and phases, states count too", np.append(np.ones(axes), share), 0.03),
                ("and phases, states alone count", np.append(np.zeros(axes), share), 0.03),
            ):
                began = time.process_time()
                played = lowest_nets(signals, gains, weights, rpf_budget=budget, limits=limits)
                seconds = time.process_time() - began
                after, rise = net_peaks(played, gains), 100 * (factors(played) / factors(signals) - 1)
                print(f"{what}: RPF rises by {spread(rise)} %, {seconds:.1f} s")
                for label, values, digits in (
                    ("net peak / rms", after / rms, 2),
                    ("% below default starts", 100 * (1 - after / given), 1),
                    ("% below chance", 100 * (1 - after / chance), 1),
                    ("% of abort limit", np.append(np.full(axes, np.nan), 100 * after[axes:]), 1),
                ):
                    told = [f"{v:.{digits}f}" for v in values]
                    pairs = zip((*WRENCH, *states), told, strict=True)
                    print(f"  {label:<24}" + "".join(f"{n:>6}{v:>6}" for n, v in pairs))
                    rows.append([name, f"{db:g}", what, label, *told, f"{rise.max():.2f}", f"{seconds:.1f}"])
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        title = ["allocation", "power_db", "method", "figure", *WRENCH, *states]
        writer.writerow([*title, "rpf_rise_max_percent", "process_seconds"])
        writer.writerows(rows)
    print("\nLowest crest factor of the two ruddervators' harmonics as one signal, no limit on either's RPF")
    for name, sets in allocations.items():
        both = np.sort(
            np.concatenate([s for s, e in zip(sets, effectors, strict=True) if e.name[:2] == "dr"])
        )
        crest = [lowest_peak(both, limits=limits_from_db(db), measure="peak").factor for db in (0.0, 3.0)]
        print(f"{name:<44}flat {crest[0]:.2f}, within 3 dB {crest[1]:.2f}")


def spread(values: np.ndarray) -> str:
    return f"{values.min():.3f} / {np.median(values):.3f} / {values.max():.3f}"


if __name__ == "__main__":
    main()
