"""The tandem tilt-wing that flies: strips that stall softly, in jets and in the front wing's wake."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import tiltwing_numbers as g  # noqa: E402
from multisine import control_gains, multisines, trim_of  # noqa: E402
from tilt_air import MASS, SCENARIO, Memory, loads  # noqa: E402, F401

SIMULATION = HERE / "simulation.py"
EFFECTORS = tuple(e["name"] for e in SCENARIO["effector"])
SURFACES, ROTORS = g.SURFACES, g.ROTORS
TILTS = ("tilt_f", "tilt_r")
TILTED = (0, 0, 1, 1)  # the tilt of each rotor
INERTIA = tuple(SCENARIO["vehicle"]["inertia"][k] for k in ("xx", "yy", "zz", "xz"))
ROTOR_AXIS = np.array([r["axis"] for r in SCENARIO["rotor"]], dtype=float)
ROTOR_MOMENTUM = np.array([r["spin"] * r["inertia"] for r in SCENARIO["rotor"]])
SERVO, MOTOR_TAU, DELAY = g.SERVO, g.MOTOR_TAU, g.DELAY
SENSOR = np.array(g.SENSOR)
GAINS = control_gains(SCENARIO)
DESIGNS = (61, 62)  # seeds of phases: flown twice, and held out
TOLERANCES = g.SIGMAS
SLIPSTREAM = True  # more of the jets than described
OUTSIDERS = {"tilt_give": (1e-3, 2.0), "jet_on_jet": (1e-3, 5.0), "body_vortex": (1e-3, 1.5)}


def excitation(time):
    """Return the excitation of every design, shape (design, effector, sample)."""
    return multisines(SCENARIO, DESIGNS, time)


TRIM = trim_of(SIMULATION, SCENARIO)
