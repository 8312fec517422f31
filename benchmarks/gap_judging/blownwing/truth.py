"""The blown wing that flies: a lifting line in the jets of eight propellers."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import blownwing_numbers as g  # noqa: E402
from blown_air import MASS, SCENARIO, Memory, loads  # noqa: E402, F401
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
DESIGNS = (51, 52)  # seeds of phases: flown twice, and held out
TOLERANCES = g.SIGMAS
SLIPSTREAM = True  # more of the jets than described
ABSENT = ("downwash_lag",)  # there is no tail behind the wing
OUTSIDERS = {
    "bending_mode": (1e-3, 3.0),
    "loose_battery": (1e-3, 0.6),
    "neighbour_jet": (1e-3, 3.0),
    "flap_bubble": (1e-3, 2.0),
    "rudder_wash": (1e-3, 3.0),
    "pod_vortex": (1e-3, 2.0),
    "phase_lock": (1e-3, 3.0),
}


def excitation(time):
    """Return the excitation of every design, shape (design, effector, sample)."""
    return multisines(SCENARIO, DESIGNS, time)


TRIM = trim_of(SIMULATION, SCENARIO)
