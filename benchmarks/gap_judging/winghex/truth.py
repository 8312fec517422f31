"""The winged hexacopter that flies: rigid blades in edgewise flow, rolled-up wakes, Weissinger's wing."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import winghex_numbers as g  # noqa: E402
from hex_air import MASS, SCENARIO, Memory, loads  # noqa: E402, F401
from multisine import control_gains, multisines, trim_of  # noqa: E402

SIMULATION = HERE / "simulation.py"
EFFECTORS = tuple(e["name"] for e in SCENARIO["effector"])
SURFACES, ROTORS = g.SURFACES, g.ROTORS
INERTIA = tuple(SCENARIO["vehicle"]["inertia"][k] for k in ("xx", "yy", "zz", "xz"))
ROTOR_AXIS = np.array([r["axis"] for r in SCENARIO["rotor"]], dtype=float)
ROTOR_MOMENTUM = np.array([r["spin"] * r["inertia"] for r in SCENARIO["rotor"]])
SERVO, MOTOR_TAU, DELAY = g.SERVO, g.MOTOR_TAU, g.DELAY
SENSOR = np.array(g.SENSOR)
GAINS = control_gains(SCENARIO)
DESIGNS = (71, 72)  # seeds of phases: flown twice, and held out
TOLERANCES = g.SIGMAS
SLIPSTREAM = True  # more of the rotors' wakes than described
OUTSIDERS = {"boom_give": (1e-3, 3.0), "tip_jet": (1e-3, 3.0), "boom_vortex": (1e-3, 2.0)}


def excitation(time):
    """Return the excitation of every design, shape (design, effector, sample)."""
    return multisines(SCENARIO, DESIGNS, time)


TRIM = trim_of(SIMULATION, SCENARIO)
