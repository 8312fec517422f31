"""What two sensor suites make of the same flights: `python benchmarks/study_suites.py`.

Each flight of the LA-8 class simulation is measured 12 times with each suite, on a day of its own, and every
parameter compared with the estimate from the same flight without any sensor error (research suite at zero
noise: velocity through the air, no delay). The owner's suite knows velocity over the ground alone, so without
`--align fit` the parameters of u v w are refused; "owner, wind ignored" takes velocity over the ground for
that through the air and shows what it would cost. Writes benchmarks/study_suites.csv.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from _la8 import EXCITATION, SCENARIO, SETTINGS, write
from _la8_flights import flights, measured, reference_of

import freqid as fq
from freqid.core.channels import WRENCH
from freqid.identify.point import identify_point
from freqid.identify.sensors.alignment import Alignment, identify_aligned
from freqid.identify.sensors.alignment_motion import Misaligned
from freqid.simulate import sensors
from freqid.simulate.air.dryden import steady_wind

CONDITIONS = ("u00", "u10", "u20", "u36", "u45", "u62", "u85")
SEEDS = 12
KNOWN = 5.0  # a parameter's size over the research suite's standard error, from which its bias is a share
VARIANTS = ("research", "owner, wind ignored", "owner, aligned")
OWNER = sensors.suite(SCENARIO, "owner")
DELAYS = {
    f"{what} delay": OWNER[label].latency_s - OWNER["gyro"].latency_s
    for what, label in (
        ("velocity", "velocity"),
        ("attitude", "attitude"),
        ("surface", "servos"),
        ("rotor", "speed_controllers"),
    )
}


def identified(record: fq.FlightRecord, at: str) -> fq.PointModel:
    """Identify as the scenario says."""
    return identify_point(fq.Maneuver.of(record), SETTINGS, excitation=EXCITATION, reference=reference_of(at))


def aligned(record: fq.FlightRecord, at: str) -> tuple[fq.PointModel, Alignment]:
    """Identify as with `--align fit`."""
    model, found = identify_aligned(
        [fq.Maneuver.of(record)], SETTINGS, excitation=EXCITATION, reference=reference_of(at)
    )
    return model, found[0]


def main() -> None:
    """Print and write the tables."""
    rows = []
    flights(CONDITIONS)
    with ProcessPoolExecutor(2) as pool:
        for found in pool.map(of_condition, CONDITIONS):
            for row in found:
                print("  ".join(f"{value!s:<8}" for value in row.values()), flush=True)
            rows += found
    write(Path(__file__), rows)


def of_condition(at: str) -> list[dict[str, object]]:
    """Return the rows of one condition."""
    truth = flights([at])[at]
    exact = identified(measured(truth, 0, 0.0), at)
    owner = [measured(truth, s, 1.0, "owner") for s in range(SEEDS)]
    both = [aligned(record, at) for record in owner]
    models = {
        "research": [identified(measured(truth, s), at) for s in range(SEEDS)],
        # as if nobody had said that the air moves
        "owner, wind ignored": [
            identified(Misaligned(fq.Maneuver.of(r), {}).at({}).record, at) for r in owner
        ],
        "owner, aligned": [model for model, _ in both],
    }
    rows: list[dict[str, object]] = []
    for response in WRENCH:
        truth_of = exact[response].estimate
        research = np.sqrt(np.mean([m[response].std_error ** 2 for m in models["research"]], axis=0))
        known = np.abs(truth_of) > KNOWN * research
        for variant in VARIANTS:
            found = [m[response] for m in models[variant]]
            estimate, stated = (np.array([getattr(f, n) for f in found]) for n in ("estimate", "std_error"))
            inside = [(f.lower <= truth_of) & (truth_of <= f.upper) for f in found]
            error = (estimate - truth_of) / stated
            bias, rms = estimate.mean(axis=0) - truth_of, np.sqrt((stated**2).mean(axis=0))
            share = np.abs(bias / truth_of)[known]
            wrong = (np.abs(bias) > 2 * rms) & (np.abs(bias) > 0.1 * np.abs(truth_of))
            names = np.array(exact[response].regressors)
            rows.append(
                {
                    "condition": at,
                    "suite": variant,
                    "of": response,
                    "coverage_of_95": f"{np.mean(inside):.3f}",
                    "rms_normalised_error": f"{np.sqrt((error**2).mean()):.3f}",
                    "mean_normalised_error_rms": f"{np.sqrt((error.mean(axis=0) ** 2).mean()):.3f}",
                    "median_bias_percent": f"{100 * np.median(share):.2f}" if share.size else "",
                    "worst_bias_percent": f"{100 * share.max():.1f}" if share.size else "",
                    "parameters_compared": share.size,
                    "std_error_over_research": f"{np.median(rms / research):.2f}",
                    "not_told_from_zero": " ".join(names[np.abs(truth_of) < 2 * rms]),
                    "biased_beyond_2_sigma_and_10_percent": " ".join(names[wrong]),
                }
            )
    return rows + [of_unknown(at, name, [a for _, a in both]) for name in both[0][1].names]


def of_unknown(at: str, name: str, found: list[Alignment]) -> dict[str, object]:
    """Return the row of one unknown of the alignment: coverage, rms error, stated error and mean error."""
    each = np.array([a[name] for a in found])
    true = np.array([actual(name, seed) for seed in range(len(found))])
    off = each[:, 0] - true
    at_ = found[0].names.index(name)
    inside = [a.lower[at_] <= t <= a.upper[at_] for a, t in zip(found, true, strict=True)]
    return {
        "condition": at,
        "suite": "owner, aligned",
        "of": name,
        "coverage_of_95": f"{np.mean(inside):.3f}",
        "rms_normalised_error": f"{np.sqrt(np.mean((off / each[:, 1]) ** 2)):.3f}",
        "mean_normalised_error_rms": f"{abs(np.mean(off / each[:, 1])):.3f}",
        "median_bias_percent": "",
        "worst_bias_percent": "",
        "parameters_compared": "",
        "std_error_over_research": "",
        "not_told_from_zero": f"rms error {np.sqrt(np.mean(off**2)):.3g} {found[0].account()[name]['units']}",
        "biased_beyond_2_sigma_and_10_percent": f"stated {np.sqrt(np.mean(each[:, 1] ** 2)):.3g}",
    }


def actual(name: str, seed: int) -> float:
    """Return an error of the owner's sensors as it was drawn: less that of the inertial sensors."""
    if name in DELAYS:
        return DELAYS[name]
    if name.startswith("wind"):
        return float(steady_wind(SCENARIO, "owner", seed)[("wind north", "wind east").index(name)])
    channel, kind = name.split()
    rng = np.random.default_rng([seed, *f"state/{channel}".encode()])  # as `sensors.measure` draws them
    bias, scale = rng.standard_normal(2)
    return OWNER["attitude"].bias * bias if kind == "bias" else OWNER["gyro"].scale * scale


if __name__ == "__main__":
    main()
