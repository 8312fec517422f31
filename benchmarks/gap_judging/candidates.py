"""The effects that the truth can have: parameter, place, physical range and possible signs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Candidate:
    """One effect at one place.

    Attributes
    ----------
    id, parameter : str
        As in docs/effects.md; outsiders have the id ``outsider``.
    place : str or None
        Effector, where the effect has one.
    low, high : float
        Range of sizes that are searched, of which the upper end is the physical bound.
    signed : bool
        Whether the opposite sign is physical too.
    """

    id: str
    parameter: str
    low: float
    high: float
    place: str | None = None
    signed: bool = False

    @property
    def sign(self) -> float:
        """Sign of the effect in this set: of those that can have both, half are negative."""
        return -1.0 if self.signed and sum(map(ord, self.key)) % 2 else 1.0

    @property
    def key(self) -> str:
        """Name of the departure that the truth understands."""
        if self.place and self.id == "sensor_bias":
            return f"{self.id}.{self.parameter}@{self.place}"
        return f"{self.id}.{self.parameter}" + (f"@{self.place}" if self.place else "")

    @property
    def label(self) -> str:
        """Name in tables."""
        return self.key

    def described(self, size: float) -> dict[str, float]:
        """Return parameters as docs/effects.md names them."""
        by_name = {"actuator_delay", "surface_effectiveness", "weak_rotor"}
        return {self.place if self.place and self.id in by_name else self.parameter: size}


def candidates(aircraft: Any) -> list[Candidate]:
    """Return all effects of a vehicle, without outsiders and without those that it cannot have, `ABSENT`."""
    surfaces, rotors = aircraft.SURFACES, aircraft.ROTORS
    out = [Candidate("actuator_delay", "extra", 1e-3, 0.15)]
    out += [Candidate("actuator_delay", "extra", 1e-3, 0.25, e) for e in surfaces]
    out += [Candidate("actuator_lag", "extra", 1e-3, 0.4, e) for e in surfaces]
    out += [Candidate("rate_limit", "slowness", 0.3, 40.0)]
    out += [Candidate("rate_limit", "slowness", 0.3, 60.0, e) for e in surfaces]
    out += [Candidate("backlash", "width", 1e-3, 0.12, e) for e in surfaces]
    out += [Candidate("surface_effectiveness", "loss", 2e-3, 0.7)]
    out += [Candidate("surface_effectiveness", "loss", 2e-3, 0.8, e) for e in surfaces]
    out += [Candidate("weak_rotor", "loss", 2e-3, 0.5)]
    if len(rotors) > 1:
        out += [Candidate("weak_rotor", "loss", 2e-3, 0.7, e) for e in rotors]
        out += [Candidate("actuator_delay", "extra", 1e-3, 0.25, e) for e in rotors[-2:]]
    if hasattr(aircraft, "SLIPSTREAM"):
        out += [Candidate("slipstream", "strength", 0.01, 3.0)]
    out += [
        Candidate("rotor_inplane_force", "strength", 0.01, 5.0),
        Candidate("battery_sag", "strength", 0.01, 4.0),
        Candidate("motor_lag", "extra", 1e-3, 0.5),
        Candidate("gyroscopic", "strength", 0.02, 3.0, signed=False),
        Candidate("downwash_lag", "strength", 0.02, 3.0),
        Candidate("stall", "strength", 0.01, 1.0),
        Candidate("unsteady_lift", "time_constant", 2e-3, 0.6),
        Candidate("extra_drag", "coefficient", 5e-4, 0.2),
        Candidate("mass", "fraction", 0.002, 0.4, signed=True),
        Candidate("cg_offset", "x", 1e-3, 0.10, signed=True),
        Candidate("cg_offset", "y", 3e-4, 0.08, signed=True),
        Candidate("cg_offset", "z", 1e-3, 0.12, signed=True),
        Candidate("inertia", "xx", 0.005, 1.0, signed=True),
        Candidate("inertia", "yy", 0.005, 1.0, signed=True),
        Candidate("inertia", "zz", 0.005, 1.0, signed=True),
        Candidate("inertia", "xz", 0.003, 0.4, signed=True),
        Candidate("flexible_mode", "strength", 0.01, 2.0),
        Candidate("lever_arm", "x", 2e-3, 0.8, signed=True),
        Candidate("lever_arm", "y", 2e-3, 0.8, signed=True),
        Candidate("lever_arm", "z", 2e-3, 0.8, signed=True),
        Candidate("flow_upwash", "alpha", 5e-3, 0.7, signed=True),
        Candidate("flow_upwash", "beta", 5e-3, 0.7, signed=True),
        Candidate("steady_wind", "north", 0.02, 8.0, signed=True),
        Candidate("steady_wind", "east", 0.02, 8.0, signed=True),
        Candidate("steady_wind", "down", 0.02, 3.0, signed=True),
    ]
    out += [
        Candidate("misalignment", f"{t}_{end}", 1e-3, 0.3, signed=True)
        for t in ("imu", "velocity")
        for end in "xyz"
    ]
    out += [
        Candidate("time_skew", g, 5e-4, 0.15)
        for g in ("velocity", "rates", "accelerometers", "attitude", "effectors")
    ]
    out += [
        Candidate("sensor_scale", c, 1e-3, 0.4, signed=True)
        for c in ("ax", "ay", "az", "p", "q", "r", "theta", "u", "v", "w", "surface", "rotor")
    ]
    bias = {"ax": 1.0, "ay": 1.0, "az": 1.5, "p": 0.1, "q": 0.1, "r": 0.1, "phi": 0.1, "theta": 0.1}
    bias |= {"u": 3.0, "v": 2.0, "w": 2.0, "surface": 0.08, "rotor": 20.0}
    if hasattr(aircraft, "TILTS"):
        bias["tilt"] = 0.2
        out += [Candidate("wing_wake", "strength", 0.01, 3.0)]
    out += [Candidate("sensor_bias", c, top / 500, top, signed=True) for c, top in bias.items()]
    return [c for c in out if c.id not in getattr(aircraft, "ABSENT", ())]


def stated(aircraft: Any, c: Candidate) -> dict[str, float]:
    """Return the tolerances that the owner states for the same thing: departure by a unit of size.

    They have the effect's own key, or another name where the owner's parameter has one: a rotor's thrust is
    stated, not its weakness.
    """
    surfaces = [c.place] if c.place else list(aircraft.SURFACES)
    rotors = [c.place] if c.place else list(aircraft.ROTORS)
    if c.id == "surface_effectiveness":
        return {f"{e}.effectiveness": -1.0 for e in surfaces}
    if c.id == "weak_rotor":
        return {f"{e}.thrust": -1.0 for e in rotors}
    if c.id == "motor_lag":
        return {f"{e}.time_constant": 1.0 / aircraft.MOTOR_TAU for e in rotors}
    if c.id == "slipstream":
        return {"jets.strength": 1.0}  # where the owner has jets
    if c.key == "sensor_bias.surface":
        return {f"{c.key}@{e}": 1.0 for e in surfaces}
    if c.key == "sensor_bias.rotor":
        return {f"{c.key}@{e}": 1.0 for e in rotors}
    if c.key == "sensor_bias.tilt":
        return {f"{c.key}@{e}": 1.0 for e in aircraft.TILTS}
    if c.id == "wing_wake":
        return {"rear.downwash": 1.0}
    if c.id == "rotor_inplane_force":
        return {"props.inplane": 1.0}  # where the owner has it
    return {c.key.partition("@")[0]: 1.0}  # one delay is stated for every effector


def outsiders(aircraft: Any) -> list[Candidate]:
    """Return the effects that no library describes, with ranges of their own."""
    return [Candidate("outsider", name, low, high) for name, (low, high) in aircraft.OUTSIDERS.items()]
