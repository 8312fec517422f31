"""A set of orthogonal multisine inputs: harmonics, amplitudes and phases by effector."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Multisine:
    """The excitation of one effector, ``sum_k amplitude_k sin(2 pi index_k t / T + phase_k)``.

    Attributes
    ----------
    name, unit : str
        Effector and its SI unit.
    index : ndarray of int, shape (tone,)
        Harmonics of 1/T.
    amplitude : ndarray, shape (tone,)
        In `unit`.
    phase : ndarray, shape (tone,)
        rad.
    """

    name: str
    unit: str
    index: NDArray[np.int64]
    amplitude: Array
    phase: Array


@dataclass(frozen=True)
class MultisineDesign:
    """What is to be flown.

    Attributes
    ----------
    signals : tuple of Multisine
    period_s : float
        Fundamental period T.
    periods : int
        How many are flown.
    band_hz : tuple of 2 floats
    dt_s : float
        Interval at which it is sampled.
    seed : int
    provenance : dict
        JSON-compatible.
    """

    signals: tuple[Multisine, ...]
    period_s: float
    periods: int
    band_hz: tuple[float, float]
    dt_s: float
    seed: int
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Effectors, in order."""
        return tuple(signal.name for signal in self.signals)

    @property
    def duration_s(self) -> float:
        """Of all periods together, s."""
        return self.period_s * self.periods
