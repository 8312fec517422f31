"""What a study says of each condition, whether it was simulated or flown."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from freqid.blend.campaign import HeldOut, StudiedPoint, StudyResults, rmse_inside
from freqid.blend.consistency import density_agreement, repeat_agreement
from freqid.blend.global_model import GlobalModel
from freqid.blend.predict import replay
from freqid.core.errors import GateFailed
from freqid.core.record import Maneuver
from freqid.core.results.point import MissedGate, PointModel, gate_sentences
from freqid.core.scenario import Scenario
from freqid.core.sections.estimators import ESTIMATOR_NAMES
from freqid.identify.in_flight.convergence import validation_rmse
from freqid.identify.in_flight.parameter_history import parameter_history
from freqid.identify.model.problem import measured_responses
from freqid.identify.point import predict_responses
from freqid.workflows.inputs import identification_of
from freqid.workflows.models.identify import identify_point


def studied_point(
    scenario: Scenario,
    model: PointModel,
    *,
    linear: Mapping[str, Mapping[str, float]] | None = None,
    flown: Maneuver | None = None,
    validating: Maneuver | None = None,
) -> StudiedPoint:
    """Return one condition for the page.

    Parameters
    ----------
    scenario : Scenario
    model : PointModel
    linear : mapping of str to mapping of str to float, optional
        Derivatives of the linearised simulation.
    flown, validating : Maneuver, optional
        One that the model is made from, whose parameters are followed over its length where it is given,
        and one that it is not made from. Where the scenario has a gate of consistency, a model of the latter
        is compared.
    """
    settings, repeated = identification_of(scenario), {}
    if scenario.gates.consistency is not None and validating is not None:
        other = identify_point(
            validating,
            scenario,
            at=model.reference.id,
            estimator=next((name for name in ESTIMATOR_NAMES if name == model.estimator), None),
        )
        repeated = repeat_agreement(model, other)
    recorded = settings.response_source == "record"  # which estimates in flight do not follow
    if flown is None or recorded or any("frequency" not in r.fit for r in model.responses.values()):
        return StudiedPoint(model, linear or {}, {}, np.zeros(0), {}, repeated)
    histories = parameter_history(flown, settings, every_s=2.0, excitation=scenario.excitation)
    first = settings.responses[0]
    errors = {}
    if validating is not None:
        highest = float(model[first].fit["frequency"].axis[-1])
        errors = validation_rmse(histories, validating, settings, highest)
    return StudiedPoint(model, linear or {}, histories, histories[first].time, errors, repeated)


def held_out_errors(scenario: Scenario, model: GlobalModel, point: PointModel, maneuver: Maneuver) -> HeldOut:
    """Return errors on a manoeuvre of a condition that the global model has not seen, about the means.

    Parameters
    ----------
    scenario : Scenario
    model : GlobalModel
    point : PointModel
        Identified at that condition, from another manoeuvre.
    maneuver : Maneuver
    """
    settings = identification_of(scenario)
    there = predict_responses(point, maneuver, settings)
    measured = measured_responses(maneuver, settings) if settings.response_source == "record" else None
    everywhere = replay(model, maneuver, measured=measured, outside="hold")
    highest = model.corridor.highest_hz
    if not np.isfinite(highest):
        highest = np.inf
    return HeldOut(
        reference=point.reference,
        global_rmse={name: rmse_inside(fit, highest) for name, fit in everywhere.items()},
        point_rmse={name: rmse_inside(fit, highest) for name, fit in there.items()},
    )


def refuse_missed_study_gates(results: StudyResults, scenario: Scenario, where: str) -> None:
    """Raise where a study misses what its scenario asks for.

    Parameters
    ----------
    results : StudyResults
    scenario : Scenario
    where : str
        Folder or page of the results.

    Raises
    ------
    GateFailed
        With a sentence for every gate that is missed at a condition.
    """
    missed = [
        f"{text} at {p.id}" for p in results.points for text in gate_sentences(p.model, scenario.gates)
    ] + [str(miss) for miss in _inconsistent(results, scenario.gates.consistency)]
    if missed:
        raise GateFailed("; ".join(missed), where=where, remedy="everything is written all the same")


def _inconsistent(results: StudyResults, gate: float | None) -> list[MissedGate]:
    """Return the comparisons that fall short of the gate of consistency, each held to its share of it."""
    if gate is None:
        return []
    found = {f"{r} of repeated flights at {p.id}": v for p in results.points for r, v in p.repeated.items()}
    if results.model is not None:
        for one in density_agreement(results.model):
            found[f"{one.response} between rho {one.rho[0]:.4g} and {one.rho[1]:.4g} kg/m3"] = one.p
    if not found:
        return [MissedGate("the flights, none of which was repeated,", "consistency", float("nan"), gate)]
    share = gate / len(found)
    return [MissedGate(what, "consistency", p, share) for what, p in found.items() if not p >= share]
