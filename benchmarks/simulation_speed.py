"""Flight simulation on one core, beside JSBSim: `python benchmarks/simulation_speed.py`.

The vehicle of scenarios/la8.toml with all its memory: rigid body, 12 servos, 8 motors, battery, delays
and wake; Runge-Kutta steps of 5 ms, a record at 100 Hz. JSBSim flies its c172p with its own integrators
(one evaluation a step, where Runge-Kutta has four). Steps are counted per second of processor time, so
that other work on the machine disturbs little. Writes benchmarks/simulation_speed.csv.
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # one core, also for the libraries' threads

HERE = Path(__file__).parent
DT, STEPS, BATCH, REPEATS = 0.005, 2000, 64, 5


def best(work: Callable[[], object]) -> float:
    """Return the least processor time of several runs, s."""
    times = []
    for _ in range(REPEATS):
        before = time.process_time()
        work()
        times.append(time.process_time() - before)
    return min(times)


def flight():
    """Return the flight function and its inputs, from reading the scenario on."""
    import jax
    import jax.numpy as jnp
    import numpy as np

    from freqid.core.scenario import read_scenario
    from freqid.simulate import attitude, motion
    from freqid.simulate.integrate import integrate
    from freqid.simulate.quantities import Positions
    from freqid.simulate.rigid_body import BodyState
    from freqid.simulate.surroundings import calm

    parameters = motion.parameters(read_scenario(HERE.parent / "scenarios" / "la8.toml")[0])
    around = calm(1.2, ground=40.0)
    body = BodyState(
        jnp.array([0.0, 0.0, -100.0]),
        attitude.from_euler(0, 0.05, 0),
        jnp.array([14.0, 0.0, 0.7]),
        jnp.zeros(3),
    )
    positions = Positions(jnp.zeros(10), jnp.full(2, 0.3), jnp.zeros(2), jnp.full(8, 450.0))
    state = jax.jit(partial(motion.start, dt=DT))(parameters, body, positions, around)
    waves = 0.02 * np.sin(np.arange(STEPS)[:, None] * DT * np.arange(1, 11))
    commands = jax.tree.map(lambda line: jnp.repeat(line[:1], STEPS, axis=0), state.commands)
    commands = commands._replace(surface=jnp.asarray(waves))

    def fly(parameters, state, commands):
        step = lambda s, c: motion.step(parameters, s, c, around, DT)  # noqa: E731
        return integrate(step, state, commands, observe=lambda s, _: s.moving, every=2)[0]

    return fly, (parameters, state, commands)


def first_call() -> float:
    """Return the wall time of a fresh process from its start to the end of its first flight, s."""
    code = "import benchmark; import jax; f, x = benchmark.flight(); jax.block_until_ready(jax.jit(f)(*x))"
    code = code.replace("benchmark", Path(__file__).stem)
    before = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], cwd=HERE, check=True)
    return time.perf_counter() - before


def jsbsim_steps() -> float:
    """Return JSBSim's steps a second with its c172p."""
    import jsbsim

    fdm = jsbsim.FGFDMExec(None)
    fdm.set_debug_level(0)
    fdm.load_model("c172p")
    fdm.set_dt(DT)
    fdm["ic/h-sl-ft"], fdm["ic/vc-kts"] = 3000, 90
    fdm.run_ic()
    return STEPS / best(lambda: [fdm.run() for _ in range(STEPS)])


def main() -> None:
    import jax
    import numpy as np

    fly, (parameters, state, commands) = flight()
    single = jax.jit(fly)
    flown = jax.block_until_ready(single(parameters, state, commands))
    assert all(np.all(np.isfinite(x)) for x in jax.tree.leaves(flown))
    one = STEPS / best(lambda: jax.block_until_ready(single(parameters, state, commands)))
    batch = jax.jit(jax.vmap(fly, (None, 0, None)))
    states = jax.tree.map(lambda x: np.repeat(np.asarray(x)[None], BATCH, axis=0), state)
    jax.block_until_ready(batch(parameters, states, commands))
    many = BATCH * STEPS / best(lambda: jax.block_until_ready(batch(parameters, states, commands)))
    theirs = jsbsim_steps()
    first_call()  # fills the cache of compiled code
    fresh = min(first_call() for _ in range(2))
    rows = [
        ("freqid, one flight", f"{one:.0f} steps/s", f"{one / theirs:.2f}"),
        (f"freqid, batch of {BATCH}", f"{many:.0f} steps/s", f"{many / theirs:.2f}"),
        ("JSBSim c172p", f"{theirs:.0f} steps/s", "1.00"),
        ("fresh process to the end of its first flight, cache warm", f"{fresh:.1f} s (wall)", ""),
    ]
    for row in rows:
        print(f"{row[0]:58s} {row[1]:>16s} {row[2]:>6s}")
    with open(HERE / "simulation_speed.csv", "w", newline="") as file:
        csv.writer(file).writerows([("case", "found", "over JSBSim"), *rows])


if __name__ == "__main__":
    main()
