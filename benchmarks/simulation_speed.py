"""Flight simulation on one core, beside JSBSim: `python benchmarks/simulation_speed.py`.

The vehicle of scenarios/la8.toml with all its memory: rigid body, 12 servos, 8 motors, battery, delays
and wake, under its control law and excited on 18 effectors; Runge-Kutta steps of 5 ms, everything kept at
100 Hz, from `fly.fly` and `fly.fly_batch` as they are called. JSBSim flies its c172p with its own
integrators (one evaluation a step, where Runge-Kutta has four). Times are processor times, so that other
work on the machine disturbs little; of fresh processes, with the cache of compiled code filled. Writes
benchmarks/simulation_speed.csv.
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # one core, also for the libraries' threads

HERE = Path(__file__).parent
SCENARIO = HERE.parent / "scenarios" / "la8.toml"
DURATION, BATCH, REPEATS = 9.9, 64, 5  # s: two legs
STEPS = 2000  # of JSBSim


def best(work: Callable[[], object]) -> float:
    """Return the least processor time of several runs, s."""
    times = []
    for _ in range(REPEATS):
        before = time.process_time()
        work()
        times.append(time.process_time() - before)
    return min(times)


def closed_loop():
    """Return what `fly` needs: the excited vehicle at u45 under its control law, from reading on."""
    import numpy as np

    import freqid as fq
    from freqid.core.results.design import SampledInputs
    from freqid.simulate.control.lq import close_loop
    from freqid.simulate.fly import sortie

    scenario = fq.read_scenario(SCENARIO)
    reference = scenario.reference_of("u45")
    time = 0.02 * np.arange(round(DURATION / 0.02) + 1, dtype=float)
    excited = [e for e in scenario.effector if e.kind != "tilt"]
    sizes = np.array([18.0 if e.kind == "rotor" else 0.06 for e in excited])  # as in the scenario
    waves = sizes[:, None] * np.sin(2 * np.pi * 0.1 * np.arange(1, len(excited) + 1)[:, None] * time)
    names, units = zip(*((e.name, e.unit) for e in excited), strict=True)
    inputs = SampledInputs(names, units, time, waves)
    return sortie(scenario, close_loop(scenario, reference), reference, inputs, duration=DURATION)


def fresh(code: str) -> tuple[float, float]:
    """Return processor and wall time of a fresh process that runs some code, the least of three, s."""
    times = []
    for _ in range(1 + 3):  # the first one fills the cache of compiled code
        before, used = time.perf_counter(), os.times()
        subprocess.run([sys.executable, "-c", code], cwd=HERE, check=True, stdout=subprocess.DEVNULL)
        now = os.times()
        processor = now.children_user + now.children_system - used.children_user - used.children_system
        times.append((processor, time.perf_counter() - before))
    return min(times[1:])


def jsbsim_steps() -> float:
    """Return JSBSim's steps a second with its c172p."""
    import jsbsim

    fdm = jsbsim.FGFDMExec(None)
    fdm.set_debug_level(0)
    fdm.load_model("c172p")
    fdm.set_dt(0.005)
    fdm["ic/h-sl-ft"], fdm["ic/vc-kts"] = 3000, 90
    fdm.run_ic()
    return STEPS / best(lambda: [fdm.run() for _ in range(STEPS)])


def main() -> None:
    from freqid.simulate.fly import DT, fly, fly_batch

    plan = closed_loop()
    flight = fly(plan)  # compiles
    assert flight.divergence is None
    one = DURATION / DT / best(lambda: fly(plan))
    batch = [plan] * BATCH
    assert all(flight.divergence is None for flight in fly_batch(batch))
    many = BATCH * DURATION / DT / best(lambda: fly_batch(batch))
    theirs = jsbsim_steps()
    bare = fresh(
        f"import {Path(__file__).stem} as b; from freqid.simulate.fly import fly; fly(b.closed_loop())"
    )
    with tempfile.TemporaryDirectory() as folder:
        command = ["simulate", str(SCENARIO), "--at", "u45", "--duration", "60", "-o", f"{folder}/r.h5"]
        whole = fresh(f"from freqid.cli.main import run; run({command})")
    rows = [
        ("freqid, one flight in closed loop", f"{one:.0f} steps/s", f"{one / theirs:.2f}"),
        (f"freqid, batch of {BATCH} in closed loop", f"{many:.0f} steps/s", f"{many / theirs:.2f}"),
        ("JSBSim c172p", f"{theirs:.0f} steps/s", "1.00"),
        ("fresh process: trim, control law and first flight", f"{bare[0]:.1f} s ({bare[1]:.1f} s wall)", ""),
        ("fresh process: freqid simulate, 60 s", f"{whole[0]:.1f} s ({whole[1]:.1f} s wall)", ""),
    ]
    for row in rows:
        print(f"{row[0]:52s} {row[1]:>22s} {row[2]:>6s}")
    with open(HERE / "simulation_speed.csv", "w", newline="") as file:
        csv.writer(file).writerows([("case", "found", "over JSBSim"), *rows])


if __name__ == "__main__":
    main()
