"""HDF5 files that are written whole or not at all, and refused when they are not ours or not intact.

The first 512 bytes of a file are text (HDF5's user block, which every HDF5 program skips): its format, and
the SHA-256 of all bytes after them. They are compared before the HDF5 library sees the file, because a
damaged file can make it hang or crash. Whoever means harm can compute a checksum too, so what passes, and
was not written by this process, is read by another process first, and looked through for what no honest
file holds.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import shutil
import tempfile
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager
from datetime import UTC, datetime
from io import BufferedRandom, BufferedReader
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from freqid import __version__
from freqid.core import probe
from freqid.core.errors import DataError, FreqidError, UncheckedFile

try:
    import fcntl
except ImportError:  # where there are no such locks, what killed runs left stays
    fcntl = None

VERSION = "1.3"  # of the file layout; the major number changes when an old release could misread a file
_CHECKED_SINCE = (1, 3)  # the layout that a checksum came with
_BLOCK = 512  # bytes, the smallest that HDF5 leaves to others
_SUM = re.compile(rb"(freqid-[a-z-]+) file\nSHA-256 of all bytes from the 513th on:\n[0-9a-f]{64}\n")
_SIGNATURE = b"\x89HDF\r\n\x1a\n"  # where the HDF5 part begins
_LEFT_OVER = re.compile(r"\..+\.[a-z0-9_]{8}\.part")
_GROWTH, _SMALL = 100, 1 << 26  # times its own size, and bytes, that a file may unpack to
_DEPTH = 32  # groups in groups; ours are six deep
_LOGS = (".csv", ".tsv", ".txt", ".asc", ".dat", ".parquet", ".ulg", ".ulog", ".bin", ".mat")

_writing: set[Path] = set()  # temporary files of this process, which whoever made them moves into place
_swept: set[Path] = set()  # folders that this process has cleared
_written: set[bytes] = set()  # first 512 bytes, with the checksum, of what this process wrote


@contextmanager
def replacing(path: Path) -> Generator[Path]:
    """Yield a temporary path beside `path`; move it there at the end, or remove it after an error.

    What killed processes left in the folder is removed first. A temporary path that another call yielded is
    yielded as it is: that call moves it.

    Raises
    ------
    DataError
        Where the folder cannot be written, the disk is full, or something that is no regular file has that
        name.
    """
    target = Path(path)
    if target in _writing:
        yield target
        return
    if target.exists() and not target.is_file():
        kind = "a folder" if target.is_dir() else "no regular file"
        raise DataError(f"cannot be written, it is {kind}", where=str(target), remedy="name a file with -o")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if (folder := target.parent.resolve()) not in _swept:
            _swept.add(folder)
            remove_left_overs(folder)
        handle, temporary = _temporary(target)
    except OSError as error:
        raise DataError(
            f"cannot be written ({error.strerror})",
            where=str(target),
            remedy="choose a folder that you may write to with -o",
        ) from None
    _writing.add(temporary)
    try:
        yield temporary
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)  # mkstemp makes files for the owner alone
        os.replace(temporary, target)
    except OSError as error:
        raise DataError(
            f"cannot be written ({error.strerror or error})",
            where=str(target),
            remedy="free space or change -o",
        ) from None
    finally:
        _writing.discard(temporary)
        temporary.unlink(missing_ok=True)
        os.close(handle)  # last: whoever may lock the file takes it for a left-over


def _temporary(target: Path) -> tuple[int, Path]:
    """Make a temporary file beside a target, locked for as long as its handle is open; a kill unlocks it."""
    while True:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent)
        path = Path(name)
        if fcntl is None:
            return handle, path
        try:
            fcntl.flock(
                handle, fcntl.LOCK_SH
            )  # shared, so that the result can be read as soon as it is there
        except OSError:  # a file system without locks: then nobody can take it for a left-over either
            return handle, path
        try:
            if os.path.samestat(os.stat(name), os.fstat(handle)):
                return handle, path
        except FileNotFoundError:
            pass  # another process cleared the folder before the lock was on
        os.close(handle)


def remove_left_overs(folder: Path) -> None:
    """Remove the temporary files that killed processes left in a folder, and none that is being written.

    The first result that a process writes into a folder calls this. A file that is being written is locked by
    its process; the operating system drops the lock when the process ends, however it ends.

    Parameters
    ----------
    folder : Path
    """
    if fcntl is None:
        return
    try:
        with os.scandir(folder) as entries:
            files = [e for e in entries if _LEFT_OVER.fullmatch(e.name)]
            found = [e.path for e in files if e.is_file(follow_symlinks=False)]
    except OSError:
        return  # it may be written to, but not listed
    for name in found:
        try:
            handle = os.open(name, os.O_RDWR)
        except OSError:
            continue  # moved into place in the meantime, or another user's
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.unlink(name)
        except OSError:
            pass  # it is being written
        finally:
            os.close(handle)


def write(path: Path, kind: str, fill: Callable[[h5py.File], None], scenario_sha256: str = "") -> None:
    """Write one HDF5 file atomically, with the root attributes and the checksum that every file carries.

    Parameters
    ----------
    path : Path
    kind : str
        The format name, for example ``freqid-record``.
    fill : callable
        Writes the content into the open file.
    scenario_sha256 : str
        Of the scenario that the content was made with.

    Raises
    ------
    DataError
        Where it cannot be written.
    """
    with replacing(path) as temporary:
        # HDF5's own lock would collide with that on the temporary file, which nobody else writes anyway
        with _told_as_os_errors(), h5py.File(temporary, "w", userblock_size=_BLOCK, locking=False) as file:
            file.attrs["format"] = kind
            file.attrs["version"] = VERSION
            file.attrs["created"] = datetime.now(UTC).isoformat(timespec="seconds")
            file.attrs["scenario_sha256"] = scenario_sha256
            file.attrs["freqid_version"] = __version__
            fill(file)
        _add_checksum(temporary, kind)


@contextmanager
def editing(path: Path) -> Generator[h5py.File]:
    """Open a copy of one of freqid's files for changes on purpose; at the end it takes the file's place.

    Parameters
    ----------
    path : Path

    Raises
    ------
    DataError
        Where the file is damaged, or of a release without checksums, or cannot be written.

    Examples
    --------
    >>> with editing("flight.h5") as file:  # doctest: +SKIP
    ...     file["state/ax"].attrs["position_m"] = (0.1, 0.0, -0.2)
    """
    kind = kind_of(path)
    with reading(path, kind) as file:
        if file.userblock_size != _BLOCK:
            raise DataError(
                "has no place for a checksum", remedy="read it and save it with this release, then edit that"
            )
    with replacing(path) as temporary:
        shutil.copyfile(path, temporary)
        with h5py.File(temporary, "r+", locking=False) as file:
            yield file
        _add_checksum(temporary, kind)


def _add_checksum(path: Path, kind: str) -> None:
    """Write the checksum of a file that is written into its first 512 bytes."""
    with open(path, "r+b") as raw:
        text = _block_text(kind, raw)
        raw.seek(0)
        raw.write(text)
    _written.add(text)


@contextmanager
def reading(path: Path, kind: str) -> Generator[h5py.File]:
    """Open an HDF5 file of a given format whose bytes are as they were written.

    Raises
    ------
    DataError
        Where the file is missing, damaged, foreign, hostile, of another format or of a newer major version,
        or lacks a part that the reader asks for.

    Warns
    -----
    UncheckedFile
        Where an earlier release wrote the file, which has no checksum.
    """
    where = str(path)
    if not Path(path).is_file():
        found = "is a folder" if Path(path).is_dir() else "no such file"
        raise DataError(found, where=where, remedy="check the path")
    try:
        block = _checked(Path(path))
        if block not in _written:
            refuse_fatal(path)
        stated = _stated(block)
        file = h5py.File(path, "r")
    except DataError as error:
        raise error.at(where) from None
    except Exception:  # a damaged byte can make h5py raise almost anything
        raise DataError(
            f"is no readable HDF5 file (truncated, or of another kind); expected a {kind} file",
            where=where,
            remedy=(
                "import the log first: freqid import-log"
                if kind == "freqid-record" and Path(path).suffix.lower() in _LOGS
                else "make it again with the command that wrote it"
            ),
        ) from None
    with file:
        with _in_one_sentence(where, kind):
            _check_header(file, kind, stated)
            refuse_hostile(file, os.path.getsize(path))
            writer = get_text(file, "freqid_version")
        if not stated and writer:  # other programs write the formats too, and never had a checksum
            warnings.warn(
                f"{where}: was written by freqid {writer}, before files had a checksum; damage to its "
                "numbers would not be seen",
                UncheckedFile,
                stacklevel=3,
            )
        with _in_one_sentence(where, kind):
            yield file


@contextmanager
def _in_one_sentence(where: str, kind: str) -> Generator[None]:
    """Raise whatever goes wrong in reading as an error that names the file."""
    try:
        yield
    except FreqidError as error:
        raise error.at(where) from None
    except Exception as error:
        said = " ".join(f"{type(error).__name__}: {error}".split())
        raise DataError(
            f"is damaged or incomplete as a {kind} file ({said[:300]})", where=where, remedy="write it again"
        ) from error


def _check_header(file: h5py.File, kind: str, stated: str) -> None:
    """Refuse a file of another format or of a newer major version, or one that has lost its checksum."""
    found = get_text(file, "format")
    if found != kind:
        raise DataError(f"found format '{found or 'none'}', expected '{kind}'", remedy="check the path")
    version = get_text(file, "version")
    major, _, minor = version.partition(".")
    if not major.isdecimal():
        raise DataError(f"found layout version '{version}', expected a number", remedy="write it again")
    writer = get_text(file, "freqid_version")
    if int(major) > int(VERSION.partition(".")[0]):
        raise DataError(
            f"layout version {version} is newer than {VERSION}, which freqid {__version__} reads",
            remedy=f"read it with freqid {writer or 'of a newer release'} or later",
        )
    if stated:
        if stated != found:
            raise _damaged(f"it states the format '{stated}' before its checksum and '{found}' within")
        return
    if (int(major), int(minor) if minor.isdecimal() else 0) >= _CHECKED_SINCE:
        raise _damaged(f"a file of layout {version} starts with its checksum, and this one does not")


def _checked(path: Path) -> bytes:
    """Return the first 512 bytes of a file, once the checksum in them is compared; empty without one.

    Raises
    ------
    DataError
        Where the bytes have another checksum.
    """
    with open(path, "rb") as raw:
        block = raw.read(_BLOCK)
        stated = _stated(block)
        if not stated and raw.read(len(_SIGNATURE)) != _SIGNATURE:
            return b""  # no file of ours, or one of a release without checksums
        if stated and block == _block_text(stated, raw):
            return block
    raise _damaged("its bytes do not have the checksum that it states")


def _stated(block: bytes) -> str:
    """Return the format that a file's first 512 bytes state beside a checksum; empty without one."""
    found = _SUM.match(block)
    return found[1].decode() if found else ""


def _block_text(kind: str, raw: BufferedReader | BufferedRandom) -> bytes:
    """Return the first 512 bytes that an open file of a format should have."""
    raw.seek(_BLOCK)
    digest = hashlib.file_digest(raw, "sha256").hexdigest()
    text = f"{kind} file\nSHA-256 of all bytes from the 513th on:\n{digest}\n"
    return text.encode().ljust(_BLOCK, b"\0")


def _damaged(why: str) -> DataError:
    return DataError(
        f"is damaged or was changed after it was written: {why}",
        remedy="make it again with the command that wrote it",
    )


def refuse_fatal(path: Path, *, objects: bool = False) -> None:
    """Refuse a file that the HDF5 library, or of MATLAB's objects mat-io, hangs or crashes over.

    Raises
    ------
    DataError
    """
    fault = probe.fault_of(path, objects=objects)
    if fault:
        raise DataError(
            f"is damaged: reading {'its objects' if objects else 'it as HDF5'} {fault}",
            where=str(path),
            remedy="make it again with the program that wrote it",
        )


def refuse_hostile(file: h5py.File, size: int) -> None:
    """Refuse what no honest file holds and reading could be harmed by, before anything is read.

    That is links out of the file or in circles, data in other files, and data that unpack to far more than
    the file's size.

    Parameters
    ----------
    file : h5py.File
    size : int
        Of the file, bytes.

    Raises
    ------
    DataError
    """
    total, seen = 0, set()
    stack: list[tuple[h5py.Group, int]] = [(subgroup(file, "/"), 0)]
    while stack:
        group, depth = stack.pop()
        if group.id in seen or depth > _DEPTH:  # two ids of one object are equal
            raise DataError(f"group '{group.name}' leads back to itself or too deep", remedy=_DISTRUST)
        seen.add(group.id)
        for name in group:
            place = f"{str(group.name).rstrip('/')}/{name}"
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise DataError(f"'{place}' is a link to another place", remedy=_DISTRUST)
            item = group[name]
            if isinstance(item, h5py.Group):
                stack.append((item, depth + 1))
            elif isinstance(item, h5py.Dataset):
                if item.is_virtual or item.external:
                    raise DataError(f"'{place}' has its data in another file", remedy=_DISTRUST)
                total += math.prod(item.shape or ()) * item.dtype.itemsize
    if total > max(_SMALL, _GROWTH * size):
        raise DataError(
            f"states {total / 1e9:.3g} GB of data in a file of {size / 1e9:.3g} GB, more than is believed",
            remedy="store the data uncompressed",
        )


_DISTRUST = "make the file again with the program that wrote it"


@contextmanager
def _told_as_os_errors() -> Generator[None]:
    """Raise what h5py raises on a full disk as the system error that it is."""
    try:
        yield
    except RuntimeError as error:
        raise OSError(None, " ".join(str(error).split())) from None


def kind_of(path: Path) -> str:
    """Return the format that a file says it has; empty where it is none of ours."""
    try:
        with open(path, "rb") as raw:
            stated = _stated(raw.read(_BLOCK))
        if stated:
            return stated
        if not h5py.is_hdf5(path) or probe.fault_of(path):
            return ""
        with h5py.File(path, "r") as file:
            return get_text(file, "format")
    except Exception:  # a damaged byte can make h5py raise almost anything
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
