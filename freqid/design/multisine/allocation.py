"""Who gets which harmonics, and how the power of each signal is spread over them.

Where two effectors alone act on an axis, as two ruddervators do on side force, the net peak there can only
be low if the two signals together are one smooth signal. Whether they can be is decided by who has which
harmonics: see docs/theory/net-loads.md.

Sets that share no harmonic are orthogonal over the period. Sets in arithmetic progression have the lowest
peaks, so every allocation here is made of progressions; the search chooses among those that fit together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.design.multisine.phases import RANKING, lowest_peak


def limits_from_db(band_db: float) -> tuple[float, float] | None:
    """Return the lowest and highest ratio of a power to its reference for a band of +-`band_db`.

    Parameters
    ----------
    band_db : float
        dB of power, >= 0; zero means that powers are fixed.

    Returns
    -------
    limits : tuple of 2 floats, or None
        For `freqid.design.multisine.phases.lowest_peak`; None where powers are fixed.

    Raises
    ------
    UsageError
        If the band is negative or not finite.
    """
    if not 0.0 <= band_db < np.inf:
        raise UsageError(f"power free within {band_db} dB has no meaning", remedy="give 0 dB or more")
    if band_db == 0.0:
        return None
    return 10.0 ** (-band_db / 10.0), 10.0 ** (band_db / 10.0)


def fractions(
    index: ArrayLike, period_s: float, frequency_hz: ArrayLike, density: ArrayLike
) -> NDArray[np.float64]:
    """Return power fractions that follow a user's spectrum.

    Parameters
    ----------
    index : array_like of int, shape (tone,)
        Harmonics of 1/T.
    period_s : float
        T, s.
    frequency_hz : array_like, shape (point,)
        Rising, Hz; the spectrum is interpolated linearly and held beyond its ends.
    density : array_like, shape (point,)
        Relative power at those frequencies, > 0, in any scale.

    Returns
    -------
    power : ndarray, shape (tone,)
        Their sum is 1.

    Raises
    ------
    UsageError
        If frequencies do not rise or a density is not positive.
    """
    frequency_hz, density = np.asarray(frequency_hz, dtype=float), np.asarray(density, dtype=float)
    if frequency_hz.shape != density.shape or frequency_hz.ndim != 1 or frequency_hz.size == 0:
        raise UsageError(
            f"a spectrum has {frequency_hz.size} frequencies and {density.size} powers",
            remedy="give one power for each frequency",
        )
    if np.any(np.diff(frequency_hz) <= 0.0):
        raise UsageError("the frequencies of a spectrum do not rise", remedy="sort them")
    if not np.all(density > 0.0):
        raise UsageError(
            f"a spectrum has the power {density.min():g}, which leaves a harmonic without a signal",
            remedy="give powers above zero, or take those harmonics out of the set",
        )
    power = np.interp(np.asarray(index) / period_s, frequency_hz, density)
    return power / power.sum()


ToneLines = NDArray[np.int64]
EffectorPair = tuple[int, int]

_ALIKE = 0.9  # cosine of the angle between what two effectors do, signs aside


def mirrored(sets: Sequence[ToneLines], loads: Array) -> tuple[ToneLines, ...]:
    """Hand the same combs to other effectors.

    Parameters
    ----------
    sets : sequence of ndarray of int, length effector
        Harmonics of each effector.
    loads : ndarray, shape (axis, effector)
        Load of each effector at the rms of its signal, times the importance of the axis.

    Returns
    -------
    sets : tuple of ndarray of int, length effector

    Notes
    -----
    Combs of one stride s mirror each other where the first lines add up to a multiple of s: their
    harmonics are ``s m + r`` and ``s m - r``. The pair with the largest share of an axis chooses first.
    It takes the combs with the largest common divisor of s and r, whose peaks are the lowest. Sets and
    effectors without a partner keep their order.
    """
    pairs = list(zip(_equivalent_pairs(loads), _mirror_images(sets), strict=False))
    effectors = [i for pair, _ in pairs for i in pair]
    combs = [j for _, images in pairs for j in images]
    effectors += [i for i in range(len(sets)) if i not in effectors]
    combs += [j for j in range(len(sets)) if j not in combs]
    given = dict(zip(effectors, combs, strict=True))
    return tuple(sets[given[i]] for i in range(len(sets)))


def _equivalent_pairs(loads: Array) -> list[EffectorPair]:
    """Return disjoint pairs of effectors that do the same but for signs, the weightiest pair first."""
    total = np.sqrt(np.sum(loads**2, axis=1, keepdims=True))
    share = np.abs(loads) / np.where(total > 0.0, total, 1.0)
    size = np.linalg.norm(share, axis=0)
    found = [
        (float(np.max(share[:, i] ** 2 + share[:, j] ** 2)), (i, j))
        for i, j in combinations(range(size.size), 2)
        if share[:, i] @ share[:, j] > _ALIKE * size[i] * size[j] > 0.0
    ]
    return _disjoint(found)


def _mirror_images(sets: Sequence[ToneLines]) -> list[EffectorPair]:
    """Return disjoint pairs of combs that mirror each other, those with the lowest peaks first."""
    strides = [int(np.gcd.reduce(np.diff(s))) if s.size > 1 else 0 for s in sets]
    found = [
        (float(np.gcd(strides[i], sets[i][0])), (i, j))
        for i, j in combinations(range(len(sets)), 2)
        if strides[i] == strides[j] > 0 and (sets[i][0] + sets[j][0]) % strides[i] == 0
    ]
    return _disjoint(found)


def _disjoint(ranked: Sequence[tuple[float, EffectorPair]]) -> list[EffectorPair]:
    """Return pairs that share no member, the highest rank first."""
    chosen: list[EffectorPair] = []
    for _, pair in sorted(ranked, key=lambda entry: -entry[0]):
        if not any(set(pair) & set(other) for other in chosen):
            chosen.append(pair)
    return chosen


_QUICK_STARTS = 3  # of a waveform that is only ranked
_SPARSEST = 2.0  # strides up to this multiple of the number of effectors are tried
_QUICK_SPARSEST = 1.25  # in a quick search; the best of 18 effectors, 40 to 120 s, have 0.9 and 1.1
_FEWEST_TONES = 4  # with fewer, peaks rise (1.16 for 4 tones, 1.37 for 2, power within 3 dB) and so does risk
_MOST_CHOICES = 2000  # ways to hand residue classes to the two groups, by layout


def lines_in_band(period_s: float, band_hz: tuple[float, float]) -> ToneLines:
    """Return the harmonics of 1/T inside a band, its ends included.

    Parameters
    ----------
    period_s : float
        T, s.
    band_hz : tuple of 2 floats
        Hz.

    Returns
    -------
    lines : ndarray of int, shape (line,)

    Raises
    ------
    UsageError
        If the band holds no harmonic.
    """
    low, high = band_hz
    tolerance = 1e-9 * max(1.0, high * period_s)  # 0.05 Hz times 60 s is 3.0000000000000004
    lines = np.arange(max(1, np.ceil(low * period_s - tolerance)), np.floor(high * period_s + tolerance) + 1)
    if lines.size == 0:
        raise UsageError(
            f"the band {low:g} to {high:g} Hz holds no harmonic of 1/{period_s:g} s",
            remedy=f"widen the band or lengthen the period, to {1 / high:.4g} s or more",
        )
    return lines.astype(np.int64)


def interleave(lines: ArrayLike, effectors: int, *, empty: int = 0) -> tuple[ToneLines, ...]:
    """Deal harmonics out in turn, so that every effector has a comb across the band.

    Parameters
    ----------
    lines : array_like of int, shape (line,)
        Rising.
    effectors : int
    empty : int
        Combs that nobody gets: their lines stay free of excitation and show noise and nonlinearity.

    Returns
    -------
    sets : tuple of ndarray of int, one for each effector

    Raises
    ------
    UsageError
        If there are fewer lines than effectors.
    """
    lines = np.asarray(lines, dtype=np.int64)
    stride = effectors + empty
    if lines.size < effectors:
        raise UsageError(
            f"{lines.size} harmonics are too few for {effectors} effectors",
            remedy=f"lengthen the period {effectors / max(lines.size, 1):.3g} times, or widen the band",
        )
    return tuple(lines[j::stride] for j in range(effectors))


def check_sets(sets: Mapping[str, ArrayLike], lines: ArrayLike) -> tuple[ToneLines, ...]:
    """Check sets of harmonics that a user wrote down.

    Parameters
    ----------
    sets : mapping from effector name to array_like of int
    lines : array_like of int
        Harmonics inside the band.

    Returns
    -------
    sets : tuple of ndarray of int
        Sorted, in the order of the mapping.

    Raises
    ------
    UsageError
        If a set is empty, leaves the band, repeats a harmonic or shares one with another effector.
    """
    lines = np.asarray(lines)
    owner: dict[int, str] = {}
    for name, wanted in sets.items():
        numbers = [int(k) for k in np.atleast_1d(np.asarray(wanted))]
        if not numbers:
            raise UsageError(f"effector {name} has no harmonic", remedy="give it one or more")
        for k in numbers:
            if k not in lines:
                nearest = int(lines[np.argmin(np.abs(lines - k))])
                raise UsageError(
                    f"harmonic {k} of effector {name} is outside the band",
                    remedy=f"the nearest one inside is {nearest}",
                )
            if k in owner:
                raise UsageError(
                    f"effectors {owner[k]} and {name} share harmonic {k}, so they are not orthogonal",
                    remedy="give each harmonic to one effector, once",
                )
            owner[k] = name
    return tuple(np.sort(np.atleast_1d(np.asarray(wanted, dtype=np.int64))) for wanted in sets.values())


@dataclass(frozen=True)
class _Layout:
    """Two families of progressions that never meet, because their residues modulo `modulus` differ."""

    modulus: int
    low_classes: int  # residue classes of the low group; the others belong to the rest
    low: tuple[ToneLines, ...]  # by first line: progressions that end at the ceiling
    rest: tuple[ToneLines, ...]  # by first line: progressions across the band


def search(
    lines: ArrayLike,
    low: Sequence[bool],
    ceiling: int | None = None,
    *,
    limits: tuple[float, float] | None = None,
    starts: int = 8,
    seed: int = 0,
    quick: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[ToneLines, ...]:
    """Choose the allocation whose signals, phases and free powers included, have the lowest peaks.

    The criterion is the mean of ``log RPF``: at equal peaks the information matrix of an input grows
    with rms squared, so it is minus half the mean logarithm of the information bought.

    Parameters
    ----------
    lines : array_like of int, shape (line,)
        Rising; holes (structural modes, wanted empty lines) are kept free.
    low : sequence of bool, shape (effector,)
        Effectors that stay in the lower frequencies: the propulsors, whose thrust follows slow commands
        only (the rule of the LA-8 work).
    ceiling : int, optional
        Highest harmonic of those; needed where `low` has any.
    limits : tuple of 2 floats, optional
        As for `freqid.design.multisine.phases.lowest_peak`.
    starts, seed : int
        Of each of the few hundred waveforms that are compared.
    quick : bool
        Compare fewer of them, from few starts, before their peaks are lowest: a tenth of the time, for a set
        of about the same worth.
    progress : callable, optional
        Called with how many layouts are done and how many there are.

    Returns
    -------
    sets : tuple of ndarray of int, one for each effector
        Lines of `lines` that no set holds stay empty.

    Raises
    ------
    UsageError
        If the low effectors have no ceiling, or no layout gives every effector enough harmonics.

    Notes
    -----
    Progressions of strides p and q are disjoint if and only if their first lines differ modulo
    ``gcd(p, q)``. A layout splits the residues modulo m between the groups and gives the low group the
    stride p = m a, the rest q = m b, with a and b just large enough for their numbers.
    """
    lines = np.asarray(lines, dtype=np.int64)
    lows = sum(map(bool, low))
    rests = len(low) - lows
    if lows and ceiling is None:
        raise UsageError("the low effectors have no ceiling", remedy="give their highest harmonic")
    highest = int(lines[-1] if ceiling is None else ceiling)
    layouts = tuple(_layouts(lines, lows, rests, highest, _QUICK_SPARSEST)) if quick else ()
    layouts = layouts or tuple(_layouts(lines, lows, rests, highest, _SPARSEST))
    if not layouts:
        raise UsageError(
            f"no layout gives {lows} low and {rests} other effectors enough of {lines.size} harmonics",
            remedy="raise the ceiling (excitation.propulsor_share), widen band_hz or lengthen period_s, "
            "or use allocation 'interleaved'",
        )
    known: dict[tuple[int, ...], float] = {}
    effort: dict[str, Any] = {"starts": _QUICK_STARTS, "sharpest": RANKING} if quick else {"starts": starts}

    def cost(index: ToneLines) -> float:
        shape = tuple(
            (index // np.gcd.reduce(index)).tolist()
        )  # waves that differ by a factor of time are one
        if shape not in known:
            waveform = lowest_peak(np.array(shape), limits=limits, seed=seed, **effort)
            known[shape] = float(np.log(waveform.factor))
        return known[shape]

    best, chosen = np.inf, ((), ())
    for i, layout in enumerate(layouts):
        total, found = _choose(layout, lows, rests, cost)
        if total < best:
            best, chosen = total, found
        if progress is not None:
            progress(i + 1, len(layouts))
    low_sets, rest_sets = iter(chosen[0]), iter(chosen[1])
    return tuple(next(low_sets) if is_low else next(rest_sets) for is_low in low)


def _layouts(lines: ToneLines, lows: int, rests: int, ceiling: int, sparsest: float) -> Iterator[_Layout]:
    """Yield the layouts in which everybody has enough tones, with strides up to a multiple of the number."""
    fewest = min(_FEWEST_TONES, lines.size // (lows + rests))
    strides: set[tuple[int, int, int, int]] = set()
    for modulus in range(1, int(sparsest * (lows + rests)) + 1):
        for classes in range(modulus + 1):
            if (classes == 0) == (lows == 0) and (classes == modulus) == (rests == 0):
                a = -(-lows // classes) if lows else 1
                b = -(-rests // (modulus - classes)) if rests else 1
                strides.add((modulus, classes, modulus * a, modulus * b))
    for modulus, classes, p, q in sorted(strides):
        many = int(np.prod([(modulus - i) / (i + 1) for i in range(classes)]))  # binomial
        if max(p if lows else 0, q if rests else 0) > sparsest * (lows + rests) or many > _MOST_CHOICES:
            continue
        low = _progressions(lines[lines <= ceiling], lines[0], p) if lows else ()
        rest = _progressions(lines, lines[0], q) if rests else ()
        if min((s.size for s in (*low, *rest)), default=0) >= fewest:
            yield _Layout(modulus, classes, low, rest)


def _progressions(lines: ToneLines, first: int, stride: int) -> tuple[ToneLines, ...]:
    """Return the lines of every residue of `stride`, counted from `first`."""
    return tuple(lines[(lines - first) % stride == j] for j in range(stride))


def _choose(
    layout: _Layout, lows: int, rests: int, cost: Callable[[ToneLines], float]
) -> tuple[float, tuple[tuple[ToneLines, ...], tuple[ToneLines, ...]]]:
    """Return the cheapest choice of a layout: total cost, and the sets of both groups by first line."""
    low_cost = np.array([cost(s) for s in layout.low])
    rest_cost = np.array([cost(s) for s in layout.rest])
    low_class = np.arange(low_cost.size) % layout.modulus
    rest_class = np.arange(rest_cost.size) % layout.modulus
    best, chosen = np.inf, ((), ())
    for classes in combinations(range(layout.modulus), layout.low_classes):
        a = np.flatnonzero(np.isin(low_class, classes))
        b = np.flatnonzero(~np.isin(rest_class, classes))
        a = np.sort(a[np.argsort(low_cost[a], kind="stable")[:lows]])
        b = np.sort(b[np.argsort(rest_cost[b], kind="stable")[:rests]])
        total = low_cost[a].sum() + rest_cost[b].sum()
        if total < best:
            best = total
            chosen = tuple(layout.low[i] for i in a), tuple(layout.rest[i] for i in b)
    return best, chosen
