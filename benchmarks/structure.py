"""What a choice of terms does at a point: the LA-8 at `u45`, and an aircraft that is linear.

Two designs (seeds 0 and 1) are flown at `u45` without and with noise. The model of the first is scored on the
second, and on the second flown without noise. Then the linear example is flown 60 times with noise: how often
products enter that are not there, and regressors stay that do nothing. Run as
``python benchmarks/structure.py`` (some minutes: the designs are searched first).
"""

from __future__ import annotations

import csv
import importlib.util
import os
import tempfile
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import msgspec
import numpy as np

import freqid as fq
from freqid.design.finish import finish
from freqid.design.multisine.orthogonal_set import design_multisines, sampled
from freqid.flightlog.read import read_log
from freqid.identify.model import selection
from freqid.identify.point import identify_point, predict_responses
from freqid.simulate.control import lq
from freqid.simulate.maneuver import Conditions, fly_maneuver

ROOT = Path(__file__).resolve().parents[1]
SEEDS = 60
NOISE = {"u": 0.15, "v": 0.15, "w": 0.15, "p": 0.00175, "q": 0.00175, "r": 0.00175, "ax": 0.098}
NOISE |= {"ay": 0.098, "az": 0.098, "de": 0.00087, "da": 0.00087, "dr": 0.00087, "n1": 0.84}
CHOICES = {
    "given": {},
    "stepwise": {"structure": "stepwise"},
    "products": {"nonlinear": "products"},
    "both": {"structure": "stepwise", "nonlinear": "products"},
}


def la8() -> list[dict[str, object]]:
    """Score models of `u45` by what they leave of their own flight and of another design's."""
    scenario = fq.read_scenario("la8")
    at = scenario.reference_of("u45")
    loop = lq.close_loop(scenario, at)
    flights = {}
    for seed in (0, 1):
        found = design_multisines(scenario.excitation, scenario.effector, seed=seed)
        inputs = sampled(finish(found, scenario.excitation, scenario.effector).design)
        for noise in (0.0, 1.0):
            flown = fly_maneuver(scenario, at, inputs, Conditions(noise=noise, seed=seed + 1), loop=loop)
            flights[seed, noise] = fq.Maneuver.of(flown.record)
    rows = []
    for noise in (0.0, 1.0):
        for choice, changes in CHOICES.items():
            settings = msgspec.structs.replace(scenario.identification, **changes)
            model = identify_point(flights[0, noise], settings, excitation=scenario.excitation, reference=at)
            held_out = predict_responses(model, flights[1, noise], settings)
            without = predict_responses(model, flights[1, 0.0], settings)
            for name, response in model.responses.items():
                products = [n for n in response.regressors if "*" in n]
                row = {"case": "la8 u45", "noise": noise, "choice": choice, "response": name}
                row |= {
                    "regressors": len(response.regressors) - len(products),
                    "products": " ".join(products),
                }
                row |= {"distortion": f"{response.distortion:.3g}", "rmse": f"{response.rmse:.4g}"}
                row |= {"held_out_rmse": f"{np.std(held_out[name].residual):.4g}"}
                row |= {"held_out_noise_free_rmse": f"{np.std(without[name].residual):.4g}"}
                rows.append(row)
    return rows


def linear() -> list[dict[str, object]]:
    """Count what enters and what stays wrongly where the aircraft is linear."""
    spec = importlib.util.spec_from_file_location("linear_record", ROOT / "examples" / "linear_record.py")
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    scenario = fq.read_scenario(ROOT / "scenarios" / "linear.toml")
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        example.fly(seed=3, noise=0.0).to_csv(log, index=False)
        maps = ROOT / "scenarios" / "maps" / "linear.toml"
        clean = fq.Maneuver.of(read_log(log, maps, vehicle=scenario.aircraft()))
    names = ("u", "w", "q", "v", "p", "r", "de", "da", "dr", "n1")
    settings = msgspec.structs.replace(
        scenario.identification, regressors=names, residuals="noise-lines", **CHOICES["both"]
    )
    rows = []
    for threshold in (selection.DISTORTED, 0.0):
        selection.DISTORTED = threshold
        for estimator in ("least-squares", "instruments"):
            bent, useless, idle = 0, 0, 0
            for seed in range(SEEDS):
                model = identify_point(
                    _noisy(clean, seed), settings, excitation=scenario.excitation, estimator=estimator
                )
                bent += any("*" in n for r in model.responses.values() for n in r.regressors)
                for name, response in model.responses.items():
                    useless += len(set(names) & set(response.regressors) - set(example.DERIVATIVES[name]))
                    idle += len(set(names) - set(example.DERIVATIVES[name]))
            row = {"case": f"linear, distortion above {threshold:g}", "noise": 1.0, "choice": estimator}
            row |= {
                "products": f"{bent} of {SEEDS} flights",
                "regressors": f"{useless} of {idle} useless ones",
            }
            rows.append(row)
    return rows


def _noisy(maneuver: fq.Maneuver, seed: int) -> fq.Maneuver:
    rng = np.random.default_rng(seed)
    channels = {}
    for name, channel in maneuver.record.channels.items():
        group, _, short = name.partition("/")
        sigma = NOISE.get(short, 0.0) if group in ("state", "effector") else 0.0
        values = channel.values + sigma * rng.standard_normal(channel.values.size)
        channels[name] = replace(channel, values=values)
    return replace(maneuver, record=replace(maneuver.record, channels=channels))


def main() -> None:
    """Print and write the table."""
    rows = [*la8(), *linear()]
    for row in rows:
        print("  ".join(f"{key} {value}" for key, value in row.items()))
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
