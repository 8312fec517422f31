"""Draws of flights without a gap, kept from one diagnosis to the next: they take most of its time."""

from __future__ import annotations

import hashlib
import os
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from freqid import __version__
from freqid.core.errors import DataError
from freqid.core.store import replacing

Complex = NDArray[np.complex128]

_MOST = 2_000_000_000  # bytes in the folder; what was not used for longest goes first


def folder() -> Path:
    """Return where draws are kept, unless told otherwise: the user's cache."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "freqid" / "draws"


def kept(
    where: Path | None,
    known_by: Sequence[NDArray],
    count: int,
    seed: int,
    make: Callable[[], tuple[Complex, Complex]],
) -> tuple[Complex, Complex]:
    """Return draws that were kept, or make them and keep them.

    Parameters
    ----------
    where : Path or None
        Folder; none is used where this is None.
    known_by : sequence of ndarray
        By these draws are known again, to the last bit: what is predicted without noise, and of the first
        draw what noise was added and what was made of it. That serves any kind of simulation; a change of
        one is missed only where neither the flight nor the first draw's noise comes to it.
    count, seed : int
    make : callable
        Returns all draws, the first too.

    Notes
    -----
    Nothing is lost where the folder cannot be written or a file in it is damaged: draws are made again.
    """
    if where is None:
        return make()
    path = where / f"{_key(known_by, count, seed)}.npz"
    try:
        with path.open("rb") as opened, np.load(opened) as file:
            found = file["made"], file["noise"]
        os.utime(path)
        return found
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile):
        found = make()
    try:
        with replacing(path) as partial, partial.open("wb") as file:
            np.savez(file, made=found[0], noise=found[1])
        _prune(where, path)
    except (OSError, DataError):
        pass
    return found


def _key(known_by: Sequence[NDArray], count: int, seed: int) -> str:
    digest = hashlib.sha256(f"{__version__} {count} {seed}".encode())
    for part in known_by:
        digest.update(f"{part.shape}".encode() + np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()[:32]


def _prune(where: Path, new: Path) -> None:
    """Remove the files that were not used for longest, while there is too much."""
    files = sorted(where.glob("*.npz"), key=lambda p: p.stat().st_mtime)
    size = sum(p.stat().st_size for p in files)
    for path in files:
        if size <= _MOST:
            return
        if path != new:
            size -= path.stat().st_size
            path.unlink(missing_ok=True)
