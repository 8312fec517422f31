"""What MATLAB keeps of a timeseries and of Simulink's containers, as plain structs.

mat-io reads the properties of an object of any class; which of them hold the samples is said here, by the
public definitions of the classes [1]_. Nothing else of an object is of use to a log.

- ``timeseries`` becomes a struct with ``Name``, ``Time`` (s), ``Data`` (time along the rows) and
  ``DataInfo.Units``. Its ``TimeInfo`` holds the times themselves, or of uniform times start, increment and
  length alone.
- ``Simulink.SimulationData.Dataset`` becomes a struct of its elements by name. An element without a name that
  a path can hold, or with one that an earlier element has, is called by its number, ``{3}``.
- ``Signal``, ``State`` and other elements become what their ``Values`` are; of a bus, a struct.
- ``Simulink.SimulationOutput`` becomes a struct of its variables.

References
----------
.. [1] The MathWorks, class definitions of ``timeseries``, ``Simulink.SimulationData.Dataset`` with its
   ``RamDatasetStorage``, and ``Simulink.SimulationOutput``.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core import store
from freqid.core.errors import DataError
from freqid.core.extras import extra
from freqid.flightlog.readers.mat5 import Allowance, MatlabObject

_SERIES, _OUTPUT = "timeseries", "Simulink.SimulationOutput"
_DATASET = "Simulink.SimulationData.Dataset"
_LOGGED = ("Simulink.SimulationData.", "Stateflow.SimulationData.")
_DEEPEST = 32  # structs and objects in each other; buses in buses are a few deep
_REMEDY = "save it again, with -v7"
_UNKNOWN = "which only MATLAB can read"
_SECONDS = {
    **{"nanoseconds": 1e-9, "microseconds": 1e-6, "milliseconds": 1e-3, "seconds": 1.0, "s": 1.0},
    **{"minutes": 60.0, "hours": 3600.0, "days": 86400.0, "weeks": 604800.0},
}


def is_log(value: Any) -> bool:
    """Tell whether something is an object of a class that logs are kept in."""
    if not isinstance(value, MatlabObject) or value.because:
        return False
    return value.class_name in (_SERIES, _OUTPUT) or value.class_name.startswith(_LOGGED)


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
        self._series: dict[int, Any] = {}  # by identity, as a bus may be logged twice
        self._uniform: dict[tuple[float, float, int], NDArray[np.float64]] = {}  # clocks that signals share

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
            old = getattr(found, "classname", "")  # of a class of the kind before 2008
            if old:
                return MatlabObject(str(old), _UNKNOWN)
            rows = [{n: self.value(row[n], depth + 1) for n in found.dtype.names} for row in found.ravel("F")]
            return rows[0] if len(rows) == 1 else rows
        if found.dtype.kind == "O":  # a cell, or an array of objects
            return [self.value(one, depth + 1) for one in found.ravel("F")]
        if found.dtype.kind == "U":
            return _text(found)
        self._allowance.take(found.nbytes)
        return np.squeeze(found)

    def _object(self, found: Any, depth: int) -> Any:
        name = str(found.classname)
        if isinstance(found.properties, tuple):  # an array without objects
            return np.empty(0)
        properties = self._fields(found)
        if name == _SERIES:
            if id(found) not in self._series:
                self._series[id(found)] = self._timeseries(properties)
            return self._series[id(found)]
        if name == _DATASET:
            return self._dataset(properties, depth)
        place = "Data" if name == _OUTPUT else "Values" if name.startswith(_LOGGED) else ""
        return (
            self.value(properties[place], depth + 1) if place in properties else MatlabObject(name, _UNKNOWN)
        )

    def _fields(self, found: Any) -> dict[str, Any]:
        """Return the fields of a struct or an object; of one that saves itself as a struct, of that."""
        if isinstance(found, self._opaque):
            own = found.properties if isinstance(found.properties, dict) else {}
            return {**own, **self._fields(own.get("any"))}
        if isinstance(found, np.ndarray) and found.dtype.names and found.size == 1:
            row = found.ravel()[0]
            return {name: row[name] for name in found.dtype.names}
        return {}

    def _dataset(self, properties: dict[str, Any], depth: int) -> Any:
        storage = properties.get("Storage", properties.get("Storage_"))
        if str(getattr(storage, "classname", "")).endswith("MatFileDatasetStorage"):
            return MatlabObject(
                _DATASET, "saved as v7.3, where only MATLAB finds its samples", "save it in MATLAB with -v7"
            )
        held = self._fields(storage) if isinstance(storage, self._opaque) else properties
        elements = held.get("Elements")
        if not isinstance(elements, np.ndarray) or (elements.size and elements.dtype.kind != "O"):
            return MatlabObject(_DATASET, _UNKNOWN)
        result: dict[str, Any] = {}
        for number, element in enumerate(elements.ravel("F"), 1):
            name = _text(self._fields(element).get("Name"))
            usable = name and name not in result and not set(name) & set(".(){}")
            result[name if usable else f"{{{number}}}"] = self.value(element, depth + 1)
        return result

    def _timeseries(self, properties: dict[str, Any]) -> Any:
        clock, about = self._fields(properties.get("TimeInfo")), self._fields(properties.get("DataInfo"))
        samples = next((x for n in ("Data_", "Storage_") if _size(x := properties.get(n))), np.empty((0, 0)))
        if not isinstance(samples, np.ndarray) or samples.dtype.kind not in "fiubc":
            kind = getattr(samples, "classname", "") or "another kind"
            return MatlabObject(_SERIES, f"with samples of {kind}, which only MATLAB can read")
        unit = _text(clock.get("Units")) or "seconds"
        if unit.lower() not in _SECONDS:
            return MatlabObject(_SERIES, f"with times in '{unit}', which is no unit of time")
        time = self._time(properties, clock, samples.shape)
        rows = None if time is None else _rows(samples, time.size)
        if time is None or rows is None:
            shape = " x ".join(map(str, samples.shape))
            times = "without times" if time is None else f"with {time.size} times"
            return MatlabObject(_SERIES, f"{times} to samples of shape {shape}")
        self._allowance.take(rows.nbytes)
        of_data = about.get("Units")
        of_data = self._fields(of_data).get("Name") if isinstance(of_data, self._opaque) else of_data
        return {
            "Name": _text(properties.get("Name")),
            "Time": time if unit.lower() in ("seconds", "s") else _SECONDS[unit.lower()] * time,
            "Data": rows[:, 0] if rows.shape[1] == 1 else rows,
            "DataInfo": {"Units": _text(of_data)},
        }

    def _time(
        self, properties: dict[str, Any], clock: dict[str, Any], shape: tuple[int, ...]
    ) -> NDArray[np.float64] | None:
        """Return the times, or None; never more than there are samples."""
        for stored in (properties.get("Time_"), clock.get("Time_")):
            if isinstance(stored, np.ndarray) and stored.size and stored.dtype.kind in "fiu":
                return np.ravel(stored).astype(np.float64)
        start, step, count = (_number(clock.get(n)) for n in ("Start_", "Increment_", "Length"))
        if count == 0 and 0 in shape:
            return np.empty(0)
        if not (np.isfinite(start) and np.isfinite(step)) or count not in (1, *shape):
            return None
        key = start, step, int(count)
        if key not in self._uniform:
            self._uniform[key] = start + step * np.arange(int(count), dtype=np.float64)
        return self._uniform[key]


def _rows(samples: NDArray[Any], count: int) -> NDArray[Any] | None:
    """Return samples with time along the rows, or None where no axis is as long as the clock.

    MATLAB has time along the rows of a matrix and along the last axis of a larger array; before 2011
    either could be otherwise.
    """
    if count == 0:
        return np.empty((0, 1)) if not samples.size else None
    if count == 1:
        return samples.reshape(1, -1, order="F")
    first, last = samples.shape[0] == count, samples.shape[-1] == count
    if not (first or last):
        return None
    if last and (samples.ndim > 2 or not first):
        samples = np.moveaxis(samples, -1, 0)
    return samples.reshape(count, -1, order="F")


def _size(found: Any) -> int:
    """Return how much is there: an object counts as one, and a property that is absent as nothing."""
    return found.size if isinstance(found, np.ndarray) else int(found is not None)


def _number(found: Any) -> float:
    """Return a scalar, or NaN."""
    if isinstance(found, np.ndarray) and found.size == 1 and found.dtype.kind in "fiub":
        return float(found.ravel()[0])
    return float("nan")


def _text(found: Any) -> str:
    """Return a line of text; anything else is empty."""
    if isinstance(found, np.ndarray) and found.dtype.kind == "U" and found.size == 1:
        return str(found.ravel()[0]).strip()
    return ""
