"""Expected excursions: what states, effectors and loads do while a design is flown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.results.design import ClassicDesign, MultisineDesign
from freqid.design.forecast.closed_loop import PerturbedAircraft
from freqid.design.multisine.signals import PEAK_POINTS, band_lines, sample, samples_per_period, tones

NEGLIGIBLE = 1e-4  # lines of a classic input below this share of its largest are left out, to save time


@dataclass(frozen=True, eq=False)
class Excursions:
    """One period of the periodic motion about the trim, feedback included.

    Of classic inputs, the period is one sequence of all effectors.

    Attributes
    ----------
    names, units : tuple of str
        Channels, and their SI units.
    time : ndarray, shape (sample,)
        s; fine enough that peaks show, of multisines at least 64 samples in the shortest period.
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
    design: MultisineDesign | ClassicDesign,
    loop: PerturbedAircraft,
    channels: Sequence[str],
    *,
    rate: bool = False,
) -> Excursions:
    """Predict the motion that a design excites.

    Parameters
    ----------
    design : MultisineDesign or ClassicDesign
    loop : PerturbedAircraft
    channels : sequence of str
        As in `PerturbedAircraft.rows`: states, effectors, ``X`` to ``N`` for net loads.
    rate : bool
        Whether to return the channels' rates of change instead.

    Returns
    -------
    Excursions

    Notes
    -----
    Steady state of the linear model. What the first seconds add decays with the modes of the loop. Classic
    inputs are taken as repeated for ever, which is exact where the motion dies away within a rest.
    """
    if isinstance(design, MultisineDesign):
        lines, names, duration = band_lines(design), design.names, design.period_s
        driven, samples = tones(design, lines), samples_per_period(lines, PEAK_POINTS)
    else:
        names, duration, lines, driven, samples = _sequence_tones(design)
    frequencies = lines / duration
    c = loop.rows(channels) @ loop.motion(names, driven, frequencies)
    units = loop.units(channels)
    if rate:
        c, units = c * (2j * np.pi * frequencies), tuple(f"{unit}/s" for unit in units)
    time = np.linspace(0.0, duration, samples, endpoint=False)
    return Excursions(tuple(channels), units, time, sample(lines, c, 0.0, samples))


def _sequence_tones(
    design: ClassicDesign,
) -> tuple[tuple[str, ...], float, NDArray[np.int64], NDArray[np.complex128], int]:
    """Return effectors, duration, lines, complex amplitudes and samples of one sequence."""
    samples = design.inputs.time.size // design.periods
    driven = 2j / samples * np.fft.rfft(design.inputs.values[:, :samples])
    size = np.abs(driven).max(axis=1, keepdims=True)
    lines = np.flatnonzero((np.abs(driven) > NEGLIGIBLE * size).any(axis=0))
    return design.names, design.period_s, lines, driven[:, lines], samples
