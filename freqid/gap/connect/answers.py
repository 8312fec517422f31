"""What somebody else's simulation answered, checked before anything is concluded from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import RESPONSE, STATE
from freqid.core.errors import DataError, nearest

Array = NDArray[np.float64]

KNOWN = {**RESPONSE, **STATE}


def stacked(
    found: Any, time: Array, where: str, expected: Sequence[str] = ()
) -> tuple[tuple[str, ...], Array]:
    """Return the names and the rows of a dictionary of predicted responses.

    Parameters
    ----------
    found : object
        Should be a dictionary of arrays of the record's length.
    time : ndarray, shape (sample,)
    where : str
        Which simulation, for errors.
    expected : sequence of str, optional
        Names that must be there, and their order; all that are there where empty.

    Returns
    -------
    names : tuple of str
        Among the record's responses and states.
    rows : ndarray, shape (response, sample)

    Raises
    ------
    DataError
        Where it is no dictionary, is empty, has a name that no channel has, lacks one, or an array has
        another shape, no numbers, or is not finite.
    """
    if not isinstance(found, Mapping):
        raise DataError(
            f"the simulation returned {type(found).__name__}, expected a dictionary of arrays by response",
            where=where,
            remedy='return {"X": array, ...}',
        )
    for name in found:
        if name not in KNOWN:
            raise DataError(
                f"the simulation returned '{name}', which is no response and no state",
                where=where,
                remedy=nearest(str(name), KNOWN),
            )
    names = tuple(expected) or tuple(found)
    if not names:
        raise DataError("the simulation returned no response", where=where, remedy="return at least one")
    missing = [name for name in names if name not in found]
    if missing:
        raise DataError(
            f"the simulation returned no '{missing[0]}', which it says it predicts",
            where=where,
            remedy=f"it returned {', '.join(map(str, found)) or 'nothing'}",
        )
    return names, np.array([row(found[name], name, time, where) for name in names])


def row(values: Any, name: str, time: Array, where: str) -> Array:
    """Return one predicted signal, shape (sample,); a single number is held. Errors as in `stacked`."""
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise DataError(
            f"what the simulation returned as '{name}' is no array of numbers but {type(values).__name__}",
            where=where,
        ) from None
    if found.ndim == 0:
        found = np.full(time.shape, float(found))
    if found.shape != time.shape:
        raise DataError(
            f"what the simulation returned as '{name}' has shape {found.shape}, expected {time.shape}",
            where=where,
        )
    bad = np.flatnonzero(~np.isfinite(found))
    if bad.size:
        raise DataError(
            f"what the simulation returned as '{name}' is not finite in {bad.size} of {time.size} samples, "
            f"first at t = {time[bad[0]]:.4g} s",
            where=where,
            remedy="check what it does with the states and positions of that time",
        )
    return found
