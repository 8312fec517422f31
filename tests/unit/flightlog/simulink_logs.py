"""Objects as MATLAB saves them, by the public definitions of their classes, written with mat-io's writer."""

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
        "Quality_": empty,
        "IsTimeFirst_": True,
        "TreatNaNasMissing": True,
        "Storage_": empty,
        "Version": 10.2,
        "BeingBuilt": False,
    }
    return MatlabOpaque({**properties, **others}, "timeseries")


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
