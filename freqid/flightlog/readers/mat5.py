"""MATLAB files of level 5 (v5 to v7) as plain Python.

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
from typing import Any

import numpy as np

from freqid.core.errors import DataError

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
# numpy's type by the file's data type; the last three are text in UTF-8, UTF-16 and UTF-32.
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_TEXT = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_CELL, _STRUCT, _CHAR, _FUNCTION, _OPAQUE = 1, 2, 4, 16, 17
_NUMERIC = range(6, 16)
_COMPLEX = 0x0800
_GROWTH, _SMALL = 100, 1 << 26  # times its own size, and bytes, that a file may unpack to
_PIECES = 1 << 16  # arrays, cells and structs


@dataclass(frozen=True)
class MatlabObject:
    """An object whose contents are not read.

    Attributes
    ----------
    class_name : str
    because : str
        Why it cannot be read, to follow "is a MATLAB object of class ..."; empty where nobody has tried.
    remedy : str
        What to do, where it is not the same for all of its class.
    """

    class_name: str
    because: str = ""
    remedy: str = ""


class Allowance:
    """How much a file may unpack to before it is no longer believed.

    Parameters
    ----------
    size : int
        Of the file, bytes.
    """

    def __init__(self, size: int) -> None:
        self.bytes = max(_SMALL, _GROWTH * size)
        self._pieces = _PIECES

    def take(self, size: int) -> None:
        """Count one more piece of so many bytes.

        Raises
        ------
        DataError
            Where it is one too many.
        """
        self.bytes -= size
        self._pieces -= 1
        if self.bytes < 0 or self._pieces < 0:
            raise DataError(
                "unpacks to more than is believed of a file of its size",
                remedy="save the wanted variables alone",
            )


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
        By variable: arrays without their unit axes, text as str, scalar structs as dict, cells, struct arrays
        and rows of a character matrix as list in MATLAB's order, objects as `MatlabObject`. What has no such
        counterpart (sparse matrices, functions) is an empty dict.

    Raises
    ------
    DataError
        Where the file is of another kind, truncated or damaged.
    """
    order = {b"IM": "<", b"MI": ">"}.get(raw[126:_HEADER])
    if order is None:
        raise DataError("has no header of a MATLAB file of level 5")
    variables, allowance = {}, Allowance(len(raw))
    try:
        for element in _elements(memoryview(raw)[_HEADER:], order):
            if element.kind == _COMPRESSED:
                element = next(_elements(memoryview(_unpacked(element.data, allowance)), order))
            name, value = _matrix(element)
            if name:
                variables[name] = value
    except (zlib.error, StopIteration, RecursionError, RuntimeError) as error:
        raise DataError(f"is damaged ({error or 'incomplete'})") from None
    return variables


def _unpacked(data: memoryview, allowance: Allowance) -> bytes:
    """Return what was compressed; it is whole, with its checksum."""
    stream = zlib.decompressobj()
    unpacked = stream.decompress(data, allowance.bytes + 1)
    allowance.take(len(unpacked))
    if not stream.eof:
        raise zlib.error("incomplete or truncated stream")
    return unpacked


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
    if kind == _OPAQUE:
        name, _, class_name = (_next(parts).text() for _ in range(3))  # between them the kind of class system
        return name, MatlabObject(class_name)
    if kind >= _FUNCTION:  # these have another layout
        return "", {}
    shape = tuple(int(n) for n in _next(parts).numbers())
    name = _next(parts).text()
    if len(shape) < 2 or min(shape) < 0:
        raise DataError(f"has a variable '{name}' of shape {shape}")
    if kind in _NUMERIC:
        return name, _numeric(parts, name, shape, bool(int(flags[0]) & _COMPLEX))
    if kind == _CHAR:
        return name, characters(_next(parts).text(), shape)
    if kind == _CELL:
        return name, [_matrix(part)[1] for part in _exactly(parts, prod(shape), name)]
    if kind == _STRUCT:
        return name, _struct(parts, name, prod(shape))
    return name, {}


def characters(text: str, shape: tuple[int, ...]) -> str | list[str]:
    """Return characters in MATLAB's order as text; of a character matrix its rows, which blanks fill up."""
    if len(shape) != 2 or min(shape) < 2 or len(text) != prod(shape):
        return text if prod(shape) else ""
    return [text[k :: shape[0]].rstrip() for k in range(shape[0])]


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
