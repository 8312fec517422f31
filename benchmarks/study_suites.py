"""What two sensor suites make of the same flights: `python benchmarks/study_suites.py`.

Each flight of the LA-8 class simulation is measured 24 times with each suite, and every parameter compared
with the estimate from the same flight without any sensor error (research suite at zero noise: velocity
through the air, no delay). Beside the owner's suite as it is: in still air, then also without its delays one
after another, so that what each costs can be told. Writes benchmarks/study_suites.csv.
"""

from __future__ import annotations

import csv
from pathlib import Path

import msgspec
import numpy as np
from _la8_flights import SCENARIO, finer, flights, measured

from freqid.core.models import PointModel
from freqid.core.record import FlightRecord, Maneuver
from freqid.identify.point import identify_point
from freqid.simulate import sensors

CONDITIONS = ("u00", "u10", "u20", "u36", "u45", "u62", "u85")
SEEDS = 24
KNOWN = 5.0  # a parameter's size over the research suite's standard error, from which its bias is a share
OWNER = sensors.suite(SCENARIO, "owner")


def on_time(*labels: str) -> dict[str, sensors.Sensor]:
    """Return sensors of the owner's suite without their delay, and at the log's rate."""
    return {label: msgspec.structs.replace(OWNER[label], latency_s=0.0, rate_hz=100.0) for label in labels}


VARIANTS: dict[str, tuple[str, dict[str, sensors.Sensor]]] = {
    "research": ("research", {}),
    "owner": ("owner", {}),
    "owner, still air": ("owner, still air", {}),
    "owner, still air, velocity on time": ("owner, still air", on_time("velocity")),
    "owner, still air, rotors on time": ("owner, still air", on_time("speed_controllers")),
    "owner, still air, all on time": ("owner, still air", on_time(*OWNER)),
}


def identified(record: FlightRecord, at: str) -> PointModel:
    """Identify as the scenario says."""
    settings = SCENARIO.identification
    assert settings is not None
    here = finer().reference_of(at)
    return identify_point(Maneuver.of(record), settings, excitation=SCENARIO.excitation, reference=here)


def main() -> None:
    """Print and write the tables."""
    rows, shares = [], []
    for at, truth in flights(CONDITIONS).items():
        exact = identified(measured(truth, 0, 0.0), at)
        known: dict[str, np.ndarray] = {}
        for variant, (suite, changed) in VARIANTS.items():
            models = [identified(measured(truth, s, 1.0, suite, **changed), at) for s in range(SEEDS)]
            for name, response in exact.responses.items():
                found = np.array([m[name].estimate for m in models])
                stated = np.array([m[name].std_error for m in models])
                inside = [
                    (m[name].lower <= response.estimate) & (response.estimate <= m[name].upper) for m in models
                ]
                error = (found - response.estimate) / stated
                bias = found.mean(axis=0) - response.estimate
                rms = np.sqrt((stated**2).mean(axis=0))
                if variant == "research":
                    known[name] = np.abs(response.estimate) > KNOWN * rms
                share = np.abs(bias / response.estimate)[known[name]]
                lost = np.abs(response.estimate) < 2 * rms
                rows.append(
                    {
                        "condition": at,
                        "suite": variant,
                        "response": name,
                        "rms_normalised_error": f"{np.sqrt((error**2).mean()):.3f}",
                        "coverage_of_95": f"{np.mean(inside):.3f}",
                        "mean_normalised_error_rms": f"{np.sqrt((error.mean(axis=0) ** 2).mean()):.3f}",
                        "median_bias_percent": f"{100 * np.median(share):.2f}" if share.size else "",
                        "worst_bias_percent": f"{100 * share.max():.1f}" if share.size else "",
                        "parameters_compared": share.size,
                        "scatter_over_stated": f"{np.median(found.std(axis=0, ddof=1) / rms):.3f}",
                        "not_told_from_zero": " ".join(np.array(response.regressors)[lost]),
                        "biased_beyond_2_sigma_and_10_percent": " ".join(
                            n
                            for n, b, s, e in zip(response.regressors, bias, rms, response.estimate, strict=True)
                            if abs(b) > 2 * s and abs(b) > 0.1 * abs(e)
                        ),
                    }
                )
            shares.append(rows[-6:])
            show(at, variant, rows[-6:])
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def show(at: str, variant: str, rows: list[dict[str, object]]) -> None:
    """Print one condition and suite: coverage, and median bias in per cent, by response."""
    cover = " ".join(f"{r['response']} {float(str(r['coverage_of_95'])):5.3f}" for r in rows)
    bias = " ".join(f"{r['median_bias_percent'] or '-':>6}" for r in rows)
    error = " ".join(f"{float(str(r['rms_normalised_error'])):5.2f}" for r in rows)
    print(f"{at:<5}{variant:<36}covers {cover}  nrms {error}  bias % {bias}", flush=True)


if __name__ == "__main__":
    main()
