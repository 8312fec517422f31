"""A JSBSim aircraft as a simulation: ``jsbsim:c172p``, or an aircraft's XML file.

JSBSim runs along the record: at every sample it is put into the recorded motion, its effectors are where
the record says, and forces and moments are read; engines, which cannot be put anywhere, run on from their
throttle. So that the flight control system does not move the effectors again, its outputs to the recorded
ones are taken out of a working copy of the aircraft.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import RATES, WRENCH
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord
from freqid.core.units import FOOT
from freqid.core.vehicle import Vehicle
from freqid.gap.connect import answers
from freqid.gap.connect.differences import by_parameters, size
from freqid.gap.connect.feedback import HEARD, law
from freqid.gap.connect.flow import velocity
from freqid.gap.connect.jsbsim_aircraft import (
    SETTLED,
    STATES,
    JsbsimAircraft,
    loads,
    place,
    put,
    quiet,
    states,
)
from freqid.gap.simulation import Departures, Settings, Tolerance, checked_departures

_INTEGRATORS = ("rate/rotational", "rate/translational", "position/rotational", "position/translational")
"""JSBSim's own, by which it moves on from one step to the next."""

_STEP = 1 / 120  # s, the longest of JSBSim's own steps
_ENGINES = 15.0  # s, until engines have the speed they start with
_CLEARANCE = 1000.0  # m, above ground: manoeuvres are flown high
_GRID_HZ = 10.0  # of derivatives
_FELT = ("state/u", "state/v", "state/w", *RATES)


@dataclass(frozen=True, eq=False)
class JsbsimSimulation:
    """A JSBSim aircraft; methods as in `freqid.gap.simulation.Simulation`.

    Effectors of a record are found by name: ``elevator`` (or de) is ``fcs/elevator-pos-rad``, ``aileron``
    the left one and the right one opposite, ``throttle`` is ``fcs/throttle-pos-norm``, any other
    ``fcs/<name>-pos-rad`` or ``-pos-norm``. Commands without a unit are ``fcs/<name>-cmd-norm``; in radians,
    the position that the control system would bring in the end. The moments contain the engines'
    gyroscopic ones, so the vehicle is described without rotors.

    Attributes
    ----------
    aircraft : JsbsimAircraft
    vehicle : Vehicle or None
    """

    aircraft: JsbsimAircraft
    vehicle: Vehicle | None = None
    name: str = "jsbsim"
    kind: Literal["jsbsim"] = "jsbsim"
    responses: tuple[str, ...] = WRENCH
    effects: Settings = field(default_factory=dict)
    parts: tuple[str, ...] = ()
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict)
    can_fly: bool = True
    has_actuators: bool = True
    gyroscopic: bool | None = False

    @quiet()
    def predict(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> Array:
        """Return the wrench about the centre of gravity, shape (6, sample)."""
        self._nothing_to_set(effects, departures)
        rows = [loads(fdm) for _, fdm in self._run(record).along()]
        if not np.isfinite(rows).all():
            self.aircraft.forget()
        predicted = dict(zip(WRENCH, np.array(rows).T, strict=True))
        names, checked = answers.stacked(predicted, record.time, self.name)
        answers.check_moving(names, checked, record, self.name)
        return checked

    def sensitivity(
        self, record: FlightRecord, sizes: Departures, departures: Departures | None = None
    ) -> Array:
        """Return what departures of its own parameters make, of which it has none."""
        return by_parameters(self.predict, record, sizes, departures)

    @quiet()
    def gradient(self, record: FlightRecord, inputs: Sequence[str]) -> Array:
        """Return derivatives, shape (6, input, sample): central differences each tenth of a second.

        Engine speeds are held; channels that JSBSim does not feel have zeros.
        """
        run = self._run(record)
        felt = [(i, n) for i, n in enumerate(inputs) if n in _FELT or n.startswith("effector/")]
        steps = {name: size(record[name]) for _, name in felt}
        every = max(1, int(1 / (_GRID_HZ * record.dt)))
        grid, table = [], []
        for k, fdm in run.along():
            if k % every and k != record.time.size - 1:
                continue
            slopes = np.zeros((len(WRENCH), len(inputs)))
            for i, name in felt:
                effector = self.aircraft.where(name.partition("/")[2]) if name.startswith("effector/") else []
                pair = []
                for sign in (1, -1):
                    there = run.motion[:, k].copy()
                    if name in _FELT:
                        there[_FELT.index(name)] += sign * steps[name]
                    put(fdm, there)
                    place(fdm, effector, record[name][k] + sign * steps[name])
                    fdm.run_ic()
                    pair.append(loads(fdm))
                place(fdm, effector, record[name][k])
                slopes[:, i] = np.subtract(pair[0], pair[1]) / (2 * steps[name])
            put(fdm, run.motion[:, k])
            fdm.run_ic()
            grid.append(record.time[k])
            table.append(slopes)
        columns = np.moveaxis(np.array(table), 0, -1)
        return np.array([[np.interp(record.time, grid, x) for x in row] for row in columns])

    @quiet()
    def positions(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> dict[str, Array]:
        """Return what the flight control system makes of the commands in the recorded motion.

        Dampers of the aircraft's own feel that motion.
        """
        self._nothing_to_set(effects, departures)
        names = [n for n in record.group("command") if self.aircraft.where(n)]
        if not names:
            return {}
        run = self._run(record)
        commands = np.array([run.command(n) for n in names])
        fdm, steps = run.ready(())
        self.aircraft.command(fdm, names, commands[:, 0])
        for _ in range(int(SETTLED / fdm.get_delta_t())):
            fdm.run_ic()  # one step of the control system, the motion as it was put
        out = np.empty_like(commands)
        for k in range(record.time.size):
            for j in range(1, steps + 1) if k else ():
                share = j / steps
                put(fdm, run.motion[:, k - 1] + share * (run.motion[:, k] - run.motion[:, k - 1]))
                self.aircraft.command(fdm, names, (1 - share) * commands[:, k - 1] + share * commands[:, k])
                fdm.run_ic()
            out[:, k] = [fdm[self.aircraft.where(n)[0][0]] for n in names]
        return dict(zip(names, out, strict=True))

    @quiet()
    def fly(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> dict[str, Array]:
        """Return states, and positions of effectors, of its own flight: from its own trim, by departures.

        Where attitude and rates tell what was added to injected signals, the law that did it flies along.
        """
        import jsbsim

        self._nothing_to_set(effects, departures)
        names = [n for n in record.group("command") if self.aircraft.where(n)]
        run = self._run(record)
        commands = np.array([run.command(n) for n in names]).reshape(len(names), record.time.size)
        fdm, steps = run.ready(())
        start = run.velocity[:, 0]
        fdm["ic/vt-fps"], fdm["ic/gamma-deg"] = float(np.linalg.norm(start)) / FOOT, 0.0
        fdm.run_ic()
        try:
            fdm["simulation/do_simple_trim"] = 1
        except jsbsim.TrimFailureError:
            raise DataError(
                f"JSBSim finds no trim at {np.linalg.norm(start):.4g} m/s",
                where=self.name,
                remedy="compare by replay, or begin the record in steady level flight",
            ) from None
        trim = np.array([fdm[self.aircraft.commands(n)[0]] for n in names])
        rest = np.array([run.command(n, of_law=True) for n in names]).reshape(commands.shape)
        gains, by_law = law(record, rest, [f"excitation/{n}" in record for n in names])
        departure = commands - np.where(by_law[:, None], rest, commands[:, :1])
        rows, moved = [states(fdm)], [self._placed(fdm, names)]
        heard = [STATES.index(n) for n in HEARD]
        start = np.array(rows[0])[heard]
        for k in range(1, record.time.size):
            departure[:, k] += gains @ (np.array(rows[-1])[heard] - start)
            for j in range(1, steps + 1):
                between = departure[:, k - 1] + (departure[:, k] - departure[:, k - 1]) * j / steps
                self.aircraft.command(fdm, names, trim + between)
                fdm.run()
            rows.append(states(fdm))
            moved.append(self._placed(fdm, names))
            if not np.isfinite(rows[-1]).all() or abs(rows[-1][7]) > 1.4 or rows[-1][-1] < -500:
                raise DataError(
                    f"JSBSim's own flight diverges at t = {record.time[k]:.4g} s",
                    where=self.name,
                    remedy="compare by replay on the flown states",
                )
        positions = zip((f"effector/{n}" for n in names), np.array(moved).T, strict=True)
        sent = {
            f"command/{n}": bias + x
            for n, bias, x in zip(names, trim, departure, strict=True)
            if record.channel(f"command/{n}").unit == "1"
        }
        return {**dict(zip(STATES, np.array(rows).T, strict=True)), **dict(positions), **sent}

    def _placed(self, fdm: Any, names: Sequence[str]) -> list[float]:
        return [fdm[self.aircraft.where(n)[0][0]] for n in names]

    def _run(self, record: FlightRecord) -> _Run:
        described = record.vehicle or self.vehicle
        centre = described.mass_properties.cg_m if described else (0.0, 0.0, 0.0)
        return _Run(self.aircraft, record, centre, self.name)

    def _nothing_to_set(self, effects: Settings | None, departures: Departures | None) -> None:
        checked_departures(departures, self.tolerances, self.name)
        if effects:
            raise UsageError("a JSBSim aircraft has no effects that could be set", where=self.name)


def load(aircraft: str, vehicle: Vehicle | None = None) -> JsbsimSimulation:
    """Load an aircraft by its name or its file.

    Raises
    ------
    DataError
        Where JSBSim is not installed, or has or accepts no such aircraft.
    """
    loaded = JsbsimAircraft.of(aircraft)
    # described by an instance of its own, whose effectors are moved all the way
    return JsbsimSimulation(loaded, vehicle or JsbsimAircraft(aircraft).vehicle(), name=loaded.name)


@dataclass(frozen=True, eq=False)
class _Run:
    """An aircraft along one record.

    Attributes
    ----------
    aircraft : JsbsimAircraft
    record : FlightRecord
    centre : tuple of 3 floats
        Of gravity, m.
    name : str
        Of the simulation, for errors.
    """

    aircraft: JsbsimAircraft
    record: FlightRecord
    centre: tuple[float, float, float]
    name: str

    @cached_property
    def velocity(self) -> Array:
        """Velocity of the centre of gravity through the air, m/s, shape (3, sample)."""
        return velocity(self.record, self.centre)

    @cached_property
    def motion(self) -> Array:
        """What JSBSim is put into: u v w p q r, phi theta psi, altitude, shape (10, sample)."""
        record = self.record
        angles = [
            record[f"state/{n}"] if f"state/{n}" in record else 0 * record.time
            for n in ("phi", "theta", "psi")
        ]
        if "air/rho" in record:  # the altitude in the standard troposphere
            altitude = (1 - (record["air/rho"] / 1.225) ** (1 / 4.25588)) / 2.25577e-5
        else:
            altitude = record["state/alt"] if "state/alt" in record else np.full(record.time.size, 300.0)
        return np.concatenate([self.velocity, record.matrix(RATES), angles, np.array(altitude)[None]])

    def command(self, name: str, *, of_law: bool = False) -> Array:
        """Return a command as JSBSim wants it, from -1 to 1; `of_law` without what was injected."""
        record = self.record
        channel, injected = record.channel(f"command/{name}"), f"excitation/{name}"
        values = channel.values - record[injected] if of_law and injected in record else channel.values
        if channel.unit == "1":
            return values
        norm, position = self.aircraft.travel(name)
        order = np.argsort(position)
        return np.interp(values, position[order], norm[order])

    def ready(self, prescribed: tuple[str, ...]) -> tuple[Any, int]:
        """Return JSBSim at the record's start with running engines, and its steps for each sample."""
        fdm = self.aircraft.model(prescribed)
        steps = max(1, int(np.ceil(self.record.dt / _STEP - 1e-6)))
        fdm.reset_to_initial_conditions(1)
        fdm.set_dt(self.record.dt / steps)
        for what, how in zip(_INTEGRATORS, (3, 4, 2, 3), strict=True):
            fdm[f"simulation/integrator/{what}"] = how
        fdm["ic/terrain-elevation-ft"] = (float(self.motion[9].min()) - _CLEARANCE) / FOOT
        put(fdm, self.motion[:, 0])
        self.aircraft.start_engines(fdm)
        fdm.run_ic()
        return fdm, steps

    def along(self) -> Iterator[tuple[int, Any]]:
        """Yield JSBSim in the motion and with the effectors of every sample."""
        record = self.record
        names, prescribed = [], []
        for name in record.group("effector"):
            where = self.aircraft.where(name)
            if not where:
                raise DataError(
                    f"the aircraft has no effector '{name}'",
                    where=self.name,
                    remedy="name effectors as in fcs/<name>-pos-rad: elevator, aileron, rudder, throttle",
                )
            names.append(name)
            prescribed += [p for p, _ in where]
        fdm, steps = self.ready(tuple(prescribed))
        places = record.matrix(f"effector/{n}" for n in names).reshape(len(names), record.time.size)

        def move(k: int) -> None:
            put(fdm, self.motion[:, k])
            for name, value in zip(names, places[:, k], strict=True):
                place(fdm, self.aircraft.where(name), value)
            fdm.run_ic()

        move(0)
        for _ in range(int(_ENGINES / fdm.get_delta_t())):  # to the speed they start with
            move(0)
            fdm.run()
        for k in range(record.time.size):
            move(k)
            yield k, fdm
            for _ in range(steps):
                fdm.run()
