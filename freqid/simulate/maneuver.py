"""One manoeuvre from its plan to what the aircraft logs of it, and to the truth that it never sees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.core.record import FlightRecord
from freqid.core.results.design import SampledInputs
from freqid.core.scenario import Reference, Scenario
from freqid.simulate import effects, sensors
from freqid.simulate.air import dryden as turbulence
from freqid.simulate.control.lq import ClosedLoop, close_loop
from freqid.simulate.fly import Flight, fly, sortie
from freqid.simulate.motion.integrate import Divergence
from freqid.simulate.truth import truth_of

LOG_RATE = 50.0  # Hz


@dataclass(frozen=True)
class Conditions:
    """How a manoeuvre is flown and measured.

    Attributes
    ----------
    sensors : str
        Suite of ``[simulation.sensors]``; the day is that of the same name in ``[simulation.wind]``.
    noise : float
        Multiple of the suite's noise; at zero the sensors have no error at all.
    turbulence : float
        Mean wind 20 ft above ground that the gusts go with, m/s; zero for none.
    feedback : bool
    seed : int
        Of wind, gusts and sensors.
    log_rate : float
        Hz.
    """

    sensors: str = "research"
    noise: float = 0.0
    turbulence: float = 0.0
    feedback: bool = True
    seed: int = 0
    log_rate: float = LOG_RATE


@dataclass(frozen=True, eq=False)
class Flown:
    """A manoeuvre that was flown.

    Attributes
    ----------
    record : FlightRecord
        What the aircraft logged.
    truth : FlightRecord
    flight : Flight
    """

    record: FlightRecord
    truth: FlightRecord
    flight: Flight

    @property
    def divergence(self) -> Divergence | None:
        """Where the flight left its limits; record and truth end there."""
        return self.flight.divergence


def with_effects(scenario: Scenario, settings: Mapping[str, Any]) -> Scenario:
    """Return a scenario with effects set anew: by id, a size or parameters by name.

    Raises
    ------
    UsageError
        For an unknown effect or parameter.
    """
    effects.settings(settings, scenario.aircraft())  # says what is wrong before anything is flown
    simulation = scenario.simulation
    table = dict(simulation.effects)
    for identifier, value in settings.items():
        old = table.get(identifier, {})
        size = effects.find(identifier).size
        old = old if isinstance(old, dict) else {size: old}
        table[identifier] = {**old, **(value if isinstance(value, dict) else {size: value})}
    return msgspec.structs.replace(scenario, simulation=msgspec.structs.replace(simulation, effects=table))


def fly_maneuver(
    scenario: Scenario,
    reference: Reference,
    inputs: SampledInputs | None = None,
    conditions: Conditions = Conditions(),
    *,
    loop: ClosedLoop | None = None,
    duration: float | None = None,
    to: Reference | None = None,
) -> Flown:
    """Fly one manoeuvre and log it.

    Parameters
    ----------
    scenario : Scenario
    reference : Reference
        Where it starts, trimmed.
    inputs : SampledInputs, optional
        Excitation, added after the control law.
    conditions : Conditions
    loop : ClosedLoop, optional
        Of the same scenario and density, where it is at hand.
    duration, to
        As in `fly.sortie`.

    Returns
    -------
    Flown

    Raises
    ------
    UsageError
        Where the scenario lacks the suite, the condition cannot be trimmed, or as in `fly.sortie`.
    DataError
        Where the flight diverges before there is anything to log.
    """
    flown, wind = flyable(scenario, conditions)
    if flown is not scenario:
        loop = None
    flight = fly(
        sortie(
            flown,
            loop or close_loop(flown, reference),
            reference,
            inputs,
            duration=duration,
            to=to,
            wind=wind,
            feedback=conditions.feedback,
            seed=conditions.seed,
        )
    )
    return logged(flown, flight, inputs.names if inputs else (), reference.id, conditions, wind)


def flyable(scenario: Scenario, conditions: Conditions) -> tuple[Scenario, Array]:
    """Return a scenario with the turbulence of the day, and its mean wind, north, east, down, m/s.

    Raises
    ------
    UsageError
        Where the scenario lacks the suite.
    """
    sensors.suite(scenario, conditions.sensors)  # says what is wrong before anything is flown
    if conditions.turbulence:
        scenario = with_effects(scenario, {"turbulence": conditions.turbulence})
    wind = np.zeros(3)
    if conditions.sensors in scenario.simulation.wind:
        wind = turbulence.steady_wind(scenario, conditions.sensors, conditions.seed)
    return scenario, wind


def logged(
    scenario: Scenario,
    flight: Flight,
    excited: tuple[str, ...],
    reference: str,
    conditions: Conditions,
    wind: Array,
) -> Flown:
    """Return what the aircraft logs of a flight, and the truth.

    Parameters
    ----------
    scenario : Scenario
        As it was flown.
    flight : Flight
    excited : tuple of str
        Effectors whose excitation is logged.
    reference : str
        Id of the reference condition, empty where the flight had many.
    conditions : Conditions
    wind : ndarray, shape (3,)
        m/s.

    Raises
    ------
    DataError
        Where the flight diverged before there is anything to log.
    """
    c = conditions
    if flight.divergence and flight.time.size < 50:
        raise DataError(f"{flight.divergence}; nothing was recorded", remedy="start from another condition")
    suite = sensors.with_scaled_noise(sensors.suite(scenario, c.sensors), c.noise)
    truth, moving_air = truth_of(scenario, flight, excited=excited, reference=reference)
    settings = effects.settings(scenario.simulation.effects, scenario.aircraft())
    how = {
        "effects": effects.acting(settings),
        "wind_m_s": list(wind),
        "seed": c.seed,
        "noise": c.noise,
        "sensors": c.sensors,
        "feedback": c.feedback,
    }
    if flight.divergence:
        how["diverged"] = str(flight.divergence)
    record = effects.distorted(sensors.measure(truth, moving_air, suite, c.log_rate, c.seed), settings)
    return Flown(record, replace(truth, provenance={"simulation": how}), flight)
