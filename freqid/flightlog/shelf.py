"""Arrays of a long log that need not all stand in memory: beyond a total they wait in a temporary file."""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Hashable, Iterator, MutableMapping
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError

IN_MEMORY = 1 << 28
"""Bytes that are held in memory at most."""


class Shelf(MutableMapping[Hashable, NDArray[np.float64]]):
    """A mapping of arrays; those that come after `limit` bytes are in a file without a name.

    Parameters
    ----------
    limit : int, optional
        Bytes.

    Notes
    -----
    The file is where temporary files are (``TMPDIR``) and vanishes with the object or the process. What is in
    it is read anew each time it is asked for.
    """

    def __init__(self, limit: int = IN_MEMORY) -> None:
        self._limit, self._held = limit, 0
        self._near: dict[Hashable, NDArray[np.float64]] = {}
        self._far: dict[Hashable, tuple[int, int]] = {}  # first byte, number of values
        self._order: dict[Hashable, None] = {}
        self._file: BinaryIO | None = None
        self._end = 0

    def reserve(self, key: Hashable, count: int) -> None:
        """Make room for an array that `fill` gives values to."""
        if key in self:
            del self[key]
        self._order[key] = None
        if self._held + 8 * count <= self._limit:
            self._near[key] = np.empty(count)
            self._held += 8 * count
            return
        if self._file is None:
            self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - closed with the object
            weakref.finalize(self, self._file.close)
        self._far[key] = self._end, count
        self._end += 8 * count

    def fill(self, key: Hashable, start: int, values: NDArray[np.float64]) -> None:
        """Write values into an array from a place on.

        Raises
        ------
        DataError
            Where the disk is full.
        """
        if key in self._near:
            self._near[key][start : start + values.size] = values
            return
        assert self._file is not None  # of what is not in memory
        try:
            self._file.seek(self._far[key][0] + 8 * start)
            left = np.ascontiguousarray(values, dtype=np.float64).data.cast("B")
            while left:
                left = left[self._file.write(left) :]
        except OSError as error:
            raise DataError(
                f"a long log does not fit the folder of temporary files ({error.strerror})",
                remedy="free space, or name another folder in TMPDIR",
            ) from None

    def __setitem__(self, key: Hashable, values: NDArray[np.float64]) -> None:
        there = self._near[key].size if key in self._near else self._far.get(key, (0, -1))[1]
        if there != values.size:
            self.reserve(key, values.size)
        self.fill(key, 0, values)

    def __getitem__(self, key: Hashable) -> NDArray[np.float64]:
        if key in self._near:
            return self._near[key]
        first, count = self._far[key]
        assert self._file is not None  # of what is not in memory
        self._file.seek(first)
        return np.fromfile(self._file, dtype=np.float64, count=count)

    def __contains__(self, key: object) -> bool:
        return key in self._order

    def __delitem__(self, key: Hashable) -> None:
        del self._order[key]
        if key in self._near:
            self._held -= self._near.pop(key).nbytes
        else:
            del self._far[key]

    def __iter__(self) -> Iterator[Hashable]:
        return iter(list(self._order))

    def __len__(self) -> int:
        return len(self._order)
