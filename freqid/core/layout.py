"""Where the fields of a result lie in its HDF5 file: one table a result, by which it is written and read.

A layout names for each field a place, ``group/dataset`` or ``group@attribute``. ``{name}`` in a place or a
unit stands for a field of the object, or of the object that holds it, or for the key that it is held under.
Where that is a tuple, the field is spread over one place for each entry, rows of an array likewise;
``{table.name}`` is the entry of a mapping under what `name` stands for. A name that is no field of the class
is a property: it is written for other readers of the file, and not read back.

How a field is read follows from its annotation. Complex arrays are the two datasets ``NAME/real`` and
``NAME/imag``; what the annotation leaves open (``Any``) is one dataset of whatever type it has. A field with
a default may be absent, as it is in files of releases that did not have it.
"""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, Generic, TypeVar, get_args, get_origin, get_type_hints

import h5py
import msgspec
import numpy as np

from freqid.core import store

T = TypeVar("T")
Address = str | tuple[str, ...]
_NAME = re.compile(r"\{([^}]+)\}")


@dataclass(frozen=True)
class Dataset:
    """Numbers, with their unit.

    Attributes
    ----------
    at : str or tuple of str
    units : str
    axes : tuple of str or int, optional
        What each axis of the array runs over: a count, a field that is a tuple, or any name, which is as long
        wherever the same object has it.
    """

    at: Address
    units: str = "1"
    axes: tuple[str | int, ...] | None = None


@dataclass(frozen=True)
class Attribute:
    """A number, a text or a few numbers; as JSON, anything that is JSON-compatible."""

    at: str
    json: bool = False
    axes: tuple[str | int, ...] | None = None


@dataclass(frozen=True)
class Attributes:
    """A mapping, or an object by its ``to_json`` and ``from_json``, each entry an attribute of one group.

    Attributes
    ----------
    at : str
    only : tuple of str
        Names that an entry may have; all attributes of the group where empty.
    """

    at: str
    only: tuple[str, ...] = ()


@dataclass(frozen=True)
class Table:
    """A table that may be too long for an attribute, which holds 64 KiB: JSON as a dataset."""

    at: str


@dataclass(frozen=True)
class Nested:
    """An object inside the object."""

    of: type
    layout: Layout


@dataclass(frozen=True)
class NestedSeries:
    """A mapping or a tuple of objects.

    Attributes
    ----------
    of : type
    layout : mapping
    key : str
        Name that places and units have for the key of an entry; of a tuple, the field of that name, or else
        the index.
    listed : str
        Where the keys are: a JSON attribute that lists them, or the group that they are the names in.
    """

    of: type
    layout: Layout
    key: str
    listed: str


@dataclass(frozen=True)
class Rows:
    """A tuple of small objects as one array or list for each field; ``"a b"`` are columns of one array."""

    of: type
    layout: Layout


@dataclass(frozen=True)
class Part:
    """An object that has a layout of its own, in a group.

    Attributes
    ----------
    at : str
        The group.
    put, get : callable
        ``put(group, value)`` writes it, ``get(group)`` reads it.
    """

    at: str
    put: Callable[[h5py.Group, Any], None]
    get: Callable[[h5py.Group], Any]


Layout = Mapping[str, Dataset | Attribute | Attributes | Table | Nested | NestedSeries | Rows | Part]


@dataclass(frozen=True)
class ResultFile(Generic[T]):
    """One kind of file: what it holds, and where.

    Attributes
    ----------
    format : str
        The format that it says it has.
    of : type
    layout : mapping
        By field.
    table : str
        Dataset of the whole object as one JSON table, by its ``to_json`` and ``from_json``; empty where the
        fields are read from their own places.
    check : callable
        Raises ValueError for contents that do not fit together.
    """

    format: str
    of: type[T]
    layout: Layout
    table: str = ""
    check: Callable[[T], None] = lambda _: None

    def write(self, path: Path, result: T, scenario_sha256: str = "") -> None:
        """Write one result, whole or not at all.

        Parameters
        ----------
        path : Path
        result : object of the class `of`
        scenario_sha256 : str
            Of the scenario that it was made with.

        Raises
        ------
        DataError
            Where the folder cannot be written.
        """

        def fill(file: h5py.File) -> None:
            if self.table:
                _put(file, Table(self.table), result, (), Any)
            put_fields(file, result, self.layout)

        store.write(path, self.format, fill, scenario_sha256)

    def read(self, path: Path) -> T:
        """Read one result.

        Parameters
        ----------
        path : Path

        Raises
        ------
        DataError
            Where the file is no intact file of this format, or one of a newer layout.
        """
        with store.reading(path, self.format) as file:
            if self.table:
                return _get(file, Table(self.table), (), self.of)
            result = self.of(**get_fields(file, self.of, self.layout))
            self.check(result)
            return result


def finite_table(value: Any) -> Any:
    """Return JSON-compatible values of nested tables and lists; a float that is not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(k): finite_table(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [finite_table(v) for v in value]
    if isinstance(value, float):
        return value if abs(value) < float("inf") else None  # nan is not below either
    return finite_table(value.item()) if hasattr(value, "item") else value


def table_with_nan(value: Any) -> Any:
    """Return a table that `finite_table` made with NaN for None."""
    if isinstance(value, Mapping):
        return {k: table_with_nan(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [table_with_nan(v) for v in value]
    return float("nan") if value is None else value


def put_fields(file: h5py.Group, value: Any, layout: Layout, scopes: tuple[Any, ...] = ()) -> None:
    """Write the fields of an object, or entries of a dict, at their places; a field that is None is left out.

    Parameters
    ----------
    file : h5py.File or h5py.Group
    value : object or dict
    layout : mapping
    scopes : tuple
        Objects and dicts that hold `value`, inner ones first.
    """
    scopes = (value, *scopes)
    hints = {} if isinstance(value, dict) else _hints(type(value))
    for name, slot in layout.items():
        held = _look_up(name, scopes[:1])
        if held is not None:
            _put(file, slot, held, scopes, hints.get(name, Any))


def get_fields(file: h5py.Group, of: type, layout: Layout, scopes: tuple[Any, ...] = ()) -> dict[str, Any]:
    """Read the fields of a class from their places.

    Parameters
    ----------
    file : h5py.File or h5py.Group
    of : type
    layout : mapping
    scopes : tuple
        Dicts of the objects that hold this one, inner ones first.

    Returns
    -------
    dict
        By field; without those that are absent and have a default.

    Raises
    ------
    LookupError, TypeError, ValueError
        For what is missing, of another type, or of a shape that does not fit to the rest.
    """
    fields = {f.name: f for f in dataclasses.fields(of)}
    found: dict[str, Any] = {k: v for scope in scopes[:1] for k, v in scope.items() if k in fields}
    names = {f.name: f.default for f in fields.values() if f.default and isinstance(f.default, tuple)}
    scopes = (found, names, *scopes)  # places may be named by a field that the file does not have
    for name, slot in layout.items():
        if name not in fields or (_optional(fields[name]) and not _present(file, slot, scopes)):
            continue
        found[name] = _get(file, slot, scopes, _hints(of)[name])
    _check_shapes(found, layout, scopes)
    return {name: value for name, value in found.items() if name in fields}


def _builtins(value: Any) -> Any:
    """Return what JSON knows of a value in its place; numbers of numpy are as good as Python's."""
    return msgspec.to_builtins(value, enc_hook=_of_numpy)


def _of_numpy(value: Any) -> Any:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} cannot be written")


def _put(file: h5py.Group, slot: Any, value: Any, scopes: tuple[Any, ...], hint: Any) -> None:
    """Write one field."""
    match slot:
        case Dataset():
            places, spread = _fill_in(slot.at, scopes)
            units, _ = _fill_in(slot.units, scopes)
            rows = value if spread else [value]
            every = units * (len(places) // len(units)) if places else []
            for place, unit, row in zip(places, every, rows, strict=True):
                if _dtype(hint) is np.complex128:
                    store.put_complex(file, place, row, unit)
                else:
                    store.put(file, place, row, unit)
        case Attribute():
            places, spread = _fill_in(slot.at, scopes)
            for place, row in zip(places, value if spread else [value], strict=True):
                owner, name = _owner(file, place)
                owner.attrs[name] = json.dumps(value, sort_keys=True, default=_builtins) if slot.json else row
        case Attributes():
            owner, _ = _owner(file, f"{slot.at}@")
            entries = value if isinstance(value, Mapping) else value.to_json()
            for name, row in entries.items():
                owner.attrs[name] = row
        case Table():
            table = value.to_json() if hasattr(value, "to_json") else value
            text = json.dumps(table, allow_nan=False, default=_builtins)
            file.create_dataset(slot.at, data=text).attrs["units"] = "JSON"
        case Nested():
            put_fields(file, value, slot.layout, scopes)
        case NestedSeries():
            entries = (
                value
                if isinstance(value, Mapping)
                else {getattr(part, slot.key, str(i)): part for i, part in enumerate(value)}
            )
            (place,), _ = _fill_in(slot.listed, scopes)
            if "@" in place:
                _put(file, Attribute(place, json=True), list(entries), (), Any)
            else:
                file.require_group(place)
            for key, part in entries.items():
                put_fields(file, part, slot.layout, ({slot.key: key}, *scopes))
        case Rows():
            columns = {names: [_row(one, names.split()) for one in value] for names in slot.layout}
            put_fields(file, columns, slot.layout, scopes)
        case Part():
            slot.put(file.require_group(slot.at), value)


def _get(file: h5py.Group, slot: Any, scopes: tuple[Any, ...], hint: Any) -> Any:
    """Read one field."""
    match slot:
        case Dataset():
            places, spread = _fill_in(slot.at, scopes)
            rows = [_numbers(file, place, _dtype(hint)) for place in places]
            values = np.array(rows) if spread else rows[0]
            return values if _array(hint) else _convert(values.tolist(), hint)
        case Attribute(json=True):
            owner, name = _owner(file, _fill_in(slot.at, scopes)[0][0])
            return _convert(json.loads(owner.attrs[name]), hint)
        case Attribute():
            places, spread = _fill_in(slot.at, scopes)
            rows = [_plain(owner.attrs[name]) for owner, name in (_owner(file, place) for place in places)]
            return _convert(rows if spread else rows[0], hint, strict=False)  # 7.0 is a whole number
        case Attributes():
            attrs = store.subgroup(file, slot.at).attrs
            entries = {k: _plain(attrs[k]) for k in slot.only or attrs if k in attrs}
            return hint.from_json(entries) if hasattr(hint, "from_json") else _convert(entries, hint)
        case Table():
            table = json.loads(store.dataset(file, slot.at)[()])
            return hint.from_json(table) if hasattr(hint, "from_json") else _convert(table, hint)
        case Nested():
            return slot.of(**get_fields(file, slot.of, slot.layout, scopes))
        case NestedSeries():
            parts = {
                key: slot.of(**get_fields(file, slot.of, slot.layout, ({slot.key: key}, *scopes)))
                for key in _keys(file, _fill_in(slot.listed, scopes)[0][0])
            }
            return tuple(parts.values()) if get_origin(hint) is tuple else parts
        case Rows():
            columns = [_get(file, column, scopes, list[Any]) for column in slot.layout.values()]
            names = " ".join(slot.layout).split()
            rows = [
                [v for cell in row for v in (cell if isinstance(cell, list) else [cell])]
                for row in zip(*columns, strict=True)
            ]
            return tuple(slot.of(**dict(zip(names, row, strict=True))) for row in rows)
        case Part():
            return slot.get(store.subgroup(file, slot.at))


def _fill_in(place: Address, scopes: tuple[Any, ...]) -> tuple[list[str], bool]:
    """Return a place with its names filled in, one for each entry of a tuple, and whether it was spread."""
    if isinstance(place, tuple):
        return list(place), True
    values = {name: _look_up(name, scopes) for name in _NAME.findall(place)}
    counts = {len(value) for value in values.values() if isinstance(value, tuple)}
    if len(counts) > 1:
        raise ValueError(f"'{place}' has names of different counts: {sorted(counts)}")
    filled = [
        _NAME.sub(lambda m: str(v[i] if isinstance(v := values[m[1]], tuple) else v), place)  # noqa: B023
        for i in range(counts.pop() if counts else 1)
    ]
    return filled, any(isinstance(value, tuple) for value in values.values())


def _look_up(name: str, scopes: Sequence[Any]) -> Any:
    """Return what has a name: an entry or an attribute of the innermost scope that has it."""
    if "." in name:
        table, key = name.split(".")
        return _look_up(table, scopes)[_look_up(key, scopes)]
    for scope in scopes:
        if isinstance(scope, dict):
            if name in scope:
                return scope[name]
        elif hasattr(scope, name):
            return getattr(scope, name)
    raise KeyError(f"'{name}' is not there")


def _owner(file: h5py.Group, place: str) -> tuple[Any, str]:
    """Return what carries an attribute, and its name; a group that is not there yet is made in writing."""
    at, _, name = place.rpartition("@")
    if not at:
        return file, name
    return (file.create_group(at) if at not in file and file.file.mode != "r" else file[at]), name


def _present(file: h5py.Group, slot: Any, scopes: tuple[Any, ...]) -> bool:
    """Return whether a file has a field, or the first place of several."""
    if isinstance(slot, Nested | Rows):
        return _present(file, next(iter(slot.layout.values())), scopes)
    first = _fill_in(slot.listed if isinstance(slot, NestedSeries) else slot.at, scopes)[0][0]
    at, is_attribute, name = first.rpartition("@")
    if not is_attribute:
        return first in file
    owner: Any = file.get(at) if at else file
    return owner is not None and name in owner.attrs


def _numbers(file: h5py.Group, place: str, dtype: type | None) -> Any:
    """Return an array of a type; of the file's own, real or complex, where none is asked for."""
    if dtype is np.complex128:
        return store.complex_array(file, place)
    if dtype is None and store.dataset(file, place).dtype.kind == "c":
        return np.asarray(store.dataset(file, place)[()], dtype=np.complex128)
    return store.array(file, place).astype(dtype or np.float64, copy=False)


def _keys(file: h5py.Group, place: str) -> list[str]:
    """Return the keys of parts: from a JSON attribute, or the names in a group, numbers in their order."""
    if "@" in place:
        owner, name = _owner(file, place)
        return [str(key) for key in json.loads(owner.attrs[name])]
    names = [str(name) for name in store.subgroup(file, place)]
    return sorted(names, key=int) if all(map(str.isdecimal, names)) else names


def _check_shapes(found: dict[str, Any], layout: Layout, scopes: tuple[Any, ...]) -> None:
    """Raise ValueError for an array whose axes are not as long as what they run over."""
    lengths: dict[str, int] = {}
    for name, slot in layout.items():
        if not isinstance(slot, Dataset | Attribute) or slot.axes is None or name not in found:
            continue
        shape = np.shape(found[name])
        for i, axis in enumerate(slot.axes):
            if isinstance(axis, str) and axis not in lengths:
                listed = next((s[axis] for s in scopes if axis in s), None)
                lengths[axis] = len(listed) if isinstance(listed, tuple) else (*shape[i:], 0)[0]
        expected = tuple(axis if isinstance(axis, int) else lengths[axis] for axis in slot.axes)
        if 0 in expected and np.size(found[name]) == 0:  # an array that is spread over no places
            found[name] = np.empty(expected)
        elif shape != expected:
            raise ValueError(f"'{name}' has shape {shape}, expected {expected}")


def _row(one: Any, names: Sequence[str]) -> Any:
    """Return one field of an object, or several as a list; a field that is an object as its own fields."""
    values = [getattr(one, name) for name in names]
    values = [dataclasses.astuple(v) if is_dataclass(v) and not isinstance(v, type) else v for v in values]
    return values[0] if len(values) == 1 else values


def _plain(value: Any) -> Any:
    """Return an attribute as Python's own numbers and text."""
    if isinstance(value, bytes):
        return value.decode()
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _convert(value: Any, hint: Any, *, strict: bool = True) -> Any:
    """Return a value as its annotation says, or raise ValueError."""
    try:
        return msgspec.convert(value, hint, strict=strict)
    except msgspec.ValidationError as error:
        raise ValueError(str(error)) from None


@cache
def _hints(of: type) -> dict[str, Any]:
    return get_type_hints(of)


def _array(hint: Any) -> Any:
    """Return the annotation of an array, also of one that may be None; None for anything else."""
    return next((one for one in (hint, *get_args(hint)) if get_origin(one) is np.ndarray), None)


def _dtype(hint: Any) -> type | None:
    """Return the type of an array's numbers; None where its annotation leaves it open, float for all else."""
    array = _array(hint)
    if array is None:
        return np.float64
    dtype = get_args(get_args(array)[1])[0]
    return None if dtype is Any else dtype


def _optional(field: dataclasses.Field[Any]) -> bool:
    missing = dataclasses.MISSING
    return field.default is not missing or field.default_factory is not missing
