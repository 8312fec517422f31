"""Choose starts and senses of the signals so that what they do together to the aircraft stays small.

The relative peak factor of each signal says nothing about their sum. Starting a periodic signal at another
of its zeros, turning it upside down or playing it backwards leaves its spectrum, its rms and its peak
factor as they are, but not the sum: a choice that costs nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from freqid.core.design import Multisine
from freqid.design.signals import PEAK_POINTS, sample, samples_per_period, zero_crossings

Array = NDArray[np.float64]

SEARCH_POINTS = 8  # samples per shortest period while searching: the result is judged at 64
SHARPNESS = 24.0  # of the norm that stands for the largest ratio among axes and times
SWEEPS = 12


def ways(signal: Multisine) -> list[Multisine]:
    """Return every way to play a signal that starts and ends at zero."""
    angles, _ = zero_crossings(signal.index, signal.amplitude, signal.phase)
    found = []
    for angle in angles:
        forward = signal.phase + signal.index * angle
        # u(-theta) and -u(theta): sin(-k theta + phi) is sin(k theta + pi - phi)
        for phase in (forward, forward + np.pi, np.pi - forward, -forward):
            wrapped = np.mod(phase + np.pi, 2 * np.pi) - np.pi
            found.append(replace(signal, phase=wrapped))
    return found


def net_loads(signals: Sequence[Multisine], effectiveness: Array, points: int = PEAK_POINTS) -> Array:
    """Return the sum of all effectors' loads over one period, shape (axis, sample).

    Parameters
    ----------
    signals : sequence of Multisine, length effector
    effectiveness : ndarray, shape (axis, effector)
        Load per unit of each effector.
    points : int
        Samples per shortest period.
    """
    samples = samples_per_period(np.concatenate([s.index for s in signals]), points)
    return effectiveness @ np.array([sample(s.index, s.amplitude, s.phase, samples) for s in signals])


def lowest_net_loads(
    signals: Sequence[Multisine], effectiveness: Array, weights: Array, *, starts: int = 4, seed: int = 0
) -> list[Multisine]:
    """Choose how each signal is played so that the net peaks are low on all axes that count.

    Parameters
    ----------
    signals : sequence of Multisine, length effector
    effectiveness : ndarray, shape (axis, effector)
        Load per unit of each effector.
    weights : ndarray, shape (axis,)
        Importance of each axis; 0 leaves it out.
    starts : int
        Searches, from random ways of playing.
    seed : int

    Returns
    -------
    list of Multisine, length effector

    Notes
    -----
    Each net load is measured against its own rms, which does not depend on the choice, so that axes of
    different size count alike. One signal after another is replaced by its best way while the rest stay,
    until none changes; the best of several random starts is kept.
    """
    samples = samples_per_period(np.concatenate([s.index for s in signals]), SEARCH_POINTS)
    choices = [ways(s) for s in signals]
    waves = [np.array([sample(w.index, w.amplitude, w.phase, samples) for w in c]) for c in choices]
    power = np.array([0.5 * np.sum(s.amplitude**2) for s in signals])
    rms = np.sqrt(effectiveness**2 @ power)
    counted = (weights > 0) & (rms > 0)
    scaled = effectiveness[counted] * (weights[counted] / rms[counted])[:, None]

    rng = np.random.default_rng(seed)
    best, best_cost = [0] * len(signals), np.inf
    for start in range(starts):
        chosen = [0 if start == 0 else int(rng.integers(len(c))) for c in choices]
        net = sum(np.outer(scaled[:, i], waves[i][c]) for i, c in enumerate(chosen))
        cost = np.inf
        for _ in range(SWEEPS):
            before = cost
            for i in rng.permutation(len(signals)):
                rest = net - np.outer(scaled[:, i], waves[i][chosen[i]])
                trial = rest + scaled[:, i, None] * waves[i][:, None, :]  # (way, axis, sample)
                costs = _largest(trial)
                chosen[i] = int(np.argmin(costs))
                cost, net = float(costs[chosen[i]]), trial[chosen[i]]
            if cost > 0.9999 * before:
                break
        if cost < best_cost:
            best, best_cost = list(chosen), cost
    return [choices[i][c] for i, c in enumerate(best)]


def _largest(loads: Array) -> Array:
    """Return a smooth stand-in for the largest peak of any axis, shape (way,)."""
    peak = np.abs(loads).max(axis=-1)
    top = peak.max(axis=-1, keepdims=True)
    return top[:, 0] * np.sum((peak / top) ** SHARPNESS, axis=-1) ** (1 / SHARPNESS)
