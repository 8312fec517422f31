"""Lower the largest net peak of several multisines by small changes of all their phases, and powers.

A net is a sum over all signals, each tone turned and scaled by a gain of its own: the load on an axis, where
the gains are an effectiveness, or a state that answers to all effectors, where they are frequency responses.
The problem: least t such that every net, over its reference, stays within +-t at all times, while each signal
keeps its range (max - min) within a budget, starts at zero and keeps its rms. Each step of this sequential
linear programme makes everything linear in the changes, lets no phase change by more than a trust, and asks
a linear programme for the best step. At a solution some hundred peaks are equally high, about as many as
there are phases, so linear models with the true corners converge fast.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linprog
from scipy.sparse import csr_array

from freqid.core.arrays import Array, Complex
from freqid.core.results.design import Multisine
from freqid.design.multisine.signals import PEAK_POINTS, relative_peak_factor, sample, samples_per_period

_PENALTY = (
    3.0  # t that one unit of relative excess of a range costs; budgets were seen to be worth 0.5 to 1.5
)
_RESERVE = 0.04  # of the budget: what steps overshoot, and peaks between samples
_REACH = 2.0  # peaks lower than the highest by more than this times the trust cannot matter in one step
_NEGLIGIBLE = 2e-4  # relative gain foreseen that is not worth a step


@dataclass(frozen=True, eq=False)
class PhaseState:
    """Amplitudes and phases of all signals, and how good they are.

    Attributes
    ----------
    amplitude, phase : ndarray, shape (tone,)
        Of all signals, one after another.
    peak : float
        Largest net over its reference.
    excess : float
        Largest relative peak factor over its allowed one, less 1; 0 where all are allowed.
    """

    amplitude: Array
    phase: Array
    peak: float
    excess: float

    @property
    def merit(self) -> float:
        """Peak, with a penalty for ranges that are too large."""
        return self.peak * (1.0 + _PENALTY * self.excess)


class JointPhases:
    """The problem for one set of signals.

    Parameters
    ----------
    signals : sequence of Multisine, length signal
    gains : ndarray of complex, shape (net, tone)
        What the tones of all signals, one after another, add to each net, over the reference of the net.
    budget : float
        By how much of itself the range of each signal may grow.
    fractions : sequence of array_like, each of shape (tone,)
        Reference of the powers, in any scale.
    limits : tuple of 2 floats, optional
        Lowest and highest ratio of each power to its reference; absent, amplitudes are fixed.
    """

    def __init__(
        self,
        signals: Sequence[Multisine],
        gains: Complex,
        budget: float,
        fractions: Sequence[ArrayLike],
        limits: tuple[float, float] | None,
    ):
        self._signals, self._gains, self._limits = tuple(signals), gains, limits
        self._index = np.concatenate([s.index for s in signals])
        self._owner = np.repeat(np.arange(len(signals)), [s.index.size for s in signals])
        self._mine = self._owner == np.arange(len(signals))[:, None]  # (signal, tone)
        self._reference = np.concatenate(
            [
                np.divide(f, np.sum(f)) * np.sum(s.amplitude**2)
                for s, f in zip(signals, fractions, strict=True)
            ]
        )
        self._samples = samples_per_period(self._index, PEAK_POINTS)
        self._allowed = (1.0 + budget) * self._peak_factors(*_joined(signals))
        self._aim = (1.0 + (1.0 - _RESERVE) * budget) * np.ptp(self._waves(*_joined(signals)), axis=1)

    @property
    def tones(self) -> int:
        """How many harmonics there are."""
        return self._index.size

    def state(self, signals: Sequence[Multisine]) -> PhaseState:
        """Judge signals with the harmonics of those of the problem."""
        return self._judge(*_joined(signals))

    def signals(self, state: PhaseState) -> list[Multisine]:
        """Return the signals of a state."""
        cuts = np.flatnonzero(np.diff(self._owner)) + 1
        phases = np.mod(state.phase + np.pi, 2.0 * np.pi) - np.pi
        parts = zip(self._signals, np.split(state.amplitude, cuts), np.split(phases, cuts), strict=True)
        return [replace(s, amplitude=a, phase=p) for s, a, p in parts]

    def polish(self, state: PhaseState, steps: int, trust: float) -> list[PhaseState]:
        """Improve a state.

        Parameters
        ----------
        state : PhaseState
            Its signals start at zero, and its powers are inside the limits.
        steps : int
            Linear programmes, at most.
        trust : float
            Most that a phase changes in the first step, rad.

        Returns
        -------
        states : list of PhaseState
            The given one and those that followed, each of lower merit than the one before.
        """
        path = [state]
        for _ in range(steps):
            step = self._step(state, trust)
            if step is None:
                trust *= 0.4
                continue
            (turn, change), foreseen = step
            if state.merit - foreseen < _NEGLIGIBLE * state.merit:
                break
            amplitude = state.amplitude * np.sqrt(1.0 + change)
            new = self._judge(amplitude, self._start_at_zero(amplitude, state.phase + turn))
            share = (state.merit - new.merit) / (state.merit - foreseen)
            trust *= 2.0 if share > 0.7 else 1.0 if share > 0.3 else 0.4
            if share > 0.0:
                state = new
                path.append(state)
        return path

    def _waves(self, amplitude: Array, phase: Array) -> Array:
        return sample(self._index, self._mine * amplitude, phase, self._samples)

    def _nets(self, amplitude: Array, phase: Array) -> Array:
        return sample(self._index, self._gains * amplitude, phase, self._samples)

    def _peak_factors(self, amplitude: Array, phase: Array) -> Array:
        return np.array([relative_peak_factor(self._index[k], amplitude[k], phase[k]) for k in self._mine])

    def _judge(self, amplitude: Array, phase: Array) -> PhaseState:
        peak = float(np.abs(self._nets(amplitude, phase)).max())
        excess = float(np.max(self._peak_factors(amplitude, phase) / self._allowed)) - 1.0
        return PhaseState(amplitude, phase, peak, max(excess, 0.0))

    def _start_at_zero(self, amplitude: Array, phase: Array) -> Array:
        """Undo what a linear step leaves of u(0) = 0, by the smallest change of phases (Newton)."""
        for _ in range(6):
            slope = amplitude * np.cos(phase)
            start = self._mine @ (amplitude * np.sin(phase)) / (self._mine @ slope**2)
            phase = phase - start[self._owner] * slope
        return phase

    def _step(self, state: PhaseState, trust: float) -> tuple[tuple[Array, Array], float] | None:
        """Return the best changes of phases (rad) and powers (relative), and the merit foreseen.

        Unknowns are the phases, the powers where free, t and the largest relative excess of a range.
        """
        a, p = state.amplitude, state.phase
        rows, bound = self._peaks(state, 1.0 - min(_REACH * trust, 0.9))
        slope, height = self._mine * (a * np.cos(p)), self._mine * (a * np.sin(p))
        scale = np.linalg.norm(slope, axis=1, keepdims=True)
        equal = slope / scale  # keeps u(0) at zero
        low, high = np.full(a.size, -trust), np.full(a.size, trust)
        if self._limits is not None:
            share = self._mine * a**2 / (self._mine @ a**2)[:, None]  # keeps the total power
            equal = np.block([[equal, 0.5 * height / scale], [np.zeros_like(share), share]])
            room = [limit * self._reference / a**2 - 1.0 for limit in self._limits]
            low = np.concatenate([low, np.clip(room[0], -2.0 * trust, 0.0)])
            high = np.concatenate([high, np.clip(room[1], 0.0, 2.0 * trust)])
        equal, none = csr_array(np.hstack([equal, np.zeros((len(equal), 2))])), np.zeros(len(equal))
        cost = np.concatenate([np.zeros_like(low), [1.0, _PENALTY * state.peak]])
        bounds = [*zip(low, high, strict=True), (0.0, None), (0.0, None)]
        found = linprog(cost, rows, bound, equal, none, bounds, method="highs-ds")  # type: ignore[arg-type]
        if found.x is None or found.fun is None:
            return None
        turn, change = found.x[: a.size], found.x[a.size : -2]
        return (turn, change if change.size else np.zeros_like(turn)), float(found.fun)

    def _peaks(self, state: PhaseState, near: float) -> tuple[csr_array, Array]:
        """Return one inequality, ``rows @ unknowns <= bound``, for each high peak of nets and signals."""
        waves = self._waves(state.amplitude, state.phase)
        nets = self._nets(state.amplitude, state.phase)
        net, net_when = _high_peaks(nets, near * state.peak)
        top, bottom = waves.max(axis=1), -waves.min(axis=1)
        spare = 0.5 * (self._aim - top - bottom)  # the same above as below
        own, own_when = _high_peaks(waves, near * np.minimum(top, bottom))
        room = np.where(waves[own, own_when] > 0.0, (top + spare)[own], (bottom + spare)[own])

        when = np.concatenate([net_when, own_when])
        height = np.concatenate([nets[net, net_when], waves[own, own_when] / room])
        row, tone = np.nonzero(np.vstack([self._gains[net] != 0.0, self._mine[own]]))
        of_net = row < net.size
        gain = np.empty(row.size, dtype=complex)
        gain[of_net] = self._gains[net[row[of_net]], tone[of_net]]
        gain[~of_net] = 1.0 / room[row[~of_net] - net.size]
        angle = when[row] * (2.0 * np.pi / self._samples) * self._index[tone] + state.phase[tone]
        # The height is the sum of these phasors' imaginary parts; a turn adds their real parts.
        phasor = np.sign(height)[row] * gain * state.amplitude[tone] * np.exp(1j * angle)

        parts = [(phasor.real, row, tone)]
        unknowns = self._index.size
        if self._limits is not None:
            parts.append((0.5 * phasor.imag, row, unknowns + tone))
            unknowns *= 2
        every = np.arange(when.size)
        parts.append((-np.ones(when.size), every, unknowns + (every >= net.size)))  # t, or the excess
        values, rows, columns = (np.concatenate(part) for part in zip(*parts, strict=True))
        bound = np.where(every < net.size, 0.0, 1.0) - np.abs(height)
        return csr_array((values, (rows, columns)), shape=(when.size, unknowns + 2)), bound


def _joined(signals: Sequence[Multisine]) -> tuple[Array, Array]:
    return np.concatenate([s.amplitude for s in signals]), np.concatenate([s.phase for s in signals])


def _high_peaks(signal: Array, least: float | Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows and samples of the local extremes of at least a magnitude, given for all or by row.

    A peak between samples is higher by 0.12 % at most, and one that moves changes its height, to first
    order, as the signal does at a fixed time.
    """
    found = []
    for row, bar in zip(np.abs(signal), np.broadcast_to(least, len(signal)), strict=True):
        peak = (row >= np.roll(row, 1)) & (row > np.roll(row, -1)) & (row >= bar)
        found.append(np.flatnonzero(peak))
    return np.repeat(np.arange(len(signal)), [when.size for when in found]), np.concatenate(found)
