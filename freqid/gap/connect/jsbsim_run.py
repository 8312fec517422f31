"""JSBSim along a record: started at its first sample, or held in its motion at every one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError
from freqid.core.record import FlightRecord
from freqid.gap.connect.flow import RATES, velocity
from freqid.gap.connect.jsbsim_aircraft import JsbsimAircraft
from freqid.gap.connect.jsbsim_properties import FOOT, place, put

Array = NDArray[np.float64]

INTEGRATORS = ("rate/rotational", "rate/translational", "position/rotational", "position/translational")
"""JSBSim's own, by which it moves on from one step to the next."""

_STEP = 1 / 120  # s, the longest of JSBSim's own steps
_ENGINES = 15.0  # s, until engines have the speed they start with
_CLEARANCE = 1000.0  # m, above ground: manoeuvres are flown high


@dataclass(frozen=True, eq=False)
class JsbsimRun:
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
        for what, how in zip(INTEGRATORS, (3, 4, 2, 3), strict=True):
            fdm[f"simulation/integrator/{what}"] = how
        fdm["ic/terrain-elevation-ft"] = (float(self.motion[9].min()) - _CLEARANCE) / FOOT
        put(fdm, self.motion[:, 0])
        fdm["fcs/mixture-cmd-norm"] = 1.0
        fdm["propulsion/set-running"] = -1
        fdm.run_ic()
        return fdm, steps

    def along(self) -> Iterator[tuple[int, Any]]:
        """Yield JSBSim in the motion and with the effectors of every sample."""
        record = self.record
        names, prescribed = [], []
        for name in record.group("effector"):
            found = self.aircraft.where(name)
            if not found:
                raise DataError(
                    f"the aircraft has no effector '{name}'",
                    where=self.name,
                    remedy="name effectors as in fcs/<name>-pos-rad: elevator, aileron, rudder, throttle",
                )
            names.append(name)
            prescribed += [p for p, _ in found]
        fdm, steps = self.ready(tuple(prescribed))
        places = record.matrix(f"effector/{n}" for n in names).reshape(len(names), -1)

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
