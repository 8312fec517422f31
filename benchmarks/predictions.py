"""Coverage of sealed predictions over 200 simulated flights: `python benchmarks/predictions.py`.

At each of five cases (the tilt-wing at three conditions, the linear aircraft in still air and in gusts), each
of five models is identified by instruments from a flight of its own, predicts another design, and is scored
on eight flights of that. Designs differ by random signs of their effectors, which keep the peaks: distortion
and transients differ with them. No two flights share a seed of noise, gusts or signs.

Rows: coverage of the 95 % bands by case, kind and channel, the mean over all flights; the standard deviation
of one flight's coverage; RMSE over the predicted one, rms over the flights; Theil's U; last, how many flights
passed the gate, and were said to contradict an assumption. Writes benchmarks/predictions.csv. Arguments are
the number of models and the first seed: those from 1000 on judge, lower ones were used to build it.
"""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
from joblib import Parallel, delayed

from freqid.core.record import FlightRecord
from freqid.core.results.design import MultisineDesign
from freqid.core.results.prediction import Score
from freqid.core.scenario import read_scenario
from freqid.simulate.maneuver import Conditions, logged
from freqid.workflows.design import design_inputs
from freqid.workflows.fly import simulate
from freqid.workflows.models.identify import identify_point
from freqid.workflows.models.seal import predict_flight, score_prediction

MODELS = int(sys.argv[1]) if len(sys.argv) > 1 else 5
SEED = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
FLIGHTS, DRAWS = 8, 60
LINEAR = str(Path(__file__).parents[1] / "scenarios" / "linear.toml")
CASES = (
    ("la8", "u20", 0.0),
    ("la8", "u45", 0.0),
    ("la8", "u70", 0.0),
    (LINEAR, "u20", 0.0),
    (LINEAR, "u20", 4.0),
)


def signed(design: MultisineDesign, seed: int) -> MultisineDesign:
    """Return a design whose effectors move the other way at random."""
    signs = np.random.default_rng(seed).choice([0.0, np.pi], len(design.signals))
    signals = tuple(replace(s, phase=s.phase + turn) for s, turn in zip(design.signals, signs, strict=True))
    return replace(design, signals=signals)


def case(scenario: str, at: str, gusts: float, models: int) -> list[dict[str, str]]:
    """Return the rows of one case."""
    described = read_scenario(scenario)[0]
    design = cast(MultisineDesign, design_inputs(described, seed=0).design)
    scores: list[Score] = []

    def flown(inputs: MultisineDesign, seeds: range) -> list[FlightRecord]:
        if gusts:
            return [
                simulate(described, inputs, at=at, noise=1.0, turbulence=gusts, seed=seed).record
                for seed in seeds
            ]
        once = simulate(described, inputs, at=at).flown.flight  # in still air only the sensors differ
        return [
            logged(described, once, inputs.names, at, Conditions(noise=1.0, seed=seed), np.zeros(3)).record
            for seed in seeds
        ]

    for m in range(models):
        first = SEED + 20 * m
        identified = flown(signed(design, first), range(first, first + 1))
        model = identify_point(identified, described, estimator="instruments")
        inputs = signed(design, first + 1)
        sealed = predict_flight(
            model, inputs, described, sensors="research", turbulence=gusts, draws=DRAWS, seed=first
        )
        again = flown(inputs, range(first + 2, first + 2 + FLIGHTS))
        scores += [score_prediction(sealed, one) for one in again]
    name = f"{described.vehicle.name} {at}" + (f" gusts {gusts:g} m/s" if gusts else "")
    return rows_of(name, scores)


def rows_of(name: str, scores: list[Score]) -> list[dict[str, str]]:
    """Return a row for each channel, for each kind, and for the assumptions."""
    rows = []

    def row(kind: str, channel: str, coverage: np.ndarray, ratio: float, theil: float) -> None:
        rows.append(
            {
                "case": name,
                "kind": kind,
                "channel": channel,
                "coverage_percent": f"{100 * coverage.mean():.1f}",
                "one_flight_sd_percent": f"{100 * coverage.std():.1f}",
                "rmse_over_expected": f"{ratio:.3f}",
                "theil": f"{theil:.3f}",
                "flights": str(len(scores)),
            }
        )

    for kind in scores[0].coverage:
        own = [[c for c in s.channels if c.kind == kind] for s in scores]
        shares = np.array([[c.coverage for c in one] for one in own])
        ratios = np.array([[c.rmse / c.expected_rmse for c in one] for one in own])
        theil = np.array([[c.theil for c in one] for one in own])
        row(kind, "all", shares.mean(axis=1), float(np.sqrt(np.mean(ratios**2))), float(theil.mean()))
        for i, c in enumerate(own[0]):
            row(
                kind,
                c.name,
                shares[:, i],
                float(np.sqrt(np.mean(ratios[:, i] ** 2))),
                float(theil[:, i].mean()),
            )
    failed = [n for s in scores for n in s.failed]
    words = " ".join(f"{n} {failed.count(n)}" for n in dict.fromkeys(failed)) or "none"
    passed = np.array([float(s.passed) for s in scores])
    row("gate passed", words, passed, float("nan"), float("nan"))
    return rows


def main() -> None:
    found = Parallel(n_jobs=2, return_as="generator")(delayed(case)(*one, MODELS) for one in CASES)
    rows: list[dict[str, str]] = []
    for one in found:
        part = cast(list[dict[str, str]], one)
        rows += part
        for each in part:
            print("  ".join(f"{value:<10}" for value in each.values()), flush=True)
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
