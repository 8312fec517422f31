"""Named departures of many flights from the nominal truth, as arrays with one value for each flight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray


class Settings:
    """Departures by name, such as ``mass.fraction`` or ``backlash.width@elev``.

    Parameters
    ----------
    flights : sequence of dict
        For each flight, the departures that are not zero.
    """

    def __init__(self, flights: Sequence[Mapping[str, float]]) -> None:
        self.count = len(flights)
        self.names = {name for flight in flights for name, value in flight.items() if value}
        self._flights = flights
        self._made: dict[str, NDArray[np.float64]] = {}

    def __call__(self, name: str) -> NDArray[np.float64] | float:
        """Return one departure, shape (flight,), or plain 0.0 where no flight has it."""
        if name not in self.names:
            return 0.0
        if name not in self._made:
            self._made[name] = np.array([flight.get(name, 0.0) for flight in self._flights])
        return self._made[name]

    def has(self, *prefixes: str) -> bool:
        """Return whether any flight has a departure whose name starts so."""
        return any(name.startswith(prefixes) for name in self.names)

    def of_all(self, name: str, places: Sequence[str]) -> NDArray[np.float64]:
        """Return what `name` and ``name@place`` make together, shape (place, flight)."""
        out = np.zeros((len(places), self.count))
        out += self(name)
        for i, place in enumerate(places):
            out[i] += self(f"{name}@{place}")
        return out
