"""What a diagnosis asks of a simulation, whoever wrote it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle

Array = NDArray[np.float64]
Settings = Mapping[str, Mapping[str, float]]
Asked = TypeVar("Asked")
Told = TypeVar("Told")

_IN_THREADS = ("scenario",)  # kinds in which nothing changes when they are asked


class Simulation(Protocol):
    """A simulation that is replayed on what an aircraft flew; ``connect/`` holds one adapter a file.

    Attributes
    ----------
    name : str
        For messages and reports.
    kind : {"scenario", "callable", "predictions", "fmu", "jsbsim"}
    responses : tuple of str
        What it predicts: among X Y Z L M N, N and N m about the instantaneous centre of gravity, their
        coefficients CX ... Cn, or state channels such as q.
    vehicle : Vehicle or None
        As the simulation has it; None where it does not say.
    effects : dict of dict of float
        Effects that it models itself, with the settings in force: these are tested as errors in them.
    parts : tuple of str
        Fields that effects may need and the vehicle does not have, ``simulation.airframe.wake`` for one.
    """

    @property
    def name(self) -> str:
        """For messages and reports."""
        ...

    @property
    def kind(self) -> str:
        """Which adapter it came through."""
        ...

    @property
    def responses(self) -> tuple[str, ...]:
        """What it predicts."""
        ...

    @property
    def vehicle(self) -> Vehicle | None:
        """As the simulation has it."""
        ...

    @property
    def effects(self) -> Settings:
        """What it models itself, with the settings in force."""
        ...

    @property
    def parts(self) -> tuple[str, ...]:
        """Fields that effects may need beside the vehicle's."""
        ...

    def predict(self, record: FlightRecord, effects: Settings | None = None) -> Array:
        """Return the responses on the record's own states and effector positions, shape (response, sample).

        Parameters
        ----------
        record : FlightRecord
        effects : dict of dict of float, optional
            In place of the settings in force.

        Raises
        ------
        DataError
            Where the record lacks a channel, or the prediction is not finite or has a wrong shape.
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

    def positions(self, record: FlightRecord, effects: Settings | None = None) -> dict[str, Array]:
        """Return the positions that its actuators make of the record's commands, by effector name.

        Empty where the simulation has no actuators; then no effect of theirs can be tested.
        """
        ...

    def fly(self, record: FlightRecord, effects: Settings | None = None) -> dict[str, Array] | None:
        """Return the state channels of its own flight under the record's injected signals, by name.

        None where it cannot fly. In closed loop where the simulation has a control law: then what the law
        made of it too, as ``effector/NAME`` and ``command/NAME``.

        Raises
        ------
        DataError
            Where it diverges, with the time.
        """
        ...


def side_by_side(simulation: Simulation, work: Callable[[Asked], Told], asked: Iterable[Asked]) -> list[Told]:
    """Return what is made of each, in order: on all cores where the simulation may be asked in threads."""
    if simulation.kind not in _IN_THREADS:
        return [work(a) for a in asked]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(work, asked))
