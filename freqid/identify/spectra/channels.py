"""The one check that every function on arrays of channels begins with."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.core.errors import DataError, UsageError


def as_channels(x: ArrayLike, least: int = 1) -> NDArray[np.float64]:
    """Return x as an array of finite channels, rows contiguous in memory.

    Parameters
    ----------
    x : array_like of float, shape (channel, sample)
        Samples, any unit.
    least : int, optional
        Fewest samples that the caller can work with.

    Returns
    -------
    x : ndarray of float, shape (channel, sample)
        The same array where it already qualifies.

    Raises
    ------
    UsageError
        The shape is not (channel, sample) with `least` samples or more.
    DataError
        A sample is NaN or infinite.
    """
    x = np.ascontiguousarray(x, dtype=float)
    if x.ndim != 2 or x.shape[1] < least:
        raise UsageError(
            f"expected an array (channel, sample) with {least} samples or more, found shape {x.shape}"
        )
    finite = np.isfinite(x)
    if not finite.all():
        channel, sample = np.argwhere(~finite)[0]
        raise DataError(
            f"channel {channel} is {x[channel, sample]} at sample {sample}",
            remedy="repair the channel or cut the record around it",
        )
    return x
