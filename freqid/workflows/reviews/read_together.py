"""Files that are reviewed together: any mixture of results, and folders of studies, of one vehicle."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py

from freqid.blend.corridor_study import StudyResults
from freqid.blend.study_file import held_files
from freqid.core import store
from freqid.core.errors import DataError, UsageError
from freqid.core.results.judged.review import Source
from freqid.workflows.files import read
from freqid.workflows.inputs import File

STUDY = "freqid-study"
_NOT_SHOWN = ("", "freqid-seal", "freqid-review")  # of the files in a folder
_OF_STUDY = ("points", "units", "model.h5", "design.h5")  # what a study that was stopped has left


@dataclass(frozen=True, eq=False)
class ReviewedFile:
    """One file as it was read.

    Attributes
    ----------
    source : Source
    path : Path
    result : object
        As `freqid.read` returns it.
    unfinished : bool
        Of a folder whose study was stopped; `result` is None then.
    held : tuple of Source
        Of a study: the files beside it that it was read from, named as in its folder.
    """

    source: Source
    path: Path
    result: Any
    unfinished: bool = False
    held: tuple[Source, ...] = ()

    @property
    def kind(self) -> str:
        """Format of the file."""
        return self.source.kind


def read_together(files: Sequence[File]) -> tuple[ReviewedFile, ...]:
    """Read files that are reviewed together.

    Parameters
    ----------
    files : sequence of path
        Files of freqid, and folders: of a study, its ``study.h5``; of any other, the files of freqid in it. A
        folder without either has a study that was stopped, whose finished models are read.

    Returns
    -------
    tuple of ReviewedFile
        In the order given; each file once, and those that a study beside them holds not again.

    Raises
    ------
    UsageError
        Where nothing is given.
    DataError
        Where a file cannot be read, a folder holds none, two files are of different vehicles, or two have the
        same name.
    """
    found: dict[Path, ReviewedFile] = {}
    for given in files:
        for path in _files_of(Path(given)):
            found.setdefault(path.resolve(), _read(path))
    if not found:
        raise UsageError("no file is given", remedy="name the results to report")
    held = {
        path.parent / name
        for path, one in found.items()
        if isinstance(one.result, StudyResults)
        for name in held_files(path)
    }
    every = tuple(one for path, one in found.items() if path not in held)
    _refuse_two_vehicles(every)
    return every


def vehicle_of(result: Any) -> str:
    """Return the name of the vehicle that a result is of; empty where it does not say."""
    for name in ("vehicle", "aircraft"):
        held = getattr(result, name, None)
        if isinstance(held, str) and held:
            return held
        named = getattr(held, "name", "")
        if isinstance(named, str) and named:
            return named
    corridor, point = getattr(result, "corridor", None), getattr(result, "point", None)
    for inner in (corridor, point):
        if inner is not None:
            return vehicle_of(inner)
    return ""


def _files_of(given: Path) -> Iterator[Path]:
    if not given.is_dir():
        yield given
        return
    here = sorted(p for p in given.glob("*.h5") if not p.name.endswith(".truth.h5"))
    if given / "study.h5" in here:
        here = [given / "study.h5", *(p for p in here if not p.match("study.h5"))]
        yield from (p for p in here if store.kind_of(p) not in _NOT_SHOWN)
        return
    if any((given / name).exists() for name in _OF_STUDY[:2]) and not (given / "campaign.json").is_file():
        yield given  # a study that is half done: said in its place
        here += sorted(given.glob("points/*.h5"))
    if not here and not (given / "units").exists():
        raise DataError(
            "the folder holds no file of freqid", where=str(given), remedy="name files, or a study's folder"
        )
    yield from (p for p in here if store.kind_of(p) not in _NOT_SHOWN)


def _read(path: Path) -> ReviewedFile:
    if path.is_dir():
        return ReviewedFile(Source(path.name, STUDY, ""), path, None, unfinished=True)
    if path.suffix == ".toml":
        raise UsageError("is a scenario, not a result", where=str(path), remedy="give it with --scenario")
    result = read(path)
    names = held_files(path) if isinstance(result, StudyResults) else ()
    held = tuple(_source(path.parent / name, name) for name in names)
    return ReviewedFile(_source(path, path.name), path, result, held=held)


def _source(path: Path, name: str) -> Source:
    with h5py.File(path, "r") as file:
        head = {n: str(file.attrs.get(n, "")) for n in ("created", "freqid_version", "scenario_sha256")}
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    return Source(name, store.kind_of(path), sha256, **head)


def _refuse_two_vehicles(files: Sequence[ReviewedFile]) -> None:
    known = [(file, name) for file in files if (name := vehicle_of(file.result))]
    for file, name in known[1:]:
        if name != known[0][1]:
            raise DataError(
                f"is of '{name}', but {known[0][0].path.name} is of '{known[0][1]}'",
                where=str(file.path),
                remedy="report one vehicle at a time",
            )
