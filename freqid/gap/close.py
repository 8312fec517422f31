"""How far a gap shrinks once named effects are added: refitted on some manoeuvres, scored on others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqid.core.diagnosis import Share
from freqid.core.errors import FreqidError
from freqid.gap.compare import Compared, evidence_of
from freqid.gap.evidence import Evidence, Hypothesis
from freqid.gap.testable import in_force_of
from freqid.gap.together import together
from freqid.gap.tolerance import OF_EFFECT
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Values = Mapping[str, Mapping[str, float]]

IMPOSSIBLE = (FreqidError, ValueError, ArithmeticError)
"""What effects raise at settings that nothing can have, as one moment of inertia beyond the others' sum."""

_ROUNDS = 12
_WORSE = 0.5  # of misfit, which is of noise alone
_SETTLED = 0.02  # standard errors
_WIDE = 10.0  # times what is expected of a parameter: a refit goes where the data send it
CHANGE = "change"
"""Name of the column of what effects make at some settings."""

_GENEROUS = 3.0  # times what is expected of a parameter
_STEP = 0.1  # of a parameter's scale, of differences
_UNKNOWN = (
    0.7  # of what was expected beforehand: a parameter that data do not narrow further is not determined
)


@dataclass(frozen=True, eq=False)
class Refit:
    """Effects with the settings that manoeuvres ask for.

    Attributes
    ----------
    effects : tuple of Effect
    names : tuple of tuple of str
        Effect id and parameter of each number.
    value : ndarray, shape (parameter,)
    covariance : ndarray, shape (parameter, parameter)
    at_bound : tuple of tuple of str
        Parameters that stopped at a bound.
    undetermined : tuple of tuple of str
        Parameters on which the data say next to nothing.
    """

    effects: tuple[Effect, ...]
    names: tuple[tuple[str, str], ...]
    value: Array
    covariance: Array
    at_bound: tuple[tuple[str, str], ...]
    undetermined: tuple[tuple[str, str], ...]

    @property
    def settings(self) -> dict[str, dict[str, float]]:
        """Refitted parameters by effect."""
        return settings_of(self.names, self.value)


def refit(compared: Sequence[Compared], effects: Sequence[Effect], start: Values) -> Refit:
    """Fit the parameters of effects, nonlinear ones in full, with tolerances free within their prior.

    Parameters
    ----------
    compared : sequence of Compared
    effects : sequence of Effect
        With their parameters on this vehicle, testable in each manoeuvre.
    start : dict of dict of float
        Parameters to be fitted, by effect; others stay as they are.

    Returns
    -------
    Refit

    Notes
    -----
    Gauss-Newton in the metric of noise and tolerances. What an effect may be off by without being one is part
    of what its parameters are fitted to.
    """
    own = tuple(f"{OF_EFFECT}{effect.id}:" for effect in effects)
    compared = [_without(c, own) for c in compared]
    names = tuple((effect.id, name) for effect in effects for name in start[effect.id])
    described = [next(e for e in effects if e.id == i).parameters[n] for i, n in names]
    scale = np.array([p.scale for p in described])
    low, high = np.array([p.low for p in described]), np.array([p.high for p in described])
    value = np.clip([start[i][n] for i, n in names], low, high)
    covariance, undetermined = np.diag(scale**2), ()
    force = {e.id: in_force_of(e, compared[0].trial.simulation) for e in effects}
    best, least = np.clip([force[i][n] for i, n in names], low, high), np.inf
    for _ in range(_ROUNDS):
        try:
            evidence = _about(compared, effects, names, value, scale)
        except IMPOSSIBLE:
            value = (value + best) / 2
            continue
        left = float(evidence.metric[0, 0])
        if left > least + _WORSE:
            # too far: tolerances take up a delay's straight line, and its curve misleads
            value = (value + best) / 2
            continue
        best, least = value, left
        columns = tuple(range(1, 1 + len(names)))
        # the prior is about no effect, so the step is drawn towards it
        found = evidence.estimate(Hypothesis("refit", columns, tuple(_WIDE * scale)))
        covariance = found.covariance
        after = np.clip(value + found.value, low, high)
        moved = np.abs(after - value) / np.sqrt(np.diag(covariance))
        value = after
        if moved.max(initial=0.0) < _SETTLED:
            break
    else:
        value = best
    sigma = np.sqrt(np.diag(covariance))
    undetermined = tuple(n for n, s, p in zip(names, sigma, scale, strict=True) if s > _UNKNOWN * _WIDE * p)
    bound = tuple(n for n, v, a, b in zip(names, value, low, high, strict=True) if v in (a, b))
    return Refit(tuple(effects), names, value, covariance, bound, undetermined)


def _without(compared: Compared, tolerances: tuple[str, ...]) -> Compared:
    """Return the same without common tolerances whose names begin so; scatter between flights stays."""
    left = {n: z for n, z in compared.common.items() if not n.startswith(tolerances)}
    return compared if len(left) == len(compared.common) else replace(compared, common=left)


def changes(compared: Compared, effects: Sequence[Effect], settings: Values) -> Complex:
    """Return what effects at some settings make of a residual, shape (row, line)."""
    return compared.lines.transform(together(effects, compared.flown, settings))


@dataclass(frozen=True, eq=False)
class Misfit:
    """Whitened squared residual of some manoeuvres, tolerances refitted, before and after effects are added.

    Along the directions that any candidate can move, so that a gap is not lost among the thousands of
    lines that hold noise alone: with all of them a gap below some hundreds in ``s^T S^-1 s`` would be
    undefined.

    Attributes
    ----------
    count : int
        Directions.
    before, after : float
        Sums over them.
    null : ndarray, shape (draw,)
        What noise and tolerances alone make.
    across : ndarray, shape (draw,)
        Twice their product with the change that the effects make.
    """

    count: int
    before: float
    after: float
    null: Array
    across: Array

    @classmethod
    def pooled(cls, parts: Sequence[Misfit]) -> Misfit:
        """Return the misfit of several sets of manoeuvres together."""
        return cls(
            sum(p.count for p in parts),
            sum(p.before for p in parts),
            sum(p.after for p in parts),
            np.sum([p.null for p in parts], axis=0),
            np.sum([p.across for p in parts], axis=0),
        )

    def share(self, interval: float) -> Share:
        """Return ``G = 1 - (after - noise) / (before - noise)`` with its interval.

        The interval is that of noise: draws are added to the change that the effects make. Undefined where
        the gap is within two standard deviations of noise.
        """
        noise, scatter = float(self.null.mean()), float(self.null.std())
        gap = self.before - noise
        if gap < 2 * scatter:
            before, level, one = (x / self.count for x in (self.before, noise, scatter))
            why = (
                f"before, {before:.4g}, is within two standard deviations of noise, {level:.4g} +- {one:.2g}"
            )
            return Share(np.nan, np.nan, np.nan, why)
        wander = self.null - noise
        each = 1 - (self.after - noise + wander) / np.maximum(gap + self.across + wander, 0.1 * gap)
        lo, hi = np.quantile(each, [(1 - interval) / 2, (1 + interval) / 2])
        return Share(1 - (self.after - noise) / gap, float(lo), float(hi))


def misfit(compared: Sequence[Compared], effects: Sequence[Effect], settings: Values) -> Misfit:
    """Score effects on manoeuvres that they were not fitted to.

    Parameters
    ----------
    compared : sequence of Compared
    effects : sequence of Effect
    settings : dict of dict of float
        Of a `Refit`.
    """
    made_here = [changes(c, effects, settings) for c in compared]
    named = [(0 * z, {CHANGE: z, **c.signatures}) for c, z in zip(compared, made_here, strict=True)]
    evidence = evidence_of(compared, changes=named, sources={CHANGE: sources_of_all(effects, compared[0])})
    last = 1 + len(evidence.signatures)
    gram = evidence.metric[1:last, 1:last]
    expected = np.array([_expected(compared[0], name) for name in evidence.signatures])
    # onto directions in the metric, each as far as it may be expected to be moved
    lengths, directions = np.linalg.eigh(expected[:, None] * gram * expected)
    onto = (directions / np.sqrt(1 + np.maximum(lengths, 0.0))).T * expected
    data = onto @ evidence.metric[1:last, 0]
    change = onto @ gram[:, evidence.signatures.index(CHANGE)]
    null = onto @ np.array([evidence.null_products(k) for k in range(1, last)])
    return Misfit(
        count=int((lengths > 1).sum()),
        before=float(data @ data),
        after=float((data - change) @ (data - change)),
        null=(null**2).sum(axis=0),
        across=2 * change @ null,
    )


def sources_of_all(effects: Sequence[Effect], compared: Compared) -> tuple[str, ...]:
    """Return the channels that anything effects make is computed from."""
    ids = {e.id for e in effects}
    each = [s for name, s in compared.sources.items() if name.partition(":")[0] in ids]
    return tuple(dict.fromkeys(n for s in each for n in s))


def _expected(compared: Compared, name: str) -> float:
    """Return by how much a candidate's parameter may be off, generously; the change itself by its all."""
    if name == CHANGE:
        return 1.0
    return _GENEROUS * compared.scales[name]


def _about(
    compared: Sequence[Compared],
    effects: Sequence[Effect],
    names: Sequence[tuple[str, str]],
    value: Array,
    scale: Array,
) -> Evidence:
    """Return the evidence of small departures from settings.

    What the settings make is told by the flight as it was, with the motion that the gap itself made; small
    departures by what the injected signals made, which no noise is in (instrumental variables).
    """
    settings = settings_of(names, value)
    taken = [
        (changes(c, effects, settings), departures(c, effects, names, value, scale)[1]) for c in compared
    ]
    return evidence_of(compared, changes=taken)


def departures(
    compared: Compared,
    effects: Sequence[Effect],
    names: Sequence[tuple[str, str]],
    value: Array,
    scale: Array,
) -> tuple[Complex, dict[str, Complex]]:
    """Return what settings make of a residual, and its derivatives by them, by what injected signals made.

    Parameters
    ----------
    compared : Compared
    effects : sequence of Effect
    names : sequence of tuple of str
        Effect id and parameter.
    value, scale : ndarray, shape (parameter,)
        Settings, and what is expected of them.

    Returns
    -------
    change : ndarray of complex, shape (row, line)
    derivatives : dict of ndarray of complex, shape (row, line)
        By ``effect:parameter``.
    """
    settings = settings_of(names, value)
    at, columns = together(effects, compared.trial, settings), {}
    for k, (identifier, name) in enumerate(names):
        parameter = next(e for e in effects if e.id == identifier).parameters[name]
        step = _STEP * scale[k]
        up = value[k] + step if value[k] + step <= parameter.high else value[k] - step
        other = {**settings, identifier: {**settings[identifier], name: float(up)}}
        moved = together(effects, compared.trial, other) - at
        columns[f"{identifier}:{name}"] = compared.lines.transform(moved) / (up - value[k])
    return compared.lines.transform(at), columns


def starting(effect: Effect, evidence: Evidence, best: Hypothesis, value: Array, trial) -> dict[str, float]:
    """Return where a refit of an effect begins: its linear estimate, other parameters at their defaults."""
    every = (*evidence.signatures, *evidence.tolerances)
    force = in_force_of(effect, trial.simulation)
    found: dict[str, float] = {}
    for column, change in zip(best.columns, value, strict=True):
        owner, _, rest = every[column - 1].partition(":")
        if owner != effect.id:
            continue
        name, _, given = rest.partition("|")
        found[name] = force[name] + float(change)
        if given:
            other, _, at = given.partition("=")
            found[other] = float(at)
    if not effect.alternatives and effect.size in found:
        for name, parameter in effect.parameters.items():
            if name not in found and parameter.scale > 0:
                found[name] = force[name]
    return found


def settings_of(names: Sequence[tuple[str, str]], value: Array) -> dict[str, dict[str, float]]:
    """Return parameters by effect."""
    found: dict[str, dict[str, float]] = {}
    for (identifier, name), x in zip(names, value, strict=True):
        found.setdefault(identifier, {})[name] = float(x)
    return found
