"""The numbers of a scenario's airframe and actuators as parameters that may be off.

Names are dotted. A departure is a share of the nominal value unless the unit says otherwise.

- ``aerofoil.lift_slope``, ``propeller.thrust``, ``wing.front.span_m``, ``surface.de1.chord_fraction``:
  a number, or all numbers of a list together, of ``[simulation.airframe]``;
- ``CL.alpha``, ``Cm.de``, ``propeller.thrust``: a derivative, or all values of its table together, of
  ``[simulation.coefficients]``;
- ``de1.natural_frequency``, ``de1.damping``, ``de1.gain``: one servo or tilt drive;
- ``n1.time_constant``, ``n1.gain``: one motor;
- ``surface.delay``, ``tilt.delay``, ``motor.delay``: the commands of one kind, s;
- ``battery.charge``, ``battery.resistance_ohm``.

A changed number makes another set of parameters of the same shapes, so nothing is compiled anew.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import jax
import msgspec
import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.core.scenario import Scenario
from freqid.core.vehicle import Vehicle
from freqid.gap.simulation import Departures, Tolerance
from freqid.simulate.motion.actuators import Actuators, Servos

SHARE = 0.05
"""One sigma of aerodynamic and propulsive numbers, natural frequencies, damping and time constants."""
MEASURED = 0.01
"""One sigma of lengths and angles that are measured on the ground, and of actuators' gains."""
DELAY = 0.002
"""One sigma of a command's delay, s."""

_MOST = {"1": 0.5, "s": 0.1}  # beyond these a nominal value says nothing

_MEASURED = ("span_m", "chord_m", "quarter_chord_m", "centre_m", "dihedral_rad", "incidence_rad")
_NUMERICAL = ("strips", "at", "about", "point_m")  # no property of the aircraft
_DELAYS = {"surface.delay": "surface", "tilt.delay": "tilt", "motor.delay": "speed"}
_BATTERY = {"battery.charge": "charge", "battery.resistance_ohm": "resistance"}
_SERVO = ("natural_frequency", "damping", "gain")
_LOADING = ("propeller.torque",)  # what loads the rotors, so the battery and the motors
_MOTOR = ("time_constant", "gain")


def own_tolerances(scenario: Scenario) -> dict[str, Tolerance]:
    """Return the parameters of a scenario's simulation and how far each may be off.

    Parameters
    ----------
    scenario : Scenario
        An entry of ``[tolerance]`` replaces the sigma of that name.

    Returns
    -------
    dict of Tolerance
        By the names that the module lists; a number that is zero has none.

    Raises
    ------
    DataError
        Where ``[tolerance]`` gives one of them a sigma that is negative, not finite or absurd.
    """
    defaults = {
        name: Tolerance(
            MEASURED if name.rpartition(".")[2] in _MEASURED else SHARE,
            loads_only=name not in _LOADING,
        )
        for name, _, _ in _numbers(scenario.simulation.loads)
    }
    if scenario.simulation.actuators:
        for effector in scenario.effector:
            if effector.kind in ("surface", "tilt", "rotor"):
                for what in _MOTOR if effector.kind == "rotor" else _SERVO:
                    sigma = MEASURED if what == "gain" else SHARE
                    defaults[f"{effector.name}.{what}"] = Tolerance(
                        sigma, actuator=effector.name, of_make=True
                    )
        kinds = {e.kind for e in scenario.effector}
        for name in _DELAYS:
            if name.partition(".")[0].replace("motor", "rotor") in kinds:
                defaults[name] = Tolerance(DELAY, "s")
        if "rotor" in kinds and "battery" in scenario.simulation.actuators:
            defaults |= {name: Tolerance(SHARE) for name in _BATTERY}
    out = {}
    for name, default in defaults.items():
        sigma, most = scenario.tolerance.get(name, default.sigma), _MOST[default.unit]
        try:
            out[name] = replace(
                default, sigma=sigma, of_make=default.of_make and name not in scenario.tolerance
            )
        except DataError as error:
            raise error.at(f"[tolerance] {name}") from None
        if sigma > most:
            raise DataError(
                f"one sigma is {sigma:g}, expected at most {most:g}",
                where=f"[tolerance] {name}",
                remedy="give it in s" if default.unit == "s" else "give it as a share: 0.05 for 5 %",
            )
    return out


def with_departures(scenario: Scenario, departures: Departures) -> Scenario:
    """Return a scenario with the numbers that give the loads changed by shares of themselves.

    Parameters
    ----------
    scenario : Scenario
    departures : dict of float
        By the names of `own_tolerances`; those of actuators change nothing here.
    """
    table = msgspec.json.decode(msgspec.json.encode(scenario.simulation.loads))
    for name, holder, key in _numbers(table):
        if departures.get(name):
            holder[key] = np.multiply(holder[key], 1 + departures[name]).tolist()
    simulation = msgspec.structs.replace(scenario.simulation, **{scenario.simulation.kind: table})
    return msgspec.structs.replace(scenario, simulation=simulation)


def actuators_with(act: Actuators, vehicle: Vehicle, departures: Departures) -> Actuators:
    """Return actuators whose frequencies, damping, time constants, delays and battery are changed.

    Gains act on commands: see `gains`.

    Parameters
    ----------
    act : Actuators
    vehicle : Vehicle
    departures : dict of float
    """

    def factors(kind: str, what: str) -> Array:
        names = [e.name for e in vehicle.effectors if e.kind == kind]
        return np.array([1 + departures.get(f"{n}.{what}", 0.0) for n in names])

    def servos(servo: Servos, kind: str) -> Servos:
        return servo._replace(
            frequency=servo.frequency * factors(kind, "natural_frequency"),
            damping=servo.damping * factors(kind, "damping"),
        )

    slower = factors("rotor", "time_constant")
    late = {
        kind: np.maximum(getattr(act.delay, kind) + departures.get(name, 0.0), 0.0)
        for name, kind in _DELAYS.items()
    }
    battery = {
        at: getattr(act.battery, at) * (1 + departures.get(name, 0.0)) for name, at in _BATTERY.items()
    }
    changed = act._replace(
        surface=servos(act.surface, "surface"),
        tilt=servos(act.tilt, "tilt"),
        motor=act.motor._replace(rise=act.motor.rise * slower, fall=act.motor.fall * slower),
        delay=act.delay._replace(**late),
        battery=act.battery._replace(**battery),
    )
    return jax.tree.map(lambda x: np.asarray(x, dtype=float), changed)  # all compile alike


def gains(vehicle: Vehicle, departures: Departures) -> dict[str, float]:
    """Return position over command at rest, by effector: one where nothing is changed."""
    return {e.name: 1 + departures.get(f"{e.name}.gain", 0.0) for e in vehicle.effectors}


def changes_airframe(departures: Departures, scenario: Scenario) -> bool:
    """Return whether any of the departures is of what gives the loads."""
    return any(name in departures for name, _, _ in _numbers(scenario.simulation.loads))


def _numbers(table: Mapping[str, Any], stem: str = "") -> Iterator[tuple[str, Any, str]]:
    """Yield dotted name, holder and key of every number or list of numbers that is not all zero."""
    for key, value in table.items():
        name = f"{stem}{key}"
        if key in _NUMERICAL:
            continue
        if isinstance(value, Mapping) and "values" in value:
            yield name, value, "values"  # a table is off as a whole
        elif isinstance(value, Mapping):
            yield from _numbers(value, f"{name}.")
        elif isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
            for part in value:
                yield from _numbers(part, f"{name}.{part['name']}.")
        elif not isinstance(value, str) and np.any(value):
            yield name, table, key
