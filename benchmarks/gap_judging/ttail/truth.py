"""The T-tail that flies: a Fourier series along the wing, separation, tip loss, a tail in a late wake."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import ttail_numbers as g  # noqa: E402
from multisine import control_gains, multisines, trim_of  # noqa: E402
from ttail_air import MASS, SCENARIO, Memory, loads  # noqa: E402, F401

SIMULATION = HERE / "simulation.py"
EFFECTORS = tuple(e["name"] for e in SCENARIO["effector"])
SURFACES, ROTORS = g.SURFACES, g.ROTORS
INERTIA = tuple(SCENARIO["vehicle"]["inertia"][k] for k in ("xx", "yy", "zz", "xz"))
ROTOR_AXIS = np.array([r["axis"] for r in SCENARIO["rotor"]], dtype=float)
ROTOR_MOMENTUM = np.array([r["spin"] * r["inertia"] for r in SCENARIO["rotor"]])
SERVO, MOTOR_TAU, DELAY = g.SERVO, g.MOTOR_TAU, g.DELAY
SENSOR = np.array(g.SENSOR)
GAINS = control_gains(SCENARIO)
DESIGNS = (81, 82)  # seeds of phases: flown twice, and held out
TOLERANCES = g.SIGMAS
SLIPSTREAM = True  # more of the jets than described
OUTSIDERS = {
    "aileron_float": (1e-3, 3.0),
    "wing_bend": (1e-3, 3.0),
    "jet_rise": (1e-3, 3.0),
    "nacelle_vortex": (1e-3, 3.0),
    "tee_leak": (1e-3, 3.0),
    "deep_wake": (1e-3, 3.0),
    "flap_twist": (1e-3, 3.0),
    "late_sidewash": (1e-3, 3.0),
}


def excitation(time):
    """Return the excitation of every design, shape (design, effector, sample)."""
    return multisines(SCENARIO, DESIGNS, time)


TRIM = trim_of(SIMULATION, SCENARIO)
