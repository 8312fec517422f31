"""The global model where nothing was identified: `python benchmarks/study_global.py`.

Point models of LA-8 class flights at the conditions of scenarios/la8.toml, measured with research sensors and
their full noise, as `study` makes them. Other flights, other multisines, are held out: the global model
replays them and its error is divided by that of a model identified at their own condition.

between    the condition lies about halfway between two of the points
left out   it is a point, and the global model is made without it
altitude   its density is none of the points'

About the means, as a point model predicts; and with means, where the model identified there is its bias
about its own trim. Errors are against the record, noise and all, and against the loads that the simulation
flew. Writes benchmarks/study_global.csv; standard errors: benchmarks/study_global_errors.py.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import msgspec
import numpy as np
from _la8 import EXCITATION, SCENARIO, SETTINGS
from _la8_flights import BETWEEN, REFERENCES, corridors, flights, measured, reference_of

import freqid as fq
from freqid.blend.line_up import line_up
from freqid.blend.predict import replay
from freqid.core.results.corridor import Corridor
from freqid.identify.loads.explanatory import history
from freqid.identify.point import identify_point, predict_responses
from freqid.identify.spectra.trend import up_to
from freqid.simulate.sensors import suite

RESPONSES = ("X", "Y", "Z", "L", "M", "N")
POINTS = tuple(at.id for at in REFERENCES)
# Points further apart, and what lies halfway between them; halfway or so between all points.
FEWER = tuple(i for i in POINTS if i not in ("u05", "u15", "u25", "u77"))
HALFWAY = ("u05", "u15", "u25", "u33", "u38", "u42", "u47", "u52", "u58", "u66", "u77")
BESIDE = tuple(name for name, _, _ in BETWEEN)
ALL = tuple(at.id for along in corridors().values() for at in along)
NEAR, FAR = 1.25, 1.5  # the study's bars: between points, at another altitude


def at_height(ids: Sequence[str], height: str) -> tuple[str, ...]:
    """Return the ids of the same speeds at 750 m or 1500 m."""
    return tuple(f"{i}-{height}" for i in ids)


@lru_cache(maxsize=2)
def flown(seed: int) -> dict[str, fq.FlightRecord]:
    """Return all flights with one set of multisines."""
    return flights(ALL, seed)


def logged(design: int, at: str, seed: int, noise: float = 1.0, bias: float = 1.0) -> fq.FlightRecord:
    """Return what is logged of a flight with multiples of the research suite's noise and of its biases.

    Each condition has noise of its own: with the same everywhere, errors would
    go along the corridor together.
    """
    change = msgspec.structs.replace
    carried = {name: change(s, bias=bias * s.bias) for name, s in suite(SCENARIO, "research").items()}
    return measured(flown(design)[at], 1000 * seed + ALL.index(at), noise, "research", **carried)


def identified(at: str, seed: int = 0, noise: float = 1.0, bias: float = 1.0) -> fq.PointModel:
    """Return the point model of a condition, from the first multisines."""
    record = logged(0, at, seed, noise, bias)
    return identify_point(fq.Maneuver.of(record), SETTINGS, excitation=EXCITATION, reference=reference_of(at))


def corridor(ids: Sequence[str], seed: int, noise: float = 1.0) -> Corridor:
    """Return the points of a global model with other noise."""
    return line_up([identified(i, seed, noise) for i in ids], list(ids))


point = lru_cache(maxsize=None)(identified)


def blended(ids: Sequence[str], bias: float = 1.0) -> fq.GlobalModel:
    """Return the global model of some conditions."""
    return fq.GlobalModel(line_up([point(i, bias=bias) for i in ids], list(ids)))


def errors(model: fq.GlobalModel, at: str, bias: float = 1.0) -> dict[str, np.ndarray]:
    """Return rms errors on a held-out flight, global model and one identified there, shape (2, 6)."""
    truth, there = flown(1)[at], point(at, bias=bias)
    maneuver = fq.Maneuver.of(logged(1, at, 1000, bias=bias))
    everywhere, local = replay(model, maneuver, outside="hold"), predict_responses(there, maneuver, SETTINGS)
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


def main() -> None:
    """Print and write the tables."""
    alike = at_height(POINTS, "1500m-eas")[:-1]  # the last one is beyond the fastest point
    both = (*POINTS, *at_height(POINTS, "1500m"))
    cases = [
        ("between", "16 points", POINTS, BESIDE, NEAR),
        ("between", "12 points", FEWER, HALFWAY, NEAR),
        ("altitude, tilts by equivalent speed", "16 points at sea level", POINTS, alike, FAR),
        ("altitude", "16 points at sea level", POINTS, at_height(POINTS, "1500m"), FAR),
        ("altitude", "16 points at sea level", POINTS, at_height(POINTS, "750m"), FAR),
        ("altitude", "32 points at 0 and 1500 m", both, at_height(POINTS, "750m"), FAR),
    ]
    rows = []
    for where, made_from, ids, held_out, bar in cases:
        model = blended(ids)
        report(rows, where, made_from, {at: errors(model, at) for at in held_out}, bar)
    model = blended(POINTS, bias=0.0)
    found = {at: errors(model, at, bias=0.0) for at in BESIDE}
    report(rows, "between, sensors without biases", "16 points", found, NEAR)
    left = {at: errors(blended([i for i in POINTS if i != at]), at) for at in POINTS[1:-1]}
    report(rows, "left out", "15 points", left, NEAR)
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["what", "points", "condition", "response", "global", "there", "ratio"])
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
