"""What one global model says where nothing was identified: `python benchmarks/study_global.py`.

Point models come from flights of the LA-8 class simulation under feedback, measured with research sensors and
their full noise, as `study` makes them. Other flights, other multisines, are held out: the global model
replays them and its error is divided by that of a model identified at their own condition.

between    the condition lies halfway between two of the points
left out   it is a point, and the global model is made without it
altitude   its density is none of the points'

About the means, as a point model predicts; and with means, where the model identified there is its bias
about its own trim. Errors are against the record, noise and all, and against the loads that the simulation
flew. Then standard errors along the corridor beside the scatter of 100 global models from the same flights
with other noise. Writes benchmarks/study_global.csv.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import cast

import numpy as np
from _la8 import EXCITATION, SETTINGS
from _la8_flights import REFERENCES, SEA, corridors, flights, measured, reference_of
from joblib import Parallel, delayed

from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up
from freqid.blend.predict import replay
from freqid.core.corridor import Corridor
from freqid.core.models import PointModel
from freqid.core.record import FlightRecord, Maneuver
from freqid.identify.explanatory import history
from freqid.identify.point import identify_point, predict
from freqid.identify.trend import up_to

RESPONSES = ("X", "Y", "Z", "L", "M", "N")
SEEDS = 100  # of noise, for the scatter
POINTS = tuple(at.id for at in REFERENCES)
HALFWAY = ("u05", "u15", "u25", "u33", "u38", "u42", "u47", "u52", "u58", "u66", "u77")
QUARTERS = ("u02", "u07", "u12", "u17", "u22", "u27", "u73", "u81")
TWO_MORE = ("u05", "u77")
ALL = tuple(at.id for along in corridors().values() for at in along)
FOUR_MORE = ("u05", "u15", "u25", "u77")


def at_height(ids: Sequence[str], height: str) -> tuple[str, ...]:
    """Return the ids of the same speeds at 750 m or 1500 m."""
    return tuple(f"{i}-{height}" for i in ids)


@lru_cache(maxsize=2)
def flown(seed: int) -> dict[str, FlightRecord]:
    """Return all flights with one set of multisines."""
    return flights(ALL, seed)


def identified(at: str, noise_seed: int = 0) -> PointModel:
    """Return the point model of a condition, from the first multisines.

    Each condition has noise of its own: with the same everywhere, errors would
    go along the corridor together.
    """
    record = measured(flown(0)[at], 1000 * noise_seed + ALL.index(at))
    return identify_point(Maneuver.of(record), SETTINGS, excitation=EXCITATION, reference=reference_of(at))


def corridor(ids: Sequence[str], noise_seed: int) -> Corridor:
    """Return the points of a global model with other noise."""
    return line_up([identified(i, noise_seed) for i in ids], list(ids))


point = lru_cache(maxsize=None)(identified)


def blended(ids: Sequence[str]) -> GlobalModel:
    """Return the global model of some conditions."""
    return GlobalModel(line_up([point(i) for i in ids], list(ids)))


def errors(model: GlobalModel, at: str) -> dict[str, np.ndarray]:
    """Return rms errors on a held-out flight, global model and one identified there, shape (2, 6)."""
    truth, there = flown(1)[at], point(at)
    maneuver = Maneuver.of(measured(truth, 1_000_000 + ALL.index(at)))
    everywhere, local = replay(model, maneuver, outside="hold"), predict(there, maneuver, SETTINGS)
    dt, highest = maneuver.record.dt, model.corridor.highest_hz
    step = round(maneuver.record.dt / truth.dt)
    loads = up_to(truth.matrix(f"response/{n}" for n in RESPONSES)[:, ::step], dt, highest)
    loads = loads[:, : maneuver.record.time.size]
    found: dict[str, list[list[float]]] = {"record, about means": [[], []], "record, with means": [[], []]}
    found |= {"loads flown, about means": [[], []]}
    for row, name in zip(loads, RESPONSES, strict=True):
        ours, theirs, response = everywhere[name], local[name], there[name]
        x = np.array([history(maneuver, n) for n in response.regressors]) - response.trim[:, None]
        absolute = response.bias + up_to((response.estimate @ x)[None], dt, highest)[0]
        cases = {
            "record, about means": (np.std(ours.residual), np.std(theirs.residual)),
            "record, with means": (
                np.sqrt(np.mean(ours.residual**2)),
                np.sqrt(np.mean((ours.measured - absolute) ** 2)),
            ),
            "loads flown, about means": (np.std(row - ours.modelled), np.std(row - theirs.modelled)),
        }
        for what, pair in cases.items():
            for place, value in zip(found[what], pair, strict=True):
                place.append(float(value))
    return {what: np.array(pair) for what, pair in found.items()}


def scatter(ids: Sequence[str]) -> list[list[str]]:
    """Return stated over empirical standard errors over noise alone: at the points, and blended between them.

    The third row propagates the scatter that was found at the points instead of what they state: what it is
    off by, blending is.
    """
    speeds = np.array([reference_of(i).u for i in ids])
    middle = 0.5 * (speeds[1:] + speeds[:-1])
    import study_global  # by name, so that other processes find it too

    calls = [delayed(study_global.corridor)(ids, seed) for seed in range(1, SEEDS + 1)]
    corridors_found = cast(list[Corridor], list(Parallel(n_jobs=2)(calls)))

    def parameters(model: GlobalModel) -> tuple[np.ndarray, np.ndarray]:
        at = model.reference(middle, SEA)
        found = [model.parameters(r, at) for r in RESPONSES]
        return np.array([f.estimate[1:] for f in found]), np.array([f.std_error[1:] for f in found])

    knots = np.array([[c.responses[r].estimate for r in RESPONSES] for c in corridors_found])
    said = np.array(
        [
            [np.sqrt(np.diagonal(c.responses[r].covariance, axis1=1, axis2=2)).T for r in RESPONSES]
            for c in corridors_found
        ]
    )
    blends = [parameters(GlobalModel(c)) for c in corridors_found]
    estimates, stated = (np.array(part) for part in zip(*blends, strict=True))
    scattered = estimates.std(axis=0, ddof=1)
    first = corridors_found[0]
    mean = {
        r: replace(
            first.responses[r],
            estimate=knots[:, i].mean(axis=0),
            covariance=np.array([np.cov(knots[:, i, :, k].T) for k in range(len(ids))]),
        )
        for i, r in enumerate(RESPONSES)
    }
    propagated = parameters(GlobalModel(replace(first, responses=mean)))[1]
    cases = {
        "stated over scatter, at the points": np.sqrt((said**2).mean(axis=0)) / knots.std(axis=0, ddof=1),
        "stated over scatter, blended between": np.sqrt((stated**2).mean(axis=0)) / scattered,
        "scatter at the points propagated over scatter, between": propagated / scattered,
    }
    rows = []
    for what, ratio in cases.items():
        print(f"\n{what}: 2.5, 50, 97.5 %, rms, share within 10 %")
        for name, own in [*zip(RESPONSES, ratio, strict=True), ("all", ratio)]:
            low, mid, high = np.percentile(own, [2.5, 50, 97.5])
            share, rms = np.mean(np.abs(own - 1) <= 0.1), np.sqrt(np.mean(own**2))
            print(f"  {name:<4} {low:.3f} {mid:.3f} {high:.3f}   {rms:.3f}   {share:.3f}")
            rows.append([what, f"{SEEDS} seeds", "all", name, f"{low:.3f}", f"{high:.3f}", f"{mid:.3f}"])
        by_place = np.median(ratio, axis=(0, 1))
        print("  median by place " + " ".join(f"{v:.2f}" for v in by_place))
    return rows


def main() -> None:
    """Print and write the tables."""
    both = (*POINTS, *at_height(POINTS, "1500m"))
    cases = [
        ("between", "12 points", POINTS, HALFWAY, 1.25),
        (
            "between",
            "14 points, with u05 u77",
            (*POINTS, *TWO_MORE),
            (*QUARTERS[:2], *HALFWAY[1:-1], *QUARTERS[-2:]),
            1.25,
        ),
        (
            "between",
            "16 points, with u05 u15 u25 u77",
            (*POINTS, *FOUR_MORE),
            (*QUARTERS[:6], *HALFWAY[3:-1], *QUARTERS[-2:]),
            1.25,
        ),
        (
            "altitude, tilts by equivalent speed",
            "12 points at sea level",
            POINTS,
            at_height(POINTS, "1500m-eas")[:-1],
            1.5,
        ),
        ("altitude", "12 points at sea level", POINTS, at_height(POINTS, "1500m"), 1.5),
        ("altitude", "12 points at sea level", POINTS, at_height(POINTS, "750m"), 1.5),
        ("altitude", "24 points at 0 and 1500 m", both, at_height(POINTS, "750m"), 1.5),
    ]
    rows = []
    for where, made_from, ids, held_out, bar in cases:
        model = blended(ids)
        report(rows, where, made_from, {at: errors(model, at) for at in held_out}, bar)
    left = {at: errors(blended([i for i in POINTS if i != at]), at) for at in POINTS[1:-1]}
    report(rows, "left out", "11 points", left, 1.25)
    rows += scatter(POINTS)
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            ["what", "points", "condition", "response", "global_or_low", "there_or_high", "ratio"]
        )
        writer.writerows(rows)


def report(
    rows: list[list[str]], where: str, made_from: str, found: dict[str, dict[str, np.ndarray]], bar: float
) -> None:
    """Print ratios by condition and append them to the table."""
    for what in next(iter(found.values())):
        ratio = np.array([e[what][0] / e[what][1] for e in found.values()])
        print(f"\n{where}, {made_from}; {what}: {np.sum(ratio > bar)} of {ratio.size} above {bar}")
        for at, row in zip(found, ratio, strict=True):
            print(
                f"  {at:<11}" + "".join(f"{r:>3}{v:6.2f}" for r, v in zip(RESPONSES, row, strict=True)),
                flush=True,
            )
            for name, ours, theirs, r in zip(RESPONSES, *found[at][what], row, strict=True):
                rows.append(
                    [f"{where}; {what}", made_from, at, name, f"{ours:.4g}", f"{theirs:.4g}", f"{r:.3f}"]
                )


if __name__ == "__main__":
    main()
