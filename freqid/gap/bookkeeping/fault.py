"""A mistake as what would take it back, and a record beside which predictions are laid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from freqid.core.arrays import Array
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.units import STANDARD_GRAVITY
from freqid.dynamics.frames import level_from_body

Mend = Callable[[FlightRecord], FlightRecord]

RADIAN = 180 / np.pi  # degrees


@dataclass(frozen=True)
class Fault:
    """One mistake; either `mend` or `undo` takes it back.

    Attributes
    ----------
    id : str
    subject : str
        Responses or channels that it is about.
    sentence, remedy : str
    rows : tuple of int
        Responses that it touches and is judged by; empty where the change itself tells.
    mend : callable, optional
        ``mend(record) -> record``: what the simulation has to be given instead.
    undo : callable, optional
        ``undo(predicted, bench) -> predicted``, shape (response, sample).
    """

    id: str
    subject: str
    sentence: str
    remedy: str
    rows: tuple[int, ...] = ()
    mend: Mend | None = None
    undo: Callable[[Array, Bench], Array] | None = None


@dataclass(frozen=True, eq=False)
class Bench:
    """A record beside which predictions are laid.

    Attributes
    ----------
    maneuver : Maneuver
    names : tuple of str
        Responses, one for each row.
    measured : ndarray, shape (response, sample)
    """

    maneuver: Maneuver
    names: tuple[str, ...]
    measured: Array

    @property
    def record(self) -> FlightRecord:
        """The manoeuvre's record."""
        return self.maneuver.record

    def rows(self, names: str) -> tuple[int, ...]:
        """Return the rows of responses, written with blanks between."""
        return tuple(self.names.index(n) for n in names.split() if n in self.names)

    def weight(self) -> Array:
        """Return the weight in body axes, N, shape (3, sample)."""
        turn = level_from_body(self.record.matrix(("state/phi", "state/theta", "state/psi")))
        return self.maneuver.vehicle.mass_properties.mass_kg * STANDARD_GRAVITY * turn[2]
