"""How the power of a multisine is spread over its harmonics: flat, along a spectrum, or free near either."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.core.errors import UsageError


def limits_from_db(band_db: float) -> tuple[float, float] | None:
    """Return the lowest and highest ratio of a power to its reference for a band of +-`band_db`.

    Parameters
    ----------
    band_db : float
        dB of power, >= 0; zero means that powers are fixed.

    Returns
    -------
    limits : tuple of 2 floats, or None
        For `freqid.design.multisine.phases.lowest_peak`; None where powers are fixed.

    Raises
    ------
    UsageError
        If the band is negative or not finite.
    """
    if not 0.0 <= band_db < np.inf:
        raise UsageError(f"power free within {band_db} dB has no meaning", remedy="give 0 dB or more")
    if band_db == 0.0:
        return None
    return 10.0 ** (-band_db / 10.0), 10.0 ** (band_db / 10.0)


def fractions(
    index: ArrayLike, period_s: float, frequency_hz: ArrayLike, density: ArrayLike
) -> NDArray[np.float64]:
    """Return power fractions that follow a user's spectrum.

    Parameters
    ----------
    index : array_like of int, shape (tone,)
        Harmonics of 1/T.
    period_s : float
        T, s.
    frequency_hz : array_like, shape (point,)
        Rising, Hz; the spectrum is interpolated linearly and held beyond its ends.
    density : array_like, shape (point,)
        Relative power at those frequencies, > 0, in any scale.

    Returns
    -------
    power : ndarray, shape (tone,)
        Their sum is 1.

    Raises
    ------
    UsageError
        If frequencies do not rise or a density is not positive.
    """
    frequency_hz, density = np.asarray(frequency_hz, dtype=float), np.asarray(density, dtype=float)
    if frequency_hz.shape != density.shape or frequency_hz.ndim != 1 or frequency_hz.size == 0:
        raise UsageError(
            f"a spectrum has {frequency_hz.size} frequencies and {density.size} powers",
            remedy="give one power for each frequency",
        )
    if np.any(np.diff(frequency_hz) <= 0.0):
        raise UsageError("the frequencies of a spectrum do not rise", remedy="sort them")
    if not np.all(density > 0.0):
        raise UsageError(
            f"a spectrum has the power {density.min():g}, which leaves a harmonic without a signal",
            remedy="give powers above zero, or take those harmonics out of the set",
        )
    power = np.interp(np.asarray(index) / period_s, frequency_hz, density)
    return power / power.sum()
