"""The tilt-wing simulation of a scenario, as a simulation to be diagnosed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from threading import Lock
from typing import Any, Literal

import jax
import jax.numpy as jnp
import msgspec
import numpy as np
from scipy.interpolate import CubicSpline

from freqid.core.arrays import Array
from freqid.core.channels import FORCES, KNOWN, RATES, VELOCITY, WRENCH, split
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.record import FlightRecord
from freqid.core.results.design import SampledInputs
from freqid.core.scenario import Reference, Scenario
from freqid.core.vehicle import Vehicle
from freqid.dynamics.frames import cross, specific_force_at
from freqid.gap.connect import actuation, loads
from freqid.gap.connect.differences import by_parameters
from freqid.gap.connect.flow import density, velocity
from freqid.gap.connect.own_parameters import (
    actuators_with,
    changes_airframe,
    gains,
    own_tolerances,
    with_departures,
)
from freqid.gap.simulation import Departures, Settings, Tolerance, checked_departures
from freqid.identify.spectra.smoothing import local_derivative
from freqid.simulate import effects as library
from freqid.simulate.air.atmosphere import altitude_of
from freqid.simulate.control.lq import ClosedLoop, close_loop, corridor
from freqid.simulate.control.trim import trim
from freqid.simulate.fly import Flight, fly, sortie
from freqid.simulate.loads import description
from freqid.simulate.loads.airframe import Airframe
from freqid.simulate.loads.quantities import Flow, Positions
from freqid.simulate.maneuver import with_effects
from freqid.simulate.motion import multibody
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.motion.actuators import by_kind
from freqid.simulate.motion.derivatives import HEIGHT
from freqid.simulate.truth import truth_of

MOTION = ("state/u", "state/v", "state/w", *RATES, "air/rho", "state/alt")
_ACCELERATIONS = ("state/pdot", "state/qdot", "state/rdot")
_DESIGNING = Lock()
_COARSE = 2  # every second sample is enough for what a parameter makes: the motion is smooth
_GRID_HZ = 10.0  # of the states at which derivatives are taken: beyond what is excited


@dataclass(frozen=True, eq=False)
class ScenarioSimulation:
    """The simulation that a scenario describes; methods as in `freqid.gap.simulation.Simulation`.

    Moments are about the centre of gravity that the record's mass properties give, else the scenario's;
    the rotors' gyroscopic moments belong to the rigid body. Own parameters: `connect.own_parameters`.

    Attributes
    ----------
    scenario : Scenario
    name : str
    """

    scenario: Scenario
    name: str = "scenario"
    kind: Literal["scenario"] = "scenario"
    responses: tuple[str, ...] = WRENCH
    can_fly: bool = True
    gyroscopic: bool | None = True
    _loops: dict[str, ClosedLoop] = field(default_factory=dict, repr=False)
    _airframes: dict[tuple, Any] = field(default_factory=dict, repr=False)

    @property
    def vehicle(self) -> Vehicle:
        """As the scenario describes it."""
        return self._vehicle

    @property
    def effects(self) -> Settings:
        """Settings in force, of the effects that act in the simulation's own physics too."""
        return self._effects

    @property
    def parts(self) -> tuple[str, ...]:
        """Tables of ``[simulation]`` and what they hold, by dotted path."""
        return tuple(_paths("simulation", msgspec.structs.asdict(self.scenario.simulation)))

    @property
    def tolerances(self) -> Mapping[str, Tolerance]:
        """Numbers of the airframe and the actuators, one sigma of each."""
        return self._tolerances

    @property
    def has_actuators(self) -> bool:
        """Whether the scenario describes actuators."""
        return bool(self.scenario.simulation.actuators)

    def acting_with(self, effects: Settings) -> ScenarioSimulation:
        """Return the simulation with effects of its own at other settings."""
        return replace(self, scenario=self._scenario(effects), _loops={}, _airframes={})

    def predict(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> Array:
        """Return the wrench on the record's states and positions, shape (6, sample)."""
        airframe = self._airframe(effects, self._departures(departures))
        return self._wrench(airframe, record, self._along(record), record.time)

    def sensitivity(
        self, record: FlightRecord, sizes: Departures, departures: Departures | None = None
    ) -> Array:
        """Return what departures of its own parameters make, shape (parameter, 6, sample).

        Computed at every second sample, as smooth motion needs; a cubic spline between.
        """
        at = np.union1d(np.arange(0, record.time.size, _COARSE), record.time.size - 1)
        along, time = jax.tree.map(lambda x: x[at], self._along(record)), record.time[at]

        def departed(_: FlightRecord, *, departures: Departures) -> Array:
            airframe = self._airframe(None, self._departures(departures))
            return self._wrench(airframe, record, along, time)

        return CubicSpline(time, by_parameters(departed, record, sizes, departures), axis=-1)(record.time)

    def gradient(self, record: FlightRecord, inputs: Sequence[str]) -> Array:
        """Return derivatives by channels along the record, shape (6, input, sample).

        Exact at smoothed states a tenth of a second apart, straight between them; the wake is steady. A
        channel that the airframe does not feel has zeros.
        """
        place = record.channels[MOTION[0]].position_m if MOTION[0] in record else None
        sensor = np.array(place or (0.0, 0.0, 0.0))
        at, grid = self._smoothed(record)
        slopes = loads.derivatives(self._airframe(None), self._mass(record), at, sensor)
        kinds = by_kind(self.vehicle, np.arange(len(self.vehicle.effectors)))
        columns = np.concatenate([np.asarray(k) for k in kinds])
        by_effector = np.empty((len(WRENCH), columns.size, grid.size))
        by_effector[:, columns] = np.concatenate(slopes[1:], axis=1)
        names = [e.name for e in self.vehicle.effectors]
        out = np.zeros((len(WRENCH), len(inputs), record.time.size))
        for i, channel in enumerate(inputs):
            group, name = split(channel)
            if channel in MOTION:
                coarse = slopes[0][:, MOTION.index(channel)]
            elif group == "effector" and name in names:
                coarse = by_effector[:, names.index(name)]
            elif group in KNOWN:
                continue
            else:
                raise UsageError(
                    f"the simulation has no input '{channel}'",
                    where=self.name,
                    remedy=nearest(name, names),
                )
            out[:, i] = [np.interp(record.time, grid, row) for row in coarse]
        return out

    def positions(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> dict[str, Array]:
        """Return positions by effector: servos, tilt drives and motors at the record's commands.

        The injected signal is straight between samples, the control law's part a cubic spline. The voltage
        is that of the scenario's battery under the rotors' load, at commanded speeds where none were
        measured. Effectors without a command are left out.
        """
        if not any(f"command/{e.name}" in record for e in self.vehicle.effectors):
            return {}
        settings, own = self._settings(effects), self._departures(departures)
        act = actuators_with(self._parameters.actuators, self.vehicle, own)
        gain, kinds = gains(self.vehicle, own), self.vehicle.effector_kinds
        unmeasured = [n for n in kinds if f"effector/{n}" not in record and f"command/{n}" in record]
        found = {n: record[f"command/{n}"] for n in unmeasured}
        for _ in range(2 if unmeasured else 1):  # the load of commanded speeds, then that of attained ones
            ratio = np.ones(record.time.size)
            if "rotor" in kinds.values():
                stand = [replace(record.channel(f"command/{n}"), values=found[n]) for n in unmeasured]
                moved = record.with_channels(*(replace(c, name=f"effector/{c.name[8:]}") for c in stand))
                airframe, sag = self._airframe(None, own), settings["battery_sag"]
                ratio = actuation.voltage_ratio(airframe, act, sag, self._along(moved), record.dt)
            found = actuation.positions(record, self.vehicle, act, settings, ratio, gain)
        return found

    def fly(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> dict[str, Array]:
        """Return its own closed-loop flight from the record's reference; effectors and commands too.

        Calm air; velocities and specific forces where the record's sensors are. With departures, the
        vehicle flies from its own trim, with the control law of the nominal vehicle.
        """
        scenario, reference = self._scenario(effects), self._reference(record)
        own = self._departures(departures)
        gain = gains(self.vehicle, own)
        excited, inputs = record.group("excitation"), None
        if excited:
            inputs = SampledInputs(
                excited,
                tuple(record.channel(f"excitation/{n}").unit for n in excited),
                record.time - record.time[0],
                np.array([gain[n] * record[f"excitation/{n}"] for n in excited]),
            )
        loop = self._loop(scenario, reference, effects)
        if own:
            loop = self._off_nominal(scenario, loop, reference, own)
        flight = fly(sortie(scenario, loop, reference, inputs, duration=record.duration))
        if flight.divergence:
            raise DataError(
                f"the simulation's own flight fails: {flight.divergence}",
                where=self.name,
                remedy="compare by replay on the flown states, or lower the inputs",
            )
        flown = _as_measured(scenario, flight, record)
        return {n: x / gain.get(n.removeprefix("command/"), 1.0) for n, x in flown.items()}

    def _off_nominal(
        self, scenario: Scenario, nominal: ClosedLoop, reference: Reference, own: Departures
    ) -> ClosedLoop:
        """Return the vehicle with departures, at its own trim, under the law of the nominal one.

        A servo's gain scales what it is sent, so it stands in the law's allocation here.
        """
        parameters = nominal.parameters
        if changes_airframe(own, scenario):
            airframe = description.parameters(with_departures(scenario, own))
            parameters = parameters._replace(airframe=airframe)
        act = actuators_with(parameters.actuators, self.vehicle, own)
        parameters = jax.device_put(parameters._replace(actuators=act))
        trimmed = trim(scenario, parameters, reference)
        law, at = nominal.law, int(np.argmin(np.abs(np.asarray(nominal.law.u) - reference.u)))
        table = law.settings
        state = np.array(table.state)
        state[at, :3], state[at, 6:8] = trimmed.body.velocity, trimmed.angles
        rows = actuation.split_by_kind(self.vehicle, np.array(list(gains(self.vehicle, own).values())))
        settings = table._replace(
            commands=jax.tree.map(
                lambda x, new: np.where(np.arange(len(x))[:, None] == at, new, x),
                table.commands,
                trimmed.commands,
            ),
            state=jnp.asarray(state),
            surface=table.surface * rows.surface[:, None],
            speed=table.speed * rows.speed[:, None],
        )
        trims = {**nominal.trims, reference.id: trimmed}
        return ClosedLoop(parameters, trims, law._replace(settings=settings))

    def _loop(self, scenario: Scenario, reference: Reference, changed: Settings | None) -> ClosedLoop:
        """Return the vehicle with its control law, one for all references of a corridor."""
        key = msgspec.json.encode([self._settings(changed), corridor(scenario, reference)]).decode()
        with _DESIGNING:  # flights side by side wait for the same law
            if key not in self._loops or reference.id not in self._loops[key].trims:
                self._loops[key] = close_loop(scenario, reference)
            return self._loops[key]

    def _settings(self, changed: Settings | None) -> dict[str, dict[str, float]]:
        """Return the settings of every effect with some of them changed; what is unknown is refused."""
        return library.settings(self._scenario(changed).simulation.effects, self.vehicle)

    def _scenario(self, changed: Settings | None) -> Scenario:
        return (
            with_effects(self.scenario, {i: dict(s) for i, s in changed.items()})
            if changed
            else self.scenario
        )

    @cached_property
    def _vehicle(self) -> Vehicle:
        return self.scenario.aircraft()

    @cached_property
    def _effects(self) -> Settings:
        absent = description.absent_effects(self.scenario)
        return {i: s for i, s in self._settings(None).items() if i not in absent}

    @cached_property
    def _tolerances(self) -> dict[str, Tolerance]:
        return own_tolerances(self.scenario)

    @cached_property
    def _parameters(self) -> motion.Parameters:
        return jax.device_put(motion.parameters(self.scenario))

    def _departures(self, departures: Departures | None) -> dict[str, float]:
        return checked_departures(departures, self.tolerances, self.name)

    def _airframe(self, changed: Settings | None, own: Departures | None = None):
        airframe = self._parameters.airframe
        if own and changes_airframe(own, self.scenario):
            key = tuple(sorted(own.items()))
            if key not in self._airframes:  # every manoeuvre asks for the same ones
                self._airframes[key] = description.parameters(with_departures(self.scenario, own))
            airframe = self._airframes[key]
        if not changed:
            return airframe
        settings = self._settings(changed)
        leaves = {i: jax.tree.map(jnp.asarray, actuation.leaves(settings[i])) for i in changed}
        return airframe._replace(effects={**airframe.effects, **leaves})

    def _wrench(self, airframe: Airframe, record: FlightRecord, along: loads.Along, time: Array) -> Array:
        predicted = loads.wrench(airframe, self._mass(record), along, time - time[0])
        bad = np.flatnonzero(~np.isfinite(predicted).all(axis=0))
        if bad.size:
            raise DataError(
                f"the prediction is not finite at t = {time[bad[0]]:.4g} s",
                where=self.name,
                remedy="check the record's states and positions there",
            )
        return predicted

    def _mass(self, record: FlightRecord) -> multibody.MassModel:
        if record.mass_properties is None:
            return self._parameters.mass
        return multibody.mass_model(
            msgspec.structs.replace(self.vehicle, mass_properties=record.mass_properties)
        )

    def _reference(self, record: FlightRecord) -> Reference:
        if record.reference:
            return self.scenario.reference_of(record.reference)
        tilts = [e.name for e in self.vehicle.effectors if e.kind == "tilt"]
        means = {t: float(record[f"effector/{t}"].mean()) for t in tilts if f"effector/{t}" in record}
        u = float(velocity(record, (0.0, 0.0, 0.0))[0].mean())
        return Reference(id="record", u=u, rho=float(density(record, 1.225).mean()), scheduled=means)

    def _along(self, record: FlightRecord) -> loads.Along:
        """Return what the airframe feels, at the vehicle's origin, with a sample axis in front."""
        known = [at.rho for at in self.scenario.reference if at.id == record.reference]
        rho: Any = density(record, known[0] if known else 1.225)
        level = altitude_of(known[0] if known else float(rho.mean())) - HEIGHT
        height: Any = record["state/alt"] - level if "state/alt" in record else np.full(rho.size, HEIGHT)
        origin: Any = velocity(record, (0.0, 0.0, 0.0)).T
        rates: Any = record.matrix(RATES).T
        rows = record.matrix(f"effector/{e.name}" for e in self.vehicle.effectors)
        surface, tilt, speed = actuation.split_by_kind(self.vehicle, rows.T)
        turning: Any = tilt
        if tilt.size:
            turning = local_derivative(tilt.T, record.dt, window=9, degree=4).T
        return loads.Along(Flow(origin, rates, rho, height), Positions(surface, tilt, turning, speed))

    def _smoothed(self, record: FlightRecord) -> tuple[loads.Along, Array]:
        """Return what the airframe feels on a coarse grid, averaged about its points, and the grid."""
        count = max(2, int(np.ceil(record.duration * _GRID_HZ)) + 1)
        grid = np.linspace(record.time[0], record.time[-1], count)
        hat = np.maximum(1 - np.abs(record.time - grid[:, None]) * (count - 1) / record.duration, 0.0)
        hat /= hat.sum(axis=1, keepdims=True)
        return jax.tree.map(lambda x: hat @ x, self._along(record)), grid


def _paths(stem: str, table: Mapping[str, Any]) -> list[str]:
    """Return the dotted paths of all that a table holds, tables of tables too."""
    found = []
    for name, value in table.items():
        if value:
            found.append(f"{stem}.{name}")
            found += _paths(found[-1], value) if isinstance(value, dict) else []
    return found


def _as_measured(scenario: Scenario, flight: Flight, record: FlightRecord) -> dict[str, Array]:
    """Return a flight's states where the record's sensors are, effectors and commands; without errors."""
    truth, _ = truth_of(scenario, flight, excited=(), reference=record.reference)
    time = np.minimum(record.time - record.time[0], truth.time[-1])
    rates, turning = truth.matrix(RATES), truth.matrix(_ACCELERATIONS)
    states = {}
    for name in truth.group("state"):
        channel, values = f"state/{name}", truth[f"state/{name}"]
        place = record.channels[channel].position_m if channel in record else None
        if place and channel in VELOCITY:
            arm = np.broadcast_to(np.array(place)[:, None], rates.shape)
            values = values + cross(rates, arm)[VELOCITY.index(channel)]
        elif place and channel in FORCES:
            values = specific_force_at(truth.matrix(FORCES), rates, turning, place)[FORCES.index(channel)]
        states[name] = CubicSpline(truth.time, values)(time)
    for name in (f"{group}/{n}" for group in ("effector", "command") for n in truth.group(group)):
        states[name] = CubicSpline(truth.time, truth[name])(time)
    return states
