"""Where a minute of multisines takes the vehicle: `python benchmarks/simulation_envelope.py`.

All reference conditions of scenarios/la8.toml, excited by one period of its multisines: in calm air with
and without feedback, in light turbulence (7.7 m/s at 20 ft) and in that with the mean wind of the owner
suite's day. A field of turbulence that stands still does not pass a vehicle that hovers, so that case is
left out. Writes benchmarks/simulation_envelope.csv: seconds flown, largest deviations from the trim, rad
and rad/s, and the largest of them over its limit in ``[excitation.abort]``; a flight without feedback ends
where it leaves `fly.LIMITS`.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import jax
import msgspec
import numpy as np

import freqid as fq
from freqid.core.results.design import SampledInputs
from freqid.core.scenario import Reference
from freqid.design.finish import finish
from freqid.design.multisine.orthogonal_set import design_multisines, sampled
from freqid.simulate.air import dryden as turbulence
from freqid.simulate.control.lq import close_loop
from freqid.simulate.fly import Flight, fly_batch, sortie
from freqid.simulate.maneuver import with_effects
from freqid.simulate.motion import attitude

HERE = Path(__file__).parent
LIGHT = 7.7  # m/s of wind at 20 ft
CASES = {
    "calm, feedback": {},
    "calm, no feedback": {"feedback": False},
    "light turbulence": {"gusts": LIGHT},
    "light turbulence, owner's wind": {"gusts": LIGHT, "day": "owner"},
}


def flights(
    scenario: fq.Scenario,
    inputs: SampledInputs,
    *,
    feedback: bool = True,
    gusts: float = 0.0,
    day: str = "research",
) -> Iterator[tuple[Reference, Flight]]:
    """Fly every reference condition, those of one density side by side."""
    scenario = with_effects(scenario, {"turbulence": gusts})
    for rho in sorted({at.rho for at in scenario.reference}, reverse=True):
        along = [at for at in scenario.reference if at.rho == rho]
        loop = close_loop(scenario, along[0])
        flown, sorties = [], []
        for seed, at in enumerate(along):
            wind = turbulence.steady_wind(scenario, day, seed)
            if gusts and max(at.u, float(np.linalg.norm(wind))) < turbulence.SLOWEST:
                continue
            flown.append(at)
            sorties.append(sortie(scenario, loop, at, inputs, wind=wind, feedback=feedback, seed=seed))
        yield from zip(flown, fly_batch(sorties), strict=True)


def excursions(flight: Flight) -> dict[str, float]:
    """Return the largest deviation of each channel from the start, rad and rad/s."""
    body = flight.samples.moving.body
    angles = np.asarray(jax.jit(attitude.euler)(body.attitude))[:, :2]
    moved = np.hstack([angles, body.rates])
    largest = np.abs(moved - moved[0]).max(axis=0)
    return dict(zip(("phi", "theta", "p", "q", "r"), largest.tolist(), strict=True))


def main() -> None:
    scenario = fq.read_scenario("la8")
    excitation = scenario.excitation
    assert excitation is not None
    once = msgspec.structs.replace(excitation, periods=1)
    searched = design_multisines(once, scenario.effector, seed=1)
    inputs = sampled(finish(searched, once, scenario.effector).design)
    rows = []
    for case, options in CASES.items():
        for at, flight in flights(scenario, inputs, **options):
            largest = excursions(flight)
            share = max(largest[name] / limit for name, limit in excitation.abort.items())
            seconds = flight.time[-1] if flight.time.size else 0.0
            ended = flight.divergence.channel if flight.divergence else ""
            figures = [f"{value:.4f}" for value in largest.values()]
            rows.append([case, at.id, f"{seconds:.2f}", ended, *figures, f"{share:.3f}"])
            print(*(f"{cell:>10s}" for cell in rows[-1][1:]), " ", case)
    head = ["case", "condition", "flown_s", "diverged_in", "phi", "theta", "p", "q", "r", "share_of_abort"]
    with open(HERE / "simulation_envelope.csv", "w", newline="") as file:
        csv.writer(file).writerows([head, *rows])


if __name__ == "__main__":
    main()
