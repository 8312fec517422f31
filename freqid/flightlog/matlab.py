"""MATLAB files, v5 to v7 and v7.3, read by a column map."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError, nearest
from freqid.core.record import FlightRecord
from freqid.flightlog.assemble import assemble_map
from freqid.flightlog.column_map import ColumnMap, Place
from freqid.flightlog.mat5 import read_mat5


def read_matlab(path: Path, column_map: ColumnMap, **options: Any) -> FlightRecord:
    """Read the mapped variables of a MATLAB file.

    Parameters
    ----------
    path : Path
    column_map : ColumnMap
        Columns of a matrix by number, or by the name its `labels` give; whole variables by `variable`.
    **options
        `cut`, `resample_hz`, `vehicle` as in `assemble`.

    Raises
    ------
    DataError
        Where the file is no intact MATLAB file, lacks a mapped variable or column, or its
        columns do not make a record.
    UsageError
        As `assemble`.
    """
    variables = load_variables(path)

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
                raise DataError(f"column '{column}' is missing", remedy=nearest(column, labels))
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
    if not Path(path).is_file():
        raise DataError("no such file", where=str(path), remedy="check the path")
    remedy = "save it again, with -v7 or -v7.3"
    if not h5py.is_hdf5(path):
        try:
            return read_mat5(Path(path).read_bytes())
        except DataError as error:
            raise DataError(
                f"no intact MATLAB file: it {error.message}", where=str(path), remedy=remedy
            ) from None
    try:
        with h5py.File(path, "r") as file:
            return {n: _plain(file, item) for n, item in file.items() if not n.startswith("#")}
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
        raise DataError(f"variable '{name}' is missing", remedy=nearest(name, variables))
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
