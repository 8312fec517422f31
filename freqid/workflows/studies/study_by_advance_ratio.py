"""A campaign over advance ratios from its scenario to laws: fly, cut, identify, fit and judge."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from freqid import __version__
from freqid.blend.consistency import repeat_agreement
from freqid.blend.semi_local.advance_ratio_study import CampaignStudy, coefficient_histories, inner_trims
from freqid.blend.semi_local.held import semi_local_model
from freqid.blend.semi_local.held_out import LOCAL, score_held_out
from freqid.blend.semi_local.one_shot import one_shot_model
from freqid.blend.semi_local.parametric import global_model
from freqid.core.errors import DataError, FreqidError, UsageError
from freqid.core.record import FlightRecord, Maneuver, read_record, write_record
from freqid.core.results.advance_ratio import AdvanceRatioModel, LocalDerivatives
from freqid.core.results.fit import Fit
from freqid.core.results.point import PointModel, read_point
from freqid.core.scenario import Scenario
from freqid.core.sections.estimators import EstimatorName
from freqid.core.store import replacing
from freqid.core.toml import overridden
from freqid.identify.advance_ratio.clusters import cluster_alpha
from freqid.identify.advance_ratio.trim import excited
from freqid.workflows.files import save
from freqid.workflows.fly_trim_sequence import simulate_campaign
from freqid.workflows.import_log import split_flight
from freqid.workflows.inputs import File, Tell, identification_of, silent
from freqid.workflows.models.advance_ratio import problems_of, told
from freqid.workflows.models.identify import identify_point
from freqid.workflows.models.output_error import identify_output_error

_LONGITUDINAL = ("X", "Z", "M")


def study_campaign(
    scenario: Scenario,
    folder: File,
    *,
    held_out: Sequence[str] = (),
    sensors: str = "research",
    noise: float = 1.0,
    turbulence: float = 1.0,
    estimator: EstimatorName | None = None,
    seed: int = 0,
    tell: Tell = silent,
) -> CampaignStudy:
    """Fly a scenario's ``[campaign]``, cut and identify its manoeuvres, fit laws and judge them.

    Parameters
    ----------
    scenario : Scenario
        With ``[campaign]`` and ``[identification]`` in coefficient form.
    folder : path
        Where everything is kept: ``flight.h5``, ``maneuvers/m00.h5``, ``points/m00.h5``, ``global.h5`` and
        the other models. What is there of the same campaign is used again.
    held_out : sequence of str
        Manoeuvres ``m03`` that models are judged by; some inside each cluster's range where empty.
    sensors, noise, turbulence, seed
        As `freqid.workflows.fly_trim_sequence.simulate_campaign`.
    estimator : {"instruments", "least-squares"}, optional
        In place of the scenario's.
    tell : callable
        Told what begins, in a few words.

    Returns
    -------
    CampaignStudy

    Raises
    ------
    UsageError
        Where a section is missing, or a manoeuvre to hold out is none of the campaign's.
    DataError
        Where the flight diverges or no manoeuvre can be identified; single ones are left out with a remark.
    """
    settings = identification_of(scenario)
    scenario = scenario.at(scenario.campaign_start)  # one excitation is flown at all trims
    at = Path(folder)
    state = {
        "scenario": scenario.sha256,
        "sensors": sensors,
        "noise": noise,
        "turbulence": turbulence,
        "estimator": estimator,
        "seed": seed,
        "freqid_version": __version__,
    }
    _keep_same(at, state)
    tell("flight of all trims")
    pieces = _maneuvers(scenario, at, sensors, noise, turbulence, seed)
    tell(f"point models of {len(pieces)} manoeuvres")
    points, left_out = _points(scenario, at, pieces, estimator)
    identified = {identifier: read_point(path) for identifier, path in points.items()}
    local, vehicle, _ = told(points.values())
    local = replace(local, ids=tuple(points))
    out = _held_out(local, held_out)
    tell("laws")
    provenance = {"scenario": {"file": scenario.file, "sha256": scenario.sha256}, **state}
    whole = global_model(local, vehicle=vehicle, provenance=provenance)
    models = _all_kinds(whole, local)
    for model in models:
        save(model, at / f"{model.kind}.h5")
    tell("held-out manoeuvres")
    used, judged = local.of(~out), local.of(out)
    judging = _all_kinds(global_model(used, clusters=len(whole.clusters), vehicle=vehicle), used)
    scores = score_held_out(judging, judged, problems_of(judged))
    shown = judged.ids[len(judged.ids) // 2]
    maneuver = Maneuver.of(excited(read_record(pieces[shown])), scenario.aircraft())
    outputs, remarks = _simulated(maneuver, scenario)
    return CampaignStudy(
        local=local,
        models=models,
        scores=scores,
        shown=shown,
        coefficients=_in_time(maneuver, scenario, local, judging, shown),
        outputs=outputs,
        points=identified,
        validation=_validation(scenario, pieces, judged, judging[0]),
        repeated=_repeated(scenario, identified, len(pieces)),
        remarks=(
            *left_out,
            *whole.remarks,
            *remarks,
            *(r for r in models[-1].remarks if r not in whole.remarks),
        ),
        provenance={**provenance, "held out": list(judged.ids), "form": settings.form},
    )


def _keep_same(folder: Path, state: dict[str, Any]) -> None:
    """Empty the folder's campaign where it is another one's."""
    file = folder / "campaign.json"
    try:
        same = json.loads(file.read_text()) == state
    except (OSError, ValueError):  # none, or a damaged one
        same = False
    if not same:
        for old in (*folder.glob("maneuvers/m*.h5"), *folder.glob("points/m*.h5"), folder / "flight.h5"):
            old.unlink(missing_ok=True)
        with replacing(file) as temporary:
            temporary.write_text(json.dumps(state, indent=2))


def _maneuvers(
    scenario: Scenario, folder: Path, sensors: str, noise: float, turbulence: float, seed: int
) -> dict[str, Path]:
    flight = folder / "flight.h5"
    if not flight.is_file():
        flown = simulate_campaign(scenario, sensors=sensors, noise=noise, turbulence=turbulence, seed=seed)
        save(flown, flight)
    found = {}
    pieces: list[FlightRecord] = split_flight(read_record(flight), name=str(flight))
    for i, piece in enumerate(pieces):  # a run that was killed may have left a part of them
        found[f"m{i:02d}"] = folder / "maneuvers" / f"m{i:02d}.h5"
        if not found[f"m{i:02d}"].is_file():
            write_record(found[f"m{i:02d}"], piece, scenario.sha256)
    return found


def _points(
    scenario: Scenario, folder: Path, pieces: dict[str, Path], estimator: EstimatorName | None
) -> tuple[dict[str, Path], list[str]]:
    """Return the points of the manoeuvres that can be identified, and why others are left out."""
    points, left_out = {}, []
    first: FreqidError | None = None
    for identifier, piece in pieces.items():
        point = folder / "points" / f"{identifier}.h5"
        if not point.is_file():
            try:
                model = identify_point(excited(read_record(piece)), scenario, estimator=estimator)
            except DataError as error:
                first = first or error.at(str(piece))
                left_out.append(f"Manoeuvre {identifier} is left out: {error.message}.")
                continue
            save(model, point)
        points[identifier] = point
    if not points:
        raise first or DataError("the campaign holds no manoeuvre", where=str(folder))
    return points, left_out


def _held_out(local: LocalDerivatives, named: Sequence[str]) -> np.ndarray:
    for identifier in named:
        if identifier not in local.ids:
            raise UsageError(
                f"manoeuvre '{identifier}' cannot be held out, the campaign has {local.ids[0]} to "
                f"{local.ids[-1]}",
                remedy="name some of them",
            )
    if named:
        return np.array([identifier in named for identifier in local.ids])
    out = inner_trims(local, cluster_alpha(local.alpha))
    if not out.any():
        raise UsageError(
            f"{len(local.ids)} manoeuvres are too few to hold some out that laws can be judged by",
            remedy="fly five advance ratios or more in a cluster, or name them with --hold-out",
        )
    return out


def _all_kinds(whole: AdvanceRatioModel, local: LocalDerivatives) -> tuple[AdvanceRatioModel, ...]:
    problems = problems_of(local)
    return whole, semi_local_model(whole, problems), one_shot_model(whole, problems)


def _in_time(
    maneuver: Maneuver,
    scenario: Scenario,
    local: LocalDerivatives,
    models: Sequence[AdvanceRatioModel],
    shown: str,
) -> dict[str, dict[str, Fit]]:
    settings = identification_of(scenario)
    highest = scenario.excitation.band_hz[1] if scenario.excitation else None
    i = local.ids.index(shown)
    by_kind = {LOCAL: dict(zip(local.names, local.estimate[i].tolist(), strict=True))}
    j, alpha = float(local.advance_ratio[i]), float(local.alpha[i])
    by_kind |= {m.kind: m.derivatives(j, alpha, outside="hold") for m in models}
    return {
        kind: coefficient_histories(maneuver, settings, derivatives, highest)
        for kind, derivatives in by_kind.items()
    }


def _validation(
    scenario: Scenario, pieces: dict[str, Path], judged: LocalDerivatives, model: AdvanceRatioModel
) -> dict[str, dict[str, float]]:
    """Return Theil's coefficient of each held-out manoeuvre and response, by laws made without it."""
    settings = identification_of(scenario)
    highest = scenario.excitation.band_hz[1] if scenario.excitation else None
    found = {}
    for identifier, j, alpha in zip(judged.ids, judged.advance_ratio, judged.alpha, strict=True):
        maneuver = Maneuver.of(excited(read_record(pieces[identifier])), scenario.aircraft())
        derivatives = model.derivatives(float(j), float(alpha), outside="hold")
        fits = coefficient_histories(maneuver, settings, derivatives, highest)
        found[identifier] = {r: fit.inside(highest or np.inf).theil for r, fit in fits.items()}
    return found


def _repeated(
    scenario: Scenario, points: Mapping[str, PointModel], count: int
) -> dict[str, dict[str, float]]:
    """Return how manoeuvres agree that were flown at one and the same trim of the campaign."""
    trims = scenario.campaign.trim if scenario.campaign else ()
    if count != len(trims):  # some were not found in the flight, so which trim is whose is not known
        return {}
    at = [(f"m{i:02d}", trim) for i, trim in enumerate(trims)]
    found = {}
    for i, (one, trim) in enumerate(at):
        for other, again in at[i + 1 :]:
            if trim == again and one in points and other in points:
                found[f"{one} and {other}"] = repeat_agreement(points[one], points[other])
    return found


def _simulated(maneuver: Maneuver, scenario: Scenario) -> tuple[dict[str, dict[str, Fit]], tuple[str, ...]]:
    """Return the longitudinal motion with parameters of equation error and of output error."""
    settings = identification_of(scenario)
    wanted = tuple(r for r in _LONGITUDINAL if r in settings.responses)
    body = msgspec.structs.replace(
        scenario,
        identification=overridden(
            settings, axes="body", responses=wanted, method="time", estimator="least-squares"
        ),
    )
    try:
        found = identify_output_error(maneuver, body)
        parameters = {
            n: v for n, v in zip(found.names, found.start.tolist(), strict=True) if not n.startswith("x0_")
        }
        before = identify_output_error(maneuver, body, fixed=parameters | dict(found.held))
    except FreqidError as error:
        return {}, (f"Equation error and output error are not compared in time: {error}",)
    return {"equation error": dict(before.fit), "output error": dict(found.fit)}, ()
