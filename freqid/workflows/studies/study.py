"""A study from scenario to results; what is done already is taken from its folder."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from freqid.blend.corridor_study import StudyResults, spanning_conditions
from freqid.blend.semi_local.advance_ratio_study import CampaignStudy
from freqid.blend.study_file import STUDY, write_study
from freqid.core.blas import on_one_thread
from freqid.core.errors import UsageError
from freqid.core.record import Maneuver, read_record
from freqid.core.results.design import MultisineDesign, read_design
from freqid.core.results.point import PointModel, read_point
from freqid.core.scenario import Scenario
from freqid.core.sections.estimators import EstimatorName
from freqid.core.store import replacing
from freqid.simulate import runner
from freqid.simulate import sensors as suites
from freqid.workflows.files import save
from freqid.workflows.inputs import File, Flight, Tell, name_of, scenario_of, silent
from freqid.workflows.models.blend import blend
from freqid.workflows.studies import units
from freqid.workflows.studies.known_truth import Known, know, read_known_truth
from freqid.workflows.studies.own_flights import study_flights
from freqid.workflows.studies.studied import held_out_errors, studied_point
from freqid.workflows.studies.study_by_advance_ratio import study_campaign

_FLIGHT_SEEDS = 1000  # apart for each design, so that no two flights share their sensors' errors


@dataclass(frozen=True)
class _Campaign:
    """What a study does: arguments of `study`, with the scenario as it was read."""

    scenario: Scenario
    folder: Path
    sensors: str
    noise: float
    estimator: EstimatorName | None
    seed: int
    jobs: int


@dataclass(frozen=True, eq=False)
class _Flights:
    """Flights of all conditions by id: one that is modelled, one that validates."""

    modelled: dict[str, Path]
    validating: dict[str, Path]


@on_one_thread
def study(
    scenario: Scenario | File,
    folder: File,
    *,
    at: Sequence[str] = (),
    held_out: Sequence[str] = (),
    sensors: str = "research",
    noise: float = 1.0,
    estimator: EstimatorName | None = None,
    seed: int = 0,
    jobs: int = 2,
    turbulence: float | None = None,
    flights: File | Iterable[Flight] | None = None,
    columns: File | None = None,
    resample_hz: float | None = None,
    validate: Sequence[str] = (),
    tell: Tell = silent,
) -> StudyResults | CampaignStudy:
    """Design inputs, fly and identify the conditions of a scenario, and blend a global model.

    Real flights take the place of the simulation where they are given: nothing is designed or simulated
    then. Of a scenario with ``[campaign]`` all its trims are flown in one flight, and laws of the propellers'
    advance ratio are fitted to what the manoeuvres tell.

    What is done is kept: a second run, or one after a stop, goes on from there.

    Parameters
    ----------
    scenario : path or name, or a Scenario as it was read
    folder : path
        Where everything is kept: designs, flights, ``points/ID.h5``, ``model.h5``.
    at : sequence of str
        Conditions that are flown and identified; all of the scenario where empty.
    held_out : sequence of str
        Those of them that the global model is judged at and not made from.
    sensors : str
        Suite of the scenario.
    noise : float
        Multiple of its noise.
    estimator : {"instruments", "least-squares"}, optional
        In place of the scenario's.
    seed : int
    jobs : int
        Processes at once; -1 for one a core.
    turbulence : float, optional
        Multiple of light turbulence, of a campaign; one where absent.
    flights : path of a folder, or FlightRecords or paths, optional
        Real flights, sorted to the scenario's conditions by the one that they state or else by their trim.
        Several at a condition make one point model; the last of them, by name, validates it.
    columns : path, optional
        Map of columns, with which logs among the flights are read.
    resample_hz : float, optional
        Rate that these logs are put on; without it they must be uniform and have one clock.
    validate : sequence of str
        Names, without suffix, of the flights that validate, in place of the last of each condition.
    tell : callable
        Told what begins, in a few words.

    Returns
    -------
    StudyResults
        Of a campaign a CampaignStudy: ``.model("global")``, ``.scores`` of held-out manoeuvres.

    Raises
    ------
    UsageError
        Where the scenario lacks a condition, was changed after it was read, or fewer than two conditions are
        left for the global model.
    DataError
        Where flights diverge or cannot be identified: how many, and the first of them.

    Examples
    --------
    >>> results = study("la8", "la8-study", at=("u20", "u45"))  # doctest: +SKIP
    >>> results.points[0].model["M"].r2  # doctest: +SKIP
    """
    described = scenario_of(scenario)
    if flights is not None:
        if turbulence is not None or (sensors, noise) != ("research", 1.0):
            raise UsageError(
                "sensors, noise and turbulence are of a simulation, but real flights are given",
                remedy="leave them out",
            )
        return study_flights(
            described,
            folder,
            flights,
            columns=columns,
            resample_hz=resample_hz,
            validate=validate,
            at=at,
            held_out=held_out,
            estimator=estimator,
            tell=tell,
        )
    if validate or columns is not None or resample_hz is not None:
        raise UsageError(
            "a column map, its rate and validating flights go with flights", remedy="name their folder"
        )
    if described.campaign is not None:
        if at:
            raise UsageError(
                "a campaign flies all its trims, but conditions are named",
                where=name_of(described),
                remedy="leave them out",
            )
        conditions = {
            "sensors": sensors,
            "noise": noise,
            "turbulence": 1.0 if turbulence is None else turbulence,
        }
        return study_campaign(
            described, folder, held_out=held_out, estimator=estimator, seed=seed, tell=tell, **conditions
        )
    if turbulence is not None:
        raise UsageError("turbulence is of a campaign, the scenario has none", remedy="leave it out")
    if not described.file or scenario_of(described.file) != described:
        raise UsageError(
            "a study works from the scenario's file, which does not say what is given",
            where=name_of(described),
            remedy="write the changes into a file",
        )
    campaign = _Campaign(described, Path(folder), sensors, noise, estimator, seed, jobs)
    ids = tuple(at) or tuple(reference.id for reference in described.reference)
    for identifier in (*ids, *held_out):
        described.reference_of(identifier)
    for identifier in held_out:
        if identifier not in ids:
            ids = (*ids, identifier)
    used = [identifier for identifier in ids if identifier not in held_out]
    if len(used) < 2:
        raise UsageError(
            f"a global model needs two conditions or more, {len(used)} is left", remedy="study more of them"
        )
    suites.suite(described, sensors)  # a wrong name is said before anything is flown
    campaign.folder.mkdir(parents=True, exist_ok=True)
    tell(f"flights at {len(ids)} conditions")
    own = [i for i in ids if described.excitation is not None and i in described.excitation.at]
    designs, flown = _fly(campaign, ids, own)
    tell("point models")
    points = _identify(campaign, flown)
    tell("flights without noise")
    known = _know(campaign, ids, own)
    tell("global model")
    model = blend(campaign.folder / "points" / f"{i}.h5" for i in used)
    save(model, campaign.folder / "model.h5")
    tell("page")
    shown = {used[k] for k in spanning_conditions([described.reference_of(i) for i in used])}
    results = StudyResults(
        vehicle=described.aircraft(),
        sensors=sensors,
        noise=noise,
        estimator=points[ids[0]].estimator,
        design=next(iter([designs[i] for i in ids if i not in own] or designs.values())),
        own_designs={i: designs[i] for i in own},
        points=tuple(
            studied_point(
                described,
                points[i],
                linear=known[i][0],
                truth=known[i][1],
                flown=_maneuver(flown.modelled[i]) if i in shown else None,
                validating=_maneuver(flown.validating[i]),
            )
            for i in ids
        ),
        model=model,
        held_out=tuple(
            held_out_errors(described, model, points[i], _maneuver(flown.validating[i])) for i in held_out
        ),
        provenance=_provenance(campaign, ids, held_out),
    )
    write_study(campaign.folder / STUDY, results, described.sha256)
    return results


def _fly(
    campaign: _Campaign, ids: Sequence[str], own: Sequence[str]
) -> tuple[dict[str, MultisineDesign], _Flights]:
    """Return the designs that are modelled with, and the records of all flights, by condition.

    Conditions share one design, but for those that state an excitation of their `own`.
    """
    of = {identifier: {"at": identifier} if identifier in own else {} for identifier in ids}
    seeds = [campaign.seed, campaign.seed + 1]
    each = [(seed, place, identifier) for seed in seeds for place, identifier in enumerate(ids)]
    wanted = [{"seed": seed} | of[identifier] for seed, _, identifier in each]
    designs = _run(campaign, units.design, wanted, ".h5")
    inputs = [
        {
            "reference": identifier,
            "design": design,
            "sensors": campaign.sensors,
            "noise": campaign.noise,
            "seed": _FLIGHT_SEEDS * seed + place,
        }
        for (seed, place, identifier), design in zip(each, designs, strict=True)
    ]
    records = _run(campaign, units.fly, inputs, ".h5")
    modelled = dict(zip(ids, designs, strict=False))
    for identifier, design in modelled.items():
        with replacing(campaign.folder / _design_name(identifier, own)) as temporary:
            shutil.copyfile(design, temporary)
    count = len(ids)
    return {i: read_design(path) for i, path in modelled.items()}, _Flights(
        dict(zip(ids, records[:count], strict=True)), dict(zip(ids, records[count:], strict=True))
    )


def _identify(campaign: _Campaign, flights: _Flights) -> dict[str, PointModel]:
    """Return the point models by condition; copies under readable names are kept beside."""
    inputs = [
        {
            "reference": identifier,
            "record": record,
            "validation": flights.validating[identifier],
            "estimator": campaign.estimator,
        }
        for identifier, record in flights.modelled.items()
    ]
    found = _run(campaign, units.identify, inputs, ".h5")
    points = dict(zip(flights.modelled, found, strict=True))
    for identifier, path in points.items():
        target = campaign.folder / "points" / f"{identifier}.h5"
        target.parent.mkdir(exist_ok=True)
        with replacing(target) as temporary:
            shutil.copyfile(path, temporary)
    return {identifier: read_point(path) for identifier, path in points.items()}


def _design_name(identifier: str, own: Sequence[str]) -> str:
    """Return the file in the folder that holds the inputs of a condition."""
    return f"design-{identifier}.h5" if identifier in own else "design.h5"


def _know(campaign: _Campaign, ids: Sequence[str], own: Sequence[str]) -> dict[str, Known]:
    """Return the linearised simulation by condition, and what three flights without noise tell of it."""
    inputs = [
        {
            "reference": identifier,
            "design": campaign.folder / _design_name(identifier, own),
            "sensors": campaign.sensors,
            "seed": _FLIGHT_SEEDS * campaign.seed + place,
            "estimator": campaign.estimator,
        }
        for place, identifier in enumerate(ids)
    ]
    found = _run(campaign, know, inputs, ".json")
    return {identifier: read_known_truth(path) for identifier, path in zip(ids, found, strict=True)}


def _run(campaign: _Campaign, unit: runner.Work, inputs: Sequence[runner.Inputs], suffix: str) -> list[Path]:
    folder = campaign.folder / "units" / unit.__name__
    return runner.run_units(
        unit,
        inputs,
        folder,
        scenario_sha256=campaign.scenario.sha256,
        suffix=suffix,
        beside={"scenario": campaign.scenario.file},  # where it lies is no matter, what it says is hashed
        jobs=campaign.jobs,
    )


def _provenance(campaign: _Campaign, ids: Sequence[str], held_out: Sequence[str]) -> dict[str, Any]:
    """Return what another needs to make the same study, beside what the page states anyway."""
    return {
        "scenario": campaign.scenario.file,
        "SHA-256": campaign.scenario.sha256,
        "seed": campaign.seed,
        "conditions": list(ids),
        "held out": list(held_out),
    }


def _maneuver(path: Path) -> Maneuver:
    return Maneuver.of(read_record(path))
