"""Figures of merit of a study that its page shows: densities, and when parameters have settled."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from freqid.blend.corridor_study import StudiedPoint, distinct_densities
from freqid.core.arrays import Array
from freqid.identify.in_flight.parameter_history import ParameterHistory


def densities(points: tuple[StudiedPoint, ...]) -> list[float]:
    """Return the air densities of some points, the densest first; those within 2 % are one. kg/m3."""
    return distinct_densities(p.model.reference.rho for p in points)


def settled(history: ParameterHistory) -> NDArray[np.bool_]:
    """Return which parameters stay within two final standard errors of their final value, shape (k, p).

    From each time on, that is: a parameter that leaves again has not settled before.
    """
    near = np.abs(history.estimate - history.estimate[-1]) <= 2 * history.std_error[-1]
    return np.logical_and.accumulate(near[::-1])[::-1]


def settled_share(histories: Mapping[str, ParameterHistory]) -> tuple[Array, Array]:
    """Return the share of the parameters of all responses that have settled, against time.

    Returns
    -------
    time, share : ndarray, shape (k,)
        s, and shares of one; from where the parameters of every response are known.
    """
    count = min(h.time.size for h in histories.values())
    done = np.hstack([settled(h)[-count:] for h in histories.values()])
    return next(iter(histories.values())).time[-count:], done.mean(axis=1)
