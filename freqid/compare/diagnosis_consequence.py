"""The consequence of what a diagnosis found: what the named effects cost in margins, modes and trim."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from freqid.compare.consequence import Consequence
from freqid.core.errors import FreqidError
from freqid.core.results.diagnosis import GapDiagnosis
from freqid.core.scenario import Scenario

Settings = Mapping[str, Mapping[str, float]]
Name = tuple[str, str]

LEVEL = 0.9
"""Of the intervals."""

DRAWS = 60
"""Vehicles drawn for the intervals."""

WORTH_SAYING = 0.5
"""Change of the phase margin from which the verdict mentions it, deg."""

_STAGES = ("command", "airframe", "mass")  # of effects that change the vehicle under its law


def with_consequence(
    diagnosis: GapDiagnosis,
    simulation: object,
    settings: Settings,
    names: Sequence[Name],
    covariance: ArrayLike,
    *,
    baseline: Settings | None = None,
    reference: str = "",
) -> GapDiagnosis:
    """Return the diagnosis with the consequence of its leading closure, in its table and its verdict.

    The diagnosis comes back as it is if there is nothing to say: no closure, no effect that changes the
    vehicle under its law (those of sensors and wind do not), or a simulation without a known law.

    Parameters
    ----------
    diagnosis : GapDiagnosis
        Read: `how_far`, its first entry; `where`, unless `reference` is given; and `verdict`, to which one
        sentence is added if the phase margin changes by `WORTH_SAYING` or stability is lost.
    simulation : object
        Only one with an attribute ``scenario`` (a `Scenario`) has a known law; its ``effects``, the settings
        in force by effect id, are needed if `baseline` is given.
    settings : mapping of mapping of float
        Refitted parameters of the leading closure, by effect id.
    names : sequence of (effect, parameter), length k
        Those of the parameters that were fitted.
    covariance : array_like, shape (k, k)
        Their covariance.
    baseline : mapping of mapping of float, optional
        Parameters, by effect id, at which the refit changes nothing: zero size for an effect that is replayed
        beside the simulation. The scenario is then flown with the settings in force plus ``settings -
        baseline``. Without it the scenario is flown with `settings` themselves.
    reference : str
        Reference condition at which margins are computed. If it is empty or not in the scenario, the one that
        holds most of the gap according to `diagnosis.where`; if there is none either, nothing is said.

    Notes
    -----
    The law is the one designed for the simulation as it is, without the effects.
    """
    scenario = getattr(simulation, "scenario", None)
    if not isinstance(scenario, Scenario) or not diagnosis.how_far:
        return diagnosis
    chosen = [i for i, (effect, _) in enumerate(names) if _changes_vehicle(effect)]
    fitted = tuple(names[i] for i in chosen)
    known = {at.id: at for at in scenario.reference}
    at = known.get(reference) or known.get(_largest(diagnosis, known))
    if not fitted or at is None:
        return diagnosis
    flown = {effect: dict(settings[effect]) for effect in settings if _changes_vehicle(effect)}
    if baseline is not None:
        flown = _added(getattr(simulation, "effects", {}), flown, baseline)
    spread = np.asarray(covariance, dtype=float)[np.ix_(chosen, chosen)]
    table = _table(scenario, at, flown, fitted, spread)
    first = replace(diagnosis.how_far[0], consequence=table)
    verdict = diagnosis.verdict
    if table.get("matters"):
        verdict = f"{verdict} With {' and '.join(first.effects)}: {table['sentence']}.".lstrip()
    return replace(diagnosis, verdict=verdict, how_far=(first, *diagnosis.how_far[1:]))


def _changes_vehicle(identifier: str) -> bool:
    """Return whether an effect changes the vehicle under its law, and a scenario can be flown with it."""
    from freqid.simulate.effects import library, shipped

    effect = library().get(identifier)
    if effect is None or effect.stage not in _STAGES:
        return False
    return identifier in shipped() or effect.replay is None or effect.add is not None


def _largest(diagnosis: GapDiagnosis, known: Mapping[str, object]) -> str:
    """Return the reference condition with the largest share of the gap; an empty name if none is known.

    A cell that several conditions share counts in equal parts for each.
    """
    share = dict.fromkeys(known, 0.0)
    for place in diagnosis.where:
        regimes = place.regime.split()
        for name in regimes:
            if name in share:
                share[name] += place.share / len(regimes)
    best = max(share, key=lambda name: share[name], default="")
    return best if best and share[best] > 0 else ""


def _added(in_force: Settings, settings: Settings, baseline: Settings) -> dict[str, dict[str, float]]:
    """Return the settings in force plus what differs between settings and baseline."""
    return {
        effect: {
            name: in_force.get(effect, {}).get(name, 0.0) + value - baseline.get(effect, {}).get(name, 0.0)
            for name, value in values.items()
        }
        for effect, values in settings.items()
    }


def _table(
    scenario: Scenario, reference: Any, settings: Settings, names: Sequence[Name], covariance: Any
) -> dict[str, Any]:
    """Return the consequence as `Closure.consequence` holds it, or why it is not known."""
    from freqid.compare.scenario_consequence import consequence_of_effects  # jax

    try:
        cost = consequence_of_effects(
            scenario,
            reference,
            {},
            settings,
            names=names,
            covariance=covariance,
            draws=DRAWS,
            level=LEVEL,
        )
    except FreqidError as error:
        return {"reference": reference.id, "sentence": f"what it costs is not known: {error.message}"}
    return {
        "reference": reference.id,
        "sentence": f"{cost.sentence()} ({reference.id})",
        "matters": _matters(cost),
        "level": LEVEL,
        "figures": _figures(cost),
    }


def _matters(cost: Consequence) -> bool:
    """Return whether the loss is worth a sentence in the verdict."""
    if not cost.before.stable:
        return False
    lost = cost.lost_phase_deg
    return not cost.after.stable or bool(np.isfinite(lost) and abs(lost) >= WORTH_SAYING)


def _figures(cost: Consequence) -> dict[str, dict[str, float]]:
    """Return margins by axis, modes and trim authority, before and after, with the interval of the change."""
    before, after = cost.before.figures(), cost.after.figures()
    table = {}
    for path in {**before, **after}:
        kind, place, *_ = path.split("/")
        if kind == "margins" and place not in cost.after.axes:
            continue
        low, high = cost.change_intervals.get(path, (np.nan, np.nan))
        table[path] = {
            "before": before.get(path, np.nan),
            "after": after.get(path, np.nan),
            "change": cost.change.get(path, np.nan),
            "lo": low,
            "hi": high,
        }
    return table
