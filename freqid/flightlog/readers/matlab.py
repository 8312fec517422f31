"""MATLAB files, v5 to v7 and v7.3, read by a column map."""

from __future__ import annotations

import re
from collections.abc import Iterator
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
from freqid.flightlog.readers.mat5 import MatlabObject, read_mat5
from freqid.flightlog.signal import NotLogged, Signal, clock_of_table, looks_like_time


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
    """Return a variable, or a field of a struct by dots, or None where there is none.

    As in MATLAB ``signals(2)`` is the second of a struct array, ``x(:,2)`` the second column of a matrix.
    Of an object, the object itself.
    """
    found: Any = variables
    for part in name.split("."):
        if isinstance(found, MatlabObject):
            return found
        field = _PART.fullmatch(part)
        found = found.get(field[1]) if field and isinstance(found, dict) else None
        if field and field[3] and found is not None:
            found = _column(found, int(field[3])) if field[2] else _element(found, int(field[3]))
    return found


_PART = re.compile(r"([^()]+)(?:\((:, *)?([1-9][0-9]*)\))?")


def _column(found: Any, number: int) -> Any:
    if not isinstance(found, np.ndarray) or found.ndim != 2 or number > found.shape[1]:
        return None
    return found[:, number - 1]


def _element(found: Any, number: int) -> Any:
    """Return one of a struct array: a list of structs, or in v7.3 a struct of lists."""
    if isinstance(found, list):
        return found[number - 1] if number <= len(found) else None
    if isinstance(found, dict):
        fields = {n: v[number - 1] for n, v in found.items() if isinstance(v, list) and number <= len(v)}
        return fields or (found if number == 1 else None)
    return None


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
    if isinstance(found, MatlabObject):
        part = name.partition(".")[0]
        raise DataError(
            f"variable '{part}' is a MATLAB object of class {found.class_name}, which only MATLAB can read",
            remedy=_remedy_of(part, found.class_name),
        )
    if not isinstance(found, np.ndarray) or not _is_real(found):
        raise DataError(f"variable '{name}' is no real vector or matrix", remedy="map another one")
    return np.atleast_1d(np.asarray(found, dtype=np.float64))


def _remedy_of(name: str, class_name: str) -> str:
    """Return what to type in MATLAB, so that an object's numbers are in the file."""
    if class_name.endswith("Dataset"):
        get = f"x = {name}.get('q').Values; q = x.Data; t = x.Time"
    else:
        get = f"q = {name}.Data; t = {name}.Time"
    return f"save its numbers as variables in MATLAB, such as {get}"


def matlab_signals(path: Path) -> Iterator[Signal]:
    """Yield what has a clock: vectors beside one called after time, and logs of Simulink that are structs.

    Names are those of a column map's `variable`. An object has no samples, and is told by its class.

    Raises
    ------
    DataError
        Where the file is damaged, or nothing in it has a clock.
    """
    variables = load_variables(path)
    found = [*_beside_a_clock(variables, "")]
    if not any(signal.values.size for signal in found):
        matrix = _matrices(variables)
        objects = [f"{s.name} is a MATLAB object of class {s.label}" for s in found]
        if len(matrix) != 1:
            raise DataError(
                "; ".join(objects) or "no vector of it increases and is called after time, as t or time",
                remedy=_remedy_of(found[0].name, found[0].label)
                if found
                else "save the times beside the data, as t",
            )
        columns = enumerate(np.asarray(variables[matrix[0]], dtype=float).T, 1)
        found = [*clock_of_table([(str(k), "", row) for k, row in columns]), *found]
    yield from found


def _beside_a_clock(held: dict[str, Any], prefix: str) -> Iterator[Signal]:
    """Yield vectors and columns of a struct, or of the file, as long as its clock, and its structs'."""
    clocks = [n for n, v in held.items() if looks_like_time(n) and _is_clock(v)]
    clock = clocks[0] if clocks else ""
    time = held[clock].astype(float) if clock else np.empty(0)
    for name, value in held.items():
        at = prefix + name
        if isinstance(value, MatlabObject):
            yield Signal(at, np.empty(0), np.empty(0), label=value.class_name)
        elif isinstance(value, np.ndarray) and clock and name != clock:
            yield from _columns_of(at, value, time, prefix + clock, "")
        elif name == "signals" and clock and isinstance(value, dict | list):  # structure with time
            several = isinstance(value, list) or isinstance(value.get("values"), list)
            count = len(value if isinstance(value, list) else value["values"]) if several else 1
            for k in range(1, count + 1):
                one: Any = _element(value, k) if several else value
                label = one.get("label") or one.get("blockName") or ""
                place = f"{at}({k}).values" if several else f"{at}.values"
                label = label if isinstance(label, str) else ""
                yield from _columns_of(place, one.get("values"), time, prefix + clock, label)
        elif isinstance(value, dict) and value:
            yield from _beside_a_clock(value, f"{at}.")


def _columns_of(name: str, value: Any, time: NDArray[np.float64], clock: str, label: str) -> Iterator[Signal]:
    """Yield a vector, or the columns of a matrix, that is as long as a clock."""
    if not isinstance(value, np.ndarray) or not _is_real(value) or value.shape[:1] != time.shape:
        return
    leaf = name.rpartition(".")[2]
    if not label and leaf in ("Data", "data"):  # of a timeseries that was made a struct
        label = name.split(".")[-2] if "." in name else ""
    note = f"clock {clock}"
    if value.ndim == 1:
        yield Signal(name, time, value.astype(float), note=note, label=label)
        return
    for k, row in enumerate(value.T.astype(float), 1):
        yield Signal(f"{name}(:,{k})", time, row, note=note, label=f"{label}({k})" if label else "")


def _is_clock(value: Any) -> bool:
    if not isinstance(value, np.ndarray) or value.ndim != 1 or value.size < 2 or not _is_real(value):
        return False
    return bool((np.diff(value.astype(float)) > 0).all())


def _matrices(variables: dict[str, Any]) -> list[str]:
    """Return the names of the file's numeric matrices."""
    return [n for n, v in variables.items() if isinstance(v, np.ndarray) and v.ndim == 2 and _is_real(v)]


def _only_matrix(variables: dict[str, Any]) -> str:
    """Return the name of the file's only numeric matrix."""
    names = _matrices(variables)
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
    """Return the stripped texts of a cell array; anything else in a cell reads as empty.

    Raises
    ------
    DataError
        For an object, as a string array of MATLAB is one.
    """
    if isinstance(found, MatlabObject):
        raise DataError(
            f"names are a MATLAB object of class {found.class_name}, expected a cell array of text",
            remedy="save them as {'q', 'theta'} in place of [\"q\", \"theta\"]",
        )
    cells = found.ravel() if isinstance(found, np.ndarray) else found if isinstance(found, list) else [found]
    return [cell.strip() if isinstance(cell, str) else "" for cell in cells]


def _is_real(array: NDArray[Any]) -> bool:
    return array.dtype.kind in "fiub" and array.ndim <= 2


def _plain(file: h5py.File, item: Any) -> Any:
    """Return one item of a v7.3 file as `read_mat5` would: HDF5 stores MATLAB's arrays transposed."""
    kind = item.attrs.get("MATLAB_class", b"")
    if "MATLAB_object_decode" in item.attrs:
        return MatlabObject(bytes(kind).decode("latin-1"))
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


READER = Reader((".mat",), read_matlab, signals=matlab_signals)
