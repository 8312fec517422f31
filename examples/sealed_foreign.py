"""Is the diagnosis right about a simulation of your own? A sealed trial of ``foreign_simulation.py``.

``python examples/sealed_foreign.py FOLDER [SEED]`` draws one of three effects by the seed, flies the airplane
with it, writes into FOLDER/seal.h5 what it was, diagnoses the flights, and only then opens the seal.
"""

import hashlib
import sys
from pathlib import Path

import foreign_simulation as airplane
import numpy as np

import freqid as fq
from freqid.core.results.judged.sealed_trial import SealedEffect

SIMULATION = f"{Path(airplane.__file__)}:wrench"
DRAWN = {  # effect: its parameter and unit, and the least and the largest change that is flown
    "actuator_delay": ("elevator", "s", 0.04, 0.09),
    "surface_effectiveness": ("elevator", "1", 0.25, 0.45),
    "extra_drag": ("coefficient", "1", 0.03, 0.06),
}
nominal = airplane.wrench


def worn(effect, size):
    """Return the loads of the airplane with an effect; one in its servo changes no loads."""

    def loads(time, state, effector, air, parameters):
        felt = dict(effector)
        if effect == "surface_effectiveness":
            felt["elevator"] = (1 - size) * effector["elevator"]
        found = nominal(time, state, felt, air, parameters)
        if effect == "extra_drag":
            speed = np.hypot(state["u"], state["w"])
            drag = 0.5 * airplane.RHO * airplane.AREA * size * speed
            found |= {"X": found["X"] - drag * state["u"], "Z": found["Z"] - drag * state["w"]}
        return found

    return loads


def trial(folder, seed):
    """Fly, seal, diagnose, open; return the outcome and its page."""
    rng = np.random.default_rng([seed, 1])
    effect = str(rng.choice(sorted(DRAWN)))
    parameter, unit, least, largest = DRAWN[effect]
    size = float(rng.uniform(least, largest))
    airplane.wrench = worn(effect, size)
    airplane.write_flights(folder, effect=size if effect == "actuator_delay" else 0.0, seed=seed)
    flights = sorted(folder.glob("flight?.h5"))
    hashes = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in flights}
    fq.save(SealedEffect("", seed, effect, parameter, unit, 0.0, size, hashes).seal(), folder / "seal.h5")

    gap = fq.diagnose_gap(SIMULATION, flights[:2], held_out=flights[2])
    outcome = fq.open_seal(folder / "seal.h5", gap)
    files = [fq.save(gap, folder / "gap.h5"), fq.save(outcome, folder / "trial.h5")]
    return outcome, fq.page(files).save(folder / "trial.html")


if __name__ == "__main__":
    Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
    outcome, page = trial(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0)
    sys.stdout.write(f"{outcome.sentence}\n{page}\n")
