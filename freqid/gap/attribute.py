"""Which effect: how strongly data speak for each candidate, for pairs of them, and for none at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from freqid.gap.evidence import IN_MANEUVER, IN_ROW, Estimate, Evidence, Hypothesis, everywhere
from freqid.gap.signature import GIVEN, scale_of
from freqid.gap.tolerance import DERIVATIVES, DYNAMICS
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]

NONE, OTHER = "none", "other"
FREE = (4.0, 15.0)
"""What no candidate explains may move derivatives and actuators by this many sigma of their tolerance."""

LEAST_ODDS = 2.5
"""Logarithm of the odds for a gap below which none is called, however narrow the null draws are: what they
do not know of, the baseline's own formulas and gusts, is worth as much."""

_APART = 0.5  # of what is expected of a size: how far it may differ between manoeuvres or responses
_PLAIN = 4.0  # standard deviations of the noise of all lines, from which a gap is plain
_MOST = 0.75  # of it
_STRONGEST = 8  # single effects that pairs are made of
_PAIR_PENALTY = 3.0  # two effects at once are this much less expected, in logarithms


@dataclass(frozen=True, eq=False)
class Judged:
    """What data say of one explanation.

    Attributes
    ----------
    name : str
        Effect id, two of them joined by ``+``, or ``other``.
    evidence : float
        Log Bayes factor against no effect, averaged over the explanation's variants.
    null : ndarray, shape (draw,)
        The same of draws without an effect.
    best : Hypothesis
        The variant that data prefer among those of one size in all manoeuvres.
    estimate : Estimate
        Its coefficients.
    settings : dict of dict of float
        Parameters by effect where it was weighed in full (`freqid.gap.finalists`), else nothing.
    """

    name: str
    evidence: float
    null: Array
    best: Hypothesis
    estimate: Estimate
    settings: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def variants(effect: Effect, evidence: Evidence) -> tuple[Hypothesis, ...]:
    """Return the ways in which an effect may show: all its parameters, or one place of several, or some.

    Each of them again with a size that differs between manoeuvres, and between responses too, where the
    evidence has columns for that: a truth of another formula than the candidate's is of another size in
    another regime and in another response.
    """
    prefix = f"{effect.id}:"
    names = [n for n in _known(evidence, prefix) if everywhere(n)]
    scales = {n: scale_of(effect, n[len(prefix) :]) for n in names}
    if not names:
        return ()
    if effect.alternatives:
        both = [n for n in names if n[len(prefix) :] in effect.jointly]
        groups = [[n] for n in names] + ([both] if len(both) > 1 else [])
    else:
        plain = [n for n in names if GIVEN not in n]
        size = f"{prefix}{effect.size}"
        rest = [n for n in plain if n != size]
        groups = [plain, *([n, *rest] for n in names if GIVEN in n)]
    whole = (
        Hypothesis(effect.id, tuple(evidence.column(n) for n in g), tuple(scales[n] for n in g))
        for g in groups
        if g
    )
    return tuple(way for h in whole for way in freer(h, evidence))


def freer(hypothesis: Hypothesis, evidence: Evidence) -> tuple[Hypothesis, ...]:
    """Return an explanation, and it with sizes of its effects that differ between manoeuvres and responses.

    As far as the evidence has columns for that; every effect of several by itself.
    """
    effects: dict[str, list[tuple[int, float]]] = {}
    for column, scale in zip(hypothesis.columns, hypothesis.scale, strict=True):
        effects.setdefault(evidence.signatures[column - 1].partition(":")[0], []).append((column, scale))
    found = []
    for way in product(*(_chain(part, evidence) for part in effects.values())):
        columns, scales = zip(*(pair for part in way for pair in part), strict=True)
        found.append(Hypothesis(hypothesis.name, columns, scales))
    return tuple(found)


def _chain(part: list[tuple[int, float]], evidence: Evidence) -> list[list[tuple[int, float]]]:
    """Return columns of an effect with their scales: as they are, by manoeuvre, by response too."""
    size, scale = part[0]
    name, chain = evidence.signatures[size - 1], [part]
    for within in (IN_MANEUVER, IN_ROW):
        more = [(evidence.column(n), _APART * scale) for n in _known(evidence, name + within)]
        if more:
            chain.append([*chain[-1], *more])
    return chain


def free(evidence: Evidence) -> tuple[Hypothesis, ...]:
    """Return explanations without a name: derivatives of one response or of all, or actuators, at will."""
    groups: dict[str, list[int]] = {}
    for name in evidence.tolerances:
        kind, _, what = name.partition(":")
        if kind == DERIVATIVES:
            groups.setdefault(what.partition(":")[0], []).append(evidence.column(name))
            groups.setdefault("responses", []).append(evidence.column(name))
        elif kind == DYNAMICS:
            groups.setdefault("actuators", []).append(evidence.column(name))
    return tuple(
        Hypothesis(OTHER, tuple(columns), (float(np.sqrt(size**2 - 1)),) * len(columns))
        for columns in groups.values()
        for size in FREE
    )


def judge(evidence: Evidence, library: Mapping[str, Effect]) -> list[Judged]:
    """Return what data say of every effect, of *other* and of the likeliest pairs, strongest first.

    Parameters
    ----------
    evidence : Evidence
    library : dict of Effect
        With the parameters that they have on the vehicle.
    """
    found = [
        judged
        for effect in library.values()
        if (judged := _judged(effect.id, variants(effect, evidence), evidence)) is not None
    ]
    found.sort(key=lambda j: -j.evidence)
    singles = list(found[:_STRONGEST])
    other = _judged(OTHER, free(evidence), evidence)
    every = [
        *found,
        *([other] if other else []),
        *(paired(a, b, evidence) for a, b in combinations(singles, 2)),
    ]
    return sorted(every, key=lambda j: -j.evidence)


def with_the_unexplained(judged: Sequence[Judged], evidence: Evidence) -> list[Judged]:
    """Return explanations with *other* as likely as most of a plain gap is, unless one explains as much.

    A gap that stands out of the noise of all lines together is not what explains a part of it.
    """
    noise = evidence.null_energy
    plain = float(evidence.metric[0, 0]) - float(noise.mean()) if noise.size else 0.0
    most = 0.5 * _MOST * plain
    if plain < _PLAIN * float(noise.std()) or any(j.evidence > most for j in judged if j.name != OTHER):
        return list(judged)
    found = [replace(j, evidence=max(j.evidence, most)) if j.name == OTHER else j for j in judged]
    return sorted(found, key=lambda j: -j.evidence)


def paired(one: Judged, other: Judged, evidence: Evidence) -> Judged:
    """Return what data say of two effects at once, each as free as it may be alone."""
    columns = (*one.best.columns, *other.best.columns)
    both = Hypothesis(f"{one.name}+{other.name}", columns, (*one.best.scale, *other.best.scale))
    each = averaged(np.array([evidence.evidences(way) for way in freer(both, evidence)]))
    return Judged(both.name, float(each[0]), each[1:], both, evidence.estimate(both))


def prior(name: str, effects: int) -> float:
    """Return the logarithm of an explanation's prior: all singles together have as much as *none*."""
    if name == OTHER:
        return -float(np.log(4.0))
    if "+" in name:
        return -float(np.log(max(effects * (effects - 1) / 2, 1))) - _PAIR_PENALTY
    return -float(np.log(max(effects, 1)))


def priors(names: Sequence[str], judged: NDArray[np.bool_]) -> Array:
    """Return the logarithm of the prior of names in many cases, shape (case, name).

    Parameters
    ----------
    names : sequence of str
        Effects and *other*.
    judged : ndarray of bool, shape (case, name)
    """
    count = judged.sum(axis=1)
    found = np.zeros(judged.shape)
    for n in np.unique(count):
        found[count == n] = [prior(name, int(n)) for name in names]
    return found


def existence(judged: Sequence[Judged]) -> tuple[float, Array]:
    """Return the statistic of whether there is a gap, of the data and of each null draw.

    The logarithm of the Bayes factor of any explanation against none: an average over the candidates, so
    that a small effect is seen along its own signature however many lines there are.
    """
    singles = [j for j in judged if "+" not in j.name]
    every = np.array([np.concatenate([[j.evidence], j.null]) for j in singles]).T
    found = statistic([j.name for j in singles], every)
    return float(found[0]), found[1:]


def statistic(names: Sequence[str], evidence: Array) -> Array:
    """Return the statistic of `existence` for many cases.

    Parameters
    ----------
    names : sequence of str
        Effects and *other*.
    evidence : ndarray, shape (case, name)
        NaN for what was not judged.

    Returns
    -------
    ndarray, shape (case,)
    """
    judged = np.isfinite(evidence)
    return _log_of_sum(np.where(judged, evidence, -np.inf) + priors(names, judged), 1)


def critical(null: Array, level: float) -> float:
    """Return the statistic above which a gap is called: rarer than `level` without one, and plain odds."""
    low, high = float(null.min()), float(null.max()) + 100.0
    for _ in range(60):
        mid = (low + high) / 2
        low, high = (low, mid) if p_value(mid, null) < level else (mid, high)
    return max(high, LEAST_ODDS)


def coefficients(judged: Judged, evidence: Evidence) -> dict[str, float]:
    """Return the estimates of an explanation's best variant, by signature or tolerance."""
    every = (*evidence.signatures, *evidence.tolerances)
    return {
        every[column - 1]: float(value)
        for column, value in zip(judged.best.columns, judged.estimate.value, strict=True)
    }


def p_value(statistic: float, null: Array) -> float:
    """Return how often no gap gives this much or more, of null draws as `existence` makes them.

    Counted where draws reach it; beyond them by a generalised Pareto tail of moments fitted to the largest
    fifth of the draws, with a shape that is not negative, so that no tail ends (Pickands, Annals of
    Statistics 3, 1975).
    """
    count = len(null)
    above = int((null >= statistic).sum())
    if above >= 5 or count < 25:
        return (above + 1) / (count + 1)
    ordered = np.sort(null)
    start = ordered[-max(count // 5, 5)]
    excess = ordered[ordered > start] - start
    mean, var = float(excess.mean()), float(excess.var())
    shape = float(np.clip(0.5 * (1 - mean**2 / max(var, 1e-300)), 0.0, 0.3))
    scale = mean * (1 - shape)
    far = max(statistic - start, 0.0) / max(scale, 1e-12)
    tail = np.exp(-far) if shape < 1e-6 else (1 + shape * far) ** (-1 / shape)
    counted = 6 / (count + 1)  # what counting says where the tail begins, so that p never rises again
    return float(np.clip(len(excess) / count * tail, 1e-12, counted))


def averaged(each: Array) -> Array:
    """Return the evidence of an explanation of that of its variants along the first axis, all as likely."""
    return _log_of_sum(each, 0) - np.log(len(each))


def _log_of_sum(values: Array, axis: int) -> Array:
    """Return the logarithm of a sum of exponentials of which one at least is finite."""
    most = values.max(axis=axis, keepdims=True)
    return np.log(np.exp(values - most).sum(axis=axis)) + most.squeeze(axis)


def _judged(name: str, hypotheses: Sequence[Hypothesis], evidence: Evidence) -> Judged | None:
    if not hypotheses:
        return None
    each = np.array([evidence.evidences(h) for h in hypotheses])
    whole = averaged(each)
    # what is shown, refitted and paired has one size
    likely = [e if evidence.whole(h) else -np.inf for e, h in zip(each[:, 0], hypotheses, strict=True)]
    best = hypotheses[int(np.argmax(likely))]
    return Judged(name, float(whole[0]), whole[1:], best, evidence.estimate(best))


def _known(evidence: Evidence, prefix: str) -> list[str]:
    """Return the signatures with a prefix that do anything in these manoeuvres."""
    size = evidence.metric.diagonal()
    names = [n for n in evidence.signatures if n.startswith(prefix)]
    return [n for n in names if size[evidence.column(n)] > 1e-12]
