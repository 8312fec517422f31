"""The file of a study, ``study.h5``: what its page needs beside the models and designs in the same folder."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py

from freqid.blend.corridor_study import HeldOut, StudiedPoint, StudyResults
from freqid.blend.global_model import GlobalModel
from freqid.core import store
from freqid.core.errors import DataError
from freqid.core.layout import Attribute, Dataset, NestedSeries, Table, get_fields, put_fields
from freqid.core.results import corridor
from freqid.core.results.design import read_design
from freqid.core.results.judged.truth import LAYOUT as TRUTH
from freqid.core.results.judged.truth import KnownTruth
from freqid.core.results.point import read_point
from freqid.core.scenario import Reference
from freqid.identify.in_flight.parameter_history import ParameterHistory

FORMAT = "freqid-study"
STUDY = "study.h5"
"""Its name in the folder of a study."""
_P = ("sample", "regressors")
_HISTORY = {
    "unit": Attribute("history/{response}@unit"),
    "regressors": Attribute("history/{response}@regressors", json=True),
    "regressor_units": Attribute("history/{response}@regressor_units", json=True),
    "time": Dataset("history/{response}/time", "s", ("sample",)),
    **{
        name: Dataset(f"history/{{response}}/{name}", "mixed", _P)
        for name in ("estimate", "std_error", "lower", "upper")
    },
    **{
        name: Dataset(f"history/{{response}}/{name}", "mixed", ("sample",))
        for name in ("bias", "bias_std_error", "r2")
    },
}
_POINT = {
    "linear": Attribute("@linear", json=True),
    "repeated": Attribute("@repeated", json=True),
    "validation_time": Dataset("validation/time", "s"),
    "history": NestedSeries(ParameterHistory, _HISTORY, "response", "@histories"),
    "truth": NestedSeries(KnownTruth, TRUTH, "response", "@truths"),
}
_HEAD = {
    "vehicle": Table("vehicle"),
    "provenance": Table("provenance"),
    "sensors": Attribute("@sensors"),
    "noise": Attribute("@noise"),
    "estimator": Attribute("@estimator"),
}


def write_study(path: Path, results: StudyResults, scenario_sha256: str = "") -> None:
    """Write a study beside its files: ``points/ID.h5``, ``model.h5``, ``design.h5`` or ``design-ID.h5``.

    They are named with their hashes and not copied.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """
    folder = path.parent
    names = {f"points/{p.id}.h5" for p in results.points}
    names |= {"model.h5"} if results.model is not None else set()
    names |= {"design.h5", *(f"design-{i}.h5" for i in results.own_designs)}

    def fill(file: h5py.File) -> None:
        put_fields(file, results, _HEAD)
        file.attrs["files"] = json.dumps(
            {name: _sha256(folder / name) for name in sorted(names) if (folder / name).is_file()}
        )
        file.attrs["points"] = json.dumps([p.id for p in results.points])
        file.attrs["own_designs"] = json.dumps(list(results.own_designs))
        for i, point in enumerate(results.points):
            group = file.create_group(f"point/{i}")
            put_fields(group, point, _POINT)
            for response, errors in point.validation_rmse.items():
                store.put(group, f"validation/rmse/{response}", errors, point.model[response].unit)
        file.attrs["held_out"] = json.dumps(
            [
                {
                    "reference": held.reference.to_json(),
                    "global_rmse": dict(held.global_rmse),
                    "point_rmse": dict(held.point_rmse),
                }
                for held in results.held_out
            ]
        )

    store.write(path, FORMAT, fill, scenario_sha256)


def read_study(path: Path) -> StudyResults:
    """Read a study; the files that it names are read beside it.

    Raises
    ------
    DataError
        Where the file is no intact study, or one that it names is missing or another than it was.
    """
    with store.reading(path, FORMAT) as file:
        head = get_fields(file, StudyResults, _HEAD)
        files: Mapping[str, str] = _listed(file, "files")
        _refuse_changed(path, files)
        ids = _listed(file, "points")
        points = tuple(
            _point(file[f"point/{i}"], path.parent / "points" / f"{at}.h5") for i, at in enumerate(ids)
        )
        held_out = tuple(
            HeldOut(Reference.from_json(one["reference"]), one["global_rmse"], one["point_rmse"])
            for one in _listed(file, "held_out")
        )
        own = {i: read_design(path.parent / f"design-{i}.h5") for i in _listed(file, "own_designs")}
    shared = path.parent / "design.h5"
    return StudyResults(
        **head,
        points=points,
        held_out=held_out,
        own_designs=own,
        design=read_design(shared) if "design.h5" in files else next(iter(own.values()), None),
        model=GlobalModel(corridor.FILE.read(path.parent / "model.h5")) if "model.h5" in files else None,
    )


def _listed(file: h5py.File, name: str) -> Any:
    """Return what an attribute lists as JSON."""
    return json.loads(str(file.attrs[name]))


def held_files(path: Path) -> tuple[str, ...]:
    """Return the files that a study names, by their names beside it."""
    with store.reading(path, FORMAT) as file:
        return tuple(_listed(file, "files"))


def _point(group: Any, path: Path) -> StudiedPoint:
    found = get_fields(group, StudiedPoint, _POINT)
    errors = group.get("validation/rmse", {})
    return StudiedPoint(
        **found, model=read_point(path), validation_rmse={name: store.array(errors, name) for name in errors}
    )


def _refuse_changed(path: Path, files: Mapping[str, str]) -> None:
    for name, sha256 in files.items():
        if not (path.parent / name).is_file():
            raise DataError(
                f"names {name}, which is not beside it", where=str(path), remedy="report the whole folder"
            )
        if _sha256(path.parent / name) != sha256:
            raise DataError(
                f"{name} is not the file that the study wrote",
                where=str(path),
                remedy="run the study again, or report the file by itself",
            )


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
