"""The air taxi that flies: large slow rotors with lagging inflow, oblique jets on a wing of vortex steps."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import airtaxi_numbers as g  # noqa: E402
from multisine import control_gains, multisines, trim_of  # noqa: E402
from taxi_air import MASS, SCENARIO, Memory, loads  # noqa: E402, F401

SIMULATION = HERE / "simulation.py"
EFFECTORS = tuple(e["name"] for e in SCENARIO["effector"])
SURFACES, ROTORS = g.SURFACES, g.ROTORS
INERTIA = tuple(SCENARIO["vehicle"]["inertia"][k] for k in ("xx", "yy", "zz", "xz"))
ROTOR_AXIS = np.array([r["axis"] for r in SCENARIO["rotor"]], dtype=float)
ROTOR_MOMENTUM = np.array([r["spin"] * r["inertia"] for r in SCENARIO["rotor"]])
SERVO, MOTOR_TAU, DELAY = g.SERVO, g.MOTOR_TAU, g.DELAY
SENSOR = np.array(g.SENSOR)
GAINS = control_gains(SCENARIO)
DESIGNS = (91, 92)  # seeds of phases: flown twice, and held out
TOLERANCES = g.SIGMAS
SLIPSTREAM = True  # more of the jets than described
OUTSIDERS = {"payload_sway": (1e-3, 5.0), "blade_stall": (1e-3, 3.0), "jet_at_tail": (1e-3, 3.0)}


def excitation(time):
    """Return the excitation of every design, shape (design, effector, sample)."""
    return multisines(SCENARIO, DESIGNS, time)


TRIM = trim_of(SIMULATION, SCENARIO)
