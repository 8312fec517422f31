"""A study of real flights: sorted to conditions, identified, blended and judged, without a simulation."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import msgspec

from freqid.blend.corridor_study import StudyResults, spanning_conditions
from freqid.blend.study_file import STUDY, write_study
from freqid.core import record as record_file
from freqid.core import store
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.point import PointModel, read_point
from freqid.core.scenario import Scenario
from freqid.core.sections.estimators import EstimatorName
from freqid.core.store import replacing
from freqid.flightlog.read import readers
from freqid.identify.point import departures, flown_reference
from freqid.simulate import runner
from freqid.workflows.files import save
from freqid.workflows.import_log import read_log
from freqid.workflows.inputs import File, Flight, Tell, name_of, record_of, several, silent
from freqid.workflows.models.blend import blend
from freqid.workflows.models.identify import identify_point
from freqid.workflows.studies.studied import held_out_errors, studied_point

Flown = Mapping[str, Maneuver]
"""Manoeuvres by the name of their flight."""


def study_flights(
    scenario: Scenario,
    folder: File,
    flights: File | Iterable[Flight],
    *,
    columns: File | None = None,
    resample_hz: float | None = None,
    validate: Sequence[str] = (),
    at: Sequence[str] = (),
    held_out: Sequence[str] = (),
    estimator: EstimatorName | None = None,
    tell: Tell = silent,
) -> StudyResults:
    """Identify real flights at their conditions, blend a global model, and judge both.

    Parameters
    ----------
    scenario : Scenario
        Its references are the conditions; those that no flight belongs to are left out.
    folder : path
        Where ``points/ID.h5`` and ``model.h5`` are kept, and under ``units`` what a later run need not do
        again: records of logs, and point models by scenario, estimator and the contents of their flights.
    flights, columns, resample_hz, validate, at, held_out, estimator, tell
        As for `freqid.study`.

    Returns
    -------
    StudyResults

    Raises
    ------
    UsageError
        Where a named flight is not there, or fewer than two conditions are left for the global model.
    DataError
        Where a flight cannot be read or identified, or belongs to no condition.
    """
    tell("flights")
    kept = _Kept(scenario, Path(folder))
    sources = find_flights(scenario, flights, columns, resample_hz, kept)
    at_condition = sort_flights(scenario, {name: record_of(source) for name, source in sources.items()})
    ids = [r.id for r in scenario.reference if r.id in at_condition]
    for wanted in (*at, *held_out):
        if wanted not in ids:
            scenario.reference_of(wanted)  # a misspelt one is said to be that
            raise UsageError(f"no flight is at reference '{wanted}'", remedy=f"flown are {', '.join(ids)}")
    if at:
        ids = [i for i in ids if i in (*at, *held_out)]
    used = [i for i in ids if i not in held_out]
    if len(used) < 2:
        raise UsageError(
            f"a global model needs flights at two conditions or more, found {len(used)}",
            remedy="identify a single condition with identify-point",
        )
    roles = _roles({i: at_condition[i] for i in ids}, validate)
    for identifier in held_out:
        if not roles[identifier][1]:
            raise UsageError(
                f"reference '{identifier}' is held out but has a single flight; one is needed to make the "
                "point model, and another to judge both models by",
                remedy="leave it out of the held-out ones, or fly it again",
            )
    tell("point models")
    points = {i: kept.identify(i, sources, *roles[i], estimator) for i in ids}
    for identifier, point in points.items():
        save(point, Path(folder) / "points" / f"{identifier}.h5")
    tell("global model")
    model = blend(Path(folder) / "points" / f"{i}.h5" for i in used)
    save(model, Path(folder) / "model.h5")
    tell("page")
    shown = {used[k] for k in spanning_conditions([scenario.reference_of(i) for i in used])}
    results = StudyResults(
        vehicle=scenario.aircraft(),
        sensors="",
        noise=float("nan"),
        estimator=points[ids[0]].estimator,
        design=None,
        points=tuple(
            studied_point(
                scenario,
                points[i],
                flown=next(iter(roles[i][0].values())) if i in shown else None,
                validating=next(iter(roles[i][1].values()), None),
                repeat=lambda i=i: kept.identify(i, sources, dict([*roles[i][1].items()][:1]), {}, estimator),
            )
            for i in ids
        ),
        model=model,
        held_out=tuple(
            held_out_errors(scenario, model, points[i], next(iter(roles[i][1].values()))) for i in held_out
        ),
        provenance={
            "scenario": name_of(scenario),
            "SHA-256": scenario.sha256,
            "held out": list(held_out),
            "flights": {i: {"modelled": [*roles[i][0]], "validating": [*roles[i][1]]} for i in ids},
        },
    )
    write_study(Path(folder) / STUDY, results, scenario.sha256)
    return results


class _Kept:
    """What a study has done, under the folder's ``units``, by everything that it was made from.

    Parameters
    ----------
    scenario : Scenario
    folder : Path
    """

    def __init__(self, scenario: Scenario, folder: Path) -> None:
        self._scenario, self._folder = scenario, folder
        # of what the scenario says, as one made in Python has no file, or no longer its file's contents
        said = msgspec.json.encode(msgspec.structs.replace(scenario, file="", sha256=""), order="sorted")
        self._sha256 = hashlib.sha256(said).hexdigest()

    def _unit(self, work: runner.Work, inputs: runner.Inputs) -> runner.Unit:
        at = self._folder / "units" / work.__name__
        (unit,) = runner.plan(work, [inputs], at, scenario_sha256=self._sha256, suffix=".h5")
        return unit

    def record(self, log: Path, name: str, columns: File | None, resample_hz: float | None) -> Path:
        """Return the record of a log, read where it was not read before."""
        inputs = {
            "log": _sha256(log),
            "columns": _sha256(Path(columns)) if columns and Path(columns).is_file() else str(columns),
            "resample_hz": resample_hz,
        }
        unit, path = self._unit(read_log, inputs), self._folder / "records" / f"{name}.h5"
        if not unit.done:
            record = read_log(log, columns, scenario=self._scenario, resample_hz=resample_hz)
            save(record, unit.path, scenario=self._scenario)
        _copy(unit.path, path)
        return path

    def identify(
        self,
        identifier: str,
        sources: Mapping[str, Flight],
        modelled: Flown,
        validating: Flown,
        estimator: EstimatorName | None,
    ) -> PointModel:
        """Return the point model of a condition, identified where it was not identified before."""
        held_out = next(iter(validating), None)
        inputs = {
            "reference": identifier,
            "flights": {name: _identity(sources[name], flown) for name, flown in modelled.items()},
            "held_out": None if held_out is None else _identity(sources[held_out], validating[held_out]),
            "estimator": estimator,
        }
        unit = self._unit(identify_point, inputs)
        if not unit.done:
            point = identify_point(
                [sources[name] for name in modelled],
                self._scenario,
                at=identifier,
                held_out=None if held_out is None else sources[held_out],
                estimator=estimator,
            )
            save(point, unit.path)
        return read_point(unit.path)


def _identity(source: Flight, flown: Maneuver) -> list[str]:
    """Return what tells a flight from another: of a file its contents, else samples and sensors."""
    if isinstance(source, str | Path):
        return [_sha256(Path(source))]
    record = flown.record
    places = {name: c.position_m for name, c in record.channels.items() if c.position_m is not None}
    beside = msgspec.json.encode([record.mass_properties, flown.vehicle, places], order="sorted")
    return [record.fingerprint, hashlib.sha256(beside).hexdigest()]


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _copy(source: Path, target: Path) -> None:
    with replacing(target) as temporary:
        shutil.copyfile(source, temporary)


def find_flights(
    scenario: Scenario,
    flights: File | Iterable[Flight],
    columns: File | None,
    resample_hz: float | None,
    kept: _Kept,
) -> dict[str, Flight]:
    """Return real flights by name, in the order of the names; logs become records.

    Parameters
    ----------
    scenario : Scenario
        Describes the vehicle of logs.
    flights : path of a folder, or FlightRecords or paths
        Of a folder, all its records (``.h5``; files of other kinds are passed over) and, with `columns`,
        its logs.
    columns : path, optional
        Map of columns.
    resample_hz : float, optional
        Rate of the records of logs.
    kept : _Kept
        Keeps the records of logs.

    Raises
    ------
    UsageError
        Where the folder is missing or holds no flight, or two flights have one name.
    DataError
        Where a file is damaged.
    """
    if isinstance(flights, str | Path) and not Path(flights).is_file():
        paths = _flights_in(Path(flights), columns)
    else:
        paths = several(flights)
    found: dict[str, Flight] = {}
    for place, given in enumerate(paths, 1):
        name = Path(given).stem if isinstance(given, str | Path) else f"flight {place}"
        if name in found:
            raise UsageError(f"two flights are called '{name}'", remedy="rename one of them")
        if isinstance(given, str | Path) and _is_log(Path(given)):
            found[name] = kept.record(Path(given), name, columns, resample_hz)
        else:
            found[name] = given
    return found


def _flights_in(folder: Path, columns: File | None) -> list[Path]:
    if not folder.is_dir():
        raise UsageError("no such folder of flights", where=str(folder), remedy="check the path")
    files = sorted(path for path in folder.iterdir() if path.is_file())
    records = [p for p in files if p.suffix == ".h5" and store.kind_of(p) == record_file.FORMAT]
    logs = [p for p in files if _is_log(p) and columns is not None]
    if not records + logs:
        others = [p for p in files if _is_log(p)]
        raise UsageError(
            f"holds no flight record, and {len(others)} logs" if others else "holds no flight record",
            where=str(folder),
            remedy="read the logs with --map COLUMNS.toml, or import them first with import-log",
        )
    return sorted(records + logs, key=lambda p: p.stem)  # by flight: 'u16' before 'u16-check'


def _is_log(path: Path) -> bool:
    """Tell whether a file is of a kind that another tool logs."""
    suffix = path.suffix.lower()
    return suffix != ".h5" and any(suffix in reader.suffixes for reader in readers())


def sort_flights(scenario: Scenario, flights: Mapping[str, FlightRecord]) -> dict[str, dict[str, Maneuver]]:
    """Return manoeuvres by condition and name of the flight.

    Parameters
    ----------
    scenario : Scenario
    flights : mapping of str to FlightRecord
        One that states a reference is taken at its word; any other belongs to the reference that its means
        of speed, density and tilt do not depart from, the nearest in speed where there are several.

    Raises
    ------
    UsageError
        Where a flight states a reference that the scenario has not.
    DataError
        Where a flight is at none of the references.
    """
    found: dict[str, dict[str, Maneuver]] = {}
    for name, record in flights.items():
        maneuver = Maneuver.of(record, scenario.aircraft())
        if record.reference:
            try:
                identifier = scenario.reference_of(record.reference).id
            except UsageError as error:
                raise error.at(name) from None
        else:
            identifier = _condition_of(scenario, name, maneuver)
        found.setdefault(identifier, {})[name] = maneuver
    return found


def _condition_of(scenario: Scenario, name: str, maneuver: Maneuver) -> str:
    flown = flown_reference([maneuver])
    if flown.u != flown.u:
        raise DataError(
            "the record states no reference and holds no speed that would tell it",
            where=name,
            remedy="import it with --at REFERENCE",
        )
    ranked = sorted(scenario.reference, key=lambda r: abs(r.u - flown.u))
    fitting = [r for r in ranked if not departures(r, flown)]
    if not fitting:
        reason = departures(ranked[0], flown)[0] if ranked else "the scenario has no [[reference]]."
        raise DataError(
            f"the flight is at no reference of the scenario; of the nearest, {reason.rstrip('.')}",
            where=name,
            remedy="add a [[reference]] for it, or import it with --at REFERENCE",
        )
    return fitting[0].id


def _roles(
    flights: Mapping[str, Mapping[str, Maneuver]], validate: Sequence[str]
) -> dict[str, tuple[Flown, Flown]]:
    """Return by condition the manoeuvres that are modelled and those that validate."""
    known = {name for of in flights.values() for name in of}
    for name in validate:
        if name not in known:
            raise UsageError(f"no flight is called '{name}'", remedy=nearest(name, known))
    roles: dict[str, tuple[Flown, Flown]] = {}
    for identifier, of in flights.items():
        names = list(of)
        chosen = [n for n in names if n in validate] if validate else names[1:][-1:]
        if len(chosen) == len(names):
            raise UsageError(
                f"all flights at reference '{identifier}' are to validate, and none is left to model",
                remedy="name fewer with --validate",
            )
        roles[identifier] = (
            {n: m for n, m in of.items() if n not in chosen},
            {n: m for n, m in of.items() if n in chosen},
        )
    return roles
