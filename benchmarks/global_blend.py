"""What blending costs in accuracy: `OPENBLAS_NUM_THREADS=1 python benchmarks/global_blend.py`.

Point models of the LA-8 class simulation at the scenario's conditions, all six responses on 24 regressors,
are blended and asked for the wrench at conditions that were never identified, beside a model that is
identified there. Loads are evaluated on multisines of every state and effector about the trim, research
noise added; errors are against the noise-free wrench of another such manoeuvre. Then standard errors are
held against a Monte Carlo of the knots. Writes benchmarks/global_blend.csv.
"""

from __future__ import annotations

import csv
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np

import freqid as fq
from freqid.blend.line_up import line_up
from freqid.core.record import Channel
from freqid.core.results.corridor import Corridor, KnotResponse
from freqid.core.scenario import Reference
from freqid.core.sections.identification import Identification
from freqid.identify.point import identify_point
from freqid.simulate.control.trim import trim
from freqid.simulate.loads import airframe
from freqid.simulate.loads.quantities import Flow, Positions
from freqid.simulate.motion import multibody
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.motion.attitude import cross

import jax  # isort: skip  after the simulation, which sets it up
import jax.numpy as jnp  # isort: skip

HERE = Path(__file__).resolve().parent
SCENARIO = fq.read_scenario("la8")
VEHICLE, PARAMETERS = SCENARIO.aircraft(), motion.parameters(SCENARIO)
RESPONSES = ("X", "Y", "Z", "L", "M", "N")
SURFACES = [e.name for e in SCENARIO.effector if e.kind == "surface"]
ROTORS = [e.name for e in SCENARIO.effector if e.kind == "rotor"]
INPUTS = [*"uvwpqr", *SURFACES, *ROTORS]
MOVED = dict.fromkeys("uvw", 0.4) | dict.fromkeys("pqr", 0.1)  # rms, m/s and rad/s
MOVED |= dict.fromkeys(SURFACES, 0.045) | dict.fromkeys(ROTORS, 12.7)  # the scenario's amplitudes, rms
NOISE = np.array([2.8, 2.8, 2.8, 0.3, 0.5, 0.5])  # 0.01 g of 28.6 kg, N; N m
RATE, PERIOD = 25.0, 60.0
LINES = np.arange(3, 109)
SEA, BETWEEN, HIGH = 1.225, 1.14, 1.0581  # kg/m3: 0, 750 and 1500 m
SPEEDS = sorted({r.u for r in SCENARIO.reference})
SETTINGS = Identification(
    regressors=tuple(INPUTS),
    responses=RESPONSES,
    response_source="record",
    frequencies_hz=tuple(LINES / PERIOD),
)


@jax.jit
def _loads(velocity, rates, rho, surface, tilt, speed):
    def one(velocity, rates, rho, surface, tilt, speed):
        centre = multibody.traced_centre_of_gravity(PARAMETERS.mass, tilt)
        flow = Flow(velocity - cross(rates, centre), rates, rho, jnp.asarray(100.0))
        force, moment = airframe.wrench(
            PARAMETERS.airframe, flow, Positions(surface, tilt, jnp.zeros(2), speed)
        ).wrench
        return jnp.concatenate([force, moment - cross(centre, force)])

    return jax.vmap(one)(velocity, rates, rho, surface, tilt, speed)


def loads(inputs: dict[str, np.ndarray]) -> np.ndarray:
    """Return the simulation's X to N about the centre of gravity, shape (6, n)."""
    groups = (list("uvw"), list("pqr"), SURFACES, ["dw1", "dw2"], ROTORS)
    velocity, rates, surface, tilt, speed = (np.stack([inputs[n] for n in g], axis=-1) for g in groups)
    return np.asarray(_loads(velocity, rates, inputs["rho"], surface, tilt, speed)).T


@cache
def trimmed(u: float, rho: float) -> dict[str, float]:
    """Return the inputs of level flight, at the scenario's tilts, straight lines between its speeds."""
    known = sorted((r.u, r["dw1"]) for r in SCENARIO.reference if r.rho == SEA)
    speeds, tilts = zip(*known, strict=True)
    tilt = float(np.interp(u, speeds, tilts))
    at = trim(SCENARIO, PARAMETERS, Reference.of(id=f"{u:.4g}", u=u, rho=rho, dw1=tilt, dw2=tilt))
    values = np.concatenate([at.body.velocity, np.zeros(3), at.positions.surface, at.positions.speed])
    return dict(zip(INPUTS, values.tolist(), strict=True)) | {"dw1": tilt, "dw2": tilt, "rho": rho}


def moved(at: dict[str, float], seed: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return a manoeuvre: every input a multisine of its own lines."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(PERIOD * RATE) + 1) / RATE
    inputs = {n: np.full_like(time, at[n]) for n in ("dw1", "dw2", "rho")}
    for i, name in zip(rng.permutation(len(INPUTS)), INPUTS, strict=True):
        lines = LINES[i :: len(INPUTS)]
        phase = rng.uniform(0, 2 * np.pi, lines.size)
        signal = np.sin(2 * np.pi * lines[:, None] * time / PERIOD + phase[:, None]).sum(axis=0)
        inputs[name] = at[name] + MOVED[name] * signal / np.sqrt(lines.size / 2)
    return time, inputs


@cache
def point(u: float, rho: float, seed: int) -> fq.PointModel:
    """Identify a point model at a condition."""
    at = trimmed(u, rho)
    time, inputs = moved(at, seed)
    noise = NOISE[:, None] * np.random.default_rng([seed, 1]).standard_normal((6, time.size))
    channels = {}
    for name, values in [*inputs.items(), *zip(RESPONSES, loads(inputs) + noise, strict=True)]:
        group = "air" if name == "rho" else "response" if name in RESPONSES else "effector"
        group = "state" if name in "uvwpqr" else group
        unit = {"rho": "kg/m3", "state": "m/s" if name in "uvw" else "rad/s"}.get(
            name if name == "rho" else group
        )
        unit = unit or ("rad/s" if name in ROTORS else "rad")
        unit = ("N" if name in "XYZ" else "N m") if group == "response" else unit
        key = f"{group}/{name}"
        channels[key] = Channel(key, unit, values, RATE, "simulated")
    reference = Reference.of(id=f"u{u:.4g}", u=u, rho=rho, dw1=at["dw1"], dw2=at["dw2"])
    return identify_point(
        fq.Maneuver(fq.FlightRecord(time, channels), VEHICLE), SETTINGS, reference=reference
    )


def blended(conditions: list[tuple[float, float]]) -> fq.GlobalModel:
    points = [point(u, rho, seed) for seed, (u, rho) in enumerate(conditions)]
    return fq.GlobalModel(line_up(points, [p.reference.id for p in points]))


def errors(model: fq.GlobalModel, u: float, rho: float, seed: int) -> np.ndarray:
    """Return rms errors of the wrench, blended and identified there, shape (2, 6), means and all."""
    _, inputs = moved(trimmed(u, rho), seed)
    truth, there = loads(inputs), point(u, rho, seed + 1)
    x = np.array([inputs[n] for n in INPUTS])
    local = np.array([r.bias + r.estimate @ (x - r.trim[:, None]) for r in there.responses.values()])
    return np.array(
        [np.sqrt(np.mean((z - truth) ** 2, axis=1)) for z in (model.wrench(inputs).values, local)]
    )


def drawn(knots: KnotResponse, rng: np.random.Generator) -> KnotResponse:
    pairs = zip(knots.estimate.T, knots.covariance, strict=True)
    estimate = np.array([rng.multivariate_normal(*pair, method="cholesky") for pair in pairs]).T
    return replace(knots, estimate=estimate, bias=rng.normal(knots.bias, knots.bias_std_error))


def error_ratios(corridor: Corridor, draws: int = 400) -> dict[str, np.ndarray]:
    """Return stated over empirical standard errors, of parameters along the corridor and of the wrench."""
    rng, model = np.random.default_rng(0), fq.GlobalModel(corridor)
    middle = (corridor.u[1:] + corridor.u[:-1]) / 2
    at = model.reference(middle, SEA)
    mean_square, scatter, wrench = [], [], []
    for _ in range(draws):
        responses = {name: drawn(knots, rng) for name, knots in corridor.responses.items()}
        again = fq.GlobalModel(replace(corridor, responses=responses))
        found = [again.parameters(r, at) for r in RESPONSES]
        scatter.append([f.estimate for f in found])
        mean_square.append([f.std_error for f in found])
        wrench.append(again.wrench(at).values)
    empirical = np.std(scatter, axis=0, ddof=1)
    stated = np.sqrt(np.mean(np.square(mean_square), axis=0))
    one_flight = np.array([model.parameters(r, at).std_error for r in RESPONSES])
    return {
        "parameters, over flights": (stated / empirical).ravel(),
        "parameters, one flight": (one_flight / empirical).ravel(),
        "wrench at the trim": (model.wrench(at).std_error / np.std(wrench, axis=0, ddof=1)).ravel(),
    }


def main() -> None:
    halfway = [(a + b) / 2 for a, b in pairwise(SPEEDS)]
    finer = sorted([*SPEEDS, *halfway])
    quarters = [(a + b) / 2 for a, b in pairwise(finer)]
    sea, both = ([(u, rho) for rho in densities for u in SPEEDS] for densities in ((SEA,), (SEA, HIGH)))
    few, many, both_densities = f"{len(SPEEDS)} points", f"{len(finer)} points", f"2 x {len(SPEEDS)} points"
    models = {
        few: blended(sea),
        many: blended([(u, SEA) for u in finer]),
        both_densities: blended(both),
    }
    cases = [
        ("between the points", few, halfway, SEA),
        ("between the points", many, quarters, SEA),
        ("750 m, at the points' speeds", both_densities, SPEEDS, BETWEEN),
        ("750 m, between the points' speeds", both_densities, halfway, BETWEEN),
        ("750 m, at the points' speeds", few, SPEEDS, BETWEEN),
        ("1500 m, at the points' speeds", few, SPEEDS, HIGH),
    ]
    rows = []
    print("rms wrench error, blended over identified there: median and (worst) over conditions")
    print(f"{'where':<36}{'points':<15}" + "".join(f"{r:>14}" for r in RESPONSES))
    for where, points, speeds, rho in cases:
        found = np.array([errors(models[points], u, rho, 100 + i) for i, u in enumerate(speeds)])
        ratio = found[:, 0] / found[:, 1]
        summary = zip(np.median(ratio, axis=0), ratio.max(axis=0), strict=True)
        print(f"{where:<36}{points:<15}" + "".join(f"{m:7.2f} ({w:4.1f})" for m, w in summary))
        for u, (ours, theirs) in zip(speeds, found, strict=True):
            for r, a, b in zip(RESPONSES, ours, theirs, strict=True):
                rows.append([where, points, f"{u:.4g}", r, f"{a:.4g}", f"{b:.4g}", f"{a / b:.3f}"])
    print("stated over empirical standard error of 400 draws: 2.5, 50 and 97.5 %, rms")
    for what, ratio in error_ratios(models[few].corridor).items():
        low, mid, high = np.percentile(ratio, [2.5, 50, 97.5])
        print(f"{what:<30}{low:8.3f}{mid:8.3f}{high:8.3f}{np.sqrt(np.mean(ratio**2)):8.3f}")
        rows.append([what, few, "", "all", f"{low:.3f}", f"{high:.3f}", f"{mid:.3f}"])
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["what", "points", "u", "response", "blended_or_low", "there_or_high", "ratio"])
        writer.writerows(rows)


if __name__ == "__main__":
    main()
