"""Effects fitted to manoeuvres, and where such fits begin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqid.gap.changes import IMPOSSIBLE, Values, changes, departures, settings_of
from freqid.gap.compare import Compared
from freqid.gap.evidence import Evidence, Hypothesis
from freqid.gap.gather import evidence_of
from freqid.gap.simulation import Simulation
from freqid.gap.testable import in_force_of
from freqid.gap.tolerance import OF_EFFECT
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]

_ROUNDS = 12
_WORSE = 0.5  # of misfit, which is of noise alone
_SETTLED = 0.02  # standard errors
_WIDE = 10.0  # times what is expected of a parameter: a refit goes where the data send it
_UNKNOWN = (
    0.7  # of what was expected beforehand: a parameter that data do not narrow further is not determined
)


@dataclass(frozen=True, eq=False)
class Sought:
    """Parameters of effects that are fitted: where they begin, what is expected of them, and their bounds.

    Attributes
    ----------
    names : tuple of tuple of str
        Effect id and parameter of each number.
    start, centre : ndarray, shape (parameter,)
        Where a fit begins, within the bounds; what is in force in the simulation.
    scale, low, high : ndarray, shape (parameter,)
    """

    names: tuple[tuple[str, str], ...]
    start: Array
    centre: Array
    scale: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, effects: Sequence[Effect], start: Values, simulation: Simulation) -> Sought:
        """Return the parameters that a start has, by effect, in the order of effects."""
        names = tuple((e.id, n) for e in effects for n in start[e.id])
        by_id = {e.id: e for e in effects}
        described = [by_id[i].parameters[n] for i, n in names]
        force = {e.id: in_force_of(e, simulation) for e in effects}
        low, high = np.array([p.low for p in described]), np.array([p.high for p in described])
        return cls(
            names=names,
            start=np.clip([start[i][n] for i, n in names], low, high),
            centre=np.array([force[i][n] for i, n in names]),
            scale=np.array([p.scale for p in described]),
            low=low,
            high=high,
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
    sought = Sought.of(effects, start, compared[0].trial.simulation)
    names, scale, low, high = sought.names, sought.scale, sought.low, sought.high
    value, covariance = sought.start, np.diag(scale**2)
    best, least = np.clip(sought.centre, low, high), np.inf
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
