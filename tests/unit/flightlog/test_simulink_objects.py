"""Timeseries and Simulink's Datasets: the samples that went in come out, by the names that MATLAB has.

The files are written here, with mat-io's writer, in the layout of the public class definitions; no file that
MATLAB wrote of these classes is at hand. Of timetables there are: `test_timetables`, `test_matlab_files`.
"""

from __future__ import annotations

import numpy as np
import pytest
import simulink_logs as m

from freqid.core.errors import DataError
from freqid.flightlog.column_map import ChannelPlace, ColumnMap, TimePlace, read_column_map
from freqid.flightlog.listing import list_log
from freqid.flightlog.read import read_log
from freqid.flightlog.readers import mat5
from freqid.flightlog.readers.matlab import load_variables, lookup
from freqid.flightlog.readers.matlab_objects import with_logs_read

T = 0.02 * np.arange(200)
FAST = 0.005 * np.arange(800)
VERSIONS = pytest.mark.parametrize("version", ["v7", "v7.3"])


def read(path):
    return with_logs_read(path, load_variables(path))


@VERSIONS
def test_timeseries_of_all_shapes_come_back_with_time_along_the_rows(tmp_path, version):
    """Against the samples that were written, wherever MATLAB's rule has time: rows, or the last axis."""
    sines = np.column_stack([np.sin(T), np.cos(T), T])
    cube = np.arange(2 * 3 * 200.0).reshape(2, 3, 200)
    path = m.write(
        tmp_path / "x.mat",
        version,
        stored=m.timeseries(np.sin(T), T, unit="deg/s"),
        uniform=m.timeseries(np.cos(FAST), uniform=(0.5, 0.005), unit=m.unit_object("rad/s")),
        columns=m.timeseries(sines, T),
        wide=m.timeseries(sines.T[:, None, :], T),
        matrices=m.timeseries(cube, T),
        ms=m.timeseries(np.sin(T), uniform=(0.0, 20.0), time_unit="milliseconds"),
        old=m.timeseries(np.sin(T), Time_=T[:, None]),
        counts=m.timeseries(np.arange(200, dtype=np.uint8), T),
        once=m.timeseries([[3.0, 4.0]], [0.0]),
        none=m.timeseries(np.empty((0, 1)), uniform=(0.0, 1.0)),
        deep={"in": {"here": m.timeseries(np.sin(T), T)}},
        row=m.array(m.timeseries(np.sin(T), T), m.timeseries(np.cos(T), T)),
        kept=m.cell(m.timeseries(np.cos(T), T), "text", 3.0),
    )
    found = read(path)
    for name, time, data in (
        ("stored", T, np.sin(T)),
        ("uniform", 0.5 + FAST, np.cos(FAST)),
        ("columns", T, sines),
        ("wide", T, sines),
        # the column of element (i, j) of a sample is i + 2 j, as MATLAB counts
        ("matrices", T, np.stack([cube[i, j] for j in range(3) for i in range(2)], axis=1)),
        ("ms", T, np.sin(T)),
        ("old", T, np.sin(T)),
        ("counts", T, np.arange(200.0)),
        ("once", [0.0], [[3.0, 4.0]]),
        ("none", [], []),
        ("deep.in.here", T, np.sin(T)),
        ("row(2)", T, np.cos(T)),
        ("kept{1}", T, np.cos(T)),
    ):
        np.testing.assert_allclose(lookup(found, f"{name}.Time"), time, rtol=1e-15, atol=1e-15)
        np.testing.assert_array_equal(lookup(found, f"{name}.Data"), data)
    assert lookup(found, "stored.DataInfo.Units") == "deg/s"
    assert lookup(found, "uniform.DataInfo.Units") == "rad/s"
    assert lookup(found, "kept{2}") == "text"
    assert lookup(found, "kept{4}") is None


def test_what_matlab_itself_asks_first_decides(tmp_path):
    """By `get.Time` and `get.Data` of the class: times are those of TimeInfo, samples those of Storage_."""
    stream = m.MatlabOpaque({"a": 1.0}, "tsdata.StreamingStorage")
    path = m.write(
        tmp_path / "x.mat",
        times=m.timeseries(np.sin(T), T, Time_=T[:, None] + 7),
        uniform=m.timeseries(np.sin(T), uniform=(0.5, 0.02), Time_=T[:, None] + 7),
        samples=m.timeseries(np.sin(T), T, Storage_=stream),
    )
    found = read(path)
    np.testing.assert_array_equal(lookup(found, "times.Time"), T)
    np.testing.assert_allclose(lookup(found, "uniform.Time"), 0.5 + T, rtol=1e-15)
    assert "with samples of tsdata.StreamingStorage" in found["samples"].because


def flight():
    """A run with signals at 50 and 200 Hz: a bus, a name twice, a name with a dot, a constant."""
    pitch, rate = m.timeseries(np.sin(T), T, unit="deg", name="theta"), m.timeseries(np.cos(FAST), FAST)
    bus = m.struct(q=m.timeseries(np.sin(FAST), uniform=(0.0, 0.005), unit="deg/s"), inner=m.struct(p=rate))
    return m.dataset(
        m.element(pitch, "theta"),
        m.element(bus, "rates"),
        m.element(m.timeseries(2 * np.sin(T), T, name="theta"), "theta"),
        m.timeseries(3 * np.sin(T), T, name="servo.1"),
        m.element(m.timeseries([7.0], [0.0]), "mass", "DataStoreMemory"),
        m.element(m.dataset(m.element(m.timeseries(T, T), "inside")), "model", "TransparentElement"),
    )


@VERSIONS
def test_a_dataset_is_listed_and_read_by_the_map_that_is_proposed(tmp_path, version):
    outputs = np.column_stack([T, T**2])
    path = m.write(tmp_path / "x.mat", version, out=m.output(tout=T[:, None], yout=outputs, logsout=flight()))
    listing = list_log(path)
    at = "out.logsout"
    assert {c.name: (c.unit, c.samples, c.label) for c in listing.channels} == {
        f"{at}.theta.Data": ("deg", 200, "theta"),
        f"{at}.rates.q.Data": ("deg/s", 800, "q"),
        f"{at}.rates.inner.p.Data": ("", 800, "p"),
        f"{at}{{3}}.Data": ("", 200, "theta"),
        f"{at}{{4}}.Data": ("", 200, "servo.1"),
        f"{at}.mass.Data": ("", 1, "mass"),
        f"{at}.model.inside.Data": ("", 200, "inside"),
        "out.yout(:,1)": ("", 200, ""),
        "out.yout(:,2)": ("", 200, ""),
    }
    found = read(path)
    np.testing.assert_array_equal(lookup(found, f"{at}{{3}}.Data"), 2 * np.sin(T))
    np.testing.assert_array_equal(lookup(found, f"{at}{{1}}.Data"), np.sin(T))  # a name or its number
    np.testing.assert_array_equal(lookup(found, f"{at}{{2}}.q.Data"), np.sin(FAST))
    text = listing.map.replace('unit = ""', 'unit = "deg/s"')
    (tmp_path / "map.toml").write_text(text)
    with pytest.raises(DataError, match=r"clocks of their own: .* --resample RATE"):
        read_log(path, tmp_path / "map.toml")
    record = read_log(path, tmp_path / "map.toml", resample_hz=50)
    inside = slice(50, -50)
    for name, of_time in (("state/theta", np.sin), ("state/q", np.sin), ("state/p", np.cos)):
        error = record[name] - np.radians(of_time(record.time))
        assert np.abs(error[inside]).max() < 1e-6  # of the resampling, 1.4e-5 of the amplitude at the most
    assert record.channel("state/q").source == f"x.mat: variable '{at}.rates.q.Data', deg/s"


def test_a_dataset_of_the_older_layout_keeps_its_elements_itself(tmp_path):
    signal = m.element(m.timeseries(np.sin(T), T), "q")
    older = m.MatlabOpaque({"Name": "logsout", "Elements": m.cell(signal)}, f"{m.SIM}Dataset")
    m.matio.save_to_mat(str(tmp_path / "x.mat"), {"logsout": older}, version="v7")
    np.testing.assert_array_equal(lookup(read(tmp_path / "x.mat"), "logsout.q.Data"), np.sin(T))


def mapped(*places):
    channels = tuple(
        ChannelPlace(name=f"state/{n}", variable=place, unit="rad/s")
        for n, place in zip("pqr", places, strict=False)
    )
    return ColumnMap(time=TimePlace(variable="t", unit="s"), channel=channels)


def test_what_is_not_read_is_refused_by_name_and_class_and_hinders_nothing_else(tmp_path):
    own = m.MatlabOpaque({"a": 1.0}, "Own")
    r2 = m.dataset(m.struct(ElementType="signal"), storage=f"{m.SIM}Storage.MatFileDatasetStorage")
    stream = m.MatlabOpaque({"a": 1.0}, "tsdata.StreamingStorage")
    streamed = m.timeseries(np.empty((0, 0)), T, Storage_=stream)
    path = m.write(
        tmp_path / "x.mat",
        t=T[:, None],
        q=np.sin(T)[:, None],
        own=own,
        r2=r2,
        streamed=streamed,
        odd=m.timeseries(np.sin(T), FAST),
        days=m.timeseries(np.sin(T), T, time_unit="moons"),
        endless=m.timeseries(np.sin(T), uniform=(0.0, 1.0), length=1e12),
        good=m.timeseries(np.cos(T), T),
    )
    for place, said in (
        ("own.a", r"'own' is a MATLAB object of class Own, which only MATLAB can read"),
        ("r2.q.Data", r"Dataset, saved as v7.3, where only MATLAB .*; save it in MATLAB with -v7\."),
        ("streamed.Data", r"with samples of tsdata.StreamingStorage, which only MATLAB can read"),
        ("odd.Data", r"class timeseries, with 800 times to samples of shape 200 x 1"),
        ("days.Data", r"class timeseries, with times in 'moons', which is no unit of time"),
        ("endless.Data", r"class timeseries, without times to samples of shape 200 x 1"),
        ("good.Dta", r"variable 'good.Dta' is missing"),
    ):
        with pytest.raises(DataError, match=said) as caught:
            read_log(path, mapped(place))
        assert caught.value.where == str(path)
    assert read_log(path, mapped("q", "good.Data")).channels.keys() == {"state/p", "state/q"}
    listed = {c.name: (c.label, c.samples) for c in list_log(path).channels}
    assert listed["own"] == ("Own", 0)
    assert listed["odd"] == ("timeseries", 0)
    assert listed["good.Data"] == ("good", 200)


def test_without_mat_io_the_command_that_installs_it_is_said_where_it_is_needed(tmp_path, monkeypatch):
    path = m.write(tmp_path / "x.mat", t=T[:, None], q=np.sin(T)[:, None], ts=m.timeseries(np.sin(T), T))
    monkeypatch.setitem(__import__("sys").modules, "matio", None)
    assert read_log(path, mapped("q")).time.size == T.size
    for read_it in (lambda: read_log(path, mapped("ts.Data")), lambda: list_log(path)):
        with pytest.raises(DataError, match=r"needs matio, .*: pip install 'freqid\[logs\]'") as caught:
            read_it()
        assert caught.value.where == str(path)


@VERSIONS
def test_damaged_objects_are_one_sentence(tmp_path, version):
    """Bytes of the tables that say which property is where are overwritten, here and there."""
    path = m.write(tmp_path / "x.mat", version, compress=False, t=T[:, None], ts=m.timeseries(np.sin(T), T))
    good = path.read_bytes()
    tables = good.index(b"IsTimeFirst_")  # among the names, behind which the tables follow
    said = []
    for shift in range(40, 760, 60):
        bad = tmp_path / f"{shift}.mat"
        bad.write_bytes(good[: tables + shift] + b"\xff\x07\xff\xff" * 3 + good[tables + shift + 12 :])
        try:
            read_log(bad, mapped("ts.Data"))
        except DataError as error:
            said.append(str(error))
    assert len(said) >= 6
    assert all(line.startswith(str(tmp_path)) and "\n" not in line for line in said)


def test_a_file_is_not_believed_to_hold_more_than_a_hundred_times_its_size(tmp_path, monkeypatch):
    path = m.write(tmp_path / "x.mat", zeros=np.zeros(200_000), ts=m.timeseries(np.sin(T), T))
    assert load_variables(path)["zeros"].size == 200_000
    monkeypatch.setattr(mat5, "_SMALL", 1 << 10)
    with pytest.raises(DataError, match="unpacks to more than is believed of a file of its size"):
        load_variables(path)
    ring = m.element(np.empty((0, 0)), "ring", "TransparentElement")
    ring.properties["Values"] = m.cell(ring)
    m.write(tmp_path / "ring.mat", ring=ring)
    with pytest.raises(DataError, match="nested deeper than 32"):
        read(tmp_path / "ring.mat")


def test_the_proposed_map_is_a_map(tmp_path):
    path = m.write(tmp_path / "x.mat", constant=m.timeseries([1.0], [0.0]), q=m.timeseries(np.sin(T), T))
    (tmp_path / "map.toml").write_text(list_log(path).map.replace('unit = ""', 'unit = "deg/s"'))
    column_map = read_column_map(tmp_path / "map.toml")
    assert column_map.time.variable == "q.Time"  # not of one sample
    assert [c.variable for c in column_map.channel] == ["q.Data"]
