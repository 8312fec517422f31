"""What two sensor suites make of the same flights: `python benchmarks/study_suites.py`.

Each flight of the LA-8 class simulation is measured 24 times with each suite, and every parameter compared
with the estimate from the same flight without any sensor error (research suite at zero noise: velocity
through the air, no delay). Beside the owner's suite as it is: in still air, then also without its delays one
after another, so that what each costs can be told; and with delays and wind that are fitted to the flight
itself (`aligned`), which the commands do not do yet. Writes benchmarks/study_suites.csv.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
from _la8 import EXCITATION, SCENARIO, SETTINGS
from _la8_flights import blowing, flights, measured, reference_of
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from freqid.core.frames import cross
from freqid.core.models import PointModel
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.units import STANDARD_GRAVITY
from freqid.identify.fourier import harmonics
from freqid.identify.line_equations import on_lines
from freqid.identify.point import identify_point
from freqid.identify.problem import Problem
from freqid.identify.wrench import AppliedWrench
from freqid.simulate import sensors
from freqid.simulate.turbulence import steady_wind

CONDITIONS = ("u00", "u10", "u20", "u36", "u45", "u62", "u85")
SEEDS = 24
VELOCITY = ("state/u", "state/v", "state/w")
KNOWN = 5.0  # a parameter's size over the research suite's standard error, from which its bias is a share
LINES = harmonics(EXCITATION.period_s, EXCITATION.band_hz)
OWNER = sensors.suite(SCENARIO, "owner")
SURFACES, ROTORS = (tuple(e.name for e in SCENARIO.effector if e.kind == k) for k in ("surface", "rotor"))


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
    "owner, still air, delays fitted": ("owner, still air", {}),
    "owner, delays and wind fitted": ("owner", {}),
}


def identified(record: FlightRecord, at: str) -> PointModel:
    """Identify as the scenario says."""
    return identify_point(Maneuver.of(record), SETTINGS, excitation=EXCITATION, reference=reference_of(at))


def shifted(record: FlightRecord, names: Sequence[str], delay: float) -> FlightRecord:
    """Return a record with some channels brought forward, held at the end."""
    late = [record.channel(name) for name in names]
    at = np.clip(record.time + delay, record.time[0], record.time[-1])
    return record.with_channels(*(replace(c, values=CubicSpline(record.time, c.values)(at)) for c in late))


def velocity_delay(record: FlightRecord) -> float:
    """Return by how much u v w come later than rates and specific forces, s: kinematics on the harmonics.

    What is left of ``v' = f + g - w x v``, all at the origin, is least at the right delay; over the ground it
    holds in any steady wind.
    """
    dt, offset = record.dt, np.array(record.channel("state/ax").position_m)
    phi, theta = record.matrix(f"state/{n}" for n in ("phi", "theta"))
    gravity = STANDARD_GRAVITY * np.stack(
        [-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)]
    )
    rates, felt = (record.matrix(f"state/{n}" for n in names) for names in ("pqr", ("ax", "ay", "az")))
    lever = cross(rates, np.broadcast_to(offset[:, None], rates.shape))

    def left(delay: np.ndarray) -> np.ndarray:
        velocity = shifted(record, VELOCITY, float(delay[0])).matrix(VELOCITY)
        # the velocity of the accelerometers is v + w x d, and its own kinematics have no turning acceleration
        there = velocity + lever
        motion = AppliedWrench(("X", "Y", "Z"), ("m/s2",) * 3, cross(rates, there) - felt - gravity, there)
        z = on_lines([there[:1]], [motion], [dt], LINES)
        real = np.concatenate([z.nuisance.real, z.nuisance.imag], axis=1)
        rows = np.concatenate([z.z.real, z.z.imag], axis=1)
        basis = np.linalg.qr(real.T)[0]
        return (rows - (rows @ basis) @ basis.T).ravel()

    return float(least_squares(left, [0.0], x_scale=[0.01]).x[0])


def aligned(record: FlightRecord, *, wind: bool) -> tuple[FlightRecord, np.ndarray]:
    """Return a record without its delays and the steady wind, and these: three delays, s; wind, m/s.

    The velocity's delay follows from kinematics. Those of surfaces and rotors, and the wind, are where the
    least of the responses is left unexplained on the harmonics: separable least squares, for the linear
    parameters follow from them. Where they tell nothing, as of the wind along a hovering aircraft, they stay
    small: 0.1 s and 5 m/s are taken to be one sigma beforehand.
    """
    delay = velocity_delay(record)
    record = shifted(record, VELOCITY, delay)
    problem = Problem.of([Maneuver.of(record)], SETTINGS)
    # A wind of 1 m/s north, then east, as it shows in u v w over the ground.
    blown = np.zeros((2, *problem.x[0].shape))
    moving = [problem.names.index(n) for n in "uvw"]
    for i, unit in enumerate(np.eye(3)[:2]):
        blown[i, moving] = blowing(record, unit)
    every = np.concatenate([problem.x[0], *(row - row.mean(axis=1, keepdims=True) for row in blown)])
    equations = on_lines([every], problem.wrench, problem.dt, LINES)
    x, *by_wind = np.split(equations.x, 3)
    late = np.array([[name in group for name in problem.names] for group in (SURFACES, ROTORS)], dtype=float)
    z = np.concatenate([equations.z.real, equations.z.imag], axis=1)

    def left(unknown: np.ndarray) -> np.ndarray:
        moved = x - sum(w * by for w, by in zip(unknown[2:], by_wind, strict=False))
        moved = moved * np.exp(2j * np.pi * np.outer(unknown[:2] @ late, LINES))
        columns = np.concatenate([moved, equations.nuisance])
        basis = np.linalg.qr(np.concatenate([columns.real, columns.imag], axis=1).T)[0]
        return z - (z @ basis) @ basis.T

    start, scale = np.zeros(4 if wind else 2), np.linalg.norm(left(np.zeros(2)), axis=1, keepdims=True)
    steps = [0.01, 0.01, 1.0, 1.0][: start.size]
    plausible = np.array([0.1, 0.1, 5.0, 5.0][: start.size]) * np.sqrt(z.shape[1])
    found = least_squares(
        lambda unknown: np.append(left(unknown) / scale, unknown / plausible), start, x_scale=steps
    ).x
    for group, own in zip((SURFACES, ROTORS), found, strict=False):
        record = shifted(record, [f"effector/{n}" for n in group], float(own))
    blowing_now = np.concatenate([found[2:], np.zeros(5 - found.size)])
    through_air = record.matrix(VELOCITY) - blowing(record, blowing_now)
    record = record.with_channels(
        *(replace(record.channel(n), values=v) for n, v in zip(VELOCITY, through_air, strict=True))
    )
    return record, np.array([delay, *found])


def main() -> None:
    """Print and write the tables."""
    rows, fitted = [], []
    for at, truth in flights(CONDITIONS).items():
        exact = identified(measured(truth, 0, 0.0), at)
        known: dict[str, np.ndarray] = {}
        for variant, (suite, changed) in VARIANTS.items():
            records = [measured(truth, s, 1.0, suite, **changed) for s in range(SEEDS)]
            if "fitted" in variant:
                corrected = [aligned(r, wind="wind" in variant) for r in records]
                records = [record for record, _ in corrected]
                fitted += [[at, variant, s, *np.round(f, 5)] for s, (_, f) in enumerate(corrected)]
            models = [identified(record, at) for record in records]
            for name, response in exact.responses.items():
                found = np.array([m[name].estimate for m in models])
                stated = np.array([m[name].std_error for m in models])
                inside = [
                    (m[name].lower <= response.estimate) & (response.estimate <= m[name].upper)
                    for m in models
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
                            for n, b, s, e in zip(
                                response.regressors, bias, rms, response.estimate, strict=True
                            )
                            if abs(b) > 2 * s and abs(b) > 0.1 * abs(e)
                        ),
                    }
                )
            show(at, variant, rows[-6:])
    print(
        "fitted delays of velocity, surfaces, rotors (0.035, 0.005, 0.045 s) and wind less the true one, rms"
    )
    for at in CONDITIONS:
        for variant in dict.fromkeys(f[1] for f in fitted):
            found = np.array([f[3:] for f in fitted if f[:2] == [at, variant]])
            true = np.array(
                [[0.035, 0.005, 0.045, *steady_wind(SCENARIO, "owner", s)[:2]] for s in range(SEEDS)]
            )
            off = np.sqrt(np.mean((found - true[:, : found.shape[1]]) ** 2, axis=0))
            print(f"{at:<5}{variant:<36}" + "".join(f"{v:9.4f}" for v in off))
            names = ("velocity_s", "surfaces_s", "rotors_s", "wind_north", "wind_east")
            for name, value in zip(names, off, strict=False):
                rows.append(
                    {"condition": at, "suite": variant, "response": f"rms error of {name}"}
                    | {"rms_normalised_error": f"{value:.4f}"}
                )
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0], restval="", lineterminator="\n")
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
