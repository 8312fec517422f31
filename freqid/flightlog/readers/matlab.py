"""MATLAB files, v5 to v7 and v7.3, read by a column map."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
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
from freqid.flightlog.readers.mat5 import Allowance, MatlabObject, characters, read_mat5
from freqid.flightlog.readers.matlab_objects import is_log, with_logs_read
from freqid.flightlog.readers.matlab_series import Timetable
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
        if is_log(lookup(variables, name)):  # what is not mapped needs no mat-io
            variables.update(with_logs_read(Path(path), variables))
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

    Objects are told by their class; `with_logs_read` reads those that are logs.

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
            size = path.stat().st_size
            store.refuse_hostile(file, size)
            allowance = Allowance(size)
            return {n: _plain(file, item, allowance) for n, item in file.items() if not n.startswith("#")}
    except DataError as error:
        raise error.at(str(path)) from None
    except Exception as error:  # a damaged byte can make h5py raise almost anything
        raise DataError(
            f"no intact MATLAB file of version 7.3 ({type(error).__name__})", where=str(path), remedy=remedy
        ) from None


def lookup(variables: dict[str, Any], name: str) -> Any:
    """Return a variable, or a field of a struct by dots, or None where there is none.

    As in MATLAB ``signals(2)`` is the second of a struct array, ``x(:,2)`` the second column of a matrix,
    ``logs{3}`` the third of a cell array or of a Dataset. Of an object, the object itself.
    """
    found: Any = variables
    for part in re.sub(r"(?<=[^.])\{", ".{", name).split("."):
        if isinstance(found, MatlabObject):
            return found
        if part.startswith("{"):
            found = _cell(found, part)
            continue
        field = _PART.fullmatch(part)
        found = found.get(field[1]) if field and isinstance(found, dict) else None
        if field and field[3] and found is not None and not isinstance(found, MatlabObject):
            found = _column(found, int(field[3])) if field[2] else _element(found, int(field[3]))
    return found


_PART = re.compile(r"([^(){}]+)(?:\((:, *)?([1-9][0-9]*)\))?")


def _cell(found: Any, part: str) -> Any:
    """Return what ``{3}`` means."""
    number = re.fullmatch(r"\{([1-9][0-9]*)\}", part)
    held = [*found.values()] if isinstance(found, dict) else found if isinstance(found, list) else []
    return held[int(number[1]) - 1] if number and int(number[1]) <= len(held) else None


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
        raise DataError(f"variable '{part}' {_said_of(found)}", remedy=_remedy_of(part, found))
    if not isinstance(found, np.ndarray) or not _is_real(found):
        raise DataError(f"variable '{name}' is no real vector or matrix", remedy="map another one")
    return np.atleast_1d(np.asarray(found, dtype=np.float64))


def _said_of(found: MatlabObject) -> str:
    """Return what an object that is not read is, after its name."""
    return f"is a MATLAB object of class {found.class_name}, {found.because or 'which only MATLAB can read'}"


def _remedy_of(name: str, found: MatlabObject) -> str:
    """Return what to type in MATLAB, so that an object's numbers are in the file."""
    if found.remedy:
        return found.remedy
    get = {
        "table": f"q = {name}.q",
        "timetable": f"q = {name}.q; t = seconds({name}.Time - {name}.Time(1))",
        "timeseries": f"q = {name}.Data; t = {name}.Time",
        "duration": f"t = seconds({name})",
        "datetime": f"t = posixtime({name})",
        "Dataset": f"x = {name}.get('q').Values; q = x.Data; t = x.Time",
    }.get(found.class_name.rpartition(".")[2])
    return f"save its numbers as variables in MATLAB{f', such as {get}' if get else ''}"


def matlab_signals(path: Path) -> Iterator[Signal]:
    """Yield what has a clock: vectors beside one called after time, timeseries, timetables, Simulink's logs.

    Names are those of a column map's `variable`. An object that is not read has no samples, and is told by
    its class.

    Raises
    ------
    DataError
        Where the file is damaged, nothing in it has a clock, or it holds objects that are logs and mat-io is
        not installed.
    """
    variables = with_logs_read(Path(path), load_variables(path))
    found = [*_beside_a_clock(variables, "")]
    if not any(signal.values.size for signal in found):
        matrix = _matrices(variables)
        objects = [*_objects(variables, "")]
        if len(matrix) != 1:
            more = f"; and {len(objects) - 3} more" if len(objects) > 3 else ""
            raise DataError(
                "; ".join(f"{name} {_said_of(one)}" for name, one in objects[:3]) + more
                or "no vector of it increases and is called after time, as t or time",
                remedy=_remedy_of(*objects[0]) if objects else "save the times beside the data, as t",
            )
        columns = enumerate(np.asarray(variables[matrix[0]], dtype=float).T, 1)
        found = [*clock_of_table([(str(k), "", row) for k, row in columns]), *found]
    yield from found


def _objects(held: dict[str, Any], prefix: str) -> Iterator[tuple[str, MatlabObject]]:
    """Yield the objects in a struct, or in the file, that are not read."""
    for name, value in held.items():
        at = _joined(prefix, name)
        for place, one in _numbered(at, value) if isinstance(value, list) else [(at, value)]:
            if isinstance(one, MatlabObject):
                yield place, one
            elif isinstance(one, dict):
                yield from _objects(one, f"{place}.")


def _joined(prefix: str, name: str) -> str:
    """Return a path; elements of a Dataset that are called by their number follow without a dot."""
    return (prefix.removesuffix(".") if name.startswith("{") else prefix) + name


def _numbered(at: str, held: list[Any]) -> list[tuple[str, Any]]:
    return [(f"{at}({k})", one) for k, one in enumerate(held, 1)]


def _beside_a_clock(held: dict[str, Any], prefix: str) -> Iterator[Signal]:
    """Yield vectors and columns of a struct, or of the file, as long as its clock, and its structs'."""
    clock = _clock_of(held)
    time = np.ravel(held[clock]).astype(float) if clock else np.empty(0)
    source, epoch = _joined(prefix, clock), "unix" if isinstance(held, Timetable) and held.absolute else ""
    for name, value in held.items():
        at = _joined(prefix, name)
        if isinstance(value, MatlabObject):
            yield Signal(at, np.empty(0), np.empty(0), label=value.class_name)
        elif isinstance(value, np.ndarray) and clock and name != clock:
            label, unit = _stated_beside(held, name, prefix)
            for signal in _columns_of(at, value, time, source, label, unit):
                yield replace(signal, epoch=epoch)
        elif name == "signals" and clock and isinstance(value, dict | list):  # structure with time
            several = isinstance(value, list) or isinstance(value.get("values"), list)
            count = len(value if isinstance(value, list) else value["values"]) if several else 1
            for k in range(1, count + 1):
                one: Any = _element(value, k) if several else value
                label = one.get("label") or one.get("blockName") or ""
                place = f"{at}({k}).values" if several else f"{at}.values"
                label = label if isinstance(label, str) else ""
                yield from _columns_of(place, one.get("values"), time, source, label)
        elif isinstance(value, dict) and value:
            yield from _beside_a_clock(value, f"{at}.")
        elif isinstance(value, list):  # an array of structs or of timeseries
            for place, one in _numbered(at, value):
                if isinstance(one, MatlabObject):
                    yield Signal(place, np.empty(0), np.empty(0), label=one.class_name)
                elif isinstance(one, dict) and one:
                    yield from _beside_a_clock(one, f"{place}.")


def _clock_of(held: dict[str, Any]) -> str:
    """Return the name of the clock of a struct, or an empty text.

    Of a timeseries or timetable it is the clock even where it does not increase: it repeats times where
    Simulink's solver stopped at an event.
    """
    if isinstance(held, Timetable):
        return held.clock
    if isinstance(held.get("Time"), np.ndarray) and isinstance(held.get("Data"), np.ndarray):
        return "Time"
    return next((n for n, v in held.items() if (n == "tout" or looks_like_time(n)) and _is_clock(v)), "")


def _stated_beside(held: dict[str, Any], name: str, prefix: str) -> tuple[str, str]:
    """Return what the data of a timeseries, or a variable of a timetable, are, and their unit, if stated.

    The data of a timeseries, and of one that Simulink logs as a timetable, are what the variable or field is
    called; one of several has its own name.
    """
    label, unit = held.stated.get(name, ("", "")) if isinstance(held, Timetable) else ("", "")
    if name not in ("Data", "data"):
        return label, unit
    label = prefix.removesuffix(".").rpartition(".")[2]
    own, about = held.get("Name"), held.get("DataInfo")
    if label.endswith((")", "}")):
        label = own if isinstance(own, str) else ""
    of_data = about.get("Units") if isinstance(about, dict) else unit
    return label, of_data if isinstance(of_data, str) else ""


def _columns_of(
    name: str, value: Any, time: NDArray[np.float64], clock: str, label: str, unit: str = ""
) -> Iterator[Signal]:
    """Yield a vector, or the columns of a matrix, that is as long as a clock."""
    value = np.atleast_1d(value) if isinstance(value, np.ndarray) else value
    if not isinstance(value, np.ndarray) or not _is_real(value) or value.shape[:1] != time.shape:
        return
    note = f"clock {clock}"
    if value.ndim == 1:
        yield Signal(name, time, value.astype(float), unit, note, label)
        return
    for k, row in enumerate(value.T.astype(float), 1):
        yield Signal(f"{name}(:,{k})", time, row, unit, note, f"{label}({k})" if label else "")


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


def _plain(file: h5py.File, item: Any, allowance: Allowance) -> Any:
    """Return one item of a v7.3 file as `read_mat5` would: HDF5 stores MATLAB's arrays transposed."""
    kind = item.attrs.get("MATLAB_class", b"")
    allowance.take(0 if isinstance(item, h5py.Group) else item.nbytes)  # cells may name one array many times
    if "MATLAB_object_decode" in item.attrs:
        return MatlabObject(bytes(kind).decode("latin-1"))
    if isinstance(item, h5py.Group):
        return {n: _plain(file, field, allowance) for n, field in item.items()}
    empty = bool(item.attrs.get("MATLAB_empty", 0))
    if kind == b"char":
        if empty:
            return ""
        units = np.ravel(item[()].astype("<u2", casting="same_kind"))
        return characters(units.tobytes().decode("utf-16-le", errors="replace"), (*item.shape[::-1],))
    if empty:
        return np.empty(0)
    values = item[()]
    if values.dtype == h5py.ref_dtype:  # a cell array, or one field of a struct array
        return [_plain(file, file[reference], allowance) for reference in values.ravel()]
    return np.squeeze(values.T)


READER = Reader((".mat",), read_matlab, signals=matlab_signals)
