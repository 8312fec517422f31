"""What a diagnosis asks of a simulation, whoever wrote it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from dataclasses import dataclass
from math import isfinite
from typing import Protocol, TypeVar

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle

Settings = Mapping[str, Mapping[str, float]]
Departures = Mapping[str, float]
Item = TypeVar("Item")
Result = TypeVar("Result")

_THREAD_SAFE = ("scenario",)  # kinds whose methods change nothing that another thread reads


LARGEST_SIGMA = 1e3
"""Of a tolerance: beyond this it is a slip of a unit."""


@dataclass(frozen=True)
class Tolerance:
    """How far one of a simulation's own parameters may be from its nominal value.

    Attributes
    ----------
    sigma : float
        One standard deviation of the departure from nominal; zero of a parameter that is known exactly.
    unit : str
        Of the departure: an SI unit, or "1" where it is a share of the nominal value.
    actuator : str
        Effector whose own position is all that the parameter moves; empty where it may move anything.
    loads_only : bool
        Whether it moves no actuator: these need not be asked again.
    of_make : bool
        Whether nobody stated it of this effector: half of the variance is then of all effectors of a kind.

    Raises
    ------
    DataError
        Where sigma is no finite number from zero up, or the unit is no string.
    """

    sigma: float
    unit: str = "1"
    actuator: str = ""
    loads_only: bool = False
    of_make: bool = False

    def __post_init__(self) -> None:
        number = isinstance(self.sigma, int | float | np.number) and not isinstance(self.sigma, bool)
        if not (number and isfinite(self.sigma) and self.sigma >= 0):
            raise DataError(
                f"a tolerance has sigma {self.sigma!r}, expected a finite number from zero up",
                remedy="give one standard deviation of the parameter's departure from nominal",
            )
        if not (isinstance(self.unit, str) and self.unit):
            raise DataError(
                f"a tolerance has unit {self.unit!r}, expected a string",
                remedy="give the unit of the departure, '1' for a share of the nominal value",
            )
        object.__setattr__(self, "sigma", float(self.sigma))


def checked_departures(
    departures: Departures | None, tolerances: Mapping[str, Tolerance], where: str
) -> dict[str, float]:
    """Return departures by name, those of zero left out.

    Parameters
    ----------
    departures : dict of float or None
        In the units of the tolerances.
    tolerances : dict of Tolerance
        Of the simulation.
    where : str
        Name of the simulation, for errors.

    Raises
    ------
    UsageError
        For a name that the simulation does not have, or a departure that is not finite.
    """
    given = dict(departures or {})
    for name, value in given.items():
        if name not in tolerances:
            raise UsageError(
                f"the simulation has no parameter '{name}' of its own",
                where=where,
                remedy=nearest(name, tolerances),
            )
        if not isfinite(value):
            raise UsageError(f"the departure of parameter '{name}' is {value!r}, not finite", where=where)
    return {name: float(value) for name, value in given.items() if value}


class Simulation(Protocol):
    """A simulation that is replayed on what an aircraft flew; ``connect/`` holds one adapter a file."""

    @property
    def name(self) -> str:
        """For messages and reports."""
        ...

    @property
    def kind(self) -> str:
        """Which adapter it came through: scenario, callable, predictions, fmu or jsbsim."""
        ...

    @property
    def responses(self) -> tuple[str, ...]:
        """What it predicts.

        Among X Y Z L M N, N and N m about the instantaneous centre of gravity, their coefficients CX ... Cn,
        or state channels such as q.
        """
        ...

    @property
    def vehicle(self) -> Vehicle | None:
        """As the simulation has it; None where it does not say."""
        ...

    @property
    def effects(self) -> Settings:
        """Effects that it models itself, with the settings in force: these are tested as errors in them."""
        ...

    @property
    def parts(self) -> tuple[str, ...]:
        """Fields that effects may need beside the vehicle's, ``simulation.airframe.wake`` for one."""
        ...

    @property
    def tolerances(self) -> Mapping[str, Tolerance]:
        """Its own parameters that may be off, by name; empty where none are known."""
        ...

    @property
    def can_fly(self) -> bool:
        """Whether `fly` returns a flight."""
        ...

    @property
    def has_actuators(self) -> bool:
        """Whether `positions` may return something."""
        ...

    @property
    def gyroscopic(self) -> bool | None:
        """Whether its wrench leaves the gyroscopic moments of the vehicle's rotors to the rigid body.

        They are then subtracted from the measured moments; None where nobody said.
        """
        ...

    def predict(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> Array:
        """Return the responses on the record's own states and effector positions, shape (response, sample).

        Parameters
        ----------
        record : FlightRecord
        effects : dict of dict of float, optional
            In place of the settings in force.
        departures : dict of float, optional
            Of its own parameters from nominal, in the unit of their tolerances; zero where absent.

        Raises
        ------
        DataError
            Where the record lacks a channel, or the prediction is not finite, has a wrong shape or stands
            still while the record moves.
        UsageError
            For an effect or a parameter that the simulation does not have.
        """
        ...

    def sensitivity(
        self, record: FlightRecord, sizes: Departures, departures: Departures | None = None
    ) -> Array:
        """Return what further departures of its own parameters, one at a time, make of the responses.

        Half the difference between the responses with a parameter above and below. Errors as in `predict`.

        Parameters
        ----------
        record : FlightRecord
        sizes : dict of float
            By parameter, in the unit of its tolerance.
        departures : dict of float, optional
            From nominal, about which these are.

        Returns
        -------
        ndarray, shape (parameter, response, sample)
        """
        ...

    def gradient(self, record: FlightRecord, inputs: Sequence[str]) -> Array:
        """Return the derivatives of the responses by inputs along the record.

        Parameters
        ----------
        record : FlightRecord
        inputs : sequence of str
            Channels by ``group/name``: ``state/u``, ``effector/de1``.

        Returns
        -------
        ndarray, shape (response, input, sample)
        """
        ...

    def positions(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> dict[str, Array]:
        """Return the positions that its actuators make of the record's commands, by effector name.

        Empty where the simulation has no actuators; then no effect of theirs can be tested. Parameters as
        in `predict`.
        """
        ...

    def fly(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> dict[str, Array] | None:
        """Return the state channels of its own flight under the record's injected signals, by name.

        None where it cannot fly. Effector positions and commands of that flight, where it has them, are
        ``effector/NAME`` and ``command/NAME``. Parameters as in `predict`.

        Raises
        ------
        DataError
            Where it diverges, with the time.
        """
        ...


def side_by_side(
    simulation: Simulation, work: Callable[[Item], Result], items: Iterable[Item]
) -> list[Result]:
    """Return the results of `work` on each item, in order; on all cores where threads are allowed."""
    if simulation.kind not in _THREAD_SAFE:
        return [work(item) for item in items]
    items = list(items)
    contexts = [copy_context() for _ in items]  # numpy's `errstate` is the caller's in its threads too
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(lambda context, item: context.run(work, item), contexts, items))
