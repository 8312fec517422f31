"""A diagnosis of a gap with what its page is drawn from; the content of a ``freqid-gap`` file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .diagnosis import Closure, Existence, GapDiagnosis, Place, SensorFault, Which
from .gap_map import GapMap

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class ResidualSpectra:
    """One manoeuvre's residual on its lines.

    Attributes
    ----------
    maneuver : str
    rows, units : tuple of str
        ``M``, ``actuator/de1``, ``kinematic/w``.
    hz : ndarray, shape (line,)
    inputs : tuple of str
        Injected signals.
    owner : ndarray, shape (line,)
        Index of the signal that drives the line; -1 where none does.
    residual, explained : ndarray of complex, shape (row, line)
        Measured less simulated, and what the likeliest explanation makes of it; unit of the row times
        sqrt(s).
    noise : ndarray, shape (row, line)
        One standard deviation of noise, same unit.
    """

    maneuver: str
    rows: tuple[str, ...]
    units: tuple[str, ...]
    hz: Array
    inputs: tuple[str, ...]
    owner: Array
    residual: Complex
    explained: Complex
    noise: Array


@dataclass(frozen=True, eq=False)
class BeforeAfter:
    """One manoeuvre as measured, as simulated, and as simulated with the effects that were found.

    Attributes
    ----------
    maneuver : str
    held_out : bool
        Whether nothing was fitted to it.
    responses, units : tuple of str
    time : ndarray, shape (sample,)
        s.
    measured, before, after : ndarray, shape (response, sample)
        Without what lies above the band.
    hz : ndarray, shape (line,)
    measured_hz, before_hz, after_hz : ndarray of complex, shape (response, line)
        Unit of the response times sqrt(s).
    noise : ndarray, shape (response, line)
        One standard deviation, same unit.
    """

    maneuver: str
    held_out: bool
    responses: tuple[str, ...]
    units: tuple[str, ...]
    time: Array
    measured: Array
    before: Array
    after: Array
    hz: Array
    measured_hz: Complex
    before_hz: Complex
    after_hz: Complex
    noise: Array


@dataclass(frozen=True)
class Increment:
    """By how much a derivative in flight differs from the simulation's.

    Attributes
    ----------
    response, input : str
    percent, lo, hi : float
        Of the simulation's derivative, with a 95 % interval.
    """

    response: str
    input: str
    percent: float
    lo: float
    hi: float

    @property
    def clear(self) -> bool:
        """Whether the interval excludes no difference."""
        return self.lo > 0 or self.hi < 0


@dataclass(frozen=True, eq=False)
class GapResult:
    """A diagnosis and its pictures' numbers; what the diagnosis says is to be had here too.

    Attributes
    ----------
    diagnosis : GapDiagnosis
    cells : GapMap
    spectra : tuple of ResidualSpectra
        One a manoeuvre.
    coherence : dict of dict of float
        By row and injected signal: share of the residual there that noise does not account for.
    increments : tuple of Increment
        Clear ones first, largest first.
    before_after : tuple of BeforeAfter
    expected : dict of float
        By effect id: the size that is expected before any data, unit of the smallest detectable one.
    provenance : dict
    """

    diagnosis: GapDiagnosis
    cells: GapMap
    spectra: tuple[ResidualSpectra, ...] = ()
    coherence: dict[str, dict[str, float]] = field(default_factory=dict)
    increments: tuple[Increment, ...] = ()
    before_after: tuple[BeforeAfter, ...] = ()
    expected: dict[str, float] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return repr(self.diagnosis)

    def to_frame(self) -> Any:
        """Return the explanations and their probabilities as a `pandas.DataFrame`."""
        return self.diagnosis.to_frame()

    def plot(self) -> Any:
        """Return the explanations and their probabilities drawn, as a `matplotlib.figure.Figure`."""
        return self.diagnosis.plot()

    def _repr_html_(self) -> str:
        return self.diagnosis._repr_html_()

    @property
    def verdict(self) -> str:
        """One line."""
        return self.diagnosis.verdict

    @property
    def gap(self) -> Existence:
        """Whether there is a gap beyond noise and tolerances."""
        return self.diagnosis.gap

    @property
    def where(self) -> tuple[Place, ...]:
        """Where it is: responses, bands, regimes, inputs."""
        return self.diagnosis.where

    @property
    def which(self) -> Which:
        """Which effect makes it, with probabilities."""
        return self.diagnosis.which

    @property
    def how_far(self) -> tuple[Closure, ...]:
        """How much of it goes on flights that were not used."""
        return self.diagnosis.how_far

    @property
    def sensors(self) -> tuple[SensorFault, ...]:
        """Faults of the sensors."""
        return self.diagnosis.sensors

    @property
    def next_flight(self) -> dict[str, Any]:
        """The tests that separate what is left."""
        return self.diagnosis.next_flight

    @property
    def remarks(self) -> tuple[str, ...]:
        """What else to know, one sentence each."""
        return self.diagnosis.remarks

    def to_json(self) -> dict[str, Any]:
        """Return the diagnosis as ``diagnose-gap --json`` has it (docs/files.md)."""
        return self.diagnosis.to_json()
