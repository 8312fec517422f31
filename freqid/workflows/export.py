"""A model or record becomes a file that another tool reads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

from freqid import __version__
from freqid.blend.exports.csv_tables import write_parameters, write_record
from freqid.blend.exports.daveml import write_daveml
from freqid.blend.exports.exact import exact, start_at
from freqid.blend.exports.jsbsim import write_jsbsim
from freqid.blend.exports.json_file import write_json
from freqid.blend.exports.mat_file import write_mat
from freqid.blend.exports.python_file import write_python
from freqid.blend.exports.tabled import TABLE_ERROR, tabled
from freqid.blend.exports.usable_range import start_of
from freqid.blend.global_model import GlobalModel
from freqid.core.errors import UsageError, nearest
from freqid.core.record import FlightRecord
from freqid.core.results.advance_ratio import AdvanceRatioModel
from freqid.core.results.output_error import OutputErrorModel
from freqid.core.results.point import PointModel
from freqid.core.scenario import Scenario
from freqid.core.vehicle import Vehicle
from freqid.flightlog.readers.sidpac import write_sidpac
from freqid.workflows.files import read
from freqid.workflows.inputs import File, scenario_of, several

Format = Literal["mat", "csv", "json", "daveml", "jsbsim", "python", "sidpac"]
FORMATS: tuple[Format, ...] = get_args(Format)

_KINDS: dict[type, str] = {
    PointModel: "a point model",
    GlobalModel: "a global model",
    AdvanceRatioModel: "an advance-ratio model",
    OutputErrorModel: "an output-error model",
    FlightRecord: "a record",
}
_MODELS = (PointModel, GlobalModel, AdvanceRatioModel, OutputErrorModel)
TAKES: dict[str, tuple[type, ...]] = {
    "mat": (*_MODELS, FlightRecord),
    "csv": (*_MODELS, FlightRecord),
    "json": _MODELS,
    "daveml": (PointModel, GlobalModel),
    "jsbsim": (PointModel, GlobalModel),
    "python": (PointModel, GlobalModel, AdvanceRatioModel),
    "sidpac": (FlightRecord,),
}
SUFFIX = {"mat": ".mat", "csv": ".csv", "json": ".json", "daveml": ".dml", "jsbsim": "", "python": ".py"}
SUFFIX["sidpac"] = ".mat"


@dataclass(frozen=True)
class Export:
    """What was written.

    Attributes
    ----------
    paths : tuple of Path
        Of the files.
    to : str
        The format.
    kind : str
        What was exported, such as ``"a global model"``.
    table_errors : dict of str to tuple of float and str
        By response, the largest error that tables make in the range that the file states, and its unit; empty
        where nothing is tabled.
    left_out : tuple of str
        What the format has no place for.
    """

    paths: tuple[Path, ...]
    to: str
    kind: str
    table_errors: dict[str, tuple[float, str]] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()


def export(
    result: Any,
    path: File,
    to: Format,
    *,
    scenario: Scenario | File | None = None,
    table_error: float | None = None,
    overwrite: bool = False,
) -> Export:
    """Write a model or a record in the format of another tool.

    Parameters
    ----------
    result : PointModel, GlobalModel, AdvanceRatioModel, OutputErrorModel, FlightRecord or path
        As ``csv`` also several models, whose rows follow each other. Of the folder of a study, all its point
        models and its global model.
    path : path
        Of the file; for ``jsbsim`` of a folder, whose name is the aircraft's; for a study of a folder.
    to : {"mat", "csv", "json", "daveml", "jsbsim", "python", "sidpac"}
        MATLAB structure; long table; JSON; DAVE-ML 2.0 (ANSI/AIAA S-119); JSBSim aircraft; Python file that
        needs numpy alone; MATLAB file in the 90 columns of SIDPAC.
    scenario : Scenario, path or name, optional
        Of the vehicle; ``jsbsim`` needs its mass properties.
    table_error : float, optional
        Of ``daveml`` and ``jsbsim`` with a global model: largest error of tables, relative to the size of a
        response along the corridor; 1e-3 without it.
    overwrite : bool
        Whether files that are there may be replaced.

    Returns
    -------
    Export

    Raises
    ------
    UsageError
        For an unknown format, a result that the format does not take, an option that does not belong to it, a
        file or folder that is already there, or a missing scenario.
    DataError
        Where a file cannot be read or written.

    Examples
    --------
    >>> export(model, "point.csv", "csv").paths[0].name
    'point.csv'
    >>> export(aircraft, "aircraft.dml", "daveml").table_errors["Z"]  # doctest: +SKIP
    (0.060, 'N')
    """
    if to not in FORMATS:
        raise UsageError(f"there is no format '{to}'", remedy=nearest(str(to), FORMATS))
    if isinstance(result, str | Path) and Path(result).is_dir():
        return _export_study(Path(result), Path(path), to, scenario, table_error, overwrite)
    given = several(result)
    if not given:
        raise UsageError("nothing is given to export", remedy="give a model or a record")
    results = [_taken(one, to) for one in given]
    if len(results) > 1 and (to != "csv" or any(isinstance(one, FlightRecord) for one in results)):
        raise UsageError(
            f"{len(results)} results are given, and only models as csv share a file",
            remedy="export them one by one",
        )
    first, destination = results[0], Path(path)
    has_tables = to in ("daveml", "jsbsim") and isinstance(first, GlobalModel)
    if table_error is not None and not has_tables:
        raise UsageError(
            "a table error is for a global model as daveml or jsbsim, which alone have tables",
            remedy="leave it out",
        )
    if scenario is not None and to != "jsbsim":
        raise UsageError(f"{to} takes nothing from a scenario, only jsbsim does", remedy="leave it out")
    vehicle = _vehicle(first, scenario) if to == "jsbsim" else None
    _refuse_existing(destination, to, overwrite)
    kind = _kind(first) if len(results) == 1 else f"{len(results)} models"
    if to in ("daveml", "jsbsim"):
        if isinstance(first, GlobalModel):
            found = tabled(first, TABLE_ERROR if table_error is None else table_error)
            start = start_of(first)
        else:
            found, start = exact(first), start_at(first)
        paths = [destination]
        if vehicle is None:
            write_daveml(destination, found, __version__)
        else:
            paths = write_jsbsim(destination, found, vehicle, start, __version__)
        units = {q.name: q.unit for q in found.quantities}
        errors = {r: (found.bounds[r], units[q]) for r, q in found.outputs.items()} if has_tables else {}
        return Export(tuple(paths), to, kind, errors)
    left_out: tuple[str, ...] = ()
    if to == "sidpac":
        left_out = write_sidpac(results[0], destination)
    elif to == "csv" and isinstance(first, FlightRecord):
        write_record(destination, first)
    elif to == "csv":
        write_parameters(destination, results)
    else:
        write: dict[str, Callable[..., None]] = {"mat": write_mat, "json": write_json, "python": write_python}
        write[to](destination, first, __version__)
    return Export((destination,), to, kind, left_out=left_out)


def default_path(result: Path, to: str) -> Path:
    """Return where a result goes that is not told: beside itself, with the format's ending."""
    return result.with_suffix(SUFFIX[to]) if result.suffix else result.with_name(f"{result.name}-{to}")


def _taken(given: Any, to: str) -> Any:
    """Return a result, read where a path is given, that a format takes."""
    result: Any = read(given) if isinstance(given, str | Path) else getattr(given, "record", given)
    if isinstance(result, TAKES[to]):
        return result
    where = str(given) if isinstance(given, str | Path) else None
    fit = [name for name, kinds in TAKES.items() if isinstance(result, kinds)]
    what = _kind(result)
    if not fit:
        raise UsageError(f"{what} cannot be exported", where=where, remedy="give a model or a record")
    kinds = " or ".join(_KINDS[kind] for kind in TAKES[to])
    raise UsageError(
        f"{what} cannot be exported to {to}, which takes {kinds}", where=where, remedy=f"use {', '.join(fit)}"
    )


def _kind(result: Any) -> str:
    name = type(result).__name__
    return next((words for kind, words in _KINDS.items() if isinstance(result, kind)), f"a {name}")


def _vehicle(model: PointModel | GlobalModel, scenario: Scenario | File | None) -> Vehicle:
    """Return the vehicle that a JSBSim aircraft has its mass from."""
    if scenario is None:
        raise UsageError(
            "a JSBSim aircraft needs mass and inertia, which the model does not have",
            remedy="give the scenario (--scenario)",
        )
    if isinstance(model, PointModel) and model.axes != "body":
        raise UsageError(
            f"a JSBSim aircraft needs body axes, the model is in {model.axes} axes",
            remedy="identify it again with --axes body",
        )
    vehicle = scenario_of(scenario).aircraft()
    of = model.vehicle if isinstance(model, PointModel) else model.corridor.vehicle
    if of and of != vehicle.name:
        raise UsageError(
            f"the scenario describes '{vehicle.name}', the model is of '{of}'",
            remedy="give the scenario that the model was identified with",
        )
    return vehicle


def _refuse_existing(path: Path, to: str, overwrite: bool) -> None:
    """Refuse a path that something has already.

    Raises
    ------
    UsageError
    """
    if not path.exists():
        return
    if to == "jsbsim":
        if not path.is_dir():
            raise UsageError(
                "is a file, and a JSBSim aircraft is a folder", where=str(path), remedy="change -o"
            )
        if any(path.iterdir()) and not overwrite:
            raise UsageError(
                "the folder is not empty", where=str(path), remedy="change -o, or give --overwrite"
            )
    elif not path.is_file():
        raise UsageError("is a folder, expected the name of a file", where=str(path), remedy="change -o")
    elif not overwrite:
        raise UsageError("is there already", where=str(path), remedy="change -o, or give --overwrite")


def _export_study(
    study: Path,
    folder: Path,
    to: Format,
    scenario: Scenario | File | None,
    table_error: float | None,
    overwrite: bool,
) -> Export:
    """Write all point models and the global model of a study's folder, under the same names in another."""
    points, whole = sorted(study.glob("points/*.h5")), study / "model.h5"
    if not points and not whole.is_file():
        raise UsageError(
            "the folder holds no points/*.h5 and no model.h5",
            where=str(study),
            remedy="give a study's folder",
        )
    if folder.exists() and (not folder.is_dir() or (any(folder.iterdir()) and not overwrite)):
        what = "is not empty" if folder.is_dir() else "is a file, and models of a study go to a folder"
        raise UsageError(what, where=str(folder), remedy="change -o, or give --overwrite")
    options: dict[str, Any] = {"scenario": scenario, "overwrite": overwrite}
    exports = []
    if to == "csv" and points:
        exports.append(export(points, folder / "points.csv", to, **options))
    elif points:
        exports += [export(p, folder / "points" / f"{p.stem}{SUFFIX[to]}", to, **options) for p in points]
    if whole.is_file():
        exports.append(export(whole, folder / f"model{SUFFIX[to]}", to, table_error=table_error, **options))
    kind = f"{len(points)} point models" + (" and a global model" if whole.is_file() else "")
    return Export(tuple(p for e in exports for p in e.paths), to, kind, exports[-1].table_errors)
