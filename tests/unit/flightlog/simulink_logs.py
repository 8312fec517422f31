"""Objects as MATLAB saves them, by the public definitions of their classes, written with mat-io's writer.

Of timetables, durations, datetimes and calendar durations the fields are those of files that MATLAB wrote.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # it sets an option that pandas 3 has deprecated
    matio = pytest.importorskip("matio", reason="mat-io is not installed (extra logs)")

from matio.utils import MatlabOpaque, MatlabOpaqueArray

SIM = "Simulink.SimulationData."
STORAGE = f"{SIM}Storage.RamDatasetStorage"


def timeseries(data, time=None, *, uniform=None, unit="", name="", time_unit="seconds", **others):
    """A timeseries with its times stored, or with a uniform clock of (start, increment)."""
    data = np.asarray(data)
    data = data[:, None] if data.ndim == 1 else data
    empty = np.empty((0, 0))
    length = len(time) if time is not None else others.pop("length", data.shape[0])
    start, step = uniform or (np.nan, np.nan)
    clock = {
        "Units": time_unit,
        "Format": "",
        "StartDate": "",
        "UserData": empty,
        "Time_": empty if time is None else np.asarray(time)[:, None],
        "Start_": start if uniform else empty,
        "Increment_": step if uniform else empty,
        "Length": float(length),
        "Initialized": True,
    }
    about = {"Units": unit, "UserData": empty, "InterpretSingleRowDataAs3D": False}
    properties = {
        "Events": empty,
        "Name": name,
        "UserData": empty,
        "Data_": data,
        "DataInfo": MatlabOpaque(about, "tsdata.datametadata"),
        "Time_": empty,
        "TimeInfo": MatlabOpaque(clock, "tsdata.timemetadata"),
        "QualityInfo": MatlabOpaque({"Code": empty, "Description": empty}, "tsdata.qualmetadata"),
        "Quality_": empty,
        "IsTimeFirst_": True,
        "TreatNaNasMissing": True,
        "Storage_": empty,
        "Version": 10.2,
        "BeingBuilt": False,
    }
    return MatlabOpaque({**properties, **others}, "timeseries")


def duration(seconds):
    return MatlabOpaque({"millis": 1e3 * np.atleast_2d(seconds).T, "fmt": "s"}, "duration")


def moment(milliseconds, zone="", **others):
    """Datetimes by their milliseconds since 1970; of finer ones the rest stands in an imaginary part."""
    own = {"data": np.atleast_2d(milliseconds).T, "fmt": "", "tz": zone}
    return MatlabOpaque({**own, **others}, "datetime")


def calendar(months=0.0, days=0.0):
    parts = struct(months=months, days=days, millis=0.0)
    return MatlabOpaque({"components": parts, "fmt": "ymdt"}, "calendarDuration")


def regular(origin, step, rate=None):
    """Row times that MATLAB does not keep one by one: specified by a time step, or by a rate in Hz."""
    return struct(
        origin=origin,
        specifiedAsRate=rate is not None,
        stepSize=step,
        sampleRate=np.nan if rate is None else float(rate),
    )


def timetable(times, variables, units=(), *, version=6, dimension="Time", compatible=2.0, rows=None):
    """A timetable as its `saveobj` leaves it; of versions 7 and 8 names may have 2048 letters."""
    words = lambda *names: cell(*names) if names else np.empty((0, 0), dtype=object)  # noqa: E731
    cut = lambda names: [name[:63] for name in names]  # noqa: E731
    odd = lambda names: any(len(n) > 63 or not n.isidentifier() for n in names)  # noqa: E731
    nothing, names, dimensions = np.empty((0, 0)), list(variables), [dimension, "Variables"]
    columns = [x[:, None] if isinstance(x, np.ndarray) and x.ndim == 1 else x for x in variables.values()]
    saved = {
        "CustomProps": struct(a=nothing),
        "VariableCustomProps": struct(a=nothing),
        "versionSavedFrom": float(version),
        "minCompatibleVersion": compatible,
        "incompatibilityMsg": "",
        "arrayProps": struct(Description="", UserData=nothing, TableCustomProperties=struct(a=nothing)),
        "data": cell(*columns),
        "numDims": 2.0,
        "numRows": float(columns[0].shape[0] if rows is None and columns else rows or 0),
        "numVars": float(len(names)),
        "varDescriptions": words(),
        "varUnits": words(*units),
        "rowTimes": times,
        "varContinuity": words(),
    }
    if version >= 6:
        saved["timeEvents"] = nothing
    for kind, given in (("var", names), ("dim", dimensions)):
        plain = [f"{kind}{k}" if odd([name]) else name for k, name in enumerate(given, 1)]
        saved[f"{kind}Names"] = cell(*plain)
        saved[f"use{kind.capitalize()}NamesOrig"] = odd(given)
        saved[f"{kind}NamesOrig"] = words(*cut(given)) if odd(given) else words()
        if version >= 7:
            long = any(len(name) > 63 for name in given)
            saved[f"use{kind.capitalize()}Names2048"] = long
            saved[f"{kind}Names2048"] = words(*given) if long else words()
    return MatlabOpaque({"any": struct(**saved)}, "timetable")


def unit_object(name):
    return MatlabOpaque({"Name": name}, f"{SIM}Unit")


def cell(*items):
    row = np.empty((1, len(items)), dtype=object)
    row[0, :] = items
    return row


def struct(**fields):
    row = np.empty((1, 1), dtype=[(name, object) for name in fields])
    row[0, 0] = tuple(fields.values())
    return row


def element(values, name="", kind="Signal"):
    path = MatlabOpaque({"Path": cell("model/Gain"), "SubPath": ""}, f"{SIM}BlockPath")
    own = {"Name": name, "BlockPath": path, "Values": values, "PortType": "outport", "PortIndex": 1.0}
    return MatlabOpaque(own, SIM + kind)


def dataset(*elements, storage=STORAGE, name="logsout"):
    """A Dataset as its `saveobj` leaves it: a struct, whose storage saves itself as a struct too."""
    held = MatlabOpaque({"any": struct(Version=2.0, Elements=cell(*elements))}, storage)
    return MatlabOpaque({"any": struct(Name=name, Version=3.0, Storage=held)}, f"{SIM}Dataset")


def output(**variables):
    own = {"Data": struct(**variables), "Metadata": np.empty((0, 0)), "ErrorMessage": ""}
    return MatlabOpaque(own, "Simulink.SimulationOutput")


def array(*objects):
    row = np.empty((1, len(objects)), dtype=object)
    row[0, :] = objects
    return MatlabOpaqueArray(row, objects[0].classname)


def write(path, version="v7", /, *, compress=True, **variables):
    saved = [f"{SIM}Dataset", STORAGE, f"{SIM}Storage.MatFileDatasetStorage"]
    matio.save_to_mat(str(path), variables, version=version, saveobj_classes=saved, do_compression=compress)
    return path
