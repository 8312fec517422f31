"""Least squares and instruments at three times research-quality noise: `python benchmarks/study_noise.py`.

One flight of the LA-8 simulation at each of two conditions, measured anew for every seed. All estimates are
compared with the estimate from the same flight without noise. Instruments are made

fitted   as `identify_point` makes them;
truth    of the regressors of the flight without noise: the best that instruments can do.

By response and over all: root mean square over parameters of the mean normalised error (of 200 seeds without
bias: 0.071); empirical over stated standard deviation, its median and the share of parameters within 0.88 to
1.12; empirical standard deviation over that with instruments from the truth. Writes
benchmarks/study_noise.csv. An argument gives another number of seeds.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from _la8 import SCENARIO, flown, identified, inputs, logged, on_harmonics, table, told, write
from joblib import Parallel, delayed

from freqid.core.channels import WRENCH
from freqid.core.results.design import SampledInputs
from freqid.identify.regress.two_stage import WeakInstruments, two_stage_least_squares

SEEDS = int(sys.argv[1]) if len(sys.argv) > 1 else 200
CONDITIONS = ("u45", "u20")
NOISE = 3.0
ESTIMATORS = ("least squares", "fitted", "truth")


def condition(identifier: str, signals: SampledInputs) -> list[dict[str, str]]:
    """Return the rows of one condition."""
    at = SCENARIO.reference_of(identifier)
    truth = flown(at, signals)
    quiet = logged(truth, 0.0)
    aim, driven = table(identified(quiet, at))[0], on_harmonics(quiet).x
    estimates: dict[str, list[np.ndarray]] = {name: [] for name in ESTIMATORS}
    errors: dict[str, list[np.ndarray]] = {name: [] for name in ESTIMATORS}
    for seed in range(SEEDS):
        flight = logged(truth, NOISE, seed)
        try:
            model = identified(flight, at)
        except WeakInstruments:
            continue
        for name, found in (
            ("least squares", table(identified(flight, at, "least-squares"))),
            ("fitted", table(model)),
        ):
            estimates[name].append(found[0])
            errors[name].append(found[1])
        seen = on_harmonics(flight)
        fit, _ = two_stage_least_squares(seen.x, seen.z, driven, nuisance=seen.nuisance)
        estimates["truth"].append(fit.estimate)
    kept = len(estimates["fitted"])
    scatter = {name: np.std(found, axis=0, ddof=1) for name, found in estimates.items()}
    rows = []
    for name in ("least squares", "fitted"):
        mean = np.mean((np.array(estimates[name]) - aim) / errors[name], axis=0)
        ratio = scatter[name] / np.sqrt(np.mean(np.square(errors[name]), axis=0))
        best = scatter[name] / scatter["truth"]
        for response in ("all", *WRENCH):
            of = slice(None) if response == "all" else WRENCH.index(response)
            inside = (ratio[of] > 0.88) & (ratio[of] < 1.12)
            rows.append(
                {
                    "condition": identifier,
                    "estimator": name,
                    "response": response,
                    "mean_error_rms": f"{np.sqrt(np.mean(mean[of] ** 2)):.3f}",
                    "largest": f"{np.abs(mean[of]).max():.2f}",
                    "scatter_over_stated": f"{np.median(ratio[of]):.3f}",
                    "within_0.88_1.12_percent": f"{100 * inside.mean():.1f}",
                    "scatter_over_truth_s": f"{np.median(best[of]):.3f}",
                    "largest_over_truth_s": f"{best[of].max():.3f}",
                    "seeds": str(kept),
                    "refused": str(SEEDS - kept),
                }
            )
    return rows


def main() -> None:
    signals = inputs(0)
    found = Parallel(n_jobs=2, return_as="generator")(delayed(condition)(at, signals) for at in CONDITIONS)
    rows = told(found)
    write(Path(__file__), rows)


if __name__ == "__main__":
    main()
