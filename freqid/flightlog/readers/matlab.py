"""MATLAB files, v5 to v7 and v7.3, read by a column map.

scipy's reader indexes tables by type codes of the file unchecked: one damaged byte can end the process
without a word, where a log reader owes an error. The format is small enough to read here.

References
----------
.. [1] The MathWorks, "MAT-File Format", chapter 1: level 5 MAT-file format.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from freqid.core import store
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.record import FlightRecord
from freqid.flightlog.column_map import ColumnMap, Place
from freqid.flightlog.mapped import assemble_map
from freqid.flightlog.read import Reader
from freqid.flightlog.signal import NotLogged

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
# numpy's type by the file's data type; the last three are text in UTF-8, UTF-16 and UTF-32.
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_TEXT = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_CELL, _STRUCT, _CHAR = 1, 2, 4
_NUMERIC = range(6, 16)
_COMPLEX = 0x0800


@dataclass(frozen=True)
class _Element:
    """One tagged piece of a file: its data type, its bytes and their order (``<`` or ``>``)."""

    kind: int
    data: memoryview
    order: str

    def parts(self) -> Iterator[_Element]:
        return _elements(self.data, self.order)

    def numbers(self) -> np.ndarray:
        if self.kind not in _TYPES:
            raise DataError(f"holds data of type {self.kind} where numbers are expected")
        dtype = np.dtype(self.order + _TYPES[self.kind])
        if len(self.data) % dtype.itemsize:
            raise DataError(f"holds {len(self.data)} bytes of numbers that take {dtype.itemsize} each")
        return np.frombuffer(self.data, dtype=dtype)

    def text(self) -> str:
        if self.kind not in _TEXT:
            raise DataError(f"holds data of type {self.kind} where text is expected")
        wide = self.kind in (4, 17, 18)
        codec = _TEXT[self.kind] + (("-le" if self.order == "<" else "-be") if wide else "")
        return bytes(self.data).decode(codec, errors="replace")


def read_mat5(raw: bytes) -> dict[str, Any]:
    """Read the variables of a level-5 file as plain Python.

    Parameters
    ----------
    raw : bytes
        The whole file.

    Returns
    -------
    dict
        By variable: arrays without their unit axes, text as str, scalar structs as dict, cells and struct
        arrays as list in MATLAB's order. What has no such counterpart (sparse matrices, objects,
        functions) is an empty dict.

    Raises
    ------
    DataError
        Where the file is of another kind, truncated or damaged.
    """
    order = {b"IM": "<", b"MI": ">"}.get(raw[126:_HEADER])
    if order is None:
        raise DataError("has no header of a MATLAB file of level 5")
    variables = {}
    try:
        for element in _elements(memoryview(raw)[_HEADER:], order):
            if element.kind == _COMPRESSED:
                # decompress() checks the checksum and that the stream is whole
                element = next(_elements(memoryview(zlib.decompress(element.data)), order))
            name, value = _matrix(element)
            if name:
                variables[name] = value
    except (zlib.error, StopIteration, RecursionError, RuntimeError) as error:
        raise DataError(f"is damaged ({error or 'incomplete'})") from None
    return variables


def _elements(data: memoryview, order: str) -> Iterator[_Element]:
    """Split bytes into tagged elements; each starts on a multiple of eight, but for compressed ones."""
    at = 0
    while at < len(data):
        if len(data) - at < 8:
            raise DataError("is truncated inside a tag")
        first, size = (int(x) for x in np.frombuffer(data[at : at + 8], dtype=f"{order}u4"))
        if first >> 16:  # a small element: type and size share four bytes, the data take the other four
            kind, size, start, end = first & 0xFFFF, first >> 16, at + 4, at + 8
            if size > 4:
                raise DataError(f"has a small element of {size} bytes, expected at most 4")
        else:
            kind, start = first, at + 8
            end = start + size + (0 if kind == _COMPRESSED else -size % 8)
        if start + size > len(data):
            raise DataError(f"is truncated: an element of {size} bytes has {len(data) - start}")
        yield _Element(kind, data[start : start + size], order)
        at = end


def _matrix(element: _Element) -> tuple[str, Any]:
    """Return the name and the value of one array element."""
    if element.kind != _MATRIX:
        raise DataError(f"holds an element of type {element.kind} where an array is expected")
    if not len(element.data):
        return "", np.empty(0)
    parts = element.parts()
    flags = _next(parts).numbers()
    if flags.size != 2:
        raise DataError("has an array without flags")
    kind = int(flags[0]) & 0xFF
    if kind >= 16:  # functions and opaque objects have another layout
        return "", {}
    shape = tuple(int(n) for n in _next(parts).numbers())
    name = _next(parts).text()
    if len(shape) < 2 or min(shape) < 0:
        raise DataError(f"has a variable '{name}' of shape {shape}")
    if kind in _NUMERIC:
        return name, _numeric(parts, name, shape, bool(int(flags[0]) & _COMPLEX))
    if kind == _CHAR:
        return name, _next(parts).text() if prod(shape) else ""
    if kind == _CELL:
        return name, [_matrix(part)[1] for part in _exactly(parts, prod(shape), name)]
    if kind == _STRUCT:
        return name, _struct(parts, name, prod(shape))
    return name, {}


def _numeric(parts: Iterator[_Element], name: str, shape: tuple[int, ...], is_complex: bool) -> np.ndarray:
    # Integers may be stored in a narrower type than the variable's: only values matter here.
    halves = [_next(parts).numbers() for _ in range(2 if is_complex else 1)]
    for half in halves:
        if half.size != prod(shape):
            raise DataError(f"has {half.size} values in variable '{name}' of shape {shape}")
    values = halves[0]
    if is_complex:
        values = np.empty(values.size, dtype=np.complex128)
        values.real, values.imag = halves
    return np.squeeze(values.reshape(shape, order="F"))


def _struct(parts: Iterator[_Element], name: str, count: int) -> Any:
    width = _next(parts).numbers()
    text = bytes(_next(parts).data)
    step = int(width[0]) if width.size == 1 and np.isfinite(width[0]) else 0
    if step < 1:
        raise DataError(f"has a struct '{name}' without a length of its field names")
    fields = [text[i : i + step].partition(b"\0")[0].decode("latin-1") for i in range(0, len(text), step)]
    if not fields:
        return {}
    values = [_matrix(part)[1] for part in _exactly(parts, count * len(fields), name)]
    rows = [
        dict(zip(fields, values[i : i + len(fields)], strict=True))
        for i in range(0, len(values), len(fields))
    ]
    return rows[0] if count == 1 else rows


def _next(parts: Iterator[_Element]) -> _Element:
    part = next(parts, None)
    if part is None:
        raise DataError("has an incomplete array")
    return part


def _exactly(parts: Iterator[_Element], count: int, name: str) -> list[_Element]:
    found = list(parts)
    if len(found) != count:
        raise DataError(f"has {len(found)} elements in variable '{name}', expected {count}")
    return found


def read_matlab(path: Path, column_map: ColumnMap | None, **options: Any) -> FlightRecord:
    """Read the mapped variables of a MATLAB file.

    Parameters
    ----------
    path : Path
    column_map : ColumnMap
        Columns of a matrix by number, or by the name its `labels` give; whole variables by `variable`.
        None is refused.
    **options
        `cut`, `resample_hz`, `vehicle` as in `assemble`.

    Raises
    ------
    DataError
        Where the file is no intact MATLAB file, lacks a mapped variable or column, or its
        columns do not make a record.
    UsageError
        Where there is no map; as `assemble`.
    """
    variables = load_variables(path)
    if column_map is None:
        raise UsageError(
            f"is not in the SIDPAC layout and no column map is given (its variables: "
            f"{', '.join(sorted(variables)[:8]) or 'none'})",
            where=str(path),
            remedy="write a map (docs/flight-logs.md)",
        )

    def pick(place: Place) -> NDArray[np.float64]:
        name = place.variable or column_map.variable or _only_matrix(variables)
        array = numeric(variables, name)
        if place.column is None:
            if array.ndim != 1:
                raise DataError(
                    f"variable '{name}' has shape {array.shape}, expected one column",
                    remedy="add column = n to the map",
                )
            return array
        matrix = array[:, None] if array.ndim == 1 else array
        column = place.column
        if isinstance(column, str):
            labels = _labels(variables, column_map.labels)
            if column not in labels:
                raise NotLogged(f"column '{column}' is missing", remedy=nearest(column, labels))
            column = labels.index(column) + 1
        if column > matrix.shape[1]:
            raise DataError(
                f"column {column} is missing, variable '{name}' has {matrix.shape[1]}",
                remedy="correct the column map",
            )
        return matrix[:, column - 1]

    return assemble_map(Path(path), "matlab", column_map, pick, **options)


def load_variables(path: Path) -> dict[str, Any]:
    """Load a MATLAB file as plain Python: arrays without unit axes, text as str, structs as dict.

    Parameters
    ----------
    path : Path

    Raises
    ------
    DataError
        Where the file is missing, truncated, damaged or of another kind.
    """
    path = Path(path)
    if not path.is_file():
        raise DataError("no such file", where=str(path), remedy="check the path")
    remedy = "save it again, with -v7 or -v7.3"
    if not h5py.is_hdf5(path):
        try:
            return read_mat5(path.read_bytes())
        except DataError as error:
            raise DataError(
                f"no intact MATLAB file: it {error.message}", where=str(path), remedy=remedy
            ) from None
    store.refuse_fatal(path)
    try:
        with h5py.File(path, "r") as file:
            store.refuse_hostile(file, path.stat().st_size)
            return {n: _plain(file, item) for n, item in file.items() if not n.startswith("#")}
    except DataError as error:
        raise error.at(str(path)) from None
    except Exception as error:  # a damaged byte can make h5py raise almost anything
        raise DataError(
            f"no intact MATLAB file of version 7.3 ({type(error).__name__})", where=str(path), remedy=remedy
        ) from None


def lookup(variables: dict[str, Any], name: str) -> Any:
    """Return a variable, or a field of a struct by dots, or None where there is none."""
    found: Any = variables
    for part in name.split("."):
        found = found.get(part) if isinstance(found, dict) else None
    return found


def numeric(variables: dict[str, Any], name: str) -> NDArray[np.float64]:
    """Return a real numeric variable with one or two axes.

    Raises
    ------
    DataError
        Where it is missing or something else.
    """
    found = lookup(variables, name)
    if found is None:
        raise NotLogged(f"variable '{name}' is missing", remedy=nearest(name, variables))
    if not isinstance(found, np.ndarray) or not _is_real(found):
        raise DataError(f"variable '{name}' is no real vector or matrix", remedy="map another one")
    return np.atleast_1d(np.asarray(found, dtype=np.float64))


def _only_matrix(variables: dict[str, Any]) -> str:
    """Return the name of the file's only numeric matrix."""
    names = [n for n, v in variables.items() if isinstance(v, np.ndarray) and v.ndim == 2 and _is_real(v)]
    if len(names) != 1:
        raise DataError(
            f"the file holds {len(names)} matrices ({', '.join(sorted(names)[:8]) or 'none'}), expected one",
            remedy="name the wanted one with variable = in the map",
        )
    return names[0]


def _labels(variables: dict[str, Any], name: str | None) -> list[str]:
    """Return the column names that a cell array of text gives."""
    if name is None:
        raise DataError(
            "columns are asked for by name, but the map states no labels",
            remedy="state labels = the cell array of names, or map columns by number",
        )
    found = lookup(variables, name)
    if found is None:
        raise DataError(f"variable '{name}' is missing", remedy=nearest(name, variables))
    return texts(found)


def texts(found: Any) -> list[str]:
    """Return the stripped texts of a cell array; anything else in a cell reads as empty."""
    cells = found.ravel() if isinstance(found, np.ndarray) else found if isinstance(found, list) else [found]
    return [cell.strip() if isinstance(cell, str) else "" for cell in cells]


def _is_real(array: NDArray[Any]) -> bool:
    return array.dtype.kind in "fiub" and array.ndim <= 2


def _plain(file: h5py.File, item: Any) -> Any:
    """Return one item of a v7.3 file as `read_mat5` would: HDF5 stores MATLAB's arrays transposed."""
    kind = item.attrs.get("MATLAB_class", b"")
    if isinstance(item, h5py.Group):
        return {n: _plain(file, field) for n, field in item.items()}
    empty = bool(item.attrs.get("MATLAB_empty", 0))
    if kind == b"char":
        return "" if empty else "".join(map(chr, np.ravel(item[()])))
    if empty:
        return np.empty(0)
    values = item[()]
    if values.dtype == h5py.ref_dtype:  # a cell array, or one field of a struct array
        return [_plain(file, file[reference]) for reference in values.ravel()]
    return np.squeeze(values.T)


READER = Reader((".mat",), read_matlab)
