"""A simulation about its likeliest parameters, an effect acting or none, not about its nominal ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, cast

from freqid.core.arrays import Array
from freqid.core.record import FlightRecord
from freqid.gap.connect.differences import central
from freqid.gap.simulation import Departures, Settings, Simulation

_BY_DIFFERENCES = ("callable", "fmu")
"""Kinds whose derivatives are differences of what they predict."""


@dataclass(frozen=True, eq=False)
class Departed:
    """A simulation about other values of its own parameters.

    What an offset of a rotor's speed makes depends on the rotor's thrust. So columns are made about the
    likeliest parameters: about nominal ones, what an offset and a tolerance make together is in no column.
    The same holds for an effect that is large: without the slipstream a wing feels an offset of the airspeed
    less.

    Attributes
    ----------
    nominal : Simulation
    departures : dict of float
        Of its own parameters from nominal; what is asked for beside them adds up.
    acting : dict of dict of float
        Effects of its own that act, by id with all their parameters; `effects` are still the nominal ones.
    """

    nominal: Simulation
    departures: Departures
    acting: Settings = field(default_factory=dict)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.nominal, name)

    @property
    def undeparted(self) -> Simulation:
        """The simulation with nominal parameters, the same effects acting."""
        return cast(Simulation, Departed(self.nominal, {}, self.acting)) if self.acting else self.nominal

    @cached_property
    def _asked(self) -> Simulation:
        own: Any = self.nominal  # one that has effects can be asked with them
        return own.acting_with(self.acting) if self.acting else own

    def _at(self, departures: Departures | None) -> dict[str, float]:
        added = dict(self.departures)
        for name, x in (departures or {}).items():
            added[name] = added.get(name, 0.0) + x
        return added

    def predict(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> Array:
        """Return the responses; see `Simulation.predict`."""
        return self._asked.predict(record, effects, self._at(departures))

    def sensitivity(
        self, record: FlightRecord, sizes: Departures, departures: Departures | None = None
    ) -> Array:
        """Return what further departures make, one at a time; see `Simulation.sensitivity`."""
        return self._asked.sensitivity(record, sizes, self._at(departures))

    def gradient(self, record: FlightRecord, inputs: Sequence[str]) -> Array:
        """Return the derivatives of the responses; those of the nominal one where it has its own."""
        if self.nominal.kind in _BY_DIFFERENCES:
            return central(self.predict, record, inputs)
        return self._asked.gradient(record, inputs)

    def positions(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> dict[str, Array]:
        """Return the positions of its actuators; see `Simulation.positions`."""
        return self._asked.positions(record, effects, self._at(departures))

    def fly(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> dict[str, Array] | None:
        """Return its own flight; see `Simulation.fly`."""
        return self._asked.fly(record, effects, self._at(departures))
