"""The lines of a design: harmonics of 1/T, and the complex amplitudes that its effectors have on them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import UsageError
from freqid.core.results.design import MultisineDesign


def band_lines(design: MultisineDesign) -> NDArray[np.int64]:
    """Return the harmonics of 1/T in the design's band, excited or not: the lines of an identification.

    Returns
    -------
    ndarray of int, shape (line,)
        Ascending.

    Raises
    ------
    UsageError
        Where a signal has a harmonic outside the band.
    """
    low, high = (limit * design.period_s for limit in design.band_hz)
    lines = np.arange(max(int(np.ceil(low - 1e-9)), 1), int(np.floor(high + 1e-9)) + 1)
    for signal in design.signals:
        stray = np.setdiff1d(signal.index, lines)
        if stray.size:
            raise UsageError(
                f"harmonic {stray[0]} of '{signal.name}', {stray[0] / design.period_s:g} Hz, is outside the "
                f"band of {design.band_hz[0]:g} to {design.band_hz[1]:g} Hz",
                remedy="widen band_hz or drop the harmonic",
            )
    return lines


def tones(design: MultisineDesign, lines: NDArray[np.int64]) -> NDArray[np.complex128]:
    """Return complex amplitudes c, ``u(t) = sum_k Im(c_k exp(j 2 pi k t / T))``, shape (effector, line).

    Parameters
    ----------
    design : MultisineDesign
    lines : ndarray of int, shape (line,)
        Ascending harmonics, among them all of the design's.
    """
    c = np.zeros((len(design.signals), lines.size), dtype=complex)
    for row, signal in zip(c, design.signals, strict=True):
        # Added, not set: tones that a user lists twice on a harmonic add up in flight too.
        np.add.at(row, np.searchsorted(lines, signal.index), signal.amplitude * np.exp(1j * signal.phase))
    return c
