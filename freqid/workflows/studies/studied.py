"""What a study says of each condition, whether it was simulated or flown."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import msgspec
import numpy as np

from freqid.blend.consistency import density_agreement, repeat_agreement
from freqid.blend.corridor_study import HeldOut, StudiedPoint, StudyResults, rmse_inside
from freqid.blend.global_model import GlobalModel
from freqid.blend.predict import replay
from freqid.blend.semi_local.advance_ratio_study import CampaignStudy
from freqid.core.errors import GateFailed
from freqid.core.record import Maneuver
from freqid.core.results.judged.gates import MissedGate, gate_sentences, missed_gates
from freqid.core.results.judged.truth import KnownTruth
from freqid.core.results.point import PointModel
from freqid.core.scenario import Gates, Scenario
from freqid.core.sections.estimators import ESTIMATOR_NAMES
from freqid.identify.in_flight.convergence import validation_rmse
from freqid.identify.in_flight.parameter_history import parameter_history
from freqid.identify.model.problem import measured_responses
from freqid.identify.point import predict_responses
from freqid.workflows.inputs import identification_of
from freqid.workflows.models.identify import identify_point

_SAID = 12  # missed gates in one sentence; a campaign of many manoeuvres may miss hundreds


def studied_point(
    scenario: Scenario,
    model: PointModel,
    *,
    linear: Mapping[str, Mapping[str, float]] | None = None,
    truth: Mapping[str, KnownTruth] | None = None,
    flown: Maneuver | None = None,
    validating: Maneuver | None = None,
    repeat: Callable[[], PointModel] | None = None,
) -> StudiedPoint:
    """Return one condition for the page.

    Parameters
    ----------
    scenario : Scenario
    model : PointModel
    linear : mapping of str to mapping of str to float, optional
        Derivatives of the linearised simulation.
    truth : mapping of str to KnownTruth, optional
        By response: what flights without noise tell.
    flown, validating : Maneuver, optional
        One that the model is made from, whose parameters are followed over its length where it is given,
        and one that it is not made from. Where the scenario has a gate of consistency, a model of the latter
        is compared.
    repeat : callable, optional
        Returns that model; it is identified where absent.
    """
    settings, repeated = identification_of(scenario), {}
    if scenario.gates.consistency is not None and validating is not None:
        other = (
            repeat()
            if repeat is not None
            else identify_point(
                validating,
                scenario,
                at=model.reference.id,
                estimator=next((name for name in ESTIMATOR_NAMES if name == model.estimator), None),
            )
        )
        repeated = repeat_agreement(model, other)
    recorded = settings.response_source == "record"  # which estimates in flight do not follow
    if flown is None or recorded or any("frequency" not in r.fit for r in model.responses.values()):
        return StudiedPoint(model, linear or {}, {}, np.zeros(0), {}, repeated, truth or {})
    histories = parameter_history(
        flown, settings, every_s=2.0, excitation=scenario.at(model.reference.id).excitation
    )
    first = settings.responses[0]
    errors = {}
    if validating is not None:
        highest = float(model[first].fit["frequency"].axis[-1])
        errors = validation_rmse(histories, validating, settings, highest)
    return StudiedPoint(model, linear or {}, histories, histories[first].time, errors, repeated, truth or {})


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


def refuse_missed_study_gates(results: StudyResults | CampaignStudy, scenario: Scenario, where: str) -> None:
    """Raise where a study misses what its scenario asks for.

    Parameters
    ----------
    results : StudyResults or CampaignStudy
    scenario : Scenario
    where : str
        Folder or page of the results.

    Raises
    ------
    GateFailed
        With a sentence for every gate that is missed, the first dozen of them.
    """
    gates = scenario.gates
    if isinstance(results, CampaignStudy):
        missed = _missed_in_campaign(results, gates)
    else:
        missed = [f"{text} at {p.id}" for p in results.points for text in gate_sentences(p.model, gates)]
        compared = {
            f"{r} of repeated flights at {p.id}": v for p in results.points for r, v in p.repeated.items()
        }
        if results.model is not None:
            for one in density_agreement(results.model):
                compared[f"{one.response} between rho {one.rho[0]:.4g} and {one.rho[1]:.4g} kg/m3"] = one.p
        missed += _inconsistent(compared, gates.consistency)
    if missed:
        said = "; ".join(missed[:_SAID]) + (f"; and {len(missed) - _SAID} more" if missed[_SAID:] else "")
        raise GateFailed(said, where=where, remedy="everything is written all the same")


def _missed_in_campaign(study: CampaignStudy, gates: Gates) -> list[str]:
    """Return what the manoeuvres of a campaign miss; held-out ones validate the laws made without them."""
    of_points = msgspec.structs.replace(gates, validation=None)
    missed = [f"{miss} in {at}" for at, p in study.points.items() for miss in missed_gates(p, of_points)]
    for at, of in study.validation.items():
        for r, value in of.items():
            asked = gates.validation.get(r) if isinstance(gates.validation, dict) else gates.validation
            if asked is not None and not value <= asked:
                missed.append(f"{MissedGate(r, 'validation error', value, asked)} in {at}, held out")
    compared = {f"{r} of {pair}": p for pair, of in study.repeated.items() for r, p in of.items()}
    return missed + _inconsistent(compared, gates.consistency)


def _inconsistent(compared: Mapping[str, float], gate: float | None) -> list[str]:
    """Return the comparisons that fall short of the gate of consistency, each held to its share of it."""
    if gate is None:
        return []
    if not compared:
        return [
            str(MissedGate("the flights, none of which was repeated,", "consistency", float("nan"), gate))
        ]
    share = gate / len(compared)
    return [str(MissedGate(what, "consistency", p, share)) for what, p in compared.items() if not p >= share]
