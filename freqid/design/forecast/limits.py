"""How far and how fast effectors, states and loads may go, and what amplitudes that leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.results.design import MultisineDesign
from freqid.core.vehicle import Vehicle
from freqid.design.forecast.closed_loop import PerturbedAircraft
from freqid.design.multisine.signals import PEAK_POINTS, band_lines, sample, samples_per_period, tones


def effector_travel(
    vehicle: Vehicle, names: Sequence[str], trim: Mapping[str, float]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return how far effectors may go from their trim, and how fast.

    Parameters
    ----------
    vehicle : Vehicle
    names : sequence of str
        Effectors.
    trim : mapping of str to float
        Positions; zero where absent.

    Returns
    -------
    allowed : dict of str to float
        Distance to the nearer limit, unit of the effector.
    allowed_rate : dict of str to float
        Of those that have a rate limit, unit per s.

    Raises
    ------
    UsageError
        Where an effector is unknown, or its trim is not between its limits.
    """
    allowed = {}
    effectors = [vehicle.effector(name) for name in names]
    for effector in effectors:
        at, (low, high) = trim.get(effector.name, 0.0), effector.limits
        if not low < at < high:
            raise UsageError(
                f"the trim of '{effector.name}' is {at:g} {effector.unit}, expected {low:g} to {high:g}",
                remedy="give the position that it is flown at, or correct its limits",
            )
        allowed[effector.name] = min(at - low, high - at)
    return allowed, {e.name: e.rate_limit for e in effectors if e.rate_limit is not None}


class PeakLimits:
    """Channels over their limits as linear functions of the scales of the signals, at any moment.

    Parameters
    ----------
    design : MultisineDesign
        Of scale one.
    loop : PerturbedAircraft
    owner : ndarray of int, shape (line,)
        Effector that excites each line of the band, -1 where none does.
    allowed, allowed_rate : mapping of str to float
        Largest deviation from the trim, and largest rate of change, by channel, SI.

    Attributes
    ----------
    names : tuple of str, length channel
        The limited channels, those of rates as ``rate of ...``.
    alone : ndarray, shape (effector,)
        Scale at which an effector, excited by itself, is the first to meet a limit.

    Raises
    ------
    UsageError
        Where a limit is not positive, or nothing limits an effector.
    """

    def __init__(
        self,
        design: MultisineDesign,
        loop: PerturbedAircraft,
        owner: NDArray[np.int64],
        allowed: Mapping[str, float],
        allowed_rate: Mapping[str, float],
    ):
        for name, limit in (*allowed.items(), *allowed_rate.items()):
            if not limit > 0:
                raise UsageError(f"'{name}' is allowed {limit:g}, expected a positive excursion")
        self.names = (*allowed, *(f"rate of {name}" for name in allowed_rate))
        self.lines, excited = band_lines(design), owner >= 0
        frequencies = self.lines / design.period_s
        # Each line has one owner, so that what moves on it scales with that owner's signal alone.
        moved = loop.rows((*allowed, *allowed_rate)) @ loop.motion(
            design.names, tones(design, self.lines), frequencies
        )
        moved[len(allowed) :] *= 2j * np.pi * frequencies
        self.tones = moved / np.array([*allowed.values(), *allowed_rate.values()])[:, None]
        self.owner = np.where(excited, owner, 0)  # their tones are zero where nothing is excited
        self.incidence = np.eye(len(design.signals))[self.owner] * excited[:, None]
        self.samples = samples_per_period(self.lines, PEAK_POINTS)
        alone = np.array([self.peaks(row).max(initial=0.0) for row in np.eye(len(design.signals))])
        if not alone.all():
            name = design.names[int(np.argmin(alone))]
            raise UsageError(
                f"nothing limits '{name}'", remedy="allow it, or what it moves, an excursion that is finite"
            )
        self.alone = 1 / alone

    def histories(self, scale: Array) -> Array:
        """Return channels over their limits, shape (channel, sample)."""
        return sample(self.lines, self.tones * scale[self.owner], 0.0, self.samples)

    def peaks(self, scale: Array) -> Array:
        """Return the largest magnitudes over the limits, shape (channel,)."""
        return np.abs(self.histories(scale)).max(axis=1)

    def starts(self) -> list[Array]:
        """Return two sets of scales inside the limits: proportions as given, and as each alone may have."""
        return [scale / self.peaks(scale).max() for scale in (np.ones_like(self.alone), self.alone)]

    def cuts(self, scale: Array, level: float) -> Array:
        """Return rows g, ``g @ scale <= 1``, of the local extremes above a level, shape (cut, effector)."""
        y = self.histories(scale)
        size = np.abs(y)
        top = (size > level) & (size >= np.roll(size, 1, axis=1)) & (size > np.roll(size, -1, axis=1))
        channel, moment = np.nonzero(top)
        angle = np.outer(2 * np.pi * moment / self.samples, self.lines)
        rows = (self.tones[channel] * np.exp(1j * angle)).imag @ self.incidence
        return rows * np.sign(y[channel, moment])[:, None]
