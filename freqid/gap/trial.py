"""A simulation beside one manoeuvre: what was measured, what is predicted, and what changes make of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from freqid.core.record import FlightRecord, Maneuver
from freqid.gap.histories import Histories
from freqid.gap.residual import measured_part
from freqid.gap.simulation import Simulation

Array = NDArray[np.float64]

_REMEMBERING = ("callable", "fmu")  # kinds that are asked again


@dataclass(frozen=True, eq=False)
class Trial:
    """A simulation beside one manoeuvre, and what is computed of the pair once.

    Attributes
    ----------
    simulation : Simulation
    maneuver : Maneuver
    measured : Histories
    predicted : ndarray, shape (response, sample)
    positions : dict of ndarray
        That the simulation makes of the commands.
    inputs : tuple of str
        Channels by which `gradient` differentiates.
    """

    simulation: Simulation
    maneuver: Maneuver
    measured: Histories
    predicted: Array
    positions: dict[str, Array]
    inputs: tuple[str, ...]

    @classmethod
    def of(cls, simulation: Simulation, maneuver: Maneuver) -> Trial:
        """Replay a simulation on a manoeuvre.

        Raises
        ------
        DataError
            Where the record lacks what either needs.
        """
        positions = simulation.positions(maneuver.record)
        measured = measured_part(maneuver, simulation.responses, tuple(positions))
        predicted = simulation.predict(maneuver.record)
        inputs = inputs_of(simulation, maneuver.record)
        return cls(simulation, maneuver, measured, predicted, positions, inputs)

    @cached_property
    def gradient(self) -> Array:
        """Derivatives of the responses, shape (response, input, sample); not all that is asked needs them."""
        return self.simulation.gradient(self.maneuver.record, self.inputs)

    def rows(self, responses: Array | None = None, positions: Mapping[str, Array] | None = None) -> Histories:
        """Return histories in the residual's rows of responses, shape (response, sample), and positions."""
        direct = np.zeros_like(self.measured.direct)
        if responses is not None:
            direct[: len(responses)] = responses
        for i, row in enumerate(self.measured.rows):
            name = row.name.partition("/")[2]
            if row.kind == "actuator" and positions is not None and name in positions:
                direct[i] = positions[name]
        return Histories(self.measured.rows, direct, np.zeros_like(direct))

    @property
    def residual(self) -> Histories:
        """Measured less simulated."""
        return self.measured - self.rows(self.predicted, self.positions)

    def moved(self, changes: Mapping[str, Array]) -> Array:
        """Return what changes of input channels make of the responses.

        To first order, except where a simulation may have a memory, which no derivative at one instant has.
        """
        if self.simulation.kind in _REMEMBERING:
            record = self.maneuver.record
            channels = [
                replace(record.channel(n), values=record[n] + x) for n, x in changes.items() if n in record
            ]
            return self.simulation.predict(record.with_channels(*channels)) - self.predicted
        known = [(j, changes[name]) for j, name in enumerate(self.inputs) if name in changes]
        return sum((self.gradient[:, j] * x for j, x in known), np.zeros_like(self.predicted))


def inputs_of(simulation: Simulation, record: FlightRecord) -> tuple[str, ...]:
    """Return the channels that a simulation's responses may depend on and that move."""
    names = [f"state/{n}" for n in ("u", "v", "w", "p", "q", "r")]
    if simulation.kind in ("callable", "fmu") or "state/u" not in record:
        names += [f"air/{n}" for n in ("V", "alpha", "beta")]
    names += [f"effector/{n}" for n in record.group("effector")]
    return tuple(n for n in names if n in record and np.ptp(record[n]) > 0)
