"""A study from scenario to results; what is done already is taken from its folder."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up
from freqid.blend.predict import replay
from freqid.core.errors import UsageError
from freqid.core.record import Maneuver, read_record
from freqid.core.results.corridor import write_global
from freqid.core.results.design import read_design
from freqid.core.results.point import PointModel, read_point
from freqid.core.scenario import Scenario, read_scenario
from freqid.core.store import replacing
from freqid.identify.in_flight.parameter_history import parameter_history
from freqid.identify.point import Estimator, predict
from freqid.report.study.results import HeldOut, StudiedPoint, StudyResults, rmse_inside, spread
from freqid.simulate import runner, sensors
from freqid.study import work
from freqid.study.convergence import validation_rmse

Progress = Callable[[str], None]

_FLIGHT_SEEDS = 1000  # apart for each design, so that no two flights share their sensors' errors


@dataclass(frozen=True)
class Campaign:
    """What a study does.

    Attributes
    ----------
    scenario : Path
    folder : Path
        Where everything is kept; a second run takes from it what is done.
    references : tuple of str
        Conditions that are flown and identified; all of the scenario where empty.
    held_out : tuple of str
        Those of them that the global model is not made from.
    sensors : str
        Suite of the scenario.
    noise : float
        Multiple of its noise.
    estimator : {"instruments", "least-squares"}, optional
        In place of the scenario's.
    seed : int
    jobs : int
        Processes at once.
    """

    scenario: Path
    folder: Path
    references: tuple[str, ...] = ()
    held_out: tuple[str, ...] = ()
    sensors: str = "research"
    noise: float = 1.0
    estimator: Estimator | None = None
    seed: int = 0
    jobs: int = 2


@dataclass(frozen=True, eq=False)
class _Flights:
    """Flights of all conditions by id: one that is modelled, one that validates."""

    modelled: dict[str, Path]
    validating: dict[str, Path]


def study(campaign: Campaign, say: Progress = lambda text: None) -> StudyResults:
    """Do a campaign, or what is left of it.

    Parameters
    ----------
    campaign : Campaign
    say : callable
        Told what begins, in a few words.

    Returns
    -------
    StudyResults

    Raises
    ------
    UsageError
        Where the scenario lacks a condition, or fewer than two are left for the global model.
    DataError
        Where flights diverge or cannot be identified: how many, and the first of them.
    """
    scenario, sha256 = read_scenario(campaign.scenario)
    ids = campaign.references or tuple(at.id for at in scenario.reference)
    for identifier in (*ids, *campaign.held_out):
        scenario.reference_of(identifier)
    for identifier in campaign.held_out:
        if identifier not in ids:
            ids = (*ids, identifier)
    used = [identifier for identifier in ids if identifier not in campaign.held_out]
    if len(used) < 2:
        raise UsageError(
            f"a global model needs two conditions or more, {len(used)} is left", remedy="study more of them"
        )
    sensors.suite(scenario, campaign.sensors)  # a wrong name is said before anything is flown
    say(f"flights at {len(ids)} conditions")
    design, flights = _fly(campaign, sha256, ids)
    say("point models")
    points = _identify(campaign, sha256, flights)
    linear = _linearise(campaign, sha256, ids)
    say("global model")
    corridor = line_up([points[i] for i in used], [f"points/{i}.h5" for i in used])
    write_global(campaign.folder / "model.h5", corridor)
    model = GlobalModel(corridor)
    say("page")
    shown = {used[k] for k in spread([scenario.reference_of(i) for i in used])}
    return StudyResults(
        vehicle=scenario.aircraft(),
        sensors=campaign.sensors,
        noise=campaign.noise,
        estimator=points[ids[0]].estimator,
        design=read_design(design),
        points=tuple(
            _studied(scenario, points[i], flights, linear[i], i, converging=i in shown) for i in ids
        ),
        model=model,
        held_out=tuple(_held_out(scenario, model, points[i], flights, i) for i in campaign.held_out),
        provenance=_provenance(campaign, sha256, ids),
    )


def _fly(campaign: Campaign, sha256: str, ids: Sequence[str]) -> tuple[Path, _Flights]:
    """Return the design that is modelled with, and the records of all flights."""
    shared = {"scenario": str(campaign.scenario)}
    seeds = [campaign.seed, campaign.seed + 1]
    designs = _run(campaign, sha256, work.design, [shared | {"seed": seed} for seed in seeds], ".h5")
    inputs = [
        shared
        | {
            "reference": identifier,
            "design": str(design),
            "sensors": campaign.sensors,
            "noise": campaign.noise,
            "seed": _FLIGHT_SEEDS * seed + place,
        }
        for seed, design in zip(seeds, designs, strict=True)
        for place, identifier in enumerate(ids)
    ]
    records = _run(campaign, sha256, work.fly, inputs, ".h5")
    shutil.copyfile(designs[0], campaign.folder / "design.h5")
    count = len(ids)
    return designs[0], _Flights(
        dict(zip(ids, records[:count], strict=True)), dict(zip(ids, records[count:], strict=True))
    )


def _identify(campaign: Campaign, sha256: str, flights: _Flights) -> dict[str, PointModel]:
    """Return the point models by condition; copies under readable names are kept beside."""
    inputs = [
        {
            "scenario": str(campaign.scenario),
            "reference": identifier,
            "record": str(record),
            "validation": str(flights.validating[identifier]),
            "estimator": campaign.estimator,
        }
        for identifier, record in flights.modelled.items()
    ]
    found = _run(campaign, sha256, work.identify, inputs, ".h5")
    points = dict(zip(flights.modelled, found, strict=True))
    for identifier, path in points.items():
        target = campaign.folder / "points" / f"{identifier}.h5"
        target.parent.mkdir(exist_ok=True)
        with replacing(target) as temporary:
            shutil.copyfile(path, temporary)
    return {identifier: read_point(path) for identifier, path in points.items()}


def _linearise(campaign: Campaign, sha256: str, ids: Sequence[str]) -> dict[str, dict[str, dict[str, float]]]:
    """Return the derivatives of the linearised simulation by condition, response and regressor."""
    inputs = [{"scenario": str(campaign.scenario), "reference": identifier} for identifier in ids]
    found = _run(campaign, sha256, work.linearise, inputs, ".json")
    return {identifier: json.loads(path.read_text()) for identifier, path in zip(ids, found, strict=True)}


def _run(
    campaign: Campaign, sha256: str, unit: runner.Work, inputs: Sequence[runner.Inputs], suffix: str
) -> list[Path]:
    folder = campaign.folder / "units" / unit.__name__
    return runner.run(unit, inputs, folder, scenario_sha256=sha256, suffix=suffix, jobs=campaign.jobs)


def _provenance(campaign: Campaign, sha256: str, ids: Sequence[str]) -> dict[str, Any]:
    """Return what another needs to make the same study, beside what the page states anyway."""
    return {
        "scenario": str(campaign.scenario),
        "SHA-256": sha256,
        "seed": campaign.seed,
        "conditions": list(ids),
        "held out": list(campaign.held_out),
    }


def _studied(
    scenario: Scenario,
    model: PointModel,
    flights: _Flights,
    linear: dict[str, dict[str, float]],
    identifier: str,
    *,
    converging: bool,
) -> StudiedPoint:
    """Return one condition for the page, with histories where they are shown."""
    if not converging:
        return StudiedPoint(model, linear, {}, np.zeros(0), {})
    settings = scenario.identification
    assert settings is not None  # the units have refused a scenario without it
    flown, held_out = (
        Maneuver.of(read_record(of[identifier])) for of in (flights.modelled, flights.validating)
    )
    histories = parameter_history(flown, settings, every_s=2.0, excitation=scenario.excitation)
    first = settings.responses[0]
    highest = float(model[first].fit["frequency"].axis[-1])
    errors = validation_rmse(histories, held_out, settings, highest)
    return StudiedPoint(model, linear, histories, histories[first].time, errors)


def _held_out(
    scenario: Scenario, model: GlobalModel, point: PointModel, flights: _Flights, identifier: str
) -> HeldOut:
    """Return errors on a manoeuvre of a condition that the global model has not seen, about the means."""
    settings = scenario.identification
    assert settings is not None
    maneuver = Maneuver.of(read_record(flights.validating[identifier]))
    there = predict(point, maneuver, settings)
    everywhere = replay(model, maneuver, outside="hold")
    highest = model.corridor.highest_hz
    return HeldOut(
        reference=point.reference,
        global_rmse={name: rmse_inside(fit, highest) for name, fit in everywhere.items()},
        point_rmse={name: rmse_inside(fit, highest) for name, fit in there.items()},
    )
