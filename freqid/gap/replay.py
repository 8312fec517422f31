"""What an effect may look at when it says what it would add to a simulation along a flight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import WRENCH
from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.gap.simulation import Simulation

Array = NDArray[np.float64]


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
        """Return signals, shape (..., sample), through a first-order lag that starts in its steady state.

        The signal is taken to be straight between samples.
        """
        from scipy.signal import lfilter, lfilter_zi

        values = np.asarray(values, dtype=float)
        if time_constant <= 0:
            return values
        ratio = self.record.dt / time_constant
        decay = np.exp(-ratio)
        # y[n] = decay y[n-1] + b0 x[n] + b1 x[n-1], exact for straight pieces
        share = (1 - decay) / ratio
        b, a = np.array([1 - share, share - decay]), np.array([1.0, -decay])
        start = lfilter_zi(b, a) * values[..., :1]
        return lfilter(b, a, values, axis=-1, zi=start)[0]

    def delayed(self, values: Array, delay: float) -> Array:
        """Return signals, shape (..., sample), a time later, s; the first value is held before the start."""
        time = self.record.time
        values = np.asarray(values, dtype=float)
        rows = [np.interp(time - delay, time, row) for row in values.reshape(-1, time.size)]
        return np.reshape(rows, values.shape)

    def _as_wrench(self, rows: Array) -> Array:
        full = np.zeros((len(WRENCH), self.record.time.size))
        for name, row in zip(self.simulation.responses, rows, strict=True):
            if name in WRENCH:
                full[WRENCH.index(name)] = row
        return full
