"""The smoothed peak of a multisine, its derivatives, and the descent that lowers it.

The peak of a sampled signal, ``max u``, has no derivative where two samples tie, and at an optimum many
do. It is replaced by ``log(sum exp(s u)) / s``, which lies above it by at most ``log(samples) / s``, and
the sharpness s is raised from where only the shape counts to where nothing but the peaks does. It is the
growing L2p norm of Guillaume et al. with ``exp(s u)`` in place of ``u^(2p)``: its weights tell tops from
bottoms, which the peak-to-peak value needs, and its limit is the minimax problem itself, so that one
descent serves from the random start to the last digit.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from freqid.core.arrays import Array
from freqid.design.multisine.signals import sample, samples_per_period

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
            damping = np.clip(np.where(better, 0.3 * damping, 4.0 * damping), 1e-6, 1e6)
            phase[better], ratio[better] = new_phase[better], new_ratio[better]
            for old, new in zip((value, gradient, matrix), trial, strict=True):
                old[better] = new[better]
    return phase, ratio
