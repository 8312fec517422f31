"""Expected excursions: what states, effectors and loads do while a design is flown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.design import MultisineDesign
from freqid.design.closed_loop import ClosedLoop
from freqid.design.lines import band_lines, tones
from freqid.design.signals import PEAK_POINTS, sample, samples_per_period

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Excursions:
    """One period of the periodic motion about the trim, feedback included.

    Attributes
    ----------
    names, units : tuple of str
        Channels, and their SI units.
    time : ndarray, shape (sample,)
        s; at least 64 samples in the shortest period, so that peaks show.
    values : ndarray, shape (channel, sample)
        Deviation from the trim.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    time: Array
    values: Array

    @property
    def rms(self) -> Array:
        """Root mean square, shape (channel,)."""
        return np.sqrt(np.mean(self.values**2, axis=1))

    @property
    def peak(self) -> Array:
        """Largest magnitude, shape (channel,)."""
        return np.abs(self.values).max(axis=1)


def excursions(
    design: MultisineDesign, loop: ClosedLoop, channels: Sequence[str], *, rate: bool = False
) -> Excursions:
    """Predict the motion that a design excites.

    Parameters
    ----------
    design : MultisineDesign
    loop : ClosedLoop
    channels : sequence of str
        As in `ClosedLoop.rows`: states, effectors, ``X`` to ``N`` for net loads.
    rate : bool
        Whether to return the channels' rates of change instead.

    Returns
    -------
    Excursions

    Notes
    -----
    Steady state of the linear model. What the first seconds add decays with the modes of the loop.
    """
    lines = band_lines(design)
    frequencies = lines / design.period_s
    c = loop.rows(channels) @ loop.motion(design.names, tones(design, lines), frequencies)
    units = loop.units(channels)
    if rate:
        c, units = c * (2j * np.pi * frequencies), tuple(f"{unit}/s" for unit in units)
    samples = samples_per_period(lines, PEAK_POINTS)
    time = np.linspace(0.0, design.period_s, samples, endpoint=False)
    return Excursions(tuple(channels), units, time, sample(lines, c, 0.0, samples))
