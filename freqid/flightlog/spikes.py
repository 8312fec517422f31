"""Samples that stand out from both neighbours: left out where it is asked for, and counted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LONGEST = 2  # samples of one spike; what lasts longer may be a motion
_HALF = LONGEST  # window of 2 * _HALF + 1 samples: a spike never is its median
FACTOR = 8.0  # robust standard deviations: a normal residual exceeds it once in 1e15 samples
_LOCAL = 50  # samples on either side over which the usual size of the residual is taken


def find_spikes(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which samples of a channel are spikes.

    Parameters
    ----------
    values : ndarray, shape (sample,)
        NaN where a sample is missing.

    Returns
    -------
    ndarray of bool, shape (sample,)
        Samples that differ from the running median of five by more than `FACTOR` times what samples usually
        differ by from the median of their four neighbours: the robust standard deviation over the whole
        channel, over the 100 samples around, or the smallest step of the channel, whichever is largest.

    Notes
    -----
    The median of five removes what lasts one or two samples and passes steps and slow motion; the median of
    the neighbours alone also differs from a sample by noise and curvature, so it tells the usual size. This
    is the Hampel filter (R. K. Pearson, "Mining Imperfect Data", SIAM 2005) with a scale that a quiet stretch
    cannot shrink.
    """
    spikes = np.zeros(values.shape, dtype=bool)
    present = np.flatnonzero(np.isfinite(values))
    x = values[present]
    if x.size < 2 * _HALF + 1:
        return spikes
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(x, _HALF, mode="reflect", reflect_type="odd"), 2 * _HALF + 1
    )
    residual = np.abs(x - np.median(windows, axis=1))
    neighbours = np.delete(windows, _HALF, axis=1)
    usual = np.abs(x - np.median(neighbours, axis=1))
    steps = np.abs(np.diff(x))
    resolution = float(steps[steps > 0].min(initial=np.inf))
    if not np.isfinite(resolution):
        return spikes
    everywhere = 1.4826 * float(np.median(usual))
    width = min(2 * _LOCAL + 1, x.size)
    blocks = np.lib.stride_tricks.sliding_window_view(usual, width)[:: max(1, _LOCAL)]
    centres = np.arange(len(blocks)) * max(1, _LOCAL) + width // 2
    around = 1.4826 * np.interp(np.arange(x.size), centres, np.median(blocks, axis=1))
    limit = FACTOR * np.maximum(np.maximum(everywhere, around), resolution)
    # A spike shifts the median of the samples beside it: these are compared with what is left without it.
    suspects = np.flatnonzero(residual > limit)
    others = np.delete(np.arange(x.size), suspects)
    if suspects.size and others.size > 1:
        away = np.abs(x[suspects] - np.interp(suspects, others, x[others]))
        spikes[present[suspects]] = away > limit[suspects]
    return spikes
