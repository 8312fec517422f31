"""Multisines with the lowest peaks: random starts, a descent that sharpens, and the best one kept.

The peak of a sampled signal, ``max u``, has no derivative where two samples tie, and at an optimum many
do. It is replaced by ``log(sum exp(s u)) / s``, which lies above it by at most ``log(samples) / s``, and
the sharpness s is raised from where only the shape counts to where nothing but the peaks does. It is the
growing L2p norm of Guillaume et al. with ``exp(s u)`` in place of ``u^(2p)``: its weights tell tops from
bottoms, which the peak-to-peak value needs, and its limit is the minimax problem itself, so that one
descent serves from the random start to the last digit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import rfft

from freqid.core.arrays import Array
from freqid.design.multisine.signals import (
    crest_factor,
    relative_peak_factor,
    sample,
    samples_per_period,
    start_at_zero,
)

Measure = Literal["range", "peak"]

_BARRIER = 0.1  # times 1 / sharpness: the limits then cost as little as the smoothing itself
_HOLD_SUM = 1e3  # stiffness that keeps the step's total power at zero inside the linear solve


class SmoothPeak:
    """The smoothed peak of one multisine with rms 1, as a function of its phases and powers.

    Built once for a set of harmonics and called many times; every call treats a batch of starts.

    Parameters
    ----------
    index : ndarray of int, shape (tone,)
        Harmonics of the fundamental.
    power : ndarray, shape (tone,)
        Reference power fractions; their sum is 1.
    limits : tuple of 2 floats, optional
        Lowest < 1 and highest > 1 ratio of each power to its reference; absent, powers are fixed.
    measure : {"range", "peak"}
        What is lowered: half of max - min (the relative peak factor times sqrt(2)), or max |u|.
    points : int
        Samples per shortest period, >= 4.

    Notes
    -----
    With ``z = amplitude exp(j phase)`` every first derivative of u has the form ``Re(v exp(j k theta))``:
    v = z for the phase, v = -j z / (2 ratio) for the power. Sums of products of two of them, weighted
    by the softmax weights w, are the Fourier lines of w at the sums and differences of the harmonics.
    So gradient and Gauss-Newton matrix come from two transforms, without a Jacobian.

    References
    ----------
    Guillaume, Schoukens, Pintelon and Kollar, "Crest-factor minimization using nonlinear Chebyshev
    approximation methods", IEEE Trans. Instrum. Meas. 40(6), 1991.
    """

    def __init__(
        self,
        index: NDArray[np.int64],
        power: Array,
        limits: tuple[float, float] | None = None,
        measure: Measure = "range",
        points: int = 8,
    ):
        self.index, self.power, self.limits, self.measure = index, power, limits, measure
        self.samples = samples_per_period(index, points)
        self._line = index if limits is None else np.concatenate([index, index])
        self._top = int(index.max())  # offset of line 0 among lines -top..2 top
        self._sum = self._line[:, None] + self._line + self._top
        self._difference = self._line[:, None] - self._line + self._top

    def amplitude(self, ratio: Array) -> Array:
        """Return the amplitudes of the signal with rms 1 for given power ratios, shape (start, tone)."""
        return np.sqrt(2.0 * self.power * ratio)

    def value(self, phase: Array, ratio: Array, sharpness: float) -> Array:
        """Return the smoothed peak without the barrier of the power limits, shape (start,)."""
        signal = sample(self.index, self.amplitude(ratio), phase, self.samples)
        return self._soften(signal, sharpness)[0]

    def derivatives(self, phase: Array, ratio: Array, sharpness: float) -> tuple[Array, Array, Array]:
        """Evaluate the smoothed peak (plus barrier), its gradient and its Gauss-Newton matrix.

        Parameters
        ----------
        phase, ratio : ndarray, shape (start, tone)
            rad; power over reference power.
        sharpness : float
            s, per unit of a signal with rms 1.

        Returns
        -------
        value : ndarray, shape (start,)
        gradient : ndarray, shape (start, unknown)
            Unknowns are the phases, then the ratios where limits leave them free.
        matrix : ndarray, shape (start, unknown, unknown)
            Positive semidefinite.
        """
        amplitude = self.amplitude(ratio)
        value, up, down = self._soften(sample(self.index, amplitude, phase, self.samples), sharpness)
        v = amplitude * np.exp(1j * phase)
        if self.limits is not None:
            v = np.concatenate([v, -0.5j * v / ratio], axis=-1)
        up, down = rfft(up, axis=-1).conj(), rfft(down, axis=-1).conj()
        rise, fall = (v * up[:, self._line]).real, (v * down[:, self._line]).real

        both = (up + down)[:, : 2 * self._top + 1]
        both = np.concatenate([both[:, self._top : 0 : -1].conj(), both], axis=-1)
        column = v[:, None, :]
        inner = both.take(self._sum, axis=-1)
        inner *= column
        other = both.take(self._difference, axis=-1)
        other *= column.conj()
        inner += other
        matrix = v.real[:, :, None] * inner.real
        matrix -= v.imag[:, :, None] * inner.imag
        matrix *= 0.5
        if self.measure == "peak":
            gradient = rise - fall
            matrix -= gradient[:, :, None] * gradient[:, None, :]
            matrix *= sharpness
        else:
            gradient = 0.5 * (rise - fall)
            matrix -= rise[:, :, None] * rise[:, None, :] + fall[:, :, None] * fall[:, None, :]
            matrix *= 0.5 * sharpness
        if self.limits is not None:
            self._add_barrier(ratio, _BARRIER / sharpness, value, gradient, matrix)
        return value, gradient, matrix

    def _soften(self, signal: Array, s: float) -> tuple[Array, Array, Array]:
        """Return the smoothed peak and the softmax weights of tops and bottoms."""
        top, bottom = signal.max(-1, keepdims=True), -signal.min(-1, keepdims=True)
        if self.measure == "peak":
            top = bottom = np.maximum(top, bottom)
        up, down = np.exp(s * (signal - top)), np.exp(-s * (signal + bottom))
        above, below = up.sum(-1, keepdims=True), down.sum(-1, keepdims=True)
        if self.measure == "peak":
            above = below = above + below
        value = 0.5 * (top + bottom + (np.log(above) + np.log(below)) / s)
        return value[:, 0], up / above, down / below

    def _add_barrier(self, ratio: Array, weight: float, value: Array, gradient: Array, matrix: Array):
        """Add the logarithmic barrier of the limits, and the stiffness against changing total power."""
        assert self.limits is not None
        above, below = ratio - self.limits[0], self.limits[1] - ratio
        tones = self.index.size
        free = np.arange(tones, 2 * tones)
        value -= weight * np.sum(np.log(above) + np.log(below), axis=-1)
        gradient[:, tones:] += weight * (1.0 / below - 1.0 / above)
        matrix[:, free, free] += weight * (1.0 / below**2 + 1.0 / above**2)
        matrix[:, tones:, tones:] += _HOLD_SUM * np.outer(self.power, self.power) * tones


def descend(
    peak: SmoothPeak, phase: Array, ratio: Array, sharpness: Iterable[float], iterations: int
) -> tuple[Array, Array]:
    """Lower the smoothed peak of a batch of starts while the sharpness rises.

    Parameters
    ----------
    peak : SmoothPeak
    phase, ratio : ndarray, shape (start, tone)
        Ratios lie strictly inside the limits and keep the total power at one.
    sharpness : iterable of float
        Rising.
    iterations : int
        Levenberg-Marquardt steps at each sharpness.

    Returns
    -------
    phase, ratio : ndarray, shape (start, tone)
    """
    phase, ratio = phase.copy(), ratio.copy()
    tones = phase.shape[1]
    damping = np.ones(phase.shape[0])
    for s in sharpness:
        value, gradient, matrix = peak.derivatives(phase, ratio, s)
        diagonal = np.arange(gradient.shape[1])
        for _ in range(iterations):
            damped = matrix.copy()
            damped[:, diagonal, diagonal] += damping[:, None]
            step = -np.linalg.solve(damped, gradient[..., None])[..., 0]
            turn, change = step[:, :tones], step[:, tones:]
            length = 1.0 / np.maximum(np.abs(turn).max(-1), 1.0)  # no phase turns by more than 1 rad
            if peak.limits is not None:
                change = change - np.outer(change @ peak.power, peak.power) / (peak.power @ peak.power)
                room = np.where(change > 0.0, peak.limits[1] - ratio, ratio - peak.limits[0])
                length = np.minimum(length, 0.9 * np.min(room / (np.abs(change) + 1e-300), axis=-1))
            new_phase = phase + length[:, None] * turn
            new_ratio = ratio + length[:, None] * change if peak.limits is not None else ratio
            trial = peak.derivatives(new_phase, new_ratio, s)
            better = trial[0] < value
            damping[:] = np.clip(np.where(better, 0.3 * damping, 4.0 * damping), 1e-6, 1e6)
            phase[better], ratio[better] = new_phase[better], new_ratio[better]
            for old, new in zip((value, gradient, matrix), trial, strict=True):
                old[better] = new[better]
    return phase, ratio


# Samples per shortest period, sharpness reached, share of the starts kept. Early values already rank the
# starts (rank correlation with the final crest 0.3-0.7 at 6, 0.8-0.98 at 40), so few are finished.
# On the last two rungs the grid must be fine: between coarse samples a descent hides peaks.
_LADDER = ((8, 6.0, 0.5), (8, 15.0, 0.4), (8, 40.0, 0.4), (32, 400.0, 0.2), (64, 6000.0, 0.0))
RANKING = 40.0
"""Sharpness at which waveforms can be ranked."""
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
    sharpest: float = math.inf,
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
    sharpest : float
        Where the descent ends. At `RANKING` the peak is some per cent above the lowest, but waveforms rank as
        they do at the end, for a quarter of the time.

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
        if sharpness > sharpest:
            break
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
