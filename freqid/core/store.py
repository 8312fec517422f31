"""HDF5 files that are written whole or not at all, and refused clearly when they are not ours."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from freqid import __version__
from freqid.core.errors import DataError

VERSION = "1.2"  # of the file layout; the major number changes when an old release could misread a file


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; move it there at the end, or remove it after an error.

    Raises
    ------
    DataError
        Where the folder cannot be written, or something that is no regular file has that name.
    """
    target = Path(path)
    if target.exists() and not target.is_file():
        kind = "a folder" if target.is_dir() else "no regular file"
        raise DataError(f"cannot be written, it is {kind}", where=str(target), remedy="name a file with -o")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent)
        os.close(handle)
    except OSError as error:
        raise DataError(
            f"cannot be written ({error.strerror})",
            where=str(target),
            remedy="choose a folder that you may write to with -o",
        ) from None
    temporary = Path(name)
    try:
        yield temporary
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)  # mkstemp makes files for the owner alone
        os.replace(temporary, target)
    except OSError as error:
        raise DataError(
            f"cannot be written ({error.strerror})", where=str(target), remedy="free space or change -o"
        ) from None
    finally:
        temporary.unlink(missing_ok=True)


def write(path: Path, kind: str, fill: Callable[[h5py.File], None], scenario_sha256: str = "") -> None:
    """Write one HDF5 file atomically, with the root attributes that every file carries.

    Parameters
    ----------
    path : Path
    kind : str
        The format name, for example ``freqid-record``.
    fill : callable
        Writes the content into the open file.
    scenario_sha256 : str
        Of the scenario that the content was made with.
    """
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        file.attrs["format"] = kind
        file.attrs["version"] = VERSION
        file.attrs["created"] = datetime.now(UTC).isoformat(timespec="seconds")
        file.attrs["scenario_sha256"] = scenario_sha256
        file.attrs["freqid_version"] = __version__
        fill(file)


@contextmanager
def reading(path: Path, kind: str) -> Iterator[h5py.File]:
    """Open an HDF5 file of a given format.

    Raises
    ------
    DataError
        Where the file is missing, truncated, foreign, of another format or of a newer major version,
        or lacks a part that the reader asks for.
    """
    where = str(path)
    if not Path(path).is_file():
        found = "is a folder" if Path(path).is_dir() else "no such file"
        raise DataError(found, where=where, remedy="check the path")
    try:
        file = h5py.File(path, "r")
    except OSError:
        raise DataError(
            f"is no readable HDF5 file (truncated, or of another kind); expected a {kind} file",
            where=where,
            remedy="make it again with the command that wrote it",
        ) from None
    with file:
        found = _text(file.attrs.get("format", ""))
        if found != kind:
            raise DataError(
                f"found format '{found or 'none'}', expected '{kind}'", where=where, remedy="check the path"
            )
        version = _text(file.attrs.get("version", ""))
        if not version.partition(".")[0].isdecimal():
            raise DataError(
                f"found layout version '{version}', expected a number", where=where, remedy="write it again"
            )
        if int(version.partition(".")[0]) > int(VERSION.partition(".")[0]):
            writer = _text(file.attrs.get("freqid_version", "a newer release"))
            raise DataError(
                f"layout version {version} is newer than {VERSION}, which freqid {__version__} reads",
                where=where,
                remedy=f"read it with freqid {writer} or later",
            )
        try:
            yield file
        except (LookupError, OSError, ValueError, TypeError, RuntimeError, AttributeError) as error:
            raise DataError(
                f"is damaged or incomplete as a {kind} file ({error})", where=where, remedy="write it again"
            ) from error
        except DataError as error:
            raise error.at(where) from None


def kind_of(path: Path) -> str:
    """Return the format that a file says it has; empty where it is none of ours."""
    try:
        with h5py.File(path, "r") as file:
            return _text(file.attrs.get("format", ""))
    except OSError:
        return ""


def put(group: h5py.Group, name: str, values: Any, units: str) -> h5py.Dataset:
    """Write one dataset with its unit."""
    dataset = group.create_dataset(name, data=np.asarray(values))
    dataset.attrs["units"] = units
    return dataset


def dataset(group: h5py.Group, name: str) -> h5py.Dataset:
    """Return one dataset; a missing one, or a group of that name, is an error that `reading` explains."""
    found = group[name]
    if not isinstance(found, h5py.Dataset):
        raise KeyError(f"'{name}' is no dataset")
    return found


def subgroup(group: h5py.Group, name: str) -> h5py.Group:
    """Return one group; a missing one, or a dataset of that name, is an error that `reading` explains."""
    found = group[name]
    if not isinstance(found, h5py.Group):
        raise KeyError(f"'{name}' is no group")
    return found


def array(group: h5py.Group, name: str) -> NDArray[np.float64]:
    """Read one real dataset; any other type is an error that `reading` explains."""
    found = dataset(group, name)
    if found.dtype.kind not in "iufb":
        raise TypeError(f"'{name}' holds {found.dtype}, expected real numbers")
    return np.asarray(found[()], dtype=np.float64)


def put_complex(group: h5py.Group, name: str, values: NDArray[np.complex128], units: str) -> None:
    """Write complex values as the two datasets ``NAME/real`` and ``NAME/imag``."""
    put(group, f"{name}/real", values.real, units)
    put(group, f"{name}/imag", values.imag, units)


def complex_array(group: h5py.Group, name: str) -> NDArray[np.complex128]:
    """Read back what `put_complex` wrote; what is missing or not real is an error that `reading` explains."""
    return np.asarray(array(group, f"{name}/real") + 1j * array(group, f"{name}/imag"), dtype=np.complex128)


def floats(group: h5py.Group | h5py.Dataset, name: str) -> tuple[float, ...]:
    """Read a numeric attribute as a tuple; empty where it is absent."""
    found = group.attrs.get(name)
    return () if found is None else tuple(np.atleast_1d(np.asarray(found, dtype=np.float64)).tolist())


def put_json(group: h5py.Group | h5py.Dataset, name: str, value: Any) -> None:
    """Write a JSON-compatible value as a text attribute."""
    group.attrs[name] = json.dumps(value, sort_keys=True)


def get_json(group: h5py.Group | h5py.Dataset, name: str) -> Any:
    """Read back what `put_json` wrote; None where it is absent."""
    text = group.attrs.get(name)
    return None if text is None else json.loads(_text(text))


def get_text(group: h5py.Group | h5py.Dataset, name: str) -> str:
    """Read a text attribute; empty where it is absent."""
    return _text(group.attrs.get(name, ""))


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)
