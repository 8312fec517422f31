"""What a flight buys at equal peaks: information of our designs over that of simplex-phased flat combs.

Run: python benchmarks/information.py
Prints a table and writes benchmarks/information.csv.

The aircraft is that of scenarios/la8.toml, trimmed and linearised by the simulation at reference u45, under
a linear-quadratic regulator (Q and R by Bryson's rule from the limits below). Every design excites the 18
effectors for two periods of 60 s; each signal is scaled to the half range, (max - min) / 2, of the
simplex-phased one of that effector. The figure is det(F)^(1/p) over that of the simplex-phased flat combs, by
response and over all parameters of all responses; F is the inverse of the covariance that
`freqid.design.forecast.standard_errors` expects of least squares with the regressors of the scenario and
research-quality noise. Those combs are interleaved, their phases Schroeder's improved by the Nelder-Mead
simplex (benchmarks/multisine.py). "inputs alone" is what rms^2 over peak^2 promises, for inputs without an
aircraft.
"""

from __future__ import annotations

import csv
import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from multisine import CEILING, COMBS, LINES, PROPULSORS, simplex_phases
from scipy.linalg import solve_continuous_are

import freqid as fq
from freqid.core.channels import WRENCH
from freqid.core.results.design import Multisine
from freqid.design.forecast.closed_loop import STATES, PerturbedAircraft
from freqid.design.forecast.modelled import perturbed_aircraft
from freqid.design.forecast.standard_errors import Forecast, forecast
from freqid.design.multisine.allocation import limits_from_db, search
from freqid.design.multisine.orthogonal_set import with_low_net_loads
from freqid.design.multisine.phases import lowest_peaks
from freqid.design.multisine.signals import relative_peak_factor
from freqid.simulate.control.linearize import linearize
from freqid.simulate.control.trim import trim
from freqid.simulate.motion import whole_vehicle as motion

SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "la8.toml"
# Deviations that cost the regulator alike: m/s, rad/s and rad in the order of STATES; rad and rad/s.
STATE_LIMITS = np.array([3.0, 2.0, 2.0, 0.6, 0.6, 0.6, 0.2, 0.2])
EFFECTOR_LIMITS = {"surface": 0.35, "rotor": 80.0}
NOISE = dict.fromkeys("uvw", 0.15) | dict.fromkeys("pqr", np.radians(0.1))
NOISE |= dict.fromkeys(("ax", "ay", "az"), 0.01 * 9.80665)
SURFACE_NOISE, ROTOR_NOISE = np.radians(0.05), 0.002  # rad; share of the speed


def regulated(scenario: fq.Scenario, reference: str = "u45") -> tuple[PerturbedAircraft, dict[str, float]]:
    """Return the aircraft in small motions under its regulator, and the trim of its effectors."""
    parameters = motion.parameters(scenario)
    at = trim(scenario, parameters, scenario.reference_of(reference))
    linear = linearize(scenario, parameters, at)
    kinds = scenario.aircraft().effector_kinds
    moving = [i for i, name in enumerate(linear.effectors) if kinds[name] in EFFECTOR_LIMITS]
    A, B = linear.A[:8, :8], linear.B[:8, moving]
    Q = np.diag(1 / STATE_LIMITS**2)
    R = np.diag([1 / EFFECTOR_LIMITS[kinds[linear.effectors[i]]] ** 2 for i in moving])
    gains = np.zeros((len(linear.effectors), len(STATES)))
    gains[moving] = -np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q, R))
    names = (*STATES[:6], *(linear.effectors[i] for i in moving))
    columns = [*range(6), *(6 + i for i in moving)]
    places = np.concatenate([at.positions.surface, at.positions.speed, at.positions.tilt])
    by_kind = [n for kind in ("surface", "rotor", "tilt") for n in linear.effectors if kinds[n] == kind]
    positions = dict(zip(by_kind, places.tolist(), strict=True))
    loop = perturbed_aircraft(
        {
            w: dict(zip(names, row[columns], strict=True))
            for w, row in zip(WRENCH, linear.wrench, strict=True)
        },
        scenario.aircraft(),
        u=float(at.body.velocity[0]),
        w=float(at.body.velocity[2]),
        theta=float(at.angles[1]),
        gains=gains,
        trim=positions,
    )
    return loop, positions


def design(scenario: fq.Scenario, sets, amplitudes, phases, rpf) -> fq.MultisineDesign:
    """Return signals, given at rms 1, whose half range is `rpf` sines of the scenario's amplitudes high."""
    excitation = scenario.excitation
    signals = []
    for e, index, amplitude, phase, factor in zip(
        (e for e in scenario.effector if e.name in excitation.amplitude),
        sets,
        amplitudes,
        phases,
        rpf,
        strict=True,
    ):
        scale = excitation.amplitude[e.name] * factor / relative_peak_factor(index, amplitude, phase)
        size = amplitude / np.sqrt(np.sum(amplitude**2)) * scale
        signals.append(Multisine(e.name, e.unit, index, size, phase))
    return fq.MultisineDesign(
        tuple(signals), excitation.period_s, excitation.periods, excitation.band_hz, excitation.dt_s, 0
    )


def main() -> None:
    scenario = fq.read_scenario(SCENARIO)
    loop, positions = regulated(scenario)
    kinds = scenario.aircraft().effector_kinds
    noise = {**NOISE}
    for name, kind in kinds.items():
        if kind in EFFECTOR_LIMITS:
            noise[name] = SURFACE_NOISE if kind == "surface" else ROTOR_NOISE * positions[name]

    rng = np.random.default_rng(0)
    flat = [np.full(s.size, np.sqrt(2 / s.size)) for s in COMBS]
    simplex = [simplex_phases(s, a, rng) for s, a in zip(COMBS, flat, strict=True)]
    rpf = [relative_peak_factor(*row) for row in zip(COMBS, flat, simplex, strict=True)]
    limits = limits_from_db(3.0)
    sets = {
        "interleaved combs, flat": (COMBS, None),
        "interleaved combs, power within 3 dB": (COMBS, limits),
        "joint search, propulsors below 1.2 Hz, flat": (search(LINES, PROPULSORS, CEILING), None),
        "joint search, propulsors below 1.2 Hz, power within 3 dB": (
            search(LINES, PROPULSORS, CEILING, limits=limits),
            limits,
        ),
    }
    designs = {"simplex-phased flat combs": design(scenario, COMBS, flat, simplex, rpf)}
    for name, (index, free) in sets.items():
        waves = lowest_peaks(index, limits=free)
        designs[name] = design(scenario, index, [w.amplitude for w in waves], [w.phase for w in waves], rpf)
    quiet = with_low_net_loads(designs[name], scenario.excitation, scenario.effector, loop).signals
    rows = zip(*((s.index, s.amplitude, s.phase) for s in quiet), strict=True)
    designs[f"{name}, net loads lowered"] = design(scenario, *rows, rpf)
    bought: dict[str, Forecast] = {
        name: forecast(made, loop, scenario.identification, noise) for name, made in designs.items()
    }
    base = bought["simplex-phased flat combs"]
    rows = []
    for name, found in bought.items():
        ratio = [found[r].det_figure / base[r].det_figure for r in WRENCH]
        ratio.append(found.det_figure / base.det_figure)
        rpfs = [float(relative_peak_factor(s.index, s.amplitude, s.phase)) for s in designs[name].signals]
        inputs = float(np.exp(2 * np.mean(np.log(rpf)) - 2 * np.mean(np.log(rpfs))))
        rows.append([name, *(f"{x:.3f}" for x in (*ratio, inputs))])
        print(
            f"{name:78s}"
            + "".join(f"{w:>4} {x:.3f}" for w, x in zip((*WRENCH, "all"), ratio, strict=True))
            + f"   inputs alone {inputs:.3f}"
        )
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["design", *WRENCH, "all", "inputs_alone"])
        writer.writerows(rows)


if __name__ == "__main__":
    main()
