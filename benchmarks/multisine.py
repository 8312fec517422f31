"""Peak factors and design times of multisines against published methods, all in the same run.

Run: OPENBLAS_NUM_THREADS=1 python benchmarks/multisine.py [--quick]
Prints a table and writes benchmarks/multisine.csv; --quick leaves out the slow peers and writes nothing.

Times are those of one core (process time). Every figure is recomputed from the phases on 64 points per
shortest period. The peers are our own code after the published descriptions, because no package on PyPI was
found that lowers the peaks of a given set of harmonics (`multisine` 0.1.1 draws random phases; pyExSi 0.43.3,
deepSI 0.4.4 and nonlinear_benchmarks 1.0.1 have none of it): the L2p method of Guillaume, Schoukens,
Pintelon and Kollar (IEEE Trans. Instrum. Meas. 40(6), 1991) from 20 random starts, and Schroeder phases
improved by the Nelder-Mead simplex and shifted to start at zero (Klein and Morelli, 2nd ed., chapter 9), the
way of SIDPAC.
"rms2/peak2" is its geometric mean over the effectors, over that of the simplex-phased flat combs: what
information promises to be before an aircraft is known. What it is: benchmarks/information.py.
"""

from __future__ import annotations

import argparse
import csv
import os
import resource
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.optimize import minimize

from freqid.design.multisine.allocation import interleave, limits_from_db, lines_in_band, search
from freqid.design.multisine.phases import lowest_peak, lowest_peaks
from freqid.design.multisine.signals import crest_factor, relative_peak_factor, start_at_zero

LINES = lines_in_band(60.0, (0.05, 1.8))
COMBS = interleave(LINES, 18)
PROPULSORS = [False] * 10 + [True] * 8  # de1..4 df1..4 dr1..2 n1..8
CEILING = 72  # 1.2 Hz
SINGLE = {16: (1000, 0), 31: (600, 20), 64: (300, 15), 128: (40, 20), 256: (10, 20)}  # starts, kicks
SIMPLEX_RESTARTS = 30
SINGLE_BARS = {16: 1.380, 31: 1.372, 64: 1.380, 128: 1.392, 256: 1.392}


def l2p_phases(index: np.ndarray, amplitude: np.ndarray, rng: np.random.Generator, starts: int = 20):
    """Return the best phases of the L2p method: Gauss-Newton on the norm of power 2p, p doubling."""
    theta = 2 * np.pi * np.arange(16 * index.max()) / (16 * index.max())
    best, best_factor = np.zeros(index.size), np.inf
    for _ in range(starts):
        phase = 2 * np.pi * rng.random(index.size)
        for p in 2 ** np.arange(1, 10):
            damping = 1e-2
            angle = np.outer(theta, index) + phase
            u = np.sin(angle) @ amplitude
            for _ in range(12):
                scale = np.abs(u).max()
                residual = (u / scale) ** p
                jacobian = (p / scale * (u / scale) ** (p - 1))[:, None] * np.cos(angle) * amplitude
                normal = jacobian.T @ jacobian
                step = np.linalg.solve(
                    normal + damping * np.trace(normal) * np.eye(index.size), jacobian.T @ residual
                )
                trial_angle = angle - step
                trial = np.sin(trial_angle) @ amplitude
                if np.sum((trial / scale) ** (2 * p)) < np.sum(residual**2):
                    phase, angle, u, damping = phase - step, trial_angle, trial, damping / 4
                else:
                    damping *= 8
        factor = relative_peak_factor(index, amplitude, phase)
        if factor < best_factor:
            best, best_factor = phase, factor
    return best


def simplex_phases(index: np.ndarray, amplitude: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return Schroeder phases improved by the simplex, restarted, on signals of 60 s sampled at 0.02 s."""
    power = amplitude**2 / np.sum(amplitude**2)
    best = -2 * np.pi * np.concatenate([[0.0], np.cumsum(np.cumsum(power)[:-1])])
    theta = 2 * np.pi * np.arange(3000) / 3000
    sine, cosine = np.sin(np.outer(index, theta)), np.cos(np.outer(index, theta))

    def height(phase: np.ndarray) -> float:
        return float(np.ptp((amplitude * np.cos(phase)) @ sine + (amplitude * np.sin(phase)) @ cosine))

    for _ in range(SIMPLEX_RESTARTS):
        corners = best + np.concatenate([np.zeros((1, index.size)), rng.uniform(-1, 1, (index.size,) * 2)])
        options = {"initial_simplex": corners, "maxfev": 3000, "xatol": 1e-4, "fatol": 1e-5}
        best = minimize(height, best, method="Nelder-Mead", options=options).x
    return start_at_zero(index, amplitude, best)


def factors(sets, amplitudes, phases) -> np.ndarray:
    return np.array([relative_peak_factor(*row) for row in zip(sets, amplitudes, phases, strict=True)])


def power_at_equal_peaks(own: np.ndarray, reference: np.ndarray) -> float:
    """Return rms^2 at equal peaks over the reference's, its geometric mean over the effectors."""
    return float(np.exp(2 * np.mean(np.log(reference)) - 2 * np.mean(np.log(own))))


def report(
    rows: list, case: str, method: str, seconds: float, figures: dict[str, float], bar: str = ""
) -> None:
    rows += [(case, method, round(seconds, 2), name, round(float(x), 4), bar) for name, x in figures.items()]
    text = "  ".join(f"{name} {x:.4f}" for name, x in figures.items())
    print(f"{case:38s} {method:24s} {seconds:6.2f} s  {text}  {bar}", flush=True)


def spread(rpf: np.ndarray) -> dict[str, float]:
    return {"rpf min": rpf.min(), "rpf median": np.median(rpf), "rpf max": rpf.max()}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    rows: list[tuple] = []
    flat = [np.full(s.size, np.sqrt(2 / s.size)) for s in COMBS]

    case = "18 combs, flat"
    begin = time.process_time()
    waveforms = lowest_peaks(COMBS)
    own = factors(COMBS, flat, [w.phase for w in waveforms])
    report(rows, case, "freqid", time.process_time() - begin, spread(own), "<= 1.032 1.242 1.244")
    reference = own
    if not quick:
        rng = np.random.default_rng(0)
        begin = time.process_time()
        phases = [l2p_phases(s, a, rng) for s, a in zip(COMBS, flat, strict=True)]
        report(
            rows,
            case,
            "L2p, 20 random starts",
            time.process_time() - begin,
            spread(factors(COMBS, flat, phases)),
        )
        begin = time.process_time()
        phases = [simplex_phases(s, a, rng) for s, a in zip(COMBS, flat, strict=True)]
        seconds, reference = time.process_time() - begin, factors(COMBS, flat, phases)
        report(rows, case, "Schroeder and simplex", seconds, spread(reference))

    limits = limits_from_db(3.0)
    begin = time.process_time()
    waveforms = lowest_peaks(COMBS, limits=limits)
    seconds = time.process_time() - begin
    own = factors(COMBS, [w.amplitude for w in waveforms], [w.phase for w in waveforms])
    figures = {**spread(own), "rms2/peak2": power_at_equal_peaks(own, reference)}
    report(rows, "18 combs, power within 3 dB", "freqid", seconds, figures, "median <= 1.12, max <= 1.15")

    for case, low, ceiling in (
        ("joint search, propulsors below 1.2 Hz", PROPULSORS, CEILING),
        ("joint search, no rule", [False] * 18, None),
    ):
        begin = time.process_time()
        sets = search(LINES, low, ceiling, limits=limits)
        waveforms = lowest_peaks(sets, limits=limits)
        seconds = time.process_time() - begin
        own = factors(sets, [w.amplitude for w in waveforms], [w.phase for w in waveforms])
        figures = {
            **spread(own),
            "rms2/peak2": power_at_equal_peaks(own, reference),
            "lines used": sum(s.size for s in sets),
        }
        report(rows, case, "freqid", seconds, figures)

    for tones, (starts, kicks) in SINGLE.items():
        begin = time.process_time()
        w = lowest_peak(np.arange(1, tones + 1), measure="peak", starts=starts, kicks=kicks)
        crest = float(crest_factor(w.index, w.amplitude, w.phase))
        seconds = time.process_time() - begin
        report(
            rows,
            f"one flat multisine, {tones} tones",
            "freqid",
            seconds,
            {"crest": crest},
            f"<= {SINGLE_BARS[tones]}, 10 s",
        )

    if not quick:
        many = interleave(lines_in_band(300.0, (0.05, 1.8)), 200)
        begin = time.process_time()
        waveforms = lowest_peaks(many)
        seconds = time.process_time() - begin
        own = factors(many, [w.amplitude for w in waveforms], [w.phase for w in waveforms])
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        report(
            rows,
            "200 combs, T = 300 s",
            "freqid",
            seconds,
            {**spread(own), "memory GiB": memory},
            "<= 120 s, 1 GiB",
        )
        with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["case", "method", "seconds", "figure", "value", "bar"])
            writer.writerows(rows)


if __name__ == "__main__":
    main()
