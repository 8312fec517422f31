"""A record's channels in the frequency domain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Spectrum:
    """Finite Fourier transforms of several channels on the same lines.

    Attributes
    ----------
    names : tuple of str
        One for each row.
    units : tuple of str
        SI units of the time histories; the transform carries a further second.
    frequencies_hz : ndarray, shape (frequency,)
    values : ndarray of complex, shape (channel, frequency)
        Integral of ``x(t) exp(-j 2 pi f t)`` over the record.
    duration : float
        Length T of the record, s.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    frequencies_hz: NDArray[np.float64]
    values: NDArray[np.complex128]
    duration: float
