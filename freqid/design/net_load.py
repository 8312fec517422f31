"""Choose how the signals are played so that what they do together to the aircraft stays small.

The relative peak factor of each signal says nothing about their sum. Starting a periodic signal at another
of its zeros, turning it upside down or playing it backwards leaves its spectrum, its rms and its peak
factor as they are, but not the sum: a choice that costs nothing. Once it is made, small changes of all
phases together, which raise each peak factor by no more than a budget, lower the sum again as much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.core.design import Multisine
from freqid.design.joint_phases import JointPhases
from freqid.design.signals import PEAK_POINTS, sample, samples_per_period, zero_crossings

Array = NDArray[np.float64]

_CHANCE = 200  # random ways of playing whose median peak is what an axis would see by chance
_CHANCE_POINTS = 16
_POINTS = 4  # samples per shortest period while searching: the result is judged at 64
_SQUARINGS = 4  # the search lowers a norm of order 2^4: many peaks of one height are hard to polish away
_SWEEPS = 12
_TABLE = 50_000_000  # samples of all ways of all signals, at most: 200 MB
_ROUNDS = ((6, 6, 0.1), (2, 30, 0.03))  # of the polish: candidates, steps, first trust in rad
_TONES = 110  # more get fewer starts and candidates, in inverse square, and steps: each costs far more


def ways(signal: Multisine, most: int | None = None) -> list[Multisine]:
    """Return every way to play a signal that starts and ends at zero, or some, at most `most`."""
    angles, _ = zero_crossings(signal.index, signal.amplitude, signal.phase)
    if most is not None:
        angles = angles[:: -(-angles.size // max(1, most // 4))]
    forward = signal.phase + np.outer(angles, signal.index)
    # u(-theta) and -u(theta): sin(-k theta + phi) is sin(k theta + pi - phi)
    phases = np.concatenate([forward, forward + np.pi, np.pi - forward, -forward])
    return [replace(signal, phase=phase) for phase in np.mod(phases + np.pi, 2.0 * np.pi) - np.pi]


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


def peaks_by_chance(
    signals: Sequence[Multisine], effectiveness: Array, *, points: int = PEAK_POINTS, seed: int = 0
) -> Array:
    """Return the median over 200 random ways of playing of the net peak of each axis, shape (axis,).

    Parameters
    ----------
    signals : sequence of Multisine, length effector
    effectiveness : ndarray, shape (axis, effector)
        Load per unit of each effector.
    points : int
        Samples per shortest period.
    seed : int
    """
    rng = np.random.default_rng(seed)
    choices = [ways(s) for s in signals]
    drawn = ([c[rng.integers(len(c))] for c in choices] for _ in range(_CHANCE))
    return np.median([np.abs(net_loads(draw, effectiveness, points)).max(axis=1) for draw in drawn], axis=0)


def lowest_net_loads(
    signals: Sequence[Multisine],
    effectiveness: Array,
    weights: Array,
    *,
    rpf_budget: float = 0.03,
    powers: Sequence[ArrayLike] | None = None,
    limits: tuple[float, float] | None = None,
    starts: int = 16,
    seed: int = 0,
) -> list[Multisine]:
    """Choose how each signal is played so that the net peaks are low on all axes that count.

    Parameters
    ----------
    signals : sequence of Multisine, length effector
        Each with phases that give it a low peak factor.
    effectiveness : ndarray, shape (axis, effector)
        Load per unit of each effector.
    weights : ndarray, shape (axis,)
        Importance of each axis; 0 leaves it out.
    rpf_budget : float
        By how much of itself each relative peak factor may rise; 0 keeps all phases but for start, sense
        and reversal.
    powers : sequence of array_like, optional
        Power fractions that `limits` refer to; flat where absent.
    limits : tuple of 2 floats, optional
        Lowest and highest ratio of each power to its reference; absent, amplitudes stay. The rms stays.
    starts : int
        Searches, from random ways of playing; fewer where there are more than 110 harmonics.
    seed : int

    Returns
    -------
    list of Multisine, length effector
        Starting at zero. Signals without effect on the axes that count come back as they are, and so do
        all where nothing better was found.

    Notes
    -----
    What is lowered is the largest ratio, among axes, of net peak to reference times weight. The
    reference is the smaller of the peak of `signals` and that of `peaks_by_chance`: a largest ratio below
    one lowers every axis that counts. One signal after another is replaced by its best way while the rest
    stay, until none changes; the best of several random starts are polished by `JointPhases`.
    """
    counted = (weights > 0) & effectiveness.any(axis=1)
    heard = [i for i in range(len(signals)) if effectiveness[counted, i].any()]
    if not heard:
        return list(signals)
    given, loads = [signals[i] for i in heard], effectiveness[counted][:, heard]
    chance = peaks_by_chance(given, loads, points=_CHANCE_POINTS, seed=seed)
    reference = np.minimum(np.abs(net_loads(given, loads)).max(axis=1), chance)
    scaled = loads * (weights[counted] / reference)[:, None]
    fractions = [np.ones(s.index.size) for s in signals] if powers is None else powers
    joint = JointPhases(given, scaled, rpf_budget, [fractions[i] for i in heard], limits)

    effort = min(1.0, _TONES / joint.tones)
    found = _search(given, scaled, int(np.ceil(effort**2 * starts)), seed)
    states = [joint.state(played) for played in found]
    seen = [joint.state(given), *states]
    if rpf_budget > 0.0:
        for keep, steps, trust in _ROUNDS:
            kept = states[: int(np.ceil(effort**2 * keep))]
            paths = [joint.polish(state, int(np.ceil(effort * steps)), trust) for state in kept]
            states = sorted((path[-1] for path in paths), key=lambda state: state.merit)
            seen += [state for path in paths for state in path[1:] if state.excess == 0.0]
    best = min(seen, key=lambda state: state.peak)
    result = list(signals)
    for i, signal in zip(heard, joint.signals(best), strict=True):
        result[i] = signal
    return result


def _search(signals: Sequence[Multisine], scaled: Array, starts: int, seed: int) -> list[list[Multisine]]:
    """Return the ways of playing that coordinate descents end in, the lowest norm first."""
    samples = samples_per_period(np.concatenate([s.index for s in signals]), _POINTS)
    choices = [ways(s, _TABLE // (samples * len(signals))) for s in signals]
    waves = [
        sample(c[0].index, c[0].amplitude, [way.phase for way in c], samples).astype(np.float32)
        for c in choices
    ]
    loads = scaled.astype(np.float32)  # half the memory traffic, which is what the search waits for
    rng = np.random.default_rng((seed, 1))
    found: list[tuple[float, list[int]]] = []
    for _ in range(starts):
        chosen = [int(rng.integers(len(c))) for c in choices]
        net = loads @ np.array([w[c] for w, c in zip(waves, chosen, strict=True)])
        cost = np.inf
        for _ in range(_SWEEPS):
            before = cost
            for i in rng.permutation(len(waves)):
                rest = net - np.outer(loads[:, i], waves[i][chosen[i]])
                costs = np.zeros(len(waves[i]))
                for r, load in zip(rest, loads[:, i], strict=True):
                    costs += _norm(r + load * waves[i])
                chosen[i] = int(np.argmin(costs))
                net = rest + np.outer(loads[:, i], waves[i][chosen[i]])
                cost = float(costs[chosen[i]])
            if cost > 0.99 * before:
                break
        found.append((cost, chosen))
    found.sort()
    return [[c[w] for c, w in zip(choices, chosen, strict=True)] for _, chosen in found]


def _norm(loads: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the sum of the 2^_SQUARINGS-th powers over time."""
    for _ in range(_SQUARINGS):
        loads = loads * loads
    return loads.sum(axis=-1)
