"""What a gap costs where the simulation is a scenario's: margins and modes, told in the verdict."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from freqid.core.errors import FreqidError
from freqid.gap.consequence import Consequence
from freqid.gap.diagnose import Findings
from freqid.gap.refit import Refit
from freqid.gap.simulation import Simulation
from freqid.gap.testable import in_force_of
from freqid.gap.verdict import verdict

LEVEL = 0.9
_DRAWS = 60
_MATTERS = 0.5  # deg of phase margin that are worth a word in the verdict
_FELT = ("command", "airframe", "mass")  # stages that change the vehicle under its law


def with_cost(found: Findings, simulation: Simulation) -> Findings:
    """Return findings whose leading closure says what it costs; the same where nothing can be said.

    Parameters
    ----------
    found : Findings
    simulation : Simulation
        Only a scenario's has a control law that is known.

    Notes
    -----
    At the reference flown that holds most of the gap's energy. The law is that of the simulation as it is.
    """
    from freqid.gap.connect.scenario import ScenarioSimulation  # jax

    diagnosis = found.diagnosis
    if not isinstance(simulation, ScenarioSimulation) or not diagnosis.how_far or not found.refits:
        return found
    refit = _of_vehicle(next(iter(found.refits.values())))
    if not refit.names:
        return found
    known = {at.id: at for at in simulation.scenario.reference}
    flown = [r for r in found.map.share("regime") if r in known]
    if not flown:
        return found
    table = _told(simulation, known[flown[0]], refit)
    closures = (replace(diagnosis.how_far[0], consequence=table), *diagnosis.how_far[1:])
    said = verdict(diagnosis.gap, diagnosis.where, found.map, diagnosis.which, closures)
    return replace(found, diagnosis=replace(diagnosis, verdict=said, how_far=closures))


def _of_vehicle(refit: Refit) -> Refit:
    """Return the part of a refit that changes the vehicle under its law, as its scenario can be flown."""
    from freqid.simulate.effects import shipped

    effects = tuple(
        e for e in refit.effects if e.stage in _FELT and (e.id in shipped() or e.replay is None or e.add)
    )
    kept = [i for i, (effect, _) in enumerate(refit.names) if effect in {e.id for e in effects}]
    return Refit(
        effects,
        tuple(refit.names[i] for i in kept),
        refit.value[kept],
        refit.covariance[np.ix_(kept, kept)],
        refit.at_bound,
        refit.undetermined,
    )


def _as_flown(simulation: Any, refit: Refit) -> dict[str, dict[str, float]]:
    """Return the settings that a scenario would have to be flown with.

    What is replayed beside a simulation comes on top of what that has in force; what the simulation
    computes itself is in its own terms already.
    """
    found = {}
    for effect in refit.effects:
        base, force = in_force_of(effect, simulation), simulation.effects[effect.id]
        found[effect.id] = {
            name: force.get(name, 0.0) + value - base.get(name, 0.0)
            for name, value in refit.settings[effect.id].items()
        }
    return found


def _told(simulation: Any, reference: Any, refit: Refit) -> dict[str, Any]:
    from freqid.gap.scenario_consequence import consequence

    try:
        found = consequence(
            simulation.scenario,
            reference,
            {},
            _as_flown(simulation, refit),
            names=refit.names,
            covariance=refit.covariance,
            draws=_DRAWS,
            level=LEVEL,
        )
    except FreqidError as error:
        return {"reference": reference.id, "sentence": f"what it costs is not known: {error.message}"}
    return {
        "reference": reference.id,
        "sentence": f"{found.sentence()} ({reference.id})",
        "matters": _matters(found),
        "level": LEVEL,
        "figures": _figures(found),
    }


def _matters(found: Consequence) -> bool:
    """Whether the loss is worth a word in the verdict."""
    if not found.before.stable:
        return False
    if not found.after.stable:
        return True
    place, _ = found.after.worst("phase_deg", found.after.axes)
    lost = found.change.get(f"margins/{place}/phase_deg", np.nan)
    return bool(np.isfinite(lost) and abs(lost) >= _MATTERS)


def _figures(found: Consequence) -> dict[str, dict[str, float]]:
    """Return margins by axis, modes and trim authority, before and after, with the interval of the change."""
    before, after = found.before.figures(), found.after.figures()
    table = {}
    for path in {**before, **after}:
        kind, place, *_ = path.split("/")
        if kind == "margins" and place not in found.after.axes:
            continue
        low, high = found.change_intervals.get(path, (np.nan, np.nan))
        table[path] = {
            "before": before.get(path, np.nan),
            "after": after.get(path, np.nan),
            "change": found.change.get(path, np.nan),
            "lo": low,
            "hi": high,
        }
    return table
