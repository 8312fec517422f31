"""The LA-8 class scenario as aircraft and as simulation: two flights compared, one held out."""

from __future__ import annotations

import numpy as np
from _la8 import PATH, RATE_HZ, SCENARIO, inputs
from scatter import Settings, added, drawn, drawn_for_a_flight

from freqid.core.errors import UsageError
from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.gap.connect.scenario import ScenarioSimulation
from freqid.simulate.effects import library, loaded
from freqid.simulate.maneuver import Conditions, fly_maneuver, with_effects

SIMULATION = SCENARIO_FILE = f"scenarios/{PATH}.toml"
BAND_HZ = (0.05, 1.8)
FLIGHTS = (("u20", 0), ("u45", 0), ("u30", 1))  # condition and phases; the last one is held out
SECONDS = 60.0
PLACES = (  # effect, parameter, sign
    ("surface_effectiveness", "de1", 1),
    ("mass", "fraction", 1),
    ("wing_wake", "strength", -1),
    ("actuator_delay", "surface", 1),
    ("slipstream", "strength", -1),
    ("cg_offset", "x", 1),
    ("weak_rotor", "n3", 1),
    ("time_skew", "velocity", 1),
    ("flow_upwash", "alpha", 1),
    ("inertia", "yy", 1),
    ("motor_lag", "extra", 1),
    ("sensor_scale", "q", 1),
)


def simulation() -> ScenarioSimulation:
    """Return what the diagnosis has."""
    return ScenarioSimulation(SCENARIO)


def flown(effect: Settings, seed: int) -> list[FlightRecord]:
    """Return the records of one case; airframe, actuators, mass and sensors are scattered.

    Gains of servos and motors are not: they would have to stand in the commands that are logged.
    """
    rng = np.random.default_rng([seed, 8])
    vehicle = SCENARIO.aircraft()
    own = simulation()
    departures = {
        n: float(t.sigma * rng.standard_normal())
        for n, t in own.tolerances.items()
        if not n.endswith(".gain")
    }
    common = drawn(library(), vehicle, 1 / RATE_HZ / np.sqrt(12), rng)
    while not _a_body(vehicle, added(effect, common)):  # it is nearly flat, so 3 % may be more than it can
        common = drawn(library(), vehicle, 1 / RATE_HZ / np.sqrt(12), rng)
    found = []
    for k, (at, phases) in enumerate(FLIGHTS):
        settings = added(effect, common, drawn_for_a_flight(rng))
        in_force = {i: dict(own.effects[i]) for i in effect}  # sizes are departures from these
        scenario = with_effects(SCENARIO, added(in_force, settings))
        reference = SCENARIO.reference_of(at)
        truth = ScenarioSimulation(scenario)
        loop = truth._off_nominal(scenario, truth._loop(scenario, reference, None), reference, departures)
        how = Conditions(noise=1.0, seed=3 * seed + k)
        flight = fly_maneuver(scenario, reference, inputs(phases), how, loop=loop, duration=SECONDS)
        found.append(flight.record)
    return found


def _a_body(vehicle: Vehicle, settings: Settings) -> bool:
    """Return whether there is a body of these mass properties."""
    try:
        loaded(vehicle, settings)
    except UsageError:
        return False
    return True
