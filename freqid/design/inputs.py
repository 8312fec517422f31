"""Inputs as samples: what classic manoeuvres are made as, and what designs are exported as."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class SampledInputs:
    """Excitations of effectors on a common, uniform time axis.

    Attributes
    ----------
    names, units : tuple of str
        Effectors and their SI units.
    time : ndarray, shape (sample,)
        s, from zero.
    values : ndarray, shape (effector, sample)
        To be added to the trim, in `units`.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    time: NDArray[np.float64]
    values: NDArray[np.float64]
