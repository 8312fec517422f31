"""The LA-8 class vehicle of the open cases: flown by its own simulation, a little off everywhere."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
from _la8 import SCENARIO as WHOLE
from _la8 import inputs
from bench import DURATION, Bench, Circumstances
from la8_descriptions import section, times
from la8_truths import find
from truth import Part

from freqid.core.record import FlightRecord
from freqid.core.scenario import Scenario
from freqid.gap.connect.scenario import ScenarioSimulation
from freqid.simulate.maneuver import Conditions, fly_maneuver, with_effects

AT = ("u20", "u45")
REFERENCE = {r.id: r for r in WHOLE.reference if r.id in AT}
SCENARIO = msgspec.structs.replace(WHOLE, reference=tuple(REFERENCE.values()))
"""With the conditions that are flown: the control law is designed for all that a scenario has, each time."""

SIMULATION = ScenarioSimulation(SCENARIO)


def scattered(seed: int, still: Collection[str] = ()) -> tuple[Scenario, dict[str, dict[str, float]]]:
    """Return the aircraft a little off everywhere, within what the tool allows for, and its mass effects.

    Without what is `still`, paths of the airframe's table; the rest is off by the same.
    """
    rng = np.random.default_rng([seed, 11])

    def off(sigma: float) -> float:
        return float(sigma * np.clip(rng.standard_normal(), -2, 2))

    def airframe(table: dict[str, Any]) -> dict[str, Any]:
        for path, sigma in (
            ("aerofoil.lift_slope", 0.04),
            ("aerofoil.drag", 0.05),
            ("aerofoil.lift_drag", 0.05),
            ("tail.aerofoil.lift_slope", 0.05),
            ("propeller.thrust", 0.03),
            ("propeller.torque", 0.05),
            ("propeller.inplane_force", 0.05),
            ("propeller.hub_moment", 0.05),
            ("fuselage.drag_area_m2", 0.05),
            ("wake.downwash", 0.05),
            ("wake.blowing", 0.05),
            ("mixing_m", 0.05),
            ("surface_efficiency", 0.05),
        ):
            factor = 1 + off(sigma)
            times(table, path, 1.0 if path in still else factor)
        return table

    def actuators(table: dict[str, Any]) -> dict[str, Any]:
        for path in ("surface.frequency_hz", "surface.damping", "tilt.frequency_hz"):
            times(table, path, 1 + off(0.05))
        speed = 1 + off(0.05)
        times(table, "motor.rise_s", speed)
        times(table, "motor.fall_s", speed)
        return table

    def inertia() -> dict[str, float]:
        """Return fractions that a body can have: no moment exceeds the sum of the other two."""
        described = SCENARIO.aircraft().mass_properties.inertia
        while True:
            each = {axis: off(0.03) for axis in ("xx", "yy", "zz")}
            xx, yy, zz = (getattr(described, axis) * (1 + x) for axis, x in each.items())
            if zz < xx + yy:
                return each

    found = section(section(SCENARIO, "airframe", airframe), "actuators", actuators)
    mass = {
        "mass": {"fraction": off(0.01)},
        "cg_offset": {axis: off(0.005) for axis in "xyz"},
        "inertia": inertia(),
    }
    return found, mass


def flown(at: str, parts: Sequence[Part], how: Circumstances, still: Collection[str] = ()) -> FlightRecord:
    """Fly one manoeuvre of a case and return its log, which describes the nominal vehicle."""
    scenario, added = scattered(how.scatter, still) if how.scatter is not None else (SCENARIO, {})
    for part in parts:
        scenario = part.truth.scenario(scenario, part.size, part.place)
        for identifier, values in part.truth.settings(part.size, part.place).items():
            here = added.setdefault(identifier, {})
            for name, value in values.items():
                here[name] = here.get(name, 0.0) + value
    every = SIMULATION.effects
    table = {i: {n: every[i].get(n, 0.0) + x for n, x in of.items()} for i, of in added.items()}
    conditions = Conditions(noise=how.noise, turbulence=how.gusts, seed=how.seed)
    flight = fly_maneuver(
        with_effects(scenario, table), REFERENCE[at], inputs(how.signals), conditions, duration=DURATION
    )
    if flight.divergence:
        raise ArithmeticError(f"{at}: {flight.divergence}")
    record = replace(flight.record, vehicle=SCENARIO.aircraft())
    for part in parts:
        record = part.truth.record(record, part.size, part.place)
    return record


LA8 = Bench(
    name="la8",
    at=AT,
    simulation=SIMULATION,
    fly=flown,
    find=find,
    tolerance=SCENARIO.tolerance,
)
