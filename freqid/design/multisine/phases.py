"""Multisines with the lowest peaks: random starts, a descent that sharpens, and the best one kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.core.arrays import Array
from freqid.design.multisine.peaks import Measure, SmoothPeak, descend
from freqid.design.multisine.signals import crest_factor, relative_peak_factor, start_at_zero

# Samples per shortest period, sharpness reached, share of the starts kept. Early values already rank the
# starts (rank correlation with the final crest 0.3-0.7 at 6, 0.8-0.98 at 40), so few are finished.
# On the last two rungs the grid must be fine: between coarse samples a descent hides peaks.
_LADDER = ((8, 6.0, 0.5), (8, 15.0, 0.4), (8, 40.0, 0.4), (32, 400.0, 0.2), (64, 6000.0, 0.0))
_FEWEST = 2  # starts kept
_FIRST_SHARPNESS = 4.0  # lower, and all starts of a short comb fall into one basin, not always the best
_GROWTH = 1.8
_ITERATIONS = 6
_KICK = 0.4  # rad; larger kicks lose the basin, smaller ones fall back
_KICK_SHARPNESS = (6.0, 15.0)


@dataclass(frozen=True)
class Waveform:
    """One multisine of rms 1, ``sum_k sqrt(2 power_k) sin(index_k theta + phase_k)``.

    Attributes
    ----------
    index : ndarray of int, shape (tone,)
        Harmonics of 1/T.
    power : ndarray, shape (tone,)
        Power fractions; their sum is 1.
    phase : ndarray, shape (tone,)
        rad; the signal starts and ends at zero.
    factor : float
        Relative peak factor, or crest factor where the measure was "peak".
    """

    index: NDArray[np.int64]
    power: Array
    phase: Array
    factor: float

    @property
    def amplitude(self) -> Array:
        """Amplitudes at rms 1, shape (tone,)."""
        return np.sqrt(2.0 * self.power)


def lowest_peak(
    index: ArrayLike,
    power: ArrayLike | None = None,
    *,
    limits: tuple[float, float] | None = None,
    measure: Measure = "range",
    starts: int = 20,
    kicks: int = 0,
    seed: int | Sequence[int] = 0,
) -> Waveform:
    """Find phases, and powers where they are free, that give a multisine the lowest peaks.

    Parameters
    ----------
    index : array_like of int, shape (tone,)
        Harmonics of 1/T, all different, >= 1.
    power : array_like, shape (tone,), optional
        Power fractions, in any scale; flat where absent.
    limits : tuple of 2 floats, optional
        Lowest and highest ratio of each power to `power`; absent, powers are fixed.
    measure : {"range", "peak"}
        Lower the relative peak factor (max - min), or the crest factor (max |u|).
    starts : int
        Random starts, at most: few tones need fewer. Twenty suit a comb of six tones; one flat band of
        16 tones is worth 1000, of 256 tones 10 and 20 kicks (each then 1 to 5 s).
    kicks : int
        Rounds in which the survivors are disturbed and lowered again; they pay from 30 tones on.
    seed : int or sequence of int

    Returns
    -------
    waveform : Waveform
    """
    index = np.asarray(index, dtype=np.int64)
    repeats = int(np.gcd.reduce(index))
    base = index // repeats  # the same wave with the fewest samples, so more starts for the same time
    reference = np.ones(index.size) if power is None else np.asarray(power, dtype=float)
    reference = reference / reference.sum()
    rng = np.random.default_rng(seed)
    starts = min(starts * repeats, (2 if limits is None else 4) ** index.size)
    phase = 2.0 * np.pi * rng.random((starts, index.size))
    ratio = np.ones_like(phase) if limits is None else _random_ratio(phase.shape, reference, limits, rng)

    fine = SmoothPeak(base, reference, limits, measure, _LADDER[-1][0])
    reached = _FIRST_SHARPNESS
    for points, sharpness, keep in _LADDER:
        peak = SmoothPeak(base, reference, limits, measure, points)
        phase, ratio = descend(peak, phase, ratio, _rise(reached, sharpness), _ITERATIONS)
        reached = sharpness
        if kicks and sharpness == _KICK_SHARPNESS[1]:
            phase, ratio = _kick(peak, phase, ratio, kicks, rng)
        rank = np.argsort(fine.value(phase, ratio, sharpness), kind="stable")  # a coarse grid flatters
        rank = rank[: max(_FEWEST, int(np.ceil(keep * rank.size)))]
        phase, ratio = phase[rank], ratio[rank]

    judge = relative_peak_factor if measure == "range" else crest_factor
    powers = reference * ratio
    factor = judge(base, np.sqrt(powers), phase)
    best = int(np.argmin(factor))
    start = start_at_zero(index, np.sqrt(powers[best]), phase[best])
    return Waveform(index, powers[best] / powers[best].sum(), start, float(factor[best]))


def lowest_peaks(
    sets: Sequence[ArrayLike],
    powers: Sequence[ArrayLike] | None = None,
    *,
    limits: tuple[float, float] | None = None,
    starts: int = 20,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Waveform, ...]:
    """Find a waveform with the lowest relative peak factor for every effector.

    Parameters
    ----------
    sets : sequence of array_like of int, each of shape (tone,)
        Harmonics of each effector.
    powers : sequence of array_like, optional
        Power fractions of each; flat where absent.
    limits : tuple of 2 floats, optional
        As for `lowest_peak`.
    starts, seed : int
    progress : callable, optional
        Called after each effector with how many are done and how many there are.

    Returns
    -------
    waveforms : tuple of Waveform
    """
    found: list[Waveform] = []
    for i, index in enumerate(sets):
        power = None if powers is None else powers[i]
        found.append(lowest_peak(index, power, limits=limits, starts=starts, seed=(seed, i)))
        if progress is not None:
            progress(i + 1, len(sets))
    return tuple(found)


def _random_ratio(
    shape: tuple[int, int], reference: Array, limits: tuple[float, float], rng: np.random.Generator
) -> Array:
    """Return power ratios at most half way to their limits that keep the total power."""
    change = rng.uniform(-1.0, 1.0, shape)
    change -= (change @ reference)[:, None]
    room = np.where(change > 0.0, limits[1] - 1.0, 1.0 - limits[0])
    return 1.0 + 0.5 * change * np.min(room / (np.abs(change) + 1e-300), axis=-1, keepdims=True)


def _rise(low: float, high: float) -> Array:
    """Return the sharpnesses after `low` up to `high`, each about _GROWTH times the one before."""
    steps = max(1, round(np.log(high / low) / np.log(_GROWTH)))
    return np.geomspace(low, high, steps + 1)[1:]


def _kick(
    peak: SmoothPeak, phase: Array, ratio: Array, kicks: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Disturb the survivors again and again, and keep what came out lower."""
    low, high = _KICK_SHARPNESS
    value = peak.value(phase, ratio, high)
    for _ in range(kicks):
        moved = phase + _KICK * rng.standard_normal(phase.shape)
        moved, new_ratio = descend(peak, moved, ratio, _rise(low, high), _ITERATIONS)
        new = peak.value(moved, new_ratio, high)
        better = new < value
        phase[better], ratio[better], value[better] = moved[better], new_ratio[better], new[better]
    return phase, ratio
