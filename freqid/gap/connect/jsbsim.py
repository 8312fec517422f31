"""A JSBSim aircraft as a simulation: ``jsbsim:c172p``, or an aircraft's XML file.

JSBSim runs along the record: at every sample it is put into the recorded motion, its effectors are where
the record says, and forces and moments are read; engines, which cannot be put anywhere, run on from their
throttle. So that the flight control system does not move the effectors again, its outputs to the recorded
ones are taken out of a working copy of the aircraft.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import WRENCH
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.gap.connect import answers
from freqid.gap.connect.differences import size
from freqid.gap.connect.feedback import HEARD, law
from freqid.gap.connect.flow import RATES
from freqid.gap.connect.jsbsim_aircraft import SETTLED, JsbsimAircraft
from freqid.gap.connect.jsbsim_properties import (
    FOOT,
    STATES,
    command,
    effector_name,
    loads,
    place,
    put,
    states,
)
from freqid.gap.connect.jsbsim_run import INTEGRATORS, JsbsimRun
from freqid.gap.simulation import Settings

Array = NDArray[np.float64]

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

    def predict(self, record: FlightRecord, effects: Settings | None = None) -> Array:
        """Return the wrench about the centre of gravity, shape (6, sample)."""
        self._has_none(effects)
        rows = [loads(fdm) for _, fdm in self._run(record).along()]
        if not np.isfinite(rows).all():
            self.aircraft.forget()
        return answers.stacked(dict(zip(WRENCH, np.array(rows).T, strict=True)), record.time, self.name)[1]

    def gradient(self, record: FlightRecord, inputs: Sequence[str]) -> Array:
        """Return derivatives, shape (6, input, sample): central differences each tenth of a second.

        Engine speeds are held; channels that JSBSim does not feel have zeros.
        """
        run = self._run(record)
        felt = [(i, n) for i, n in enumerate(inputs) if n in _FELT or n.startswith("effector/")]
        steps = {name: size(record[name]) for _, name in felt}
        every = max(1, int(1 / (_GRID_HZ * record.dt)))
        grid, found = [], []
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
                slopes[:, i] = np.subtract(*pair) / (2 * steps[name])
            put(fdm, run.motion[:, k])
            fdm.run_ic()
            grid.append(record.time[k])
            found.append(slopes)
        table = np.array(found)
        return np.array(
            [[np.interp(record.time, grid, table[:, r, i]) for i in range(len(inputs))] for r in range(6)]
        )

    def positions(self, record: FlightRecord, effects: Settings | None = None) -> dict[str, Array]:
        """Return what the flight control system makes of the commands, the motion held still."""
        self._has_none(effects)
        names = [n for n in record.group("command") if self.aircraft.where(n)]
        if not names:
            return {}
        run = self._run(record)
        commands = np.array([run.command(n) for n in names])
        fdm, steps = run.ready(())
        for what in INTEGRATORS:
            fdm[f"simulation/integrator/{what}"] = 0
        command(fdm, names, commands[:, 0])
        for _ in range(int(SETTLED / fdm.get_delta_t())):
            fdm.run()
        out = np.empty_like(commands)
        for k in range(record.time.size):
            for j in range(1, steps + 1) if k else ():
                between = commands[:, k - 1] + (commands[:, k] - commands[:, k - 1]) * j / steps
                command(fdm, names, between)
                fdm.run()
            out[:, k] = [fdm[self.aircraft.where(n)[0][0]] for n in names]
        return dict(zip(names, out, strict=True))

    def fly(self, record: FlightRecord, effects: Settings | None = None) -> dict[str, Array]:
        """Return states, and positions of effectors, of its own flight: from its own trim, by departures.

        Where attitude and rates tell what was added to injected signals, the law that did it flies along.
        """
        import jsbsim

        self._has_none(effects)
        names = [n for n in record.group("command") if self.aircraft.where(n)]
        run = self._run(record)
        commands = np.array([run.command(n) for n in names]).reshape(len(names), -1)
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
        trim = np.array([fdm[f"fcs/{effector_name(n)}-cmd-norm"] for n in names])
        rest = np.array([run.command(n, of_law=True) for n in names]).reshape(commands.shape)
        gains, told = law(record, rest, [f"excitation/{n}" in record for n in names])
        departure = commands - np.where(told[:, None], rest, commands[:, :1])
        rows, moved = [states(fdm)], [self._placed(fdm, names)]
        heard = [STATES.index(n) for n in HEARD]
        start = np.array(rows[0])[heard]
        for k in range(1, record.time.size):
            departure[:, k] += gains @ (np.array(rows[-1])[heard] - start)
            for j in range(1, steps + 1):
                between = departure[:, k - 1] + (departure[:, k] - departure[:, k - 1]) * j / steps
                command(fdm, names, trim + between)
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

    def _run(self, record: FlightRecord) -> JsbsimRun:
        described = record.vehicle or self.vehicle
        centre = described.mass_properties.cg_m if described else (0.0, 0.0, 0.0)
        return JsbsimRun(self.aircraft, record, centre, self.name)

    def _has_none(self, effects: Settings | None) -> None:
        if effects:
            raise UsageError("a JSBSim aircraft has no effects that could be set", where=self.name)


def load(aircraft: str, vehicle: Vehicle | None = None) -> JsbsimSimulation:
    """Load an aircraft by its name or its file.

    Raises
    ------
    DataError
        Where JSBSim is not installed, or has or accepts no such aircraft.
    """
    found = JsbsimAircraft.of(aircraft)
    # described by an instance of its own, whose effectors are moved all the way
    return JsbsimSimulation(found, vehicle or JsbsimAircraft(aircraft).vehicle(), name=found.name)
