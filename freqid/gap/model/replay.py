"""What an effect may look at when it says what it would add to a simulation along a flight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import COEFFICIENT, WRENCH
from freqid.core.errors import DataError
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.vehicle import Vehicle
from freqid.gap.simulation import Simulation
from freqid.identify.loads.explanatory import history
from freqid.simulate.effects.signals import delayed, lagged


@dataclass(frozen=True, eq=False)
class Replay:
    """A simulation beside a record.

    Attributes
    ----------
    simulation : Simulation
    record : FlightRecord
        SI channels, body axes; ``replay.record["state/w"]`` is one of them.
    vehicle : Vehicle or None
    """

    simulation: Simulation
    record: FlightRecord
    vehicle: Vehicle | None
    _gradients: dict[str, Array] = field(default_factory=dict, repr=False)

    @cached_property
    def wrench(self) -> Array:
        """Simulated X Y Z L M N, N and N m, shape (6, sample); zero where not predicted."""
        return self._as_wrench(self.simulation.predict(self.record))

    def gradient(self, channel: str) -> Array:
        """Return the derivatives of the simulation's wrench by one channel, shape (6, sample)."""
        return self.gradients([channel])[0]

    def gradients(self, channels: Sequence[str]) -> Array:
        """Return the derivatives by several channels, shape (channel, 6, sample), each evaluated once."""
        new = [c for c in channels if c not in self._gradients]
        if new:
            found = self.simulation.gradient(self.record, new)
            self._gradients.update((c, self._as_wrench(found[:, i])) for i, c in enumerate(new))
        return np.array([self._gradients[c] for c in channels])

    def lagged(self, values: Array, time_constant: float) -> Array:
        """Return signals, shape (..., sample), through a first-order lag that starts in its steady state."""
        return lagged(np.asarray(values, dtype=float), self.record.dt, time_constant)

    def delayed(self, values: Array, delay: float) -> Array:
        """Return signals, shape (..., sample), a time later, s; the first value is held before the start."""
        return delayed(np.asarray(values, dtype=float), self.record.dt, delay)

    def responses(self, extra: Any) -> Array:
        """Return what an effect adds as rows of the simulation's responses, shape (response, sample).

        Parameters
        ----------
        extra : ndarray, shape (6, sample), or dict of ndarray, shape (sample,)
            X Y Z L M N, N and N m, which are divided into coefficients where the simulation gives those;
            or responses by their own names. What is not named stays as it is.

        Raises
        ------
        DataError
            Where it has another shape or names what the simulation does not give.
        """
        names, count = self.simulation.responses, self.record.time.size
        found = np.zeros((len(names), count))
        if isinstance(extra, Mapping):
            strange = [n for n in extra if n not in names]
            if strange:
                raise DataError(
                    f"an effect adds to '{strange[0]}', which {self.simulation.name} does not give"
                )
            for name, row in extra.items():
                found[names.index(name)] = row
            return found
        rows = np.asarray(extra, dtype=float)
        if rows.shape != (len(WRENCH), count):
            raise DataError(f"an effect adds an array of shape {rows.shape}, expected {(len(WRENCH), count)}")
        for i, name in enumerate(names):
            letter = COEFFICIENT.get(name, name)
            if letter in WRENCH:
                found[i] = rows[WRENCH.index(letter)] / self._size(name)
        return found

    def _size(self, name: str) -> Array | float:
        """Return what makes a load of a response: one, or dynamic pressure times area and length."""
        if name not in COEFFICIENT or self.vehicle is None:
            return 1.0
        lengths = {"Cl": self.vehicle.span_m, "Cm": self.vehicle.chord_m, "Cn": self.vehicle.span_m}
        stated = (self.vehicle.area_m2, lengths.get(name, 1.0))
        if None in stated:
            raise DataError(
                f"{name} needs area, span and chord of vehicle '{self.vehicle.name}'",
                remedy="state them in [vehicle], or give a simulation of X Y Z L M N",
            )
        return history(Maneuver(self.record, self.vehicle), "qbar") * np.prod(np.array(stated, dtype=float))

    def _as_wrench(self, rows: Array) -> Array:
        full = np.zeros((len(WRENCH), self.record.time.size))
        for name, row in zip(self.simulation.responses, rows, strict=True):
            letter = COEFFICIENT.get(name, name)
            if letter in WRENCH:
                full[WRENCH.index(letter)] = row * self._size(name)
        return full
