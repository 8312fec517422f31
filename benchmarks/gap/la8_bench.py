"""The LA-8 class vehicle of the open cases: flown by its own simulation, a little off everywhere."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
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


AIRFRAME = {
    "aerofoil.lift_slope": 0.04,
    "aerofoil.drag": 0.05,
    "aerofoil.lift_drag": 0.05,
    "tail.aerofoil.lift_slope": 0.05,
    "propeller.thrust": 0.03,
    "propeller.torque": 0.05,
    "propeller.inplane_force": 0.05,
    "propeller.hub_moment": 0.05,
    "fuselage.drag_area_m2": 0.05,
    "wake.downwash": 0.05,
    "wake.blowing": 0.05,
    "mixing_m": 0.05,
    "surface_efficiency": 0.05,
}
ACTUATORS = {"surface.frequency_hz": 0.05, "surface.damping": 0.05, "tilt.frequency_hz": 0.05, "motor": 0.05}
MASS = {"mass.fraction": 0.01, **{f"cg_offset.{axis}": 0.005 for axis in "xyz"}}
INERTIA = {f"inertia.{axis}": 0.03 for axis in ("xx", "yy", "zz")}
SCATTER = {**AIRFRAME, **ACTUATORS, **MASS, **INERTIA}
"""One sigma of what the aircraft is off by, as shares of its numbers; of its centre of gravity, m."""


def drawn(seed: int) -> dict[str, float]:
    """Return what an aircraft is off by, within what the tool allows for, two sigma at most."""
    rng = np.random.default_rng([seed, 11])

    def off(sigma: float) -> float:
        return float(sigma * np.clip(rng.standard_normal(), -2, 2))

    described = SCENARIO.aircraft().mass_properties.inertia
    found = {name: off(sigma) for name, sigma in {**AIRFRAME, **ACTUATORS, **MASS}.items()}
    while True:  # until a body can have them: no moment exceeds the sum of the other two
        turning = {name: off(sigma) for name, sigma in INERTIA.items()}
        xx, yy, zz = (getattr(described, n.partition(".")[2]) * (1 + x) for n, x in turning.items())
        if zz < xx + yy:
            return found | turning


def off_by(values: Mapping[str, float]) -> tuple[Scenario, dict[str, dict[str, float]]]:
    """Return the aircraft off by some of `SCATTER`, and its mass effects."""

    def airframe(table: dict[str, Any]) -> dict[str, Any]:
        for path in AIRFRAME:
            times(table, path, 1 + values.get(path, 0.0))
        return table

    def actuators(table: dict[str, Any]) -> dict[str, Any]:
        motor = {f"motor.{time}": values.get("motor", 0.0) for time in ("rise_s", "fall_s")}
        for path, value in {**{n: values.get(n, 0.0) for n in ACTUATORS if n != "motor"}, **motor}.items():
            times(table, path, 1 + value)
        return table

    added: dict[str, dict[str, float]] = {}
    for name in (*MASS, *INERTIA):
        effect, _, parameter = name.partition(".")
        added.setdefault(effect, {})[parameter] = values.get(name, 0.0)
    return section(section(SCENARIO, "airframe", airframe), "actuators", actuators), added


def scattered(seed: int, still: Collection[str] = ()) -> tuple[Scenario, dict[str, dict[str, float]]]:
    """Return the aircraft a little off everywhere but in what is `still`, and its mass effects."""
    return off_by({name: value for name, value in drawn(seed).items() if name not in still})


def flown(at: str, parts: Sequence[Part], how: Circumstances, still: Collection[str] = ()) -> FlightRecord:
    """Fly one manoeuvre of a case and return its log, which describes the nominal vehicle."""
    aircraft = scattered(how.scatter, still) if how.scatter is not None else (SCENARIO, {})
    return flown_by(aircraft, at, parts, how)


def flown_by(
    aircraft: tuple[Scenario, dict[str, dict[str, float]]],
    at: str,
    parts: Sequence[Part],
    how: Circumstances,
) -> FlightRecord:
    """Fly one manoeuvre of an aircraft, as `off_by` returns it, with truths, and return its log."""
    scenario, added = aircraft[0], {i: dict(of) for i, of in aircraft[1].items()}
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
