"""Effects fitted to manoeuvres, and where such fits begin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.gap.changes import Values, changes, departures, settings_of
from freqid.gap.compare import Compared
from freqid.gap.descent import Sought, View, descend
from freqid.gap.evidence import Evidence, Hypothesis
from freqid.gap.gather import evidence_of
from freqid.gap.simulation import side_by_side
from freqid.gap.testable import in_force_of
from freqid.gap.tolerance import OF_EFFECT
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Seen = dict[tuple[int, bytes], tuple[Complex, dict[str, Complex]]]
"""What settings make of a manoeuvre, and small departures from them, by the manoeuvre and the settings."""

_ROUNDS = 12
_WORSE = 0.5  # of misfit, which is of noise alone
_SETTLED = 0.02  # standard errors
_WIDE = 10.0  # times what is expected of a parameter: a refit goes where the data send it
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


def refit(
    compared: Sequence[Compared], effects: Sequence[Effect], start: Values, seen: Seen | None = None
) -> Refit:
    """Fit the parameters of effects, nonlinear ones in full, with tolerances free within their prior.

    Parameters
    ----------
    compared : sequence of Compared
    effects : sequence of Effect
        With their parameters on this vehicle, testable in each manoeuvre.
    start : dict of dict of float
        Parameters to be fitted, by effect; others stay as they are.
    seen : dict, optional
        What was seen of manoeuvres on the way, for refits of the same effects that look there again.

    Returns
    -------
    Refit

    Raises
    ------
    ImpossibleSettings
        Where nothing can be as any of the settings looked at would have it.

    Notes
    -----
    Gauss-Newton in the metric of noise and tolerances. What an effect may be off by without being one is part
    of what its parameters are fitted to.
    """
    sought = Sought.of(effects, start, compared[0].trial.simulation)
    known: Seen = {} if seen is None else seen
    value, view = descend(
        sought,
        lambda value: _view(compared, effects, sought, value, known),
        rounds=_ROUNDS,
        settled=_SETTLED,
        worse=_WORSE,
    )
    described = list(zip(sought.names, value, np.sqrt(np.diag(view.covariance)), strict=True))
    wide = _UNKNOWN * _WIDE * sought.scale
    undetermined = tuple(n for (n, _, sigma), least in zip(described, wide, strict=True) if sigma > least)
    bounds = zip(described, sought.low, sought.high, strict=True)
    bound = tuple(n for (n, v, _), low, high in bounds if v in (low, high))
    return Refit(tuple(effects), sought.names, value, view.covariance, bound, undetermined)


def stepped(
    compared: Sequence[Compared], effects: Sequence[Effect], fitted: Refit, seen: Seen
) -> dict[str, dict[str, float]]:
    """Return what some of a refit's manoeuvres ask for by themselves, by effect: one step from what all do.

    Without anything computed anew: between such settings, a fraction of a standard error apart, effects are
    straight.

    Parameters
    ----------
    compared : sequence of Compared
    effects : sequence of Effect
    fitted : Refit
        Of these manoeuvres and others.
    seen : dict
        What it saw.
    """
    sought = Sought.of(effects, fitted.settings, compared[0].trial.simulation)
    view = _view(compared, effects, sought, sought.start, seen)
    return settings_of(sought.names, np.clip(sought.start + view.step, sought.low, sought.high))


def _view(
    compared: Sequence[Compared], effects: Sequence[Effect], sought: Sought, value: Array, known: Seen
) -> View:
    """Return what is left at some settings, and where small departures from them lead.

    What the settings make is told by the flight as it was, with the motion that the gap itself made; small
    departures by what the injected signals made, which no noise is in (instrumental variables).
    """
    names, scale = sought.names, sought.scale
    settings = settings_of(names, value)
    own = tuple(f"{OF_EFFECT}{effect.id}:" for effect in effects)
    # their tolerances are part of what is fitted; scatter between flights stays
    theirs = {n for c in compared for n in c.common if n.startswith(own)}

    def seen(c: Compared) -> tuple[Complex, dict[str, Complex]]:
        key = (id(c), value.tobytes())
        if key not in known:
            known[key] = changes(c, effects, settings), departures(c, effects, names, value, scale)[1]
        return known[key]

    taken = side_by_side(compared[0].trial.simulation, seen, compared)
    evidence = evidence_of(compared, changes=taken, null=False).without(theirs)
    # the prior is about no departure: a step is drawn short, and goes as far as data send it
    columns = tuple(range(1, 1 + len(names)))
    found = evidence.estimate(Hypothesis("refit", columns, tuple(_WIDE * scale)))
    return View(float(evidence.metric[0, 0]), found.value, found.covariance)


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
