"""What MATLAB keeps of a timeseries, a timetable and of Simulink's containers, as plain structs.

mat-io reads the properties of an object of any class; which of them hold the samples is said here, by the
public definitions of the classes [1]_. Nothing else of an object is of use to a log.

- ``timeseries`` and ``timetable``: `matlab_series`.
- ``Simulink.SimulationData.Dataset`` becomes a struct of its elements by name. An element without a name that
  a path can hold, or with one that an earlier element has, is called by its number, ``{3}``.
- ``Signal``, ``State`` and other elements become what their ``Values`` are; of a bus, a struct.
- ``Simulink.SimulationOutput`` becomes a struct of its variables.

References
----------
.. [1] The MathWorks, class definitions of ``Simulink.SimulationData.Dataset`` with its ``RamDatasetStorage``,
   and of ``Simulink.SimulationOutput``.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from freqid.core import store
from freqid.core.errors import DataError
from freqid.core.extras import extra
from freqid.flightlog.readers.mat5 import Allowance, MatlabObject
from freqid.flightlog.readers.matlab_series import (
    SERIES,
    TABLE,
    SeriesReader,
    class_of,
    fields,
    key_of,
    text,
)

_OUTPUT = "Simulink.SimulationOutput"
_DATASET = "Simulink.SimulationData.Dataset"
_LOGGED = ("Simulink.SimulationData.", "Stateflow.SimulationData.")
_DEEPEST = 32  # structs and objects in each other; buses in buses are a few deep
_REMEDY = "save it again, with -v7"
_UNKNOWN = "which only MATLAB can read"


def is_log(value: Any) -> bool:
    """Tell whether something is an object of a class that logs are kept in."""
    if not isinstance(value, MatlabObject) or value.because:
        return False
    return value.class_name in (SERIES, TABLE, _OUTPUT) or value.class_name.startswith(_LOGGED)


def with_logs_read(path: Path, variables: dict[str, Any]) -> dict[str, Any]:
    """Return the variables of a file with structs in place of the objects that are logs.

    Parameters
    ----------
    path : Path
    variables : dict
        As `load_variables` gives them.

    Raises
    ------
    DataError
        Where mat-io is not installed, or what the file holds of an object is damaged.
    """
    names = [name for name, value in variables.items() if _holds_log(value)]
    if not names:
        return variables
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it sets an option that pandas 3 has deprecated
        matio = extra("matio", "logs", str(path))
    store.refuse_fatal(path, objects=True)
    try:
        loaded = _loaded(matio, path, names)
        plain = _Plain(matio, path.stat().st_size)
        return variables | {name: plain.value(loaded[name], 0) for name in names}
    except DataError as error:
        raise error.at(str(path)) from None
    except Exception as error:  # a damaged byte can make it raise almost anything
        raise DataError(
            f"no intact MATLAB file: the objects in it are damaged ({type(error).__name__})",
            where=str(path),
            remedy=_REMEDY,
        ) from None


def _holds_log(value: Any) -> bool:
    if isinstance(value, dict):
        return any(map(_holds_log, value.values()))
    return any(map(_holds_log, value)) if isinstance(value, list) else is_log(value)


def _loaded(matio: ModuleType, path: Path, names: list[str]) -> dict[str, Any]:
    """Return variables as mat-io has them, objects with their raw properties."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        loaded = matio.load_from_mat(str(path), raw_data=True, variable_names=list(names))
    if any(str(w.message).startswith(("Failed", "Unreadable")) for w in said):
        raise DataError("no intact MATLAB file: the objects in it are damaged", remedy=_REMEDY)
    return loaded


class _Plain:
    """Makes plain Python of what mat-io gives."""

    def __init__(self, matio: ModuleType, size: int) -> None:
        self._opaque: type = matio.utils.MatlabOpaque
        self._allowance = Allowance(size)
        self._reader = SeriesReader(self._allowance)
        self._series: dict[int, Any] = {}  # by identity, as a bus may be logged twice

    def value(self, found: Any, depth: int) -> Any:
        """Return one value; raise DataError where a file holds more, or nests deeper, than is believed."""
        if depth > _DEEPEST:
            raise DataError(f"holds objects nested deeper than {_DEEPEST}", remedy=_REMEDY)
        self._allowance.take(0)
        if isinstance(found, self._opaque):
            return self._object(found, depth)
        if not isinstance(found, np.ndarray):
            return {}
        if found.dtype.names:
            if class_of(found):  # of the kind before 2008
                return MatlabObject(class_of(found), _UNKNOWN)
            rows = [{n: self.value(row[n], depth + 1) for n in found.dtype.names} for row in found.ravel("F")]
            return rows[0] if len(rows) == 1 else rows
        if found.dtype.kind == "O":  # a cell, or an array of objects
            return [self.value(one, depth + 1) for one in found.ravel("F")]
        if found.dtype.kind == "U":
            return text(found)
        self._allowance.take(found.nbytes)
        return np.squeeze(found)

    def _object(self, found: Any, depth: int) -> Any:
        name = class_of(found)
        if isinstance(found.properties, tuple):  # an array without objects
            return np.empty(0)
        properties = fields(found)
        if name in (SERIES, TABLE):
            if id(found) not in self._series:
                self._series[id(found)] = (
                    self._reader.timeseries(properties)
                    if name == SERIES
                    else self._reader.timetable(properties, lambda held: self.value(held, depth + 1))
                )
            return self._series[id(found)]
        if name == _DATASET:
            return self._dataset(properties, depth)
        place = "Data" if name == _OUTPUT else "Values" if name.startswith(_LOGGED) else ""
        return (
            self.value(properties[place], depth + 1) if place in properties else MatlabObject(name, _UNKNOWN)
        )

    def _dataset(self, properties: dict[str, Any], depth: int) -> Any:
        storage = properties.get("Storage", properties.get("Storage_"))
        if class_of(storage).endswith("MatFileDatasetStorage"):
            return MatlabObject(
                _DATASET, "saved as v7.3, where only MATLAB finds its samples", "save it in MATLAB with -v7"
            )
        held = fields(storage) if isinstance(storage, self._opaque) else properties
        elements = held.get("Elements")
        if not isinstance(elements, np.ndarray) or (elements.size and elements.dtype.kind != "O"):
            return MatlabObject(_DATASET, _UNKNOWN)
        result: dict[str, Any] = {}
        for element in elements.ravel("F"):
            result[key_of(text(fields(element).get("Name")), result)] = self.value(element, depth + 1)
        return result
