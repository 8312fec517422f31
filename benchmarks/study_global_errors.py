"""Standard errors of the global model beside a Monte Carlo: `python benchmarks/study_global_errors.py`.

The same LA-8 class flights, at the conditions of scenarios/la8.toml at sea level, are measured many times
with other noise; every time point models are identified and blended. By response, over parameters and places:

stated, at the points           what the point models state, over the scatter of their estimates
stated without distortion       the same less what a flight without any noise states: its lines between the
                                harmonics hold motion too, which is the same in every repetition
stated, blended between         what the global model states halfway between points, over its scatter
scatter propagated, between     what it states when told the scatter at the points: what blending is off by

Ratios scatter by themselves: standard deviations of n seeds by 1 / sqrt(2 (n - 1)). Beside the share of
ratios within 10 % stands what share that alone would leave. Argument: number of seeds. Writes
benchmarks/study_global_errors.csv.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
from _la8 import write
from _la8_flights import SEA, reference_of
from joblib import Parallel, delayed
from scipy.special import erf
from study_global import POINTS, RESPONSES, corridor

import freqid as fq
from freqid.core.results.corridor import Corridor

SEEDS = int(sys.argv[1]) if len(sys.argv) > 1 else 200
WITHIN = 0.10


def at_points(corridors: Sequence[Corridor]) -> tuple[np.ndarray, np.ndarray]:
    """Return estimates and stated standard errors, shape (seed, response, regressor, point)."""
    estimate = np.array([[c.responses[r].estimate for r in RESPONSES] for c in corridors])
    variance = [
        [np.diagonal(c.responses[r].covariance, axis1=1, axis2=2).T for r in RESPONSES] for c in corridors
    ]
    return estimate, np.sqrt(variance)


def between(model: fq.GlobalModel) -> tuple[np.ndarray, np.ndarray]:
    """Return the same of a global model halfway between points, shape (response, regressor, place)."""
    u = np.array([reference_of(i).u for i in POINTS])
    at = model.reference(0.5 * (u[1:] + u[:-1]), SEA)
    found = [model.parameters(r, at) for r in RESPONSES]
    return np.array([f.estimate[1:] for f in found]), np.array([f.std_error[1:] for f in found])


def rms(stated: np.ndarray) -> np.ndarray:
    """Return the root mean square over seeds."""
    return np.sqrt((stated**2).mean(axis=0))


def ratios(corridors: Sequence[Corridor], quiet: Corridor) -> dict[str, np.ndarray]:
    """Return stated standard errors over the scatter, shape (response, regressor, place)."""
    knots, said = at_points(corridors)
    scatter, stated = knots.std(axis=0, ddof=1), rms(said)
    motion = at_points([quiet])[1][0]
    blends = [between(fq.GlobalModel(c)) for c in corridors]
    halfway, said_there = (np.array(part) for part in zip(*blends, strict=True))
    scatter_there = halfway.std(axis=0, ddof=1)
    as_found = {
        r: replace(
            quiet.responses[r],
            estimate=knots[:, i].mean(axis=0),
            covariance=np.array([np.cov(knots[:, i, :, k].T) for k in range(len(POINTS))]),
        )
        for i, r in enumerate(RESPONSES)
    }
    propagated = between(fq.GlobalModel(replace(quiet, responses=as_found)))[1]
    return {
        "stated, at the points": stated / scatter,
        "stated without distortion": np.sqrt(np.maximum(stated**2 - motion**2, 0)) / scatter,
        "stated, blended between": rms(said_there) / scatter_there,
        "scatter propagated, between": propagated / scatter_there,
    }


def summary(what: str, response: str, ratio: np.ndarray) -> dict[str, str]:
    """Return one row: quantiles, rms and how many are within 10 %."""
    low, mid, high = np.percentile(ratio, [2.5, 50, 97.5])
    alone = erf(WITHIN * np.sqrt(SEEDS - 1))  # of a normal whose variance is 1 / (2 (n - 1))
    return {
        "ratio": what,
        "seeds": str(SEEDS),
        "response": response,
        "low": f"{low:.3f}",
        "median": f"{mid:.3f}",
        "high": f"{high:.3f}",
        "rms": f"{rms(ratio.ravel()):.3f}",
        "within_10_percent": f"{np.mean(np.abs(ratio - 1) <= WITHIN):.3f}",
        "by_scatter_alone": f"{alone:.3f}",
    }


def main() -> None:
    """Print and write the table."""
    many = Parallel(n_jobs=2)(delayed(corridor)(POINTS, seed) for seed in range(1, SEEDS + 1))
    found = ratios(cast(list[Corridor], many), corridor(POINTS, 0, 0.0))
    rows = []
    for what, ratio in found.items():
        print(what + ", median of L by place: " + " ".join(f"{v:.2f}" for v in np.median(ratio[3], axis=0)))
        rows += [summary(what, *one) for one in [*zip(RESPONSES, ratio, strict=True), ("all", ratio)]]
    print("\n".join("  ".join(f"{value:<28}" for value in row.values()) for row in rows))
    write(Path(__file__), rows)


if __name__ == "__main__":
    main()
