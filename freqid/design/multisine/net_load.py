"""Choose how the signals are played so that what they do together to the aircraft stays small.

The relative peak factor of each signal says nothing about their sum. Starting a periodic signal at another
of its zeros, turning it upside down or playing it backwards leaves its spectrum, its rms and its peak
factor as they are, but not the sum: a choice that costs nothing. Once it is made, small changes of all
phases together, which raise each peak factor by no more than a budget, lower the sum again. What sums there
are, loads on axes or states that answer, is for the gains of `nets` to say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.core.arrays import Array, Complex
from freqid.core.results.design import Multisine
from freqid.design.multisine.joint_phases import JointPhases
from freqid.design.multisine.signals import PEAK_POINTS, sample, samples_per_period, zero_crossings

_CHANCE = 200  # random ways of playing whose median peak is what a net would see by chance
_CHANCE_POINTS = 16
_POINTS = 4  # samples per shortest period while searching: the result is judged at 64
_SQUARINGS = 4  # the search lowers a norm of order 2^4: many peaks of one height are hard to polish away
_SWEEPS = 12
_TABLE = 100_000_000  # samples of all nets of all ways of all signals, at most: 400 MB
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


def load_gains(signals: Sequence[Multisine], effectiveness: ArrayLike) -> Array:
    """Return the gains of loads that follow the effectors at once, shape (axis, tone).

    Parameters
    ----------
    signals : sequence of Multisine, length effector
    effectiveness : array_like, shape (axis, effector)
        Load per unit of each effector.
    """
    return np.repeat(np.asarray(effectiveness), [s.index.size for s in signals], axis=1)


def nets(signals: Sequence[Multisine], gains: ArrayLike, points: int = PEAK_POINTS) -> Array:
    """Return what all signals do together over one period, shape (net, sample).

    Parameters
    ----------
    signals : sequence of Multisine, length effector
    gains : array_like of float or complex, shape (net, tone)
        What each tone, of all signals one after another, adds: `load_gains`, or frequency responses at
        its harmonic.
    points : int
        Samples per shortest period.
    """
    index, amplitude, phase = (
        np.concatenate([getattr(s, name) for s in signals]) for name in ("index", "amplitude", "phase")
    )
    return sample(index, np.asarray(gains) * amplitude, phase, samples_per_period(index, points))


def net_loads(signals: Sequence[Multisine], effectiveness: ArrayLike) -> Array:
    """Return the sum of all effectors' loads over one period, shape (axis, sample).

    Parameters
    ----------
    signals : sequence of Multisine, length effector
    effectiveness : array_like, shape (axis, effector)
        Load per unit of each effector.
    """
    return nets(signals, load_gains(signals, effectiveness))


def net_peaks(signals: Sequence[Multisine], gains: ArrayLike, points: int = PEAK_POINTS) -> Array:
    """Return the largest magnitude of each of the `nets`, shape (net,)."""
    return np.abs(nets(signals, gains, points)).max(axis=1)


def peaks_by_chance(
    signals: Sequence[Multisine], gains: ArrayLike, *, points: int = PEAK_POINTS, seed: int = 0
) -> Array:
    """Return the median over 200 random ways of playing of the largest magnitude of each net, shape (net,).

    Parameters
    ----------
    signals : sequence of Multisine, length effector
    gains : array_like of float or complex, shape (net, tone)
        As for `nets`.
    points : int
        Samples per shortest period.
    seed : int
    """
    rng = np.random.default_rng(seed)
    choices = [ways(s) for s in signals]
    drawn = ([c[rng.integers(len(c))] for c in choices] for _ in range(_CHANCE))
    return np.median([net_peaks(draw, gains, points) for draw in drawn], axis=0)


def lowest_nets(
    signals: Sequence[Multisine],
    gains: ArrayLike,
    weights: ArrayLike,
    *,
    rpf_budget: float = 0.03,
    powers: Sequence[ArrayLike] | None = None,
    limits: tuple[float, float] | None = None,
    starts: int = 16,
    seed: int = 0,
) -> list[Multisine]:
    """Choose how each signal is played so that the peaks of all nets that count are low.

    Parameters
    ----------
    signals : sequence of Multisine, length effector
        Each with phases that give it a low peak factor.
    gains : array_like of float or complex, shape (net, tone)
        As for `nets`.
    weights : array_like, shape (net,)
        Importance of each net; 0 leaves it out.
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
        Starting at zero. Signals without effect on the nets that count come back as they are, and so do
        all where nothing better was found.

    Notes
    -----
    What is lowered is the largest ratio, among nets, of peak to reference times weight. The reference is
    the smaller of the peak of `signals` and that of `peaks_by_chance`: a largest ratio below one lowers
    every net that has weight one. One signal after another is replaced by its best way while the rest
    stay, until none changes; the best of several random starts are polished by `JointPhases`.
    """
    adds, weights = np.asarray(gains, dtype=np.complex128), np.asarray(weights, dtype=float)
    owner = np.repeat(np.arange(len(signals)), [s.index.size for s in signals])
    counted = (weights > 0) & adds.any(axis=1)
    heard = np.unique(owner[adds[counted].any(axis=0)])
    if not heard.size:
        return list(signals)
    given, adds = [signals[i] for i in heard], adds[counted][:, np.isin(owner, heard)]
    chance = peaks_by_chance(given, adds, points=_CHANCE_POINTS, seed=seed)
    reference = np.minimum(net_peaks(given, adds), chance)
    scaled = adds * (weights[counted] / reference)[:, None]
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


def _search(signals: Sequence[Multisine], scaled: Complex, starts: int, seed: int) -> list[list[Multisine]]:
    """Return the ways of playing that coordinate descents end in, the lowest norm first."""
    samples = samples_per_period(np.concatenate([s.index for s in signals]), _POINTS)
    choices = [ways(s, _TABLE // (samples * len(signals) * len(scaled))) for s in signals]
    cuts = np.cumsum([s.index.size for s in signals])[:-1]
    # By signal (net, way, sample). Single precision: half the memory traffic, which the search waits for.
    waves = [
        np.array(
            [sample(s.index, g * s.amplitude, [way.phase for way in c], samples) for g in own], np.float32
        )
        for s, c, own in zip(signals, choices, np.split(scaled, cuts, axis=1), strict=True)
    ]
    rng = np.random.default_rng((seed, 1))
    found: list[tuple[float, list[int]]] = []
    for _ in range(starts):
        chosen = [int(rng.integers(len(c))) for c in choices]
        net = np.sum([w[:, c] for w, c in zip(waves, chosen, strict=True)], axis=0)
        cost = np.inf
        for _ in range(_SWEEPS):
            before = cost
            for i in rng.permutation(len(waves)):
                rest = net - waves[i][:, chosen[i]]
                costs = np.sum([_norm(r + wave) for r, wave in zip(rest, waves[i], strict=True)], axis=0)
                chosen[i] = int(np.argmin(costs))
                net = rest + waves[i][:, chosen[i]]
                cost = float(costs[chosen[i]])
            if cost > 0.99 * before:
                break
        found.append((cost, chosen))
    found.sort()
    return [[c[w] for c, w in zip(choices, chosen, strict=True)] for _, chosen in found]


def _norm(waves: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the sum of the 2^_SQUARINGS-th powers over time; overwrites the waves."""
    for _ in range(_SQUARINGS):
        np.square(waves, out=waves)
    return waves.sum(axis=-1)
