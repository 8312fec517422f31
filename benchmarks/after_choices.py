"""How often 95 % intervals hold the truth after ``--select`` and ``--align``.

``--select``: the linear example with all ten regressors offered to each of six responses, by least squares
and by instruments, the same noise-free flight with the noise of each seed; intervals of the chosen model
alone, and with what the choice may have done; beside them those of the same parameters where nothing is
chosen. ``--align``: three aircraft of `_gusty_flights`, u v w late by
0.14 s, in still air and in gusts of 0.5 m/s. Run as ``python benchmarks/after_choices.py`` (four minutes).
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
from _gusty_flights import AIRCRAFT, LATE, SETTINGS, fly, logged

import freqid as fq
from freqid.core.errors import DataError
from freqid.flightlog.read import read_log
from freqid.identify import point
from freqid.identify.point import identify_point
from freqid.identify.sensors.alignment import identify_aligned

ROOT = Path(__file__).resolve().parents[1]
SELECT_SEEDS, ALIGN_SEEDS = range(1000, 1200), range(1000, 1040)
NOISE = {"u": 0.15, "v": 0.15, "w": 0.15, "p": 0.00175, "q": 0.00175, "r": 0.00175, "ax": 0.098}
NOISE |= {"ay": 0.098, "az": 0.098, "de": 0.00087, "da": 0.00087, "dr": 0.00087, "n1": 0.84}
REGRESSORS = ("u", "w", "q", "v", "p", "r", "de", "da", "dr", "n1")


def held(model, truth: dict[str, dict[str, float]]) -> list[bool]:
    """Tell for each parameter of a model whether its interval holds the truth."""
    return [
        bool(low < truth[r.response].get(n, 0.0) < high)
        for r in model.responses.values()
        for n, low, high in zip(r.regressors, r.lower, r.upper, strict=True)
    ]


def select(estimators: tuple[str, ...] = ("instruments", "least-squares")) -> list[dict[str, object]]:
    """Count over the linear example."""
    spec = importlib.util.spec_from_file_location("linear_record", ROOT / "examples" / "linear_record.py")
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    scenario = fq.read_scenario(ROOT / "scenarios" / "linear.toml")
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        example.fly(seed=3, noise=0.0).to_csv(log, index=False)
        clean = fq.Maneuver.of(
            read_log(log, ROOT / "scenarios" / "maps" / "linear.toml", vehicle=scenario.aircraft())
        )

    def noisy(seed: int) -> fq.Maneuver:
        rng = np.random.default_rng(seed)
        channels = {}
        for name, channel in clean.record.channels.items():
            group, _, short = name.partition("/")
            sigma = NOISE.get(short, 0.0) if group in ("state", "effector") else 0.0
            channels[name] = replace(
                channel, values=channel.values + sigma * rng.standard_normal(channel.values.size)
            )
        return replace(clean, record=replace(clean.record, channels=channels))

    rows, with_choice = [], point.with_choice
    for estimator in estimators:
        whole: dict[int, dict[tuple[str, str], bool]] = {}
        before: list[bool] = []
        for what, structure, widen in (
            ("all offered kept", "given", with_choice),
            ("chosen, choice ignored", "stepwise", lambda chosen, before: chosen),
            ("chosen", "stepwise", with_choice),
        ):
            point.with_choice = widen
            settings = msgspec.structs.replace(
                scenario.identification,
                estimator=estimator,
                structure=structure,
                regressors=REGRESSORS,
                residuals="coloured",
            )
            found, out = [], []
            for seed in SELECT_SEEDS:
                model = identify_point(noisy(seed), settings, excitation=scenario.excitation)
                covers = held(model, example.DERIVATIVES)
                named = [(r.response, n) for r in model.responses.values() for n in r.regressors]
                if structure == "given":
                    whole[seed] = dict(zip(named, covers, strict=True))
                elif widen is with_choice:
                    before += [whole[seed][n] for n in named]
                found += covers
                for r, account in model.provenance.get("structure", {}).items():
                    for name, (low, high) in account["left_out_limits"].items():
                        out.append(low < example.DERIVATIVES[r].get(name, 0.0) < high)
            rows.append(_row("--select", "drone", 0.0, estimator, what, len(SELECT_SEEDS), found, out))
        what = "all offered kept, those of them that are chosen"
        rows.append(_row("--select", "drone", 0.0, estimator, what, len(SELECT_SEEDS), before, []))
    point.with_choice = with_choice
    return rows


def align(aircraft=AIRCRAFT, sizes: tuple[float, ...] = (0.0, 0.5)) -> list[dict[str, object]]:
    """Count over aircraft in still air and in gusts."""
    rows = []
    for craft in aircraft:
        for size in sizes:
            settings = msgspec.structs.replace(SETTINGS, estimator="instruments")
            found, delays = [], []
            for seed, flown in zip(ALIGN_SEEDS, fly(craft, size, ALIGN_SEEDS), strict=True):
                try:
                    model, (aligned,) = identify_aligned(
                        [logged(craft, flown, seed, LATE, "velocity")], settings
                    )
                except DataError:  # instruments too weak in gusts: refused by name
                    continue
                found += held(model, craft.derivatives)
                delay, error = aligned["velocity delay"]
                delays.append(abs(delay - LATE) < 1.96 * error)
            what = f"velocity delay held in {sum(delays)} of {len(delays)}"
            rows.append(_row("--align", craft.name, size, "instruments", what, len(delays), found, []))
    return rows


def _row(option, aircraft, size, estimator, what, flights, found, out) -> dict[str, object]:
    row = {"option": option, "aircraft": aircraft, "gusts": size, "estimator": estimator, "intervals": what}
    row |= {"flights": flights, "parameters": len(found), "covered": f"{np.mean(found):.3f}"}
    row |= {"left out covered": f"{np.mean(out):.3f}" if out else ""}
    print("  ".join(str(v) for v in row.values()), flush=True)
    return row


def main() -> None:
    """Print and write the table."""
    rows = [*select(), *align()]
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
