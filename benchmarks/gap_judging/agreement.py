"""Say how far the owner's simulation is from the truth without scatter: `python agreement.py quadplane`.

For each load, root mean square of the difference over that of the load itself, on the lines above zero
frequency, at each condition, on noise-free motion.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
import sensing
from motion import fly
from multisine import load_module
from settings import Settings
from stack import LOADS, lines, stack

HERE = Path(__file__).resolve().parent


def main() -> None:
    for vehicle in sys.argv[1:]:
        truth = load_module(HERE / vehicle / "truth.py")
        simulation = load_module(truth.SIMULATION)
        conditions = list(truth.TRIM)
        flights = [{"condition": c, "design": 0} for c in conditions]
        log = fly(truth, flights, Settings([{}] * len(flights)))
        for k, condition in enumerate(conditions):
            rho = truth.TRIM[condition]["rho"]
            channels = sensing.measure(truth, log, k, {}, None)
            state = {key[6:]: values for key, values in channels.items() if key.startswith("state/")}
            effector = {e: channels[f"effector/{e}"] for e in truth.EFFECTORS}
            said = simulation.wrench(None, state, effector, {"rho": np.full(state["u"].size, rho)}, {})
            whole = lines(np.array([said[load] for load in LOADS]))[:, 1:]
            off = stack(truth, simulation, channels, rho)[: len(LOADS), 1:]
            share = np.linalg.norm(off, axis=1) / np.linalg.norm(whole, axis=1)
            said = " ".join(f"{n} {100 * x:.2f} %" for n, x in zip(LOADS, share, strict=True))
            print(vehicle, condition, said)


if __name__ == "__main__":
    main()
