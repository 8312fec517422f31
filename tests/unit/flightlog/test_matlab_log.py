"""MATLAB files of both kinds: the same variables, the same record."""

from __future__ import annotations

import re

import h5py
import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import csc_array

from freqid.core.errors import DataError
from freqid.flightlog.column_map import ChannelPlace, ColumnMap, MassPlace, TimePlace, read_column_map
from freqid.flightlog.listing import list_log
from freqid.flightlog.readers.matlab import load_variables, lookup, read_matlab, texts

T = 0.05 * np.arange(40)
DATA = np.column_stack([T, np.sin(T), 10 * np.cos(T)])
LABELS = ["time_s", "alph_d", "q_dps"]


def write_v5(path, **variables):
    cells = {n: np.array(v, dtype=object) if isinstance(v, list) else v for n, v in variables.items()}
    savemat(path, cells, oned_as="column", do_compression=True)
    return path


def write_v73(path, **variables):
    """Write as MATLAB does: a user block, arrays transposed, text as uint16, cells as references."""

    def put(file, parent, name, value):
        if isinstance(value, dict):
            group = parent.create_group(name)
            group.attrs["MATLAB_class"] = np.bytes_("struct")
            for field, inner in value.items():
                put(file, group, field, inner)
        elif isinstance(value, list):
            refs = file.require_group("#refs#")
            cells = []
            for text in value:
                put(file, refs, f"{name}{len(refs)}", text)
                cells.append(refs[f"{name}{len(refs) - 1}"].ref)
            dataset = parent.create_dataset(name, data=np.array(cells, dtype=h5py.ref_dtype)[:, None])
            dataset.attrs["MATLAB_class"] = np.bytes_("cell")
        elif isinstance(value, str):
            codes = np.frombuffer(value.encode("utf-16-le"), dtype=np.uint16)[:, None]
            dataset = parent.create_dataset(name, data=codes if value else np.zeros(2, dtype=np.uint64))
            dataset.attrs["MATLAB_class"] = np.bytes_("char")
            if not value:
                dataset.attrs["MATLAB_empty"] = np.uint8(1)
        elif np.asarray(value).dtype.kind == "U":
            rows = [[ord(c) for c in row.ljust(value.dtype.itemsize // 4)] for row in value]
            dataset = parent.create_dataset(name, data=np.array(rows, dtype=np.uint16).T)
            dataset.attrs["MATLAB_class"] = np.bytes_("char")
        else:
            dataset = parent.create_dataset(name, data=np.atleast_2d(np.asarray(value)).T)
            dataset.attrs["MATLAB_class"] = np.bytes_("double")

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            put(file, file, name, value)
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(116))
    return path


WRITERS = pytest.mark.parametrize("write", [write_v5, write_v73])


@WRITERS
def test_variables_come_back_without_unit_axes(tmp_path, write):
    path = write(
        tmp_path / "x.mat",
        data=DATA,
        t=T[:, None],
        row=T[None, :],
        dt=0.05,
        lab=LABELS,
        fds={"note": "ab", "a": DATA},
    )
    found = load_variables(path)
    np.testing.assert_array_equal(found["data"], DATA)
    np.testing.assert_array_equal(found["t"], T)
    np.testing.assert_array_equal(found["row"], T)
    assert float(found["dt"]) == 0.05
    assert list(np.ravel(found["lab"])) == LABELS
    assert found["fds"]["note"] == "ab"
    np.testing.assert_array_equal(found["fds"]["a"], DATA)
    assert set(found) == {"data", "t", "row", "dt", "lab", "fds"}


@WRITERS
def test_columns_of_the_only_matrix_by_number_and_by_label(tmp_path, write):
    path = write(tmp_path / "x.mat", data=DATA, lab=LABELS, mass=5.0)
    column_map = ColumnMap(
        time=TimePlace(column=1, unit="s"),
        labels="lab",
        channel=(
            ChannelPlace(name="air/alpha", column="alph_d", unit="deg"),
            ChannelPlace(name="state/q", column=3, unit="deg/s", sign=-1),
        ),
    )
    record = read_matlab(path, column_map)
    np.testing.assert_allclose(record["air/alpha"], np.deg2rad(np.sin(T)))
    np.testing.assert_allclose(record["state/q"], -np.deg2rad(10 * np.cos(T)))
    assert record.channel("state/q").source == "x.mat: column 3, deg/s, sign -1"
    assert record.provenance["source"]["reader"] == "matlab"


@WRITERS
def test_named_variables_struct_fields_and_scalars(tmp_path, write):
    content = {"flight": {"t": T, "q": DATA[:, 2:]}, "other": DATA, "more": DATA + 1, "m": 3.0}
    column_map = ColumnMap(
        time=TimePlace(variable="flight.t", unit="s"),
        variable="more",
        channel=(
            ChannelPlace(name="state/q", variable="flight.q", unit="deg/s"),
            ChannelPlace(name="state/p", variable="other", column=2, unit="deg/s"),
            ChannelPlace(name="state/r", column=2, unit="deg/s"),
        ),
        mass_property=tuple(
            MassPlace(name=n, variable="m", unit="kg" if n == "mass" else "kg m2")
            for n in ("mass", "Ixx", "Iyy", "Izz")
        ),
    )
    record = read_matlab(write(tmp_path / "x.mat", **content), column_map)
    np.testing.assert_allclose(record["state/q"], np.deg2rad(10 * np.cos(T)))
    np.testing.assert_allclose(record["state/r"] - record["state/p"], np.deg2rad(1.0))
    assert record.mass_properties.mass_kg == 3.0
    assert record.mass_properties.inertia.zz == 3.0


TIME = TimePlace(variable="t", unit="s")


@WRITERS
@pytest.mark.parametrize(
    ("place", "said"),
    [
        ({"column": 2}, r"the file holds 2 matrices \(data, more\), expected one"),
        ({"variable": "dta"}, "variable 'dta' is missing; did you mean 'data'"),
        ({"variable": "fds.q"}, "variable 'fds.q' is missing"),
        ({"variable": "data"}, r"variable 'data' has shape \(40, 3\), expected one column"),
        ({"variable": "data", "column": 4}, "column 4 is missing, variable 'data' has 3"),
        ({"variable": "data", "column": "q"}, "states no labels"),
        ({"variable": "note"}, "variable 'note' is no real vector or matrix"),
        ({"variable": "fds"}, "variable 'fds' is no real vector or matrix"),
        ({"variable": "short"}, r"channel 'state/q' has shape \(7,\), time has \(40,\)"),
        ({"variable": "t", "column": 2}, "column 2 is missing, variable 't' has 1"),
    ],
)
def test_what_is_not_there_is_said(tmp_path, write, place, said):
    path = write(tmp_path / "x.mat", data=DATA, more=DATA, t=T, note="text", short=T[:7], fds={"p": T})
    column_map = ColumnMap(time=TIME, channel=(ChannelPlace(name="state/q", unit="deg/s", **place),))
    with pytest.raises(DataError, match=said) as caught:
        read_matlab(path, column_map)
    assert caught.value.where == str(path)


@pytest.mark.parametrize(
    "value", [1j * T, csc_array(DATA), np.zeros((3, 3, 3)), np.array([T, "x"], dtype=object)]
)
def test_what_is_no_real_matrix_is_refused(tmp_path, value):
    path = tmp_path / "x.mat"
    savemat(path, {"t": T, "q": value})
    column_map = ColumnMap(time=TIME, channel=(ChannelPlace(name="state/q", variable="q", unit="deg/s"),))
    with pytest.raises(DataError, match="variable 'q' is no real vector or matrix"):
        read_matlab(path, column_map)


@WRITERS
def test_a_misspelt_label_suggests_the_nearest(tmp_path, write):
    path = write(tmp_path / "x.mat", data=DATA, lab=LABELS)
    channel = (ChannelPlace(name="state/q", column="q_dp", unit="deg/s"),)
    column_map = ColumnMap(time=TimePlace(column=1, unit="s"), labels="lab", channel=channel)
    with pytest.raises(DataError, match="column 'q_dp' is missing; did you mean 'q_dps'"):
        read_matlab(path, column_map)
    column_map = ColumnMap(time=TimePlace(column=1, unit="s"), labels="lap", channel=channel)
    with pytest.raises(DataError, match="variable 'lap' is missing; did you mean 'lab'"):
        read_matlab(path, column_map)


@pytest.mark.parametrize(
    "content", [b"", b"t,u\n0,1\n", b"MATLAB 5.0 MAT-file".ljust(200), b"\x89HDF\r\n\x1a\n" + b"\0" * 90]
)
def test_a_foreign_file_is_a_data_error(tmp_path, content):
    path = tmp_path / "x.mat"
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"no intact MATLAB file|variable 't' is missing"):
        read_matlab(
            path, ColumnMap(time=TIME, channel=(ChannelPlace(name="state/q", variable="q", unit="deg/s"),))
        )


def test_a_missing_file_is_a_data_error(tmp_path):
    with pytest.raises(DataError, match="no such file"):
        load_variables(tmp_path / "none.mat")


@WRITERS
def test_columns_may_be_named_by_the_rows_of_a_character_matrix(tmp_path, write):
    """MATLAB keeps its characters in columns, in UTF-16; the rows are filled up with blanks."""
    data = np.column_stack([T, np.sin(T), T])
    path = write(tmp_path / "x.mat", data=data, icon="\N{ROCKET}", lab=np.array(["t", "q", "pad"]))
    variables = load_variables(path)
    assert variables["lab"] == ["t", "q", "pad"]
    assert variables["icon"] == "\N{ROCKET}"  # two units
    place = ChannelPlace(name="state/q", column="q", unit="rad/s")
    column_map = ColumnMap(
        time=TimePlace(column="t", unit="s"), labels="lab", variable="data", channel=(place,)
    )
    np.testing.assert_array_equal(read_matlab(path, column_map)["state/q"], np.sin(T))


def object_v73(path, **classes):
    """A v7.3 file with a clock and objects, each a row of numbers with its class as an attribute."""
    write_v73(path, t=T)
    with h5py.File(path, "r+") as file:
        for name, class_name in classes.items():
            dataset = file.create_dataset(name, data=np.full((1, 6), 1, dtype=np.uint32))
            dataset.attrs["MATLAB_class"] = np.bytes_(class_name)
            dataset.attrs["MATLAB_object_decode"] = np.int32(3)
    return path


def test_an_object_is_refused_by_its_class_with_what_to_type(tmp_path):
    path = object_v73(tmp_path / "x.mat", ts="fints", log="Own.Dataset")
    for variable, said in (
        ("ts", r"'ts' is a MATLAB object of class fints, .*save its numbers as variables in MATLAB\.$"),
        ("ts.Data", r"'ts' is a MATLAB object of class fints"),
        ("log", r"class Own.Dataset, .*x = log.get\('q'\).Values; q = x.Data"),
    ):
        place = ChannelPlace(name="state/q", variable=variable, unit="rad/s")
        with pytest.raises(DataError, match=said):
            read_matlab(path, ColumnMap(time=TimePlace(variable="t", unit="s"), channel=(place,)))
    with h5py.File(path, "r+") as file:
        file["q"] = np.sin(T)[None]
    listed = {c.name: c for c in list_log(path).channels}
    assert (listed["ts"].label, listed["ts"].samples, listed["q"].samples) == ("fints", 0, T.size)
    named = object_v73(tmp_path / "z.mat", labels="string")
    with pytest.raises(DataError, match=r"of class string, expected a cell array .* in place of \["):
        texts(load_variables(named)["labels"])
    with pytest.raises(DataError, match="log is a MATLAB object of class Own"):
        list_log(object_v73(tmp_path / "y.mat", log="Own.Dataset"))


@WRITERS
def test_logs_of_simulink_are_listed_with_a_map_that_reads_them(tmp_path, write):
    """A structure with time, a timeseries that was made a struct, and vectors beside their clock."""
    logs = {
        "pitch": {"time": T, "signals": {"values": np.sin(T), "label": "theta"}},
        "out": {"tout": T, "q": {"Data": np.cos(T), "Time": T}, "note": "ab"},
        "rates": {"time": T, "both": np.column_stack([np.sin(2 * T), np.cos(2 * T)])},
    }
    path = write(tmp_path / "x.mat", **logs)
    listing = list_log(path)
    assert {c.name: c.source for c in listing.channels} == {
        "pitch.signals.values": "pitch.time",
        "out.q.Data": "out.q.Time",
        "rates.both(:,1)": "rates.time",
        "rates.both(:,2)": "rates.time",
    }
    assert all(c.rate_hz == pytest.approx(20.0) for c in listing.channels)
    text = listing.map
    for name, unit in (("theta", "deg"), ("q", "deg/s")):  # the log does not say: the user states them
        text = re.sub(rf'(name = "state/{name}"\n[^\[]*unit = )""', rf'\1"{unit}"', text)
    (tmp_path / "map.toml").write_text(text)
    record = read_matlab(path, read_column_map(tmp_path / "map.toml"))
    np.testing.assert_allclose(record["state/theta"], np.radians(np.sin(T)), rtol=1e-12)
    np.testing.assert_allclose(record["state/q"], np.radians(np.cos(T)), rtol=1e-12)


def test_one_of_a_struct_array_and_a_column_are_named_as_in_matlab(tmp_path):
    signals = np.array(
        [(np.sin(T)[:, None], "theta"), (np.cos(T)[:, None], "q")], dtype=[("values", "O"), ("label", "O")]
    )
    savemat(tmp_path / "x.mat", {"out": {"time": T, "signals": signals, "m": DATA}})
    listed = {c.name: c.label for c in list_log(tmp_path / "x.mat").channels}
    assert listed["out.signals(1).values"] == "theta"
    assert listed["out.signals(2).values"] == "q"
    variables = load_variables(tmp_path / "x.mat")
    np.testing.assert_array_equal(lookup(variables, "out.signals(2).values"), np.cos(T))
    np.testing.assert_array_equal(lookup(variables, "out.m(:,3)"), DATA[:, 2])
    for name in ("out.signals(3).values", "out.m(:,4)", "out.time(:,1)", "out.m(2", "out(2).m"):
        assert lookup(variables, name) is None
    # v7.3 keeps a struct array as a struct of cells
    cells = {"signals": {"values": [np.sin(T), np.cos(T)], "label": ["theta", "q"]}}
    np.testing.assert_array_equal(lookup(cells, "signals(2).values"), np.cos(T))
    assert lookup(cells, "signals(3).values") is None


def test_the_only_matrix_of_a_file_is_listed_by_number(tmp_path):
    savemat(tmp_path / "x.mat", {"data": DATA})
    listing = list_log(tmp_path / "x.mat")
    assert [c.name for c in listing.channels] == ["1", "2", "3"]
    assert "[time]\ncolumn = 1\n" in listing.map
    savemat(tmp_path / "y.mat", {"a": np.sin(T), "b": np.cos(T)})
    with pytest.raises(DataError, match="no vector of it increases and is called after time"):
        list_log(tmp_path / "y.mat")
