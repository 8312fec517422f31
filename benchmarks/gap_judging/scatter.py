"""What every flight, nulls included, draws within the stated tolerances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

CHANNELS = {
    "time_skew": ("velocity", "rates", "accelerometers", "attitude", "effectors"),
    "sensor_scale": ("ax", "ay", "az", "p", "q", "r", "theta", "u", "v", "w", "surface", "rotor"),
    "misalignment": ("imu_x", "imu_y", "imu_z", "velocity_x", "velocity_y", "velocity_z"),
    "lever_arm": ("x", "y", "z"),
    "flow_upwash": ("alpha", "beta"),
    "actuator_delay": ("extra",),
    "mass": ("fraction",),
}


def of_actuators(surfaces: Sequence[str], rotors: Sequence[str]) -> dict[str, float]:
    """Return one sigma, as shares, of what owners know no better of surfaces, servos, rotors, motors."""
    return (
        {f"{e}.effectiveness": 0.03 for e in surfaces}
        | {f"{r}.{end}": 0.03 for r in rotors for end in ("thrust", "torque")}
        | {f"{e}.natural_frequency": 0.05 for e in surfaces}
        | {f"{e}.damping": 0.05 for e in surfaces}
        | {f"{e}.gain": 0.01 for e in surfaces}
        | {f"{r}.time_constant": 0.05 for r in rotors}
    )


def per_case(aircraft: Any) -> dict[str, float]:
    """Return one sigma of what is drawn once for all flights of a case, by departure."""
    stated = aircraft.SCENARIO["tolerance"]
    out = dict(aircraft.TOLERANCES)
    for name, sigma in stated.items():
        if name in CHANNELS:
            out |= {f"{name}.{end}": sigma for end in CHANNELS[name]}
        elif not name.startswith("sensor_bias."):
            out[name] = sigma
    return out


def per_flight(aircraft: Any) -> dict[str, float]:
    """Return one sigma of the sensors' biases, drawn for every flight; each surface and rotor has its own."""
    out = {}
    for name, sigma in aircraft.SCENARIO["tolerance"].items():
        if name == "sensor_bias.surface":
            out |= {f"{name}@{e}": sigma for e in aircraft.SURFACES}
        elif name == "sensor_bias.rotor":
            out |= {f"{name}@{e}": sigma for e in aircraft.ROTORS}
        elif name == "sensor_bias.tilt":
            out |= {f"{name}@{e}": sigma for e in aircraft.TILTS}
        elif name.startswith("sensor_bias."):
            out[name] = sigma
    return out


MASS = ("mass", "cg_offset", "inertia")
WITHIN = 2.0  # sigmas of mass properties that are still scatter; from three on they are an effect


KINDS = ("own", "actuators", "mass", "sensors", "biases")
"""What is drawn: the simulation's own parameters, actuators', mass properties, sensors' errors of a case, and
the biases of each flight."""


def kind_of(name: str) -> str:
    """Return which of `KINDS` a departure is of."""
    effect = name.partition(".")[0]
    if effect in MASS:
        return "mass"
    if effect == "sensor_bias":
        return "biases"
    if effect in CHANNELS and effect != "actuator_delay":
        return "sensors"
    late = ("natural_frequency", "damping", "gain", "time_constant")
    return "actuators" if effect == "actuator_delay" or name.endswith(late) else "own"


def draw(sigmas: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    """Return one normal draw of each departure; mass properties within two sigmas."""
    out = {}
    for name, sigma in sigmas.items():
        value = float(rng.standard_normal())
        while name.partition(".")[0] in MASS and abs(value) > WITHIN:
            value = float(rng.standard_normal())
        out[name] = sigma * value
    return out


def added(*parts: dict[str, float]) -> dict[str, float]:
    """Return departures that act together."""
    out: dict[str, float] = {}
    for part in parts:
        for name, value in part.items():
            out[name] = out.get(name, 0.0) + value
    return out
